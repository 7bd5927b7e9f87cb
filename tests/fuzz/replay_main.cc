// main() of a target outside the preset fuzz: every file of a corpus once, in the order of their
// names. usage: fuzz_NAME FOLDER|FILE...

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "tests/fuzz/fuzz_target.h"

int main(int argc, char** argv) {
  std::vector<std::filesystem::path> files;
  for (int i = 1; i < argc; ++i) {
    if (std::filesystem::is_directory(argv[i])) {
      for (const auto& entry : std::filesystem::directory_iterator(argv[i])) {
        files.push_back(entry.path());
      }
    } else {
      files.emplace_back(argv[i]);
    }
  }
  std::sort(files.begin(), files.end());
  int wrong = 0;
  for (const auto& path : files) {
    std::ifstream file(path, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    std::printf("%s\n", path.c_str());
    std::fflush(stdout);  // who crashes has been named
    if (!file) {
      std::printf("  cannot be read\n");
      ++wrong;
      continue;
    }
    calib::fuzz::last_was_good = false;
    LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
    if (path.filename().string().starts_with("good_") && !calib::fuzz::last_was_good) {
      std::printf("  was refused, but its name says that it is good\n");
      ++wrong;
    }
  }
  if (files.empty()) {
    std::printf("no file of a corpus was named or is there\n");
  }
  return files.empty() || wrong > 0 ? 1 : 0;
}
