// calib-worker: the daemon on a compute node, or one evaluation with --once.
#include <malloc.h>
#include <pwd.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <optional>
#include <thread>

#include "dem/registry/catalog.h"
#include "proto/rpc/address.h"
#include "proto/rpc/digest.h"
#include "proto/rpc/service_manager.h"
#include "proto/rpc/set_up_process.h"
#include "worker/engine/engine_child.h"
#include "worker/once.h"
#include "worker/program/scratch.h"
#include "worker/program_once.h"
#include "worker/throughput.h"
#include "worker/usable_cores.h"
#include "worker/worker.h"

namespace {

constexpr std::chrono::milliseconds kBenchmark{300};
constexpr double kFewestGib = 0.001;
constexpr double kMostGib = 1e6;
constexpr double kGibibyte = 1 << 30;  // bytes

std::string CpuModel() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.rfind("model name", 0) == 0) {
      return line.substr(std::min(line.size(), line.find(':') + 2));
    }
  }
  return "unknown";
}

std::string DefaultName() {
  std::array<char, 256> host{};
  gethostname(host.data(), host.size() - 1);
  return std::string(host.data()) + "-" + std::to_string(getpid());
}

/// Its number where it has no name.
std::string AccountName() {
  std::array<char, 16384> buffer{};
  passwd entry{};
  passwd* found = nullptr;
  getpwuid_r(geteuid(), &entry, buffer.data(), buffer.size(), &found);
  return found != nullptr ? std::string(found->pw_name) : std::to_string(geteuid());
}

/// Empty where the user has no home.
std::string DefaultCheckpoints() {
  const auto from = [](const char* variable, const char* rest) {
    const char* const value = std::getenv(variable);
    return value != nullptr && *value != '\0' ? std::string(value) + rest : std::string();
  };
  const std::string cache = from("XDG_CACHE_HOME", "/calib/checkpoints");
  return cache.empty() ? from("HOME", "/.cache/calib/checkpoints") : cache;
}

/// The kernel ends this process with SIGTERM when its parent dies; false if the parent is dead
/// already.
bool ExitWithParent(int parent) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  return parent == 0 || getppid() == parent;
}

}  // namespace

