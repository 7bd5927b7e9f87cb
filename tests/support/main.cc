// main() of every test program: its temporary files lie in a folder of its own, which goes when all
// tests have passed and stays, named on standard error, when one has failed.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>

int main(int argc, char** argv) {
  testing::InitGoogleMock(&argc, argv);
  std::string folder = (std::filesystem::temp_directory_path() / "calib-test-XXXXXX").string();
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
