// simulate_service: runs seeds of the simulation. One line for each that fails, with its last
// events; exit status 1 where one does.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <string>

#include "tests/simulation/simulation.h"

int main(int argc, char** argv) {
  using calib::simulation::Simulate;
  using calib::simulation::SimulationResult;
  CLI::App app("Runs the service in a simulation, by seeds");
  std::uint64_t seed = 1;
  std::uint64_t seeds = 1;
  double seconds = 0;
  std::string fault;
  std::string trace;
  bool stops = false;
  app.add_option("--seed", seed, "the first");
  app.add_option("--seeds", seeds, "how many");
  app.add_option("--seconds", seconds, "no further seed is begun after these");
  app.add_option("--fault", fault, "planted, by its name in faults.cc");
  app.add_option("--trace", trace, "all: every event; none: not even the last")
      ->check(CLI::IsMember({"all", "last", "none"}));
  app.add_flag("--until-found", stops, "end with the first seed that fails");
  CLI11_PARSE(app, argc, argv);
  const std::clock_t began = std::clock();
  const std::time_t at = std::time(nullptr);
  std::uint64_t run = 0;
  std::uint64_t failed = 0;
  double longest = 0;
  for (std::uint64_t s = seed; s < seed + seeds; ++s) {
    if (seconds > 0 && std::difftime(std::time(nullptr), at) > seconds) break;
    const SimulationResult result =
        Simulate({.seed = s, .fault = fault, .traces_all = trace == "all"});
    ++run;
    longest = std::max(longest, result.calm_seconds);
    if (trace == "all" || seeds == 1) {
      std::printf("seed %llu: %lld events, digest %016llx, %d restarts, %.1f s simulated\n",
                  static_cast<unsigned long long>(s), static_cast<long long>(result.events),
                  static_cast<unsigned long long>(result.digest), result.restarts, result.seconds);
    }
    if (result.violation.empty()) continue;
    ++failed;
    std::printf("seed %llu: %s\n", static_cast<unsigned long long>(s), result.violation.c_str());
    if (trace == "last" || trace.empty()) {
      for (const std::string& line : result.last) std::printf("    %s\n", line.c_str());
    }
    std::fflush(stdout);
    if (stops) break;
  }
  std::printf(
      "%llu seeds, %llu failed, %.3f s of processor time a seed; calm for %.1f simulated s at "
      "most\n",
      static_cast<unsigned long long>(run), static_cast<unsigned long long>(failed),
      static_cast<double>(std::clock() - began) / CLOCKS_PER_SEC /
          static_cast<double>(run == 0 ? 1 : run),
      longest);
  return failed == 0 ? 0 : 1;
}
