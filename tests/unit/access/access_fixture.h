#pragma once
// An authority in a folder of the test's own.

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "server/access/authority.h"
#include "server/access/certificate.h"

namespace calib::access {

inline constexpr std::int64_t kOneDay = 86400;  // [s]

class AccessFixture : public ::testing::Test {
 protected:
  AccessFixture() {
    std::string pattern = (std::filesystem::temp_directory_path() / "access-test-XXXXXX").string();
    work_ = mkdtemp(pattern.data());
    made_ = InitAuthority(ca());
  }
  ~AccessFixture() override { std::filesystem::remove_all(work_); }
  void SetUp() override { ASSERT_TRUE(made_.ok()) << made_; }

  std::string At(const std::string& name) const { return (work_ / name).string(); }
  std::string ca() const { return At("ca"); }

  /// Issues into the folder NAME.
  Holder Given(const std::string& name, Role role) const {
    const auto holder = Issue(ca(), {.name = name, .role = role}, At(name));
    EXPECT_TRUE(holder.ok()) << holder.status();
    return holder.value_or(Holder{});
  }

  static std::string ReadText(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  static void WriteText(const std::string& path, const std::string& text) {
    std::ofstream(path, std::ios::binary | std::ios::trunc) << text;
  }
  static void Copy(const std::string& from, const std::string& to) {
    std::filesystem::copy_file(from, to, std::filesystem::copy_options::overwrite_existing);
  }
  /// Permissions, without the kind of file.
  static mode_t ModeOf(const std::string& path) {
    struct stat found = {};
    return stat(path.c_str(), &found) == 0 ? found.st_mode & 07777 : 0;
  }
  static std::int64_t Now() { return absl::ToUnixSeconds(absl::Now()); }

 private:
  std::filesystem::path work_;
  absl::Status made_;
};

}  // namespace calib::access
