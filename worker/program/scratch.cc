#include "worker/program/scratch.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "proto/rpc/digest.h"
#include "proto/rpc/random_id.h"
#include "worker/program/request.h"

namespace calib::worker {
namespace {

namespace files = std::filesystem;

constexpr const char* kPrefix = "worker-";
constexpr const char* kLockName = "lock";

/// Opens and locks a file; -1: another process holds it, or it cannot be opened.
int LockedFile(const std::string& path, int how) {
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (file >= 0 && flock(file, how) == 0) return file;
  if (file >= 0) close(file);
  return -1;
}

/// A program may have taken the rights to its folders away.
void RemoveWholly(const std::string& folder) {
  std::error_code error;
  files::remove_all(folder, error);
  if (!error) return;
  std::vector<files::path> open_ends{folder};
  while (!open_ends.empty()) {
    const files::path at = open_ends.back();
    open_ends.pop_back();
    std::error_code ignored;
    files::permissions(at, files::perms::owner_all, files::perm_options::add, ignored);
    for (files::directory_iterator entry(at, ignored), end; !ignored && entry != end;
         entry.increment(ignored)) {
      std::error_code none;
      if (entry->symlink_status(none).type() == files::file_type::directory) {
        open_ends.push_back(entry->path());
      }
    }
  }
  files::remove_all(folder, error);
}

void RemoveDeadWorkers(const std::string& root) {
  std::error_code error;
  for (files::directory_iterator entry(root, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string path = entry->path().string();
    if (!entry->path().filename().string().starts_with(kPrefix)) continue;
    const int lock = LockedFile(absl::StrCat(path, "/", kLockName), LOCK_EX | LOCK_NB);
    if (lock < 0) continue;
    RemoveWholly(path);
    close(lock);
  }
}

absl::Status NotMade(const std::string& path, const std::string& why) {
  return absl::UnavailableError(absl::StrCat(path, ": cannot be made: ", why));
}

absl::Status MakeParents(const std::string& path) {
  std::error_code error;
  files::create_directories(files::path(path).parent_path(), error);
  if (error) return absl::UnavailableError(absl::StrCat(path, ": ", error.message()));
  return absl::OkStatus();
}

/// Names of files, each once and none of them the folder of another.
absl::Status CheckNames(const Scratch::Files& listed) {
  std::set<std::string> names;
  for (const v1::ProgramFile& file : listed) {
    RETURN_IF_ERROR(CheckFileName(file.name()));
    if (file.name() == "request.json") {
      return absl::InvalidArgumentError("request.json is written by the worker: name it otherwise");
    }
    if (!names.insert(file.name()).second) {
      return absl::InvalidArgumentError(absl::StrCat("two files are called ", file.name()));
    }
  }
  for (const std::string& name : names) {
    for (std::size_t slash = name.find('/'); slash != std::string::npos;
         slash = name.find('/', slash + 1)) {
      if (names.contains(name.substr(0, slash))) {
        return absl::InvalidArgumentError(
            absl::StrCat(name.substr(0, slash), " is a file and the folder of ", name));
      }
    }
  }
  return absl::OkStatus();
}

absl::Status SetRights(const std::string& path, bool executable) {
  constexpr mode_t kProgram = 0700;
  constexpr mode_t kFile = 0600;
  if (chmod(path.c_str(), executable ? kProgram : kFile) != 0) {
    return absl::UnavailableError(absl::StrCat(path, ": ", std::strerror(errno)));
  }
  return absl::OkStatus();
}

}  // namespace

std::string DefaultScratchRoot(const std::string& name) {
  const char* const temporary = std::getenv("TMPDIR");
  std::string safe = name;
  std::replace(safe.begin(), safe.end(), '/', '_');
  return absl::StrCat(temporary != nullptr && *temporary != '\0' ? temporary : "/tmp", "/calib-",
                      getuid(), "-", safe);
}

absl::Status CheckFileName(const std::string& name) {
  const auto refuse = [&name](const char* why) {
    return absl::InvalidArgumentError(absl::StrCat(
        "file name \"", name, "\" ", why, ": it has to stand in the scratch folder of its run"));
  };
  if (name.empty()) return refuse("is empty");
  if (name.front() == '/') return refuse("is absolute");
  if (name.find('\0') != std::string::npos) return refuse("has a zero byte");
  for (std::size_t begin = 0; begin <= name.size();) {
    const std::size_t end = std::min(name.find('/', begin), name.size());
    const std::string part = name.substr(begin, end - begin);
    if (part == "..") return refuse("leads out of its folder");
    if (part.empty() || part == ".") return refuse("has an empty part");
    begin = end + 1;
  }
  return absl::OkStatus();
}

double BytesBelow(const std::string& folder) {
  constexpr double kBlock = 512;  // of st_blocks, whatever the disk has
  double bytes = 0;
  std::vector<files::path> open_ends{folder};
  while (!open_ends.empty()) {
    const files::path at = std::move(open_ends.back());
    open_ends.pop_back();
    std::error_code error;
    for (files::directory_iterator entry(at, error), end; !error && entry != end;
         entry.increment(error)) {
      struct stat found {};
      if (lstat(entry->path().c_str(), &found) != 0) continue;
      if (S_ISDIR(found.st_mode)) {
        open_ends.push_back(entry->path());
      } else {
        // Of a file with holes what is there, of a small one not the whole block.
        bytes += std::min(static_cast<double>(found.st_size),
                          kBlock * static_cast<double>(found.st_blocks));
      }
    }
  }
  return bytes;
}

absl::Status WriteFileBelow(const std::string& path, const std::string& content) {
  RETURN_IF_ERROR(MakeParents(path));
  const std::string part = absl::StrCat(path, ".part");
  std::error_code error;
  files::remove(part, error);
  {
    std::ofstream file(part, std::ios::binary);
    file.write(content.data(), static_cast<std::streamsize>(content.size()));
    file.close();  // tells whether the disk has taken it
    if (!file) {
      files::remove(part, error);
      return absl::UnavailableError(absl::StrCat(path, ": cannot be written; is the disk full?"));
    }
  }
  files::rename(part, path, error);
  if (error) return absl::UnavailableError(absl::StrCat(path, ": ", error.message()));
  return absl::OkStatus();
}

RunFolder::~RunFolder() {
  if (!path_.empty()) RemoveWholly(path_);
}

RunFolder& RunFolder::operator=(RunFolder&& other) noexcept {
  if (this != &other) {
    if (!path_.empty()) RemoveWholly(path_);
    path_ = std::exchange(other.path_, {});
  }
  return *this;
}

absl::StatusOr<std::unique_ptr<Scratch>> Scratch::Open(const std::string& root, Fetch fetch,
                                                       double most_cache_bytes) {
  std::error_code error;
  const std::string whole = files::absolute(root, error).lexically_normal().string();
  RETURN_IF_ERROR(MakeParents(whole));
  if (mkdir(whole.c_str(), 0700) != 0 && errno != EEXIST) {
    return NotMade(whole, std::strerror(errno));
  }
  struct stat found {};
  if (lstat(whole.c_str(), &found) != 0) return NotMade(whole, std::strerror(errno));
  // In /tmp anybody may have made a folder or a link of this name.
  if (!S_ISDIR(found.st_mode)) return NotMade(whole, "something else has this name");
  if (found.st_uid != getuid()) return NotMade(whole, "it is of another account");
  if ((found.st_mode & (S_IWGRP | S_IWOTH)) != 0) return NotMade(whole, "others may write in it");
  // While one worker begins, no other takes its folder for a dead one.
  const int beginning = LockedFile(absl::StrCat(whole, "/", kLockName), LOCK_EX);
  if (beginning < 0) return NotMade(whole, std::strerror(errno));
  RemoveDeadWorkers(whole);
  const std::string folder = absl::StrCat(whole, "/", kPrefix, rpc::RandomId());
  const bool made =
      mkdir(folder.c_str(), 0700) == 0 && mkdir(absl::StrCat(folder, "/cache").c_str(), 0700) == 0;
  const int lock = made ? LockedFile(absl::StrCat(folder, "/", kLockName), LOCK_EX | LOCK_NB) : -1;
  const int why = errno;
  close(beginning);
  if (lock < 0) return NotMade(folder, std::strerror(why));
  return std::unique_ptr<Scratch>(
      new Scratch(whole, folder, lock, std::move(fetch), most_cache_bytes));
}

Scratch::Scratch(std::string root, std::string folder, int lock, Fetch fetch,
                 double most_cache_bytes)
    : root_(std::move(root)),
      folder_(std::move(folder)),
      lock_(lock),
      fetch_(std::move(fetch)),
      most_cache_bytes_(most_cache_bytes) {}

Scratch::~Scratch() {
  RemoveWholly(folder_);
  close(lock_);
}

absl::StatusOr<RunFolder> Scratch::MakeRunFolder() {
  std::string path;
  {
    const absl::MutexLock lock(&mutex_);
    path = absl::StrCat(folder_, "/run-", ++folders_);
  }
  if (mkdir(path.c_str(), 0700) != 0) return NotMade(path, std::strerror(errno));
  return RunFolder(path);
}

class Scratch::Pinned {
 public:
  Pinned(Scratch& scratch, std::string digest) : scratch_(&scratch), digest_(std::move(digest)) {}
  ~Pinned() {
    if (scratch_ == nullptr) return;
    const absl::MutexLock lock(&scratch_->mutex_);
    --scratch_->cache_[digest_].users;
  }
  Pinned(Pinned&& other) noexcept
      : scratch_(std::exchange(other.scratch_, nullptr)), digest_(std::move(other.digest_)) {}
  Pinned& operator=(Pinned&&) = delete;
  std::string path() const { return scratch_->PathOf(digest_); }

