#include "server/service/state_folder.h"

#include <fcntl.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "proto/rpc/access.h"
#include "proto/rpc/address.h"
#include "proto/rpc/digest.h"
#include "server/access/secret.h"

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
  if (!json.is_object()) {
    return std::nullopt;
  }
  const auto address = json.find("address");
  const auto pid = json.find("pid");
  const auto stays = json.find("stays");
  if (address == json.end() || !address->is_string() || pid == json.end() ||
      !pid->is_number_integer() || (stays != json.end() && !stays->is_boolean())) {
    return std::nullopt;
  }
  return Announcement{.address = address->get<std::string>(),
                      .pid = pid->get<int>(),
                      .stays = stays != json.end() && stays->get<bool>()};
}

/// The whole file, for the open file description (not the process: threads of one process exclude
/// each other too).
struct flock WholeFile(short type) {
  struct flock lock = {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  return lock;
}

constexpr mode_t kOwnerOnly = S_IRUSR | S_IWUSR;
constexpr mode_t kOwnersFolder = S_IRWXU;

/// The account that a file or folder belongs to.
std::string OwnerOf(const std::string& path) {
  struct stat status = {};
  if (stat(path.c_str(), &status) != 0) {
    return "another account";
  }
  const passwd* const entry = getpwuid(status.st_uid);  // NOLINT(concurrency-mt-unsafe): at start
  return entry != nullptr ? absl::StrCat("the account ", entry->pw_name)
                          : absl::StrCat("the account ", status.st_uid);
}

absl::Status CannotWrite(const std::string& what, int error) {
  if (error == EACCES || error == EPERM) {
    std::error_code ignored;
    const std::string folder =
        std::filesystem::absolute(what, ignored).parent_path().lexically_normal().string();
    struct stat status = {};
    const bool is_own = stat(folder.c_str(), &status) == 0 && status.st_uid == geteuid();
    return absl::PermissionDeniedError(
        absl::StrCat(what, " may not be written by this account; ",
                     is_own ? absl::StrCat("chmod u+rwx ", folder, " lets its owner do so")
                            : absl::StrCat(folder, " belongs to ", OwnerOf(folder))));
  }
  return absl::ResourceExhaustedError(
      absl::StrCat(what, " cannot be written: ", std::generic_category().message(error)));
}

/// Written aside and renamed: readers see all of it or nothing, and only this account's do.
absl::Status WritePrivate(const std::string& path, const std::string& text) {
  const std::string draft = path + ".new";
  unlink(draft.c_str());
  const int file = open(draft.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kOwnerOnly);
  if (file < 0) {
    return CannotWrite(draft, errno);
  }
  const ssize_t written = write(file, text.data(), text.size());
  const bool is_whole = written == static_cast<ssize_t>(text.size()) && fsync(file) == 0;
  const int error = written >= 0 && !is_whole && errno == 0 ? ENOSPC : errno;
  close(file);
  if (!is_whole) {
    unlink(draft.c_str());
    return CannotWrite(draft, error);
  }
  return rename(draft.c_str(), path.c_str()) == 0 ? absl::OkStatus() : CannotWrite(path, errno);
}

/// Makes a folder that this account alone enters, or makes its own so.
absl::Status MakePrivateFolder(const std::string& path) {
  if (mkdir(path.c_str(), kOwnersFolder) != 0 && errno != EEXIST) {
    return CannotWrite(path, errno);
  }
  struct stat status = {};
  if (lstat(path.c_str(), &status) != 0) {
    return CannotWrite(path, errno);
  }
  if (!S_ISDIR(status.st_mode) || status.st_uid != geteuid()) {
    return absl::PermissionDeniedError(
        absl::StrCat(path, " has to be a folder of this account, and belongs to ", OwnerOf(path),
                     ": set XDG_RUNTIME_DIR, or choose a shorter --state"));
  }
  if ((status.st_mode & (S_IRWXG | S_IRWXO)) != 0 && chmod(path.c_str(), kOwnersFolder) != 0) {
    return CannotWrite(path, errno);
  }
  return absl::OkStatus();
}

/// A folder in which others may write can be given another server.json, or another database.
absl::Status CheckIsOwn(const std::string& directory) {
  struct stat status = {};
  if (stat(directory.c_str(), &status) != 0) {
    return CannotWrite(directory, errno);
  }
  if (status.st_uid != geteuid()) {
    return absl::PermissionDeniedError(
        absl::StrCat(directory, " belongs to ", OwnerOf(directory),
                     ": a state folder is served and read by its own account only"));
  }
  if ((status.st_mode & (S_IWGRP | S_IWOTH)) != 0) {
    return absl::PermissionDeniedError(
        absl::StrCat("other accounts may write in ", directory,
                     ", which holds the state of a server: chmod go-w ", directory));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<StateFolder>> StateFolder::Open(const std::string& directory) {
  std::error_code error;
  if (!std::filesystem::exists(directory, error)) {
    std::filesystem::create_directories(directory, error);
    if (error || chmod(directory.c_str(), kOwnersFolder) != 0) {
      return CannotWrite(directory, error ? error.value() : errno);
    }
  }
  RETURN_IF_ERROR(CheckIsOwn(directory));
  const int lock = open(LockPath(directory).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, kOwnerOnly);
  if (lock < 0) {
    return CannotWrite(LockPath(directory), errno);
  }
  fchmod(lock, kOwnerOnly);
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
  if (const auto left = rpc::ReadToken(left_token_); left.ok() && *left == token_) {
    std::filesystem::remove(left_token_, ignored);
  }
  std::filesystem::remove(AnnouncementPath(directory_), ignored);
  close(lock_);
}

absl::Status StateFolder::Announce(const std::string& address, bool stays) const {
  return WritePrivate(
      AnnouncementPath(directory_),
      nlohmann::json{{"address", address}, {"pid", getpid()}, {"stays", stays}}.dump() + "\n");
}

absl::StatusOr<std::string> StateFolder::Token() const {
  const std::string path = directory_ + "/token";
  if (auto token = rpc::ReadToken(path); token.ok()) {
    if (chmod(path.c_str(), kOwnerOnly) != 0) {
      return CannotWrite(path, errno);
    }
    return token;
  }
  ASSIGN_OR_RETURN(const std::string token, access::MakeToken());
  RETURN_IF_ERROR(WritePrivate(path, token + "\n"));
  return token;
}

absl::Status StateFolder::LeaveToken(const std::string& token, int port) {
  std::string reasons;
  for (const std::string& folder : rpc::TokenFolders()) {
    std::error_code ignored;
    std::filesystem::create_directories(std::filesystem::path(folder).parent_path(), ignored);
    const std::string path = absl::StrCat(folder, "/", rpc::TokenName(port));
    absl::Status status = MakePrivateFolder(folder);
    if (status.ok()) {
      status = WritePrivate(path, token + "\n");
    }
    if (status.ok()) {
      left_token_ = path;
      token_ = token;
      return status;
    }
    absl::StrAppend(&reasons, status.message(), "; ");
  }
  return absl::NotFoundError(
      absl::StrCat("the token could not be left for programs of this account ($XDG_RUNTIME_DIR, "
                   "~/.cache): ",
                   reasons, "name it with --token ", directory_, "/token"));
}

absl::StatusOr<std::string> StateFolder::SocketAddress() const {
  std::error_code error;
  const std::string own = std::filesystem::absolute(directory_, error).string() + "/run";
  if (const std::string path = own + "/calib.sock"; path.size() <= rpc::kLongestSocketPath) {
    RETURN_IF_ERROR(MakePrivateFolder(own));
    return "unix:" + path;
  }
  const std::string name =
      absl::StrCat("/", rpc::Sha256Hex(own).substr(0, 16), ".sock");  // one of each state folder
  std::vector<std::string> folders = rpc::TokenFolders();
  folders.push_back(absl::StrCat("/tmp/calib-", geteuid()));
  absl::Status status;
  for (const std::string& folder : folders) {
    if (folder.size() + name.size() > rpc::kLongestSocketPath) {
      continue;
    }
    status = MakePrivateFolder(folder);
    if (status.ok()) {
      return absl::StrCat("unix:", folder, name);
    }
  }
  return status;
}

absl::StatusOr<std::string> ServingAddress(const std::string& directory) {
  const int lock = open(LockPath(directory).c_str(), O_RDONLY | O_CLOEXEC);
  if (lock < 0) {
    return errno == EACCES ? absl::PermissionDeniedError(absl::StrCat(
                                 directory, " may not be read by this account; it belongs to ",
                                 OwnerOf(directory)))
                           : absl::NotFoundError(absl::StrCat("nobody serves ", directory));
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
