#include "server/messages/folder_report.h"

#include <fcntl.h>
#include <sys/statfs.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace calib::messages {
namespace {

enum class Kind { kLocal, kRemote, kVolatile };

struct FileSystem {
  std::uint32_t magic;
  std::string_view name;
  Kind kind;
};

/// Numbers of statfs(2).
constexpr std::array kFileSystems = {
    FileSystem{0x0000EF53, "ext", Kind::kLocal},
    FileSystem{0x58465342, "xfs", Kind::kLocal},
    FileSystem{0x9123683E, "btrfs", Kind::kLocal},
    FileSystem{0x2FC12FC1, "zfs", Kind::kLocal},
    FileSystem{0xF2F52010, "f2fs", Kind::kLocal},
    FileSystem{0x794C7630, "overlay", Kind::kLocal},
    FileSystem{0x00006969, "nfs", Kind::kRemote},
    FileSystem{0xFF534D42, "cifs", Kind::kRemote},
    FileSystem{0xFE534D42, "smb2", Kind::kRemote},
    FileSystem{0x0BD00BD0, "lustre", Kind::kRemote},
    FileSystem{0x47504653, "gpfs", Kind::kRemote},
    FileSystem{0x19830326, "beegfs", Kind::kRemote},
    FileSystem{0x00C36400, "ceph", Kind::kRemote},
    FileSystem{0x5346414F, "afs", Kind::kRemote},
    FileSystem{0x01021997, "9p", Kind::kRemote},
    FileSystem{0x65735546, "fuse", Kind::kRemote},
    FileSystem{0x01021994, "tmpfs", Kind::kVolatile},
    FileSystem{0x858458F6, "ramfs", Kind::kVolatile},
};

std::string Because(const std::string& what, int error) {
  return absl::StrCat(what, ": ", std::generic_category().message(error));
}

/// Closed and removed with the object.
class ProbeFile {
 public:
  explicit ProbeFile(std::string path)
      : path_(std::move(path)),
        file_(open(path_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600)) {}
  ~ProbeFile() {
    if (file_ >= 0) {
      close(file_);
      unlink(path_.c_str());
    }
  }
  ProbeFile(const ProbeFile&) = delete;
  ProbeFile& operator=(const ProbeFile&) = delete;

  int file() const { return file_; }
  /// 0, or the error.
  int Rename(const std::string& to) {
    if (rename(path_.c_str(), to.c_str()) != 0) {
      return errno;
    }
    path_ = to;
    return 0;
  }

 private:
  std::string path_;
  int file_;
};

/// What could not be done; empty when all could.
std::string Probe(const std::string& folder) {
  constexpr std::string_view kText = "calib";
  const std::string name = absl::StrCat(folder, "/.calib-probe-", getpid());
  ProbeFile probe(name + ".new");
  if (probe.file() < 0) {
    return Because("no file can be made", errno);
  }
  if (write(probe.file(), kText.data(), kText.size()) != static_cast<ssize_t>(kText.size())) {
    return Because("a file cannot be written", errno);
  }
  struct flock whole = {};
  whole.l_type = F_WRLCK;
  whole.l_whence = SEEK_SET;
  if (fcntl(probe.file(), F_OFD_SETLK, &whole) != 0) {
    return Because("a file cannot be locked", errno);
  }
  if (fsync(probe.file()) != 0) {
    return Because("a file cannot be forced to the disk", errno);
  }
  if (const int error = probe.Rename(name); error != 0) {
    return Because("a file cannot be renamed", error);
  }
  return "";
}

}  // namespace

v1::FolderReport ExamineFolder(const std::string& folder) {
  v1::FolderReport report;
  std::error_code error;
  std::filesystem::path path = std::filesystem::absolute(folder, error).lexically_normal();
  while (!std::filesystem::is_directory(path, error) && path.has_relative_path()) {
    path = path.parent_path();
  }
  report.set_path(path.string());
  struct statfs held = {};
  struct statvfs space = {};
  if (statfs(path.c_str(), &held) != 0 || statvfs(path.c_str(), &space) != 0) {
    report.set_problem(Because("it cannot be examined", errno));
    return report;
  }
  const auto magic = static_cast<std::uint32_t>(held.f_type);
  report.set_file_system(absl::StrCat("0x", absl::Hex(magic)));
  for (const FileSystem& known : kFileSystems) {
    if (known.magic == magic) {
      report.set_file_system(std::string(known.name));
      report.set_is_remote(known.kind == Kind::kRemote);
      report.set_is_volatile(known.kind == Kind::kVolatile);
    }
  }
  report.set_free_bytes(static_cast<std::int64_t>(space.f_bavail * space.f_frsize));
  report.set_total_bytes(static_cast<std::int64_t>(space.f_blocks * space.f_frsize));
  const auto start = std::chrono::steady_clock::now();
  report.set_problem(Probe(path.string()));
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  report.set_sync_seconds(took.count());
  return report;
}

}  // namespace calib::messages
