// main() of every test program: its temporary files lie in a folder of its own, in $TMPDIR where
// that is set and else in memory where there is room, since a commit that waits for the disk takes
// most of the time of a test of a store. It goes when all tests have passed and stays, named on
// standard error, when one has failed.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>

namespace {

// Of all test programs together; they take some 100 MB.
constexpr std::uintmax_t kRoom = 1 << 30;  // [byte]

std::filesystem::path FolderOfFolders() {
  const std::filesystem::path memory = "/dev/shm";
  std::error_code error;
  if (std::getenv("TMPDIR") == nullptr && access(memory.c_str(), W_OK | X_OK) == 0 &&
      std::filesystem::space(memory, error).available >= kRoom && !error) {
    return memory;
  }
  return std::filesystem::temp_directory_path();
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleMock(&argc, argv);
  std::string folder = (FolderOfFolders() / "calib-test-XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) {
    std::perror(folder.c_str());
    return 1;
  }
  setenv("TMPDIR", folder.c_str(), 1);               // std::filesystem, and programs started
  setenv("TEST_TMPDIR", (folder + "/").c_str(), 1);  // testing::TempDir()
  setenv("XDG_RUNTIME_DIR", folder.c_str(), 1);      // servers leave their tokens there
  const int failed = RUN_ALL_TESTS();
  if (failed != 0) {
    std::fprintf(stderr, "files of this run: %s\n", folder.c_str());
    return failed;
  }
  std::error_code error;
  std::filesystem::remove_all(folder, error);
  return 0;
}