int main(int argc, char** argv) {
  calib::rpc::SetUpProcess();
  // glibc raises this threshold with every large block that is freed, and the next run's arrays
  // then fragment the heap: 21 MiB instead of 14 for the second run of 5000 grains.
  mallopt(M_MMAP_THRESHOLD, 64 * 1024);
  CLI::App app{
      "Runs model evaluations for a calibd server, or one of them without a server (--once)."};
  calib::worker::WorkerOptions options;
  calib::worker::OnceOptions once;
  calib::worker::ProgramOnceOptions program_once;
  int parent = -1;
  int drain_within_s = 0;
  double checkpoints_gib = 4;
  std::optional<double> memory_gib;
  options.slots = 0;
  // Read by `calibctl doctor`, line by line.
  app.set_version_flag("--version",
                       "mechanics " + calib::dem::EngineVersion() + "\ncatalogue " +
                           calib::rpc::Sha256Hex(calib::dem::CatalogText()) + "\ncheckpoints " +
                           DefaultCheckpoints(),
                       "print what determines the bits of a run and where it rests, and leave");
  auto* server =
      app.add_option("--server", options.server, "the server, HOST:PORT or unix:/PATH")
          ->check([](const std::string& address) { return calib::rpc::ProblemOfAddress(address); });
  app.add_option("--tls", options.access.tls,
                 "folder of a certificate of the role worker, from `calibctl certs issue` "
                 "[$CALIB_TLS]");
  app.add_option("--token", options.access.token,
                 "file with the token of a server without certificates [$CALIB_TOKEN, or where a "
                 "server of this account leaves it]");
  app.add_option("--slots", options.slots,
                 "evaluations at a time [cores that it may use / threads per slot]")
      ->check(CLI::Range(1, 1024));
  app.add_option("--threads-per-slot", options.threads_per_slot, "threads of one evaluation")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  app.add_option("--threads", options.threads,
                 "threads that all evaluations may use together, an equal part a slot, where a "
                 "campaign wants more than one of its slots' own [slots times threads per slot]")
      ->check(CLI::Range(1, 1'048'576));
  app.add_option("--memory-gib", memory_gib,
                 "memory that all its runs may have together, an equal part a slot [that of the "
                 "machine or of its control group]")
      ->check(CLI::Range(kFewestGib, kMostGib));
  app.add_option("--name", options.name, "unique name [host name and process id]");
  app.add_option("--checkpoints", options.checkpoints,
                 "folder for runs that rest in breadth-first campaigns, shared by the workers of a "
                 "machine [calib/checkpoints in $XDG_CACHE_HOME or ~/.cache]");
  app.add_option("--checkpoints-gib", checkpoints_gib, "its size at most")
      ->check(CLI::Range(kFewestGib, kMostGib))
      ->capture_default_str();
  app.add_option("--allow-command", options.allowed_commands,
                 "programs that campaigns may run here as their model (names, looked for on PATH "
                 "now, or paths; *: any, which programs that a campaign brings along need). An "
                 "interpreter, as python3 or sh, runs whatever a campaign brings")
      ->allow_extra_args();
  app.add_option("--scratch", options.scratch,
                 "folder below which such programs run, each in one of its own [$TMPDIR or /tmp]");
  app.add_option(
         "--drain-within", drain_within_s,
         "seconds that runs have to end after SIGTERM or SIGINT, while nothing new is begun; "
         "a second signal stops them")
      ->check(CLI::Range(0, 86'400))
      ->capture_default_str();
  app.add_option("--exit-with-parent", parent,
                 "end when the parent process, of this id (0: whichever), ends");
  auto* spec =
      app.add_option("--once", once.spec, "run this AttemptSpec (JSON or binary) and leave");
  app.add_option("--packing", once.packing, "packing file of --once")->needs(spec);
  app.add_option("--mesh", once.meshes, "STL file of --once; may be repeated")
      ->needs(spec)
      ->allow_extra_args(false);
  auto* run = app.add_option("--once-program", program_once.run,
                             "run this ProgramRun (JSON or binary), of any program, and leave")
                  ->excludes(spec);
  app.add_option("--files", program_once.files,
                 "folder with the files of --once-program, each under its SHA-256")
      ->needs(run);
  app.add_option("--report", program_once.report,
                 "file for what the run of --once-program was like, JSON")
      ->needs(run);
  app.add_option("-o,--output", once.output,
                 "CSV file of --once, --once-program [standard output]");
  app.add_option("--vtk", once.vtk, "folder for the grains after each load step of --once")
      ->needs(spec);
  app.add_option("--load-step", once.load_step, "--once ends there and draws no other")
      ->check(CLI::NonNegativeNumber)
      ->needs(spec);
  app.add_option("--checkpoint", once.checkpoint,
                 "file to go on from after an interruption, renewed after each load step of --once")
      ->needs(spec);
  calib::worker::EngineChildOptions engine;
  app.add_option("--engine", engine.shared, "")->group("");  // what a worker starts for its slots
  app.add_option("--checkpoint-bytes", engine.most_checkpoint_bytes, "")->group("");
  server->excludes(spec)->excludes(run);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (!engine.shared.empty()) {
    engine.checkpoints = options.checkpoints;
    return calib::worker::RunEngineChild(engine);
  }
  if (once.spec.empty() && program_once.run.empty() && options.server.empty()) {
    std::cerr << "either --server HOST:PORT, --once SPEC or --once-program RUN is needed\n";
    return 2;
  }
  if (parent >= 0 && !ExitWithParent(parent)) {
    return 0;
  }
  if (!once.spec.empty()) {
    return calib::worker::RunOnce(once, std::cerr);
  }
  if (options.scratch.empty()) {
    options.scratch = calib::worker::DefaultScratchRoot("worker");
  }
  if (!program_once.run.empty()) {
    program_once.output = once.output;
    program_once.scratch = options.scratch;
    return calib::worker::RunProgramOnce(program_once, std::cerr);
  }
  spdlog::set_default_logger(spdlog::stderr_logger_mt("calib-worker"));
  spdlog::set_pattern("%Y-%m-%dT%H:%M:%S.%e %l %v");
  if (options.slots == 0) {
    options.slots = std::max(1, calib::worker::UsableCores() / options.threads_per_slot);
  }
  if (options.name.empty()) {
    options.name = DefaultName();
  }
  if (options.checkpoints.empty()) {
    options.checkpoints = DefaultCheckpoints();
  }
  if (!options.checkpoints.empty()) {  // engines run elsewhere
    options.checkpoints = std::filesystem::absolute(options.checkpoints);
  }
  options.memory = memory_gib ? *memory_gib * kGibibyte : calib::worker::UsableMemory();
  options.user = AccountName();
  options.most_checkpoint_bytes = static_cast<std::int64_t>(checkpoints_gib * kGibibyte);
  options.drain_within = std::chrono::seconds(drain_within_s);
  options.cpu = CpuModel();
  options.contact_updates_per_second = calib::worker::MeasureThroughput(kBenchmark);
  spdlog::info(
      "worker name={} slots={} threads_per_slot={} memory_gib={:.4g} "
      "contact_updates_per_second={:.4g}",
      options.name, options.slots, options.threads_per_slot, options.memory / kGibibyte,
      options.contact_updates_per_second);
  calib::worker::Worker worker(options);
  // It hears signals from here on; a server that is not there yet is waited for.
  calib::rpc::TellServiceManager(calib::rpc::kReady);
  const absl::Status status = worker.Run();
  calib::rpc::TellServiceManager(calib::rpc::kStopping);
  spdlog::info("exit ok={}", status.ok());
  return status.ok() ? 0 : 1;
}
