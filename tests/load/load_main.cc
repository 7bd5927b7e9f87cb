// load --server HOST:PORT ...: workers without mechanics at a running calibd, in one process;
// prints one JSON object. See README.md.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/load/load_worker.h"
#include "tests/support/client.h"

namespace {

using calib::load::Clock;

struct Options {
  std::string server, token;
  int workers = 10, slots = 1;
  double rate = 100;    // states per second, of all
  double warm_up = 5;   // s
  double seconds = 20;  // s, that count
  int states = 100;     // of a run
  int samples = 0;      // of the campaign; 0: as many as the time takes
  bool null = false;    // the server is a load_null
  int pid = 0;          // of the server, where it is on this machine; 0: not known
};

struct Used {
  double cpu_seconds = std::nan("");
  double rss_mib = std::nan("");
  double written = std::nan("");  ///< bytes, by write and its kin: files, and wake-ups
  double writes = std::nan("");   ///< those calls
};

/// Of a process, by its files of /proc.
Used UsedBy(int pid) {
  Used used;
  std::ifstream stat(absl::StrCat("/proc/", pid, "/stat"));
  std::string text((std::istreambuf_iterator<char>(stat)), {});
  const std::size_t name_ends = text.rfind(')');
  if (name_ends == std::string::npos) return used;
  std::istringstream fields(text.substr(name_ends + 1));
  constexpr int kBeforeUser = 11;  // proc(5): utime is the 14th, the name the second
  std::string skipped;
  for (int k = 0; k < kBeforeUser; ++k) fields >> skipped;
  double user = 0, system = 0;
  fields >> user >> system;
  used.cpu_seconds = (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
  std::ifstream pages(absl::StrCat("/proc/", pid, "/statm"));
  double all = 0, resident = 0;
  pages >> all >> resident;
  used.rss_mib = resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1024.0 * 1024.0);
  std::ifstream io(absl::StrCat("/proc/", pid, "/io"));
  for (std::string name; io >> name;) {
    double number = 0;
    io >> number;
    if (name == "wchar:") used.written = number;
    if (name == "syscw:") used.writes = number;
  }
  return used;
}

// Spheres that hit a wall at many angles: a state each.
std::string CampaignFile(int samples) {
  return absl::StrCat(
      "name: load\n"
      "model: {contact: hertz_mindlin, density: 2500 kg/m^3, fixed: {poisson_ratio: 0.25}}\n"
      "parameters:\n"
      "  young_modulus: {prior: log_uniform, min: 0.02 GPa, max: 1 GPa}\n"
      "  friction_coefficient: {prior: uniform, min: 0.05, max: 1}\n"
      "experiments:\n"
      "  - name: wall\n    test: collision\n    radius: 5 mm\n    impact_speed: 1 m/s\n"
      "    data: {file: wall.csv}\n    control: impact_angle\n    observables:\n"
      "      normal_restitution: {noise: {absolute: 0.03}}\n"
      "      tangential_restitution: {noise: {absolute: 0.03}}\n"
      "inference: {method: sqmc, samples: ",
      samples, "}\nseed: 1\n");
}

std::string Measurement(int states) {
  std::string csv = "impact_angle,normal_restitution,tangential_restitution\n";
  for (int i = 0; i < states; ++i) {
    absl::StrAppend(&csv, 0.02 + 1.3 * i / states, ",0.85,0.7\n");
  }
  return csv;
}

constexpr double kMicro = 1e6;

double Quantile(const std::vector<float>& sorted, double p) {
  if (sorted.empty()) return std::nan("");
  return sorted[static_cast<std::size_t>(p * static_cast<double>(sorted.size() - 1))];
}

int Run(const Options& o) {
  calib::rpc::AccessChoice choice;
  choice.token = o.token;
  const auto access = o.null ? absl::StatusOr<calib::rpc::Access>(calib::rpc::Access{})
                             : calib::rpc::FindAccess(o.server, choice);
  if (!access.ok()) {
    std::cerr << "load: " << access.status().message() << "\n";
    return 2;
  }
  const double taken = o.rate * (o.warm_up + o.seconds) / o.states + o.workers * o.slots;
  const int samples = o.samples > 0 ? o.samples : static_cast<int>(1.2 * taken) + 10;
  const auto campaign =
      o.null ? absl::StatusOr<std::string>("none")
             : calib::testing::Client(o.server, choice)
                   .SubmitCampaign(CampaignFile(samples), {{"wall.csv", Measurement(o.states)}},
                                   absl::StrCat("load ", samples));
  if (!campaign.ok()) {
    std::cerr << "load: " << campaign.status().message() << "\n";
    return 1;
  }
  const calib::load::Load load{.address = o.server,
                               .access = *access,
                               .slots = o.slots,
                               .states_per_second = o.rate / (o.workers * o.slots)};
  std::vector<std::unique_ptr<calib::load::LoadWorker>> workers;
  workers.reserve(static_cast<std::size_t>(o.workers));
  for (int i = 0; i < o.workers; ++i) {
    workers.push_back(std::make_unique<calib::load::LoadWorker>(absl::StrCat("load-", i), load));
  }
  const auto begun = Clock::now();
  const auto counted = begun + std::chrono::duration<double>(o.warm_up);
  const auto end = counted + std::chrono::duration<double>(o.seconds);
  constexpr std::chrono::milliseconds kTick{5};  // as fine as a birth is known
  bool counts = false;
  Used before;
  for (auto now = begun; now < end; now = Clock::now()) {
    if (!counts && now >= counted) {
      for (const auto& worker : workers) worker->Count();
      counts = true;
      before = UsedBy(o.pid);
    }
    for (const auto& worker : workers) worker->Tick(now);
    std::this_thread::sleep_until(now + kTick);
  }
  const Used after = UsedBy(o.pid);
  std::vector<float> waits;
  std::int64_t finished = 0, refused = 0, ended = 0;
  std::string why;
  for (const auto& worker : workers) {
    const calib::load::Seen seen = worker->Take();
    waits.insert(waits.end(), seen.waits_ms.begin(), seen.waits_ms.end());
    finished += seen.finished;
    refused += seen.refused;
    if (!seen.ended.empty()) {
      ++ended;
      why = seen.ended;
    }
  }
  workers.clear();
  std::sort(waits.begin(), waits.end());
  std::cout << nlohmann::ordered_json(
                   {{"campaign", *campaign},
                    {"states", waits.size()},
                    {"states_per_second", static_cast<double>(waits.size()) / o.seconds},
                    {"p50_ms", Quantile(waits, 0.5)},
                    {"p99_ms", Quantile(waits, 0.99)},
                    {"largest_ms", waits.empty() ? std::nan("") : waits.back()},
                    {"server_us_per_state", kMicro * (after.cpu_seconds - before.cpu_seconds) /
                                                static_cast<double>(waits.size())},
                    {"server_rss_mib", after.rss_mib},
                    {"server_bytes_written_per_state",
                     (after.written - before.written) / static_cast<double>(waits.size())},
                    {"server_writes_per_state",
                     (after.writes - before.writes) / static_cast<double>(waits.size())},
                    {"runs_finished", finished},
                    {"leases_lost", refused},
                    {"streams_ended", ended},
                    {"why", why}})
            << "\n";
  return ended == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  CLI::App app("Workers without mechanics: what a calibd takes");
  app.add_option("--server", o.server, "HOST:PORT")->required();
  app.add_option("--token", o.token, "file that holds the token");
  app.add_option("--workers", o.workers)->check(CLI::Range(1, 10000));
  app.add_option("--slots", o.slots, "of a worker")->check(CLI::Range(1, 4096));
  app.add_option("--rate", o.rate, "states per second, of all")->check(CLI::PositiveNumber);
  app.add_option("--warm-up", o.warm_up, "s")->check(CLI::NonNegativeNumber);
  app.add_option("--seconds", o.seconds, "that count")->check(CLI::PositiveNumber);
  app.add_option("--states", o.states, "of a run")->check(CLI::Range(1, 1000));
  app.add_flag("--null", o.null, "the server is a load_null");
  app.add_option("--pid", o.pid, "of the server: its processor time and memory are told");
  app.add_option("--samples", o.samples, "of the campaign")->check(CLI::NonNegativeNumber);
  CLI11_PARSE(app, argc, argv);
  return Run(o);
}
