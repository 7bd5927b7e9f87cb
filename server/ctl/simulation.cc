#include "server/ctl/simulation.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <thread>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"
#include "server/client/interrupt.h"
#include "server/messages/attempt_spec.h"

namespace calib::ctl {
namespace {

constexpr std::chrono::milliseconds kPollWorkers{100};

// The text of the packing file that a run's specimen is, or takes its sizes from; empty with a
// recipe of its own.
std::string PackingText(const campaign::Experiment& experiment, int stream,
                        const std::map<std::string, std::string>& contents) {
  const campaign::Specimen& specimen =
      experiment.specimens[static_cast<std::size_t>(stream) % experiment.specimens.size()];
  if (const auto* file = std::get_if<campaign::PackingFile>(&specimen)) {
    return contents.at(file->path);
  }
  const auto* like = std::get_if<campaign::PackingLike>(&specimen);
  return like != nullptr ? contents.at(like->path) : "";
}

std::vector<std::string> MeshContents(const campaign::Experiment& experiment,
                                      const std::map<std::string, std::string>& contents) {
  std::vector<std::string> meshes;
  meshes.reserve(experiment.meshes.size());
  for (const auto& [name, file] : experiment.meshes) meshes.push_back(contents.at(file.path));
  return meshes;
}

// Path of a name in a folder; empty without a folder.
std::string Below(const std::string& folder, const std::string& name) {
  return folder.empty() ? "" : (std::filesystem::path(folder) / name).string();
}

}  // namespace

bool HasPictures(const campaign::Experiment& experiment) {
  if (std::holds_alternative<campaign::ProgramSpecimen>(experiment.specimens.front())) return false;
  const dem::TestInfo* const test = dem::FindTest(experiment.test);
  return test == nullptr || test->needs_packing;
}

absl::Status Simulation::RunAll(const std::string& program, const std::string& folder) {
  const std::size_t cores = std::max(1U, std::thread::hardware_concurrency());
  client::ProgressLine line;
  for (;;) {
    std::size_t running = 0;
    for (Evaluation& run : runs_) {
      if (!run.Poll()) {
        ++running;
      } else if (auto ended = run.Result(); absl::IsInvalidArgument(ended)) {
        return ended;
      }
    }
    const bool all_started = runs_.size() == options_.experiments.size();
    if (all_started && running == 0) return absl::OkStatus();
    if (client::Interrupted()) return absl::CancelledError("stopped");
    if (!all_started && running < cores) {
      RETURN_IF_ERROR(StartNext(program, folder));
      continue;
    }
    ShowProgress(line);
    std::this_thread::sleep_for(kPollWorkers);
  }
}

absl::Status Simulation::StartNext(const std::string& program, const std::string& folder) {
  const std::size_t e = runs_.size();
  const campaign::Experiment& measured = experiment(e);
  const std::filesystem::path own = std::filesystem::path(folder) / std::to_string(e);
  if (campaign_.program) return StartProgram(program, own.string());
  Evaluation::Task task{.spec = messages::SpecOf(campaign_, options_.experiments[e], options_.run),
                        .packing = PackingText(measured, options_.run.stream, contents_),
                        .meshes = MeshContents(measured, contents_),
                        .vtk = HasPictures(measured) ? Below(options_.vtk, measured.name) : "",
                        .load_step = options_.load_step,
                        .checkpoint = Below(options_.checkpoint, measured.name + ".checkpoint")};
  std::error_code error;
  std::filesystem::create_directories(own, error);
  if (!error && !task.vtk.empty()) std::filesystem::create_directories(task.vtk, error);
  if (!error && !task.checkpoint.empty()) {
    std::filesystem::create_directories(options_.checkpoint, error);
  }
  if (error) {
    return absl::PermissionDeniedError(
        absl::StrCat("a folder for ", measured.name, " cannot be made in ",
                     task.vtk.empty() ? options_.checkpoint : options_.vtk, ": ", error.message()));
  }
  ASSIGN_OR_RETURN(auto started, Evaluation::Start(program, task, own.string()));
  runs_.push_back(std::move(started));
  return absl::OkStatus();
}

absl::Status Simulation::StartProgram(const std::string& program, const std::string& own) {
  Evaluation::Task task;
  task.program =
      messages::ProgramRunOf(campaign_, options_.experiments[runs_.size()], options_.run);
  task.program->set_threads(1);
  for (const campaign::ProgramFile& file : campaign_.program->files) {
    task.files[file.digest] = contents_.at(file.path);
  }
  std::error_code error;
  std::filesystem::create_directories(own, error);
  if (error) return absl::PermissionDeniedError(absl::StrCat(own, ": ", error.message()));
  ASSIGN_OR_RETURN(auto started, Evaluation::Start(program, task, own));
  runs_.push_back(std::move(started));
  return absl::OkStatus();
}

void Simulation::ShowProgress(client::ProgressLine& line) const {
  std::string text;
  int done = 0;
  int of = 0;
  for (std::size_t e = 0; e < runs_.size(); ++e) {
    absl::StrAppend(&text, e > 0 ? "  " : "", experiment(e).name, " ", runs_[e].StatesSoFar(), "/",
                    experiment(e).control.size());
    done += runs_[e].StatesSoFar();
  }
  for (const int e : options_.experiments) {
    of += static_cast<int>(campaign_.experiments[static_cast<std::size_t>(e)].control.size());
  }
  line.Show(text + " load steps", 5 * done / std::max(1, of));
}

}  // namespace calib::ctl
