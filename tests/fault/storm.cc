#include "tests/fault/storm.h"

#include <algorithm>
#include <array>
#include <random>

namespace calib::testing {
namespace {

constexpr int kBlows = 6;
constexpr int kWithin = 2500;   // [ms]; an undisturbed campaign takes two to four seconds
constexpr int kLongest = 1500;  // [ms], two leases of the storm's servers

constexpr std::array kWords = {"server_killed", "server_frozen", "worker_killed", "worker_frozen",
                               "engine_killed", "link_cut",      "link_slow",     "link_silent",
                               "disk_full",     "clock_jumps",   "damaged_copy"};

}  // namespace

std::vector<Blow> StormOf(std::uint64_t seed, const std::vector<Fault>& faults) {
  std::mt19937_64 random(seed);
  std::vector<Blow> storm(kBlows);
  for (Blow& blow : storm) {
    blow.fault = faults[random() % faults.size()];
    blow.at = std::chrono::milliseconds(random() % kWithin);
    blow.lasts = std::chrono::milliseconds(random() % kLongest);
    blow.chance = static_cast<std::uint32_t>(random());
  }
  std::sort(storm.begin(), storm.end(),
            [](const Blow& left, const Blow& right) { return left.at < right.at; });
  return storm;
}

std::string InWords(const std::vector<Blow>& storm) {
  std::string text;
  for (const Blow& blow : storm) {
    text += (text.empty() ? "" : ", ") + std::string(kWords[static_cast<std::size_t>(blow.fault)]) +
            " at " + std::to_string(blow.at.count()) + " ms for " +
            std::to_string(blow.lasts.count()) + " ms";
  }
  return text;
}

}  // namespace calib::testing
