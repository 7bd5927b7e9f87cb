#include "server/service/state_folder.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace calib::service {
namespace {

struct Announcement {
  std::string address;
  int pid = 0;
  bool stays = false;
};

std::string AnnouncementPath(const std::string& directory) { return directory + "/server.json"; }
std::string LockPath(const std::string& directory) { return directory + "/lock"; }

std::optional<Announcement> ReadAnnouncement(const std::string& directory) {
  std::ifstream file(AnnouncementPath(directory));
  const auto json = nlohmann::json::parse(file, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object() || !json.contains("address") || !json.contains("pid")) {
    return std::nullopt;
  }
  return Announcement{.address = json["address"].get<std::string>(),
                      .pid = json["pid"].get<int>(),
                      .stays = json.value("stays", false)};
}

/// The whole file, for the open file description (not the process: threads of one process exclude
/// each other too).
struct flock WholeFile(short type) {
  struct flock lock = {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  return lock;
}

absl::Status CannotWrite(const std::string& what, int error) {
  return absl::ResourceExhaustedError(
      absl::StrCat(what, " cannot be written: ", std::generic_category().message(error)));
}

}  // namespace

absl::StatusOr<std::unique_ptr<StateFolder>> StateFolder::Open(const std::string& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error) {
    return CannotWrite(directory, error.value());
  }
  const int lock = open(LockPath(directory).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (lock < 0) {
    return CannotWrite(LockPath(directory), errno);
  }
  struct flock exclusive = WholeFile(F_WRLCK);
  if (fcntl(lock, F_OFD_SETLK, &exclusive) != 0) {
    close(lock);
    const auto other = ReadAnnouncement(directory);
    return absl::AlreadyExistsError(
        other.has_value()
            ? absl::StrCat(directory, " is served by process ", other->pid, " at ", other->address)
            : absl::StrCat(directory, " is served by another process"));
  }
  std::filesystem::remove(AnnouncementPath(directory), error);  // left by a killed server
  return std::unique_ptr<StateFolder>(new StateFolder(directory, lock));
}

StateFolder::~StateFolder() {
  std::error_code ignored;
  std::filesystem::remove(AnnouncementPath(directory_), ignored);
  close(lock_);
}

absl::Status StateFolder::Announce(const std::string& address, bool stays) const {
  // Written aside and renamed: readers see all of it or nothing.
  const std::string path = AnnouncementPath(directory_);
  const std::string draft = path + ".new";
  {
    std::ofstream file(draft);
    file << nlohmann::json{{"address", address}, {"pid", getpid()}, {"stays", stays}}.dump()
         << '\n';
    if (!file.flush()) {
      return CannotWrite(draft, errno);
    }
  }
  std::error_code error;
  std::filesystem::rename(draft, path, error);
  return error ? CannotWrite(path, error.value()) : absl::OkStatus();
}

absl::StatusOr<std::string> ServingAddress(const std::string& directory) {
  const int lock = open(LockPath(directory).c_str(), O_RDONLY | O_CLOEXEC);
  if (lock < 0) {
    return absl::NotFoundError(absl::StrCat("nobody serves ", directory));
  }
  // Asks without taking: whoever looks never stands in the way of a server that starts.
  struct flock query = WholeFile(F_RDLCK);
  const bool is_free = fcntl(lock, F_OFD_GETLK, &query) == 0 && query.l_type == F_UNLCK;
  close(lock);
  if (is_free) {
    return absl::NotFoundError(absl::StrCat("nobody serves ", directory));
  }
  const auto announcement = ReadAnnouncement(directory);
  if (!announcement.has_value()) {
    return absl::UnavailableError(absl::StrCat("the server of ", directory, " is starting"));
  }
  return announcement->address;
}

bool IsServedForGood(const std::string& directory) {
  const auto announcement = ReadAnnouncement(directory);
  return announcement.has_value() && announcement->stays;
}

}  // namespace calib::service
