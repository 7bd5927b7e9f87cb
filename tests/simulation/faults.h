#pragma once
// Faults that can be planted: does the simulation find them? None of them is in a program of the
// product: they are in the simulated disk and queues, or in a copy of the scheduler's sources that
// only a program of this folder has (planted/plant.py).

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace calib::simulation {

struct Fault {
  std::string name{};
  bool in_scheduler = false;  ///< planted in the copy: simulate_planted has it
  std::uint64_t seed = 0;     ///< that finds it
};

const std::vector<Fault>& Faults();

/// The fault of the simulation that runs; copied sources ask for it.
inline std::string planted;
inline bool IsPlanted(const char* name) { return planted == name; }
/// What planted faults remember in the simulation that runs, by attempt.
inline std::map<std::int64_t, std::array<std::int64_t, 3>> granted;
inline std::map<std::int64_t, std::int64_t> counted;

}  // namespace calib::simulation
