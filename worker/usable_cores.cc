#include "worker/usable_cores.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <optional>
#include <thread>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace calib::worker {
namespace {

std::string FirstLine(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

/// Cores that quota / period [microseconds] pays for; empty: no limit is set.
std::optional<double> Paid(const std::string& quota, const std::string& period) {
  double time = 0;
  double every = 0;
  if (!absl::SimpleAtod(quota, &time) || !absl::SimpleAtod(period, &every)) return std::nullopt;
  return time > 0 && every > 0 ? std::optional<double>(time / every) : std::nullopt;
}

std::optional<double> QuotaOf(const std::string& group, bool unified) {
  if (!unified) {
    return Paid(FirstLine(group + "/cpu.cfs_quota_us"), FirstLine(group + "/cpu.cfs_period_us"));
  }
  const std::vector<std::string> words = absl::StrSplit(FirstLine(group + "/cpu.max"), ' ');
  return words.size() == 2 ? Paid(words[0], words[1]) : std::nullopt;
}

}  // namespace

int UsableCores(const std::string& root, const std::string& own) {
  double cores = std::max(1U, std::thread::hardware_concurrency());  // of the affinity
  std::ifstream groups(own);
  for (std::string line; std::getline(groups, line);) {
    // 0::/path of version 2, N:cpu,cpuacct:/path of version 1.
    const std::vector<std::string> parts = absl::StrSplit(line, absl::MaxSplits(':', 2));
    if (parts.size() != 3) continue;
    const std::vector<std::string> kinds = absl::StrSplit(parts[1], ',');
    const bool unified = parts[1].empty();
    if (!unified && std::find(kinds.begin(), kinds.end(), "cpu") == kinds.end()) continue;
    const std::string mount = unified ? root : absl::StrCat(root, "/cpu");
    // A group has no more than those around it. In a container the path may be that of the host.
    for (std::string path = parts[2];; path.erase(path.rfind('/'))) {
      if (const auto quota = QuotaOf(mount + path, unified); quota.has_value()) {
        cores = std::min(cores, *quota);
      }
      if (path.empty() || path.rfind('/') == std::string::npos) break;
    }
  }
  return std::max(1, static_cast<int>(cores));
}

}  // namespace calib::worker
