#include "worker/usable_cores.h"

#include <algorithm>
#include <cmath>
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

// The smallest of what the control groups of a controller say, those around them included. In a
// container the path may be that of the host.
template <typename LimitOf>
double LeastOfGroups(const std::string& root, const std::string& own, const std::string& controller,
                     double least, const LimitOf& limit_of) {
  std::ifstream groups(own);
  for (std::string line; std::getline(groups, line);) {
    // 0::/path of version 2, N:cpu,cpuacct:/path of version 1.
    const std::vector<std::string> parts = absl::StrSplit(line, absl::MaxSplits(':', 2));
    if (parts.size() != 3) continue;
    const std::vector<std::string> kinds = absl::StrSplit(parts[1], ',');
    const bool unified = parts[1].empty();
    if (!unified && std::find(kinds.begin(), kinds.end(), controller) == kinds.end()) continue;
    const std::string mount = unified ? root : absl::StrCat(root, "/", controller);
    for (std::string path = parts[2];; path.erase(path.rfind('/'))) {
      if (const std::optional<double> limit = limit_of(mount + path, unified); limit.has_value()) {
        least = std::min(least, *limit);
      }
      if (path.empty() || path.rfind('/') == std::string::npos) break;
    }
  }
  return least;
}

std::optional<double> MemoryOf(const std::string& group, bool unified) {
  double bytes = 0;
  const std::string text = FirstLine(group + (unified ? "/memory.max" : "/memory.limit_in_bytes"));
  return absl::SimpleAtod(text, &bytes) && bytes > 0 ? std::optional<double>(bytes) : std::nullopt;
}

// "MemTotal:  16337240 kB" in bytes.
double MemoryOfMachine(const std::string& path) {
  constexpr double kKibibyte = 1024;
  std::ifstream file(path);
  std::string name;
  double number = 0;
  file >> name >> number;
  return name == "MemTotal:" ? number * kKibibyte : 0;
}

}  // namespace

int UsableCores(const std::string& root, const std::string& own) {
  const double of_affinity = std::max(1U, std::thread::hardware_concurrency());
  return std::max(1, static_cast<int>(LeastOfGroups(root, own, "cpu", of_affinity, QuotaOf)));
}

double UsableMemory(const std::string& root, const std::string& own, const std::string& machine) {
  const double all = MemoryOfMachine(machine);
  if (all <= 0) return 0;
  const double bytes = LeastOfGroups(root, own, "memory", all, MemoryOf);
  return bytes < kMemoryGrain ? bytes : kMemoryGrain * std::floor(bytes / kMemoryGrain);
}

}  // namespace calib::worker
