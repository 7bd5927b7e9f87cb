#pragma once
// Servers that let in who shows a token or a certificate, and those who ask them.

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/access/signing.h"
#include "server/access/x509.h"
#include "tests/integration/ctl/calibctl_fixture.h"
#include "tests/support/process.h"

namespace calib::ctl {

using calib::testing::Eventually;
using calib::testing::Process;
using calib::testing::Program;

inline constexpr std::chrono::seconds kPatience{20};

/// A variable of the environment while this lives.
class Variable {
 public:
  Variable(const char* name, const std::string& value)
      : name_(name),
        before_(std::getenv(name) != nullptr ? std::optional<std::string>(std::getenv(name))
                                             : std::nullopt) {
    setenv(name, value.c_str(), 1);
  }
  ~Variable() {
    if (before_.has_value()) {
      setenv(name_, before_->c_str(), 1);
    } else {
      unsetenv(name_);
    }
  }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  const char* const name_;
  const std::optional<std::string> before_;
};

class Access : public CalibctlFixture {
 protected:
  Access() { Write("campaign.yaml", SmallCampaign(4, 1)); }

  std::string At(const std::string& name) const { return (work_ / name).string(); }

  /// A TCP port of 127.0.0.1 at which nothing listens, below those that the system gives to who
  /// asks for any (from 32768 on): no program beside this one takes it in between.
  static int FreePort() {
    constexpr int kLowest = 20000;
    constexpr int kPorts = 12000;
    for (int next = 0; next < kPorts; ++next) {
      const int port = kLowest + (static_cast<int>(getpid()) + next) % kPorts;
      const int file = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
      sockaddr_in address{};
      address.sin_family = AF_INET;
      address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      address.sin_port = htons(static_cast<std::uint16_t>(port));
      const bool free =
          bind(file, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
      close(file);
      if (free) return port;
    }
    ADD_FAILURE() << "no port is free";
    return 0;
  }

  /// calibd over the folder `state`, once it serves; `address` is then where.
  std::unique_ptr<Process> Serve(const std::string& state, std::vector<std::string> options) {
    std::vector<std::string> command{Program("calibd"), "--state", At(state), "--log",
                                     At(state + ".log")};
    if (std::find(options.begin(), options.end(), "--listen") == options.end()) {
      command.insert(command.end(), {"--listen", "127.0.0.1:0"});
    }
    command.insert(command.end(), options.begin(), options.end());
    auto server = std::make_unique<Process>(command, At(state + ".err"));
    EXPECT_TRUE(Eventually(kPatience, [&] {
      return std::filesystem::exists(work_ / state / "server.json") || !server->Running();
    })) << Read(state + ".err");
    const Json announced = Json::parse(Read(state + "/server.json"), nullptr, false);
    address_ = announced.is_object() ? announced["address"].get<std::string>() : "";
    return server;
  }

  /// An authority in `ca`, a server's folder `head`, and one of each role that asks.
  void IssueAll() const {
    ASSERT_EQ(Call("certs init ca").code, 0) << Read("err");
    ASSERT_EQ(Call("certs issue ca --role server head -o head").code, 0) << Read("err");
    for (const char* role : {"worker", "viewer", "submitter", "operator"}) {
      Issue(role, role);
    }
  }
  void Issue(const std::string& role, const std::string& name) const {
    ASSERT_EQ(Call("certs issue ca --role " + role + " " + name + " -o " + name).code, 0)
        << Read("err");
  }

  Answer Ask(const std::string& words, const std::string& with) const {
    return Call(words + " --server " + address_ + " " + with);
  }
  /// Refused with exit code 1 and one sentence.
  std::string Refused(const std::string& words, const std::string& with) const {
    const Answer answer = Ask(words, with);
    EXPECT_EQ(answer.code, 1) << words << " " << with << "\n" << answer.out << answer.err;
    EXPECT_EQ(answer.out, "");
    EXPECT_EQ(std::count(answer.err.begin(), answer.err.end(), '\n'), 1) << answer.err;
    return answer.err;
  }

  /// A folder whose certificate ended yesterday, signed by the authority itself.
  void IssueExpired(const std::string& name) const {
    std::filesystem::copy(work_ / "viewer", work_ / name);
    constexpr std::int64_t kDay = 86400;
    const std::int64_t now = std::time(nullptr);
    SignAnew(name, {now - 2 * kDay, now - kDay});
  }

  /// Gives the viewer's folder `name` a certificate of another validity.
  void SignAnew(const std::string& name, const access::Validity& validity) const {
    const auto ca = access::ParseCertificate(Read("ca/ca.pem"));
    const auto ca_key = access::ParseKey(Read("ca/ca-key.pem"));
    const auto key = access::ParseKey(Read(name + "/key.pem"));
    ASSERT_TRUE(ca != nullptr && ca_key != nullptr && key != nullptr);
    const auto leaf = access::SignLeaf(
        {.name = name, .role = access::Role::kViewer, .hosts = {}, .validity = validity}, key.get(),
        ca.get(), ca_key.get());
    ASSERT_TRUE(leaf.ok()) << leaf.status();
    const auto pem = access::PemOf(leaf->get());
    ASSERT_TRUE(pem.ok()) << pem.status();
    Write(name + "/cert.pem", *pem);
  }

  std::string address_;
};

}  // namespace calib::ctl
