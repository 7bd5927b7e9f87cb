#pragma once
// A small file system in memory that can be filled, in a mount namespace that only this process and
// its children see.

#include <string>

namespace calib::testing {

/// From now on what this thread and its children mount is seen by them alone. False: this account
/// may not, with root's rights or without. To be called before there is another thread.
bool HaveOwnMounts();

/// Mounted at a folder while it lives.
class SmallDisk {
 public:
  SmallDisk(std::string folder, int mebibytes);
  ~SmallDisk();
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

  bool mounted() const { return mounted_; }
  /// Until nothing more goes onto it.
  void Fill() const;
  void MakeRoom() const;

 private:
  std::string Ballast() const { return folder_ + "/ballast"; }

  std::string folder_;
  bool mounted_ = false;
};

}  // namespace calib::testing
