#include "proto/rpc/service_manager.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <string>

namespace calib::rpc {
namespace {

/// A service manager's socket at this name, told to this process by $NOTIFY_SOCKET.
class Manager {
 public:
  explicit Manager(const std::string& name) : id_(socket(AF_UNIX, SOCK_DGRAM, 0)) {
    sockaddr_un address{.sun_family = AF_UNIX, .sun_path = {}};
    name.copy(address.sun_path, sizeof(address.sun_path) - 1);
    if (name.front() == '@') address.sun_path[0] = '\0';
    EXPECT_EQ(bind(id_, reinterpret_cast<const sockaddr*>(&address),
                   static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size())),
              0);
    setenv("NOTIFY_SOCKET", name.c_str(), 1);
  }
  ~Manager() {
    unsetenv("NOTIFY_SOCKET");
    close(id_);
  }
  Manager(const Manager&) = delete;
  Manager& operator=(const Manager&) = delete;

  /// The next datagram; empty: none has come.
  std::string Hear() const {
    std::array<char, 256> text{};
    const ssize_t size = recv(id_, text.data(), text.size(), MSG_DONTWAIT);
    return size < 0 ? "" : std::string(text.data(), static_cast<std::size_t>(size));
  }

 private:
  int id_;
};

TEST(ServiceManager, HearsWhatItIsToldAtAPathAndAtAName) {
  const std::string path =
      (std::filesystem::temp_directory_path() / ("calib-notify-" + std::to_string(getpid())))
          .string();
  for (const std::string& name : {path, "@calib-notify-" + std::to_string(getpid())}) {
    const Manager manager(name);
    TellServiceManager(kReady);
    TellServiceManager(kStopping);
    EXPECT_EQ(manager.Hear(), "READY=1") << name;
    EXPECT_EQ(manager.Hear(), "STOPPING=1") << name;
    EXPECT_EQ(manager.Hear(), "") << name;
  }
  std::filesystem::remove(path);
}

TEST(ServiceManager, ThatIsNotThereIsNotWaitedFor) {
  for (const std::string& name :
       {std::string("/nowhere/at/all"), std::string(200, 'x'), std::string("@"), std::string()}) {
    setenv("NOTIFY_SOCKET", name.c_str(), 1);
    TellServiceManager(kReady);
  }
  unsetenv("NOTIFY_SOCKET");
  TellServiceManager(kReady);
}

}  // namespace
}  // namespace calib::rpc
