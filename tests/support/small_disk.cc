#include "tests/support/small_disk.h"

#include <sched.h>
#include <sys/mount.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <utility>

namespace calib::testing {
namespace {

void WriteTo(const std::string& path, const std::string& text) { std::ofstream(path) << text; }

}  // namespace

bool HaveOwnMounts() {
  const std::string user = std::to_string(getuid());
  const std::string group = std::to_string(getgid());
  if (unshare(CLONE_NEWNS) != 0) {
    if (unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0) return false;
    WriteTo("/proc/self/setgroups", "deny");
    WriteTo("/proc/self/uid_map", "0 " + user + " 1");
    WriteTo("/proc/self/gid_map", "0 " + group + " 1");
  }
  return mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0;
}

SmallDisk::SmallDisk(std::string folder, int mebibytes) : folder_(std::move(folder)) {
  std::filesystem::create_directories(folder_);
  const std::string size =
      "size=" + std::to_string(mebibytes) + "m,mode=0700";  // a state folder is its account's
  mounted_ = mount("tmpfs", folder_.c_str(), "tmpfs", 0, size.c_str()) == 0;
}

SmallDisk::~SmallDisk() {
  if (mounted_) umount2(folder_.c_str(), MNT_DETACH);
}

void SmallDisk::Fill() const {
  for (const std::size_t piece : {std::size_t{1} << 16U, std::size_t{1} << 12U}) {
    std::ofstream ballast(Ballast(), std::ios::app | std::ios::binary);
    const std::string zeros(piece, '\0');
    while (ballast.write(zeros.data(), static_cast<std::streamsize>(piece)).flush()) {
    }
  }
}

void SmallDisk::MakeRoom() const { std::filesystem::remove(Ballast()); }

}  // namespace calib::testing