 private:
  Scratch* scratch_;
  std::string digest_;
};

std::string Scratch::PathOf(const std::string& digest) const {
  return absl::StrCat(folder_, "/cache/", digest);
}

absl::StatusOr<double> Scratch::FetchInto(const std::string& path, const std::string& digest,
                                          std::stop_token stop) {
  ASSIGN_OR_RETURN(const std::string content, fetch_(digest, std::move(stop)));
  if (rpc::Sha256Hex(content) != digest) {
    return absl::DataLossError(absl::StrCat("content that was fetched is not that of ", digest));
  }
  RETURN_IF_ERROR(WriteFileBelow(path, content));
  return static_cast<double>(content.size());
}

absl::StatusOr<Scratch::Pinned> Scratch::Get(const std::string& digest, std::stop_token stop) {
  {
    const std::stop_callback wake(stop, [this] {
      const absl::MutexLock lock(&mutex_);
      changed_.SignalAll();
    });
    const absl::MutexLock lock(&mutex_);
    for (auto known = cache_.find(digest); known != cache_.end(); known = cache_.find(digest)) {
      if (known->second.there) {
        ++known->second.users;
        known->second.last_use = ++uses_;
        return Pinned(*this, digest);
      }
      if (stop.stop_requested()) return absl::CancelledError("stopped");
      changed_.Wait(&mutex_);
    }
    cache_.emplace(digest, Cached{});
  }
  const absl::StatusOr<double> bytes = FetchInto(PathOf(digest), digest, stop);
  const absl::MutexLock lock(&mutex_);
  changed_.SignalAll();
  if (!bytes.ok()) {
    cache_.erase(digest);
    return stop.stop_requested() ? absl::CancelledError("stopped") : bytes.status();
  }
  cache_[digest] = {.there = true, .users = 1, .bytes = *bytes, .last_use = ++uses_};
  MakeRoom();
  return Pinned(*this, digest);
}

void Scratch::MakeRoom() {
  double bytes = 0;
  for (const auto& [digest, cached] : cache_) bytes += cached.bytes;
  while (bytes > most_cache_bytes_) {
    auto oldest = cache_.end();
    for (auto cached = cache_.begin(); cached != cache_.end(); ++cached) {
      const bool may_go = cached->second.there && cached->second.users == 0;
      if (may_go && (oldest == cache_.end() || cached->second.last_use < oldest->second.last_use)) {
        oldest = cached;
      }
    }
    if (oldest == cache_.end()) return;
    std::error_code ignored;
    files::remove(PathOf(oldest->first), ignored);
    bytes -= oldest->second.bytes;
    cache_.erase(oldest);
  }
}

absl::Status Scratch::CopyFiles(const Files& listed, const std::string& folder,
                                std::stop_token stop) {
  RETURN_IF_ERROR(CheckNames(listed));
  for (const v1::ProgramFile& file : listed) {
    if (file.is_template()) continue;
    ASSIGN_OR_RETURN(const Pinned cached, Get(file.digest(), stop));
    const std::string path = absl::StrCat(folder, "/", file.name());
    RETURN_IF_ERROR(MakeParents(path));
    std::error_code error;
    files::copy_file(cached.path(), path, error);
    if (error) return absl::UnavailableError(absl::StrCat(path, ": ", error.message()));
    RETURN_IF_ERROR(SetRights(path, file.executable()));
  }
  return absl::OkStatus();
}

absl::Status Scratch::WriteTemplates(const Files& listed,
                                     const std::map<std::string, std::string>& replacements,
                                     const std::string& folder, std::stop_token stop) {
  RETURN_IF_ERROR(CheckNames(listed));
  for (const v1::ProgramFile& file : listed) {
    if (!file.is_template()) continue;
    ASSIGN_OR_RETURN(const Pinned cached, Get(file.digest(), stop));
    std::ifstream opened(cached.path(), std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(opened), {}};
    if (opened.bad())
      return absl::UnavailableError(absl::StrCat(cached.path(), ": cannot be read"));
    const std::string path = absl::StrCat(folder, "/", file.name());
    RETURN_IF_ERROR(WriteFileBelow(path, Replaced(text, replacements)));
    RETURN_IF_ERROR(SetRights(path, file.executable()));
  }
  return absl::OkStatus();
}

}  // namespace calib::worker
