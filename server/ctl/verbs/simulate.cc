// One model evaluation of each experiment at given parameters, by calib-worker processes, as many
// at a time as cores.
#include "dem/simulate/simulate.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"
#include "server/client/interrupt.h"
#include "server/client/progress.h"
#include "server/ctl/assignments.h"
#include "server/ctl/evaluation.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/source_files.h"
#include "server/ctl/state_table.h"
#include "server/ctl/temporary_folder.h"
#include "server/ctl/verb.h"
#include "server/ctl/write_file.h"
#include "server/messages/attempt_spec.h"
#include "server/report/documents/json_documents.h"

namespace calib::ctl {
namespace {

struct SimulateOptions {
  std::string file;
  std::vector<std::string> set{};  ///< NAME=VALUE
  std::string output;              ///< CSV file; empty: standard output
  std::string vtk;                 ///< folder; empty: no pictures
  std::string checkpoint;          ///< folder; empty: none
};

constexpr std::chrono::milliseconds kPollWorkers{100};

// The text of the packing that sample 0 of an experiment starts from; empty with a recipe.
std::string PackingText(const campaign::Experiment& experiment, const SourceFiles& source) {
  const auto* file = std::get_if<campaign::PackingFile>(&experiment.specimens.front());
  return file != nullptr ? source.contents.at(file->path) : "";
}

std::vector<std::string> MeshContents(const campaign::Experiment& experiment,
                                      const SourceFiles& source) {
  std::vector<std::string> contents;
  for (const auto& [name, file] : experiment.meshes)
    contents.push_back(source.contents.at(file.path));
  return contents;
}

// Path of a name in a folder; empty without a folder.
std::string Below(const std::string& folder, const std::string& name) {
  return folder.empty() ? "" : (std::filesystem::path(folder) / name).string();
}

// A collision is one contact, of bodies that its settings make.
bool HasPictures(const campaign::Experiment& experiment) {
  const dem::TestInfo* const test = dem::FindTest(experiment.test);
  return test == nullptr || test->needs_packing;
}

void SayWhatHasNoPictures(const campaign::Campaign& campaign) {
  std::string names;
  for (const campaign::Experiment& experiment : campaign.experiments) {
    if (!HasPictures(experiment))
      absl::StrAppend(&names, names.empty() ? "" : ", ", experiment.name);
  }
  if (names.empty()) return;
  std::cerr << "calibctl: --vtk makes no pictures of " << names
            << ": a collision is one contact without grains\n";
}

class Simulation {
 public:
  Simulation(const SourceFiles& source, const campaign::Campaign& campaign,
             std::vector<double> values, const SimulateOptions& options)
      : source_(source), campaign_(campaign), values_(std::move(values)), options_(options) {}

  // Starts what there is a core for and waits for all; the first failure to start, or checkpoint
  // of another run, ends it.
  absl::Status RunAll(const std::string& program, const std::string& folder) {
    const std::size_t cores = std::max(1U, std::thread::hardware_concurrency());
    client::ProgressLine line;
    for (;;) {
      std::size_t running = 0;
      for (Evaluation& evaluation : evaluations_) {
        if (!evaluation.Poll()) {
          ++running;
        } else if (auto ended = evaluation.Result(); absl::IsInvalidArgument(ended)) {
          return ended;
        }
      }
      const bool all_started = evaluations_.size() == campaign_.experiments.size();
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

  std::string Table() const {
    std::vector<std::pair<std::string, std::string>> tables;
    for (std::size_t e = 0; e < evaluations_.size(); ++e) {
      tables.emplace_back(campaign_.experiments[e].name, evaluations_[e].Table());
    }
    return JoinStateTables(tables);
  }

  bool HasStates() const {
    return std::any_of(evaluations_.begin(), evaluations_.end(),
                       [](const Evaluation& evaluation) { return evaluation.StatesSoFar() > 0; });
  }

  // Prints what went wrong with single experiments; returns the exit code.
  int ReportFailures() {
    int code = kDone;
    for (std::size_t e = 0; e < evaluations_.size(); ++e) {
      const absl::Status result = evaluations_[e].Result();
      if (result.ok()) continue;
      std::cerr << "calibctl: " << campaign_.experiments[e].name << " after "
                << evaluations_[e].StatesSoFar() << " states: " << result.message() << "\n";
      code = kFailed;
    }
    return code;
  }

 private:
  absl::Status StartNext(const std::string& program, const std::string& folder) {
    const std::size_t e = evaluations_.size();
    const campaign::Experiment& experiment = campaign_.experiments[e];
    const std::filesystem::path own = std::filesystem::path(folder) / std::to_string(e);
    Evaluation::Task task{
        .spec = messages::SpecOf(campaign_, static_cast<int>(e),
                                 {.values = values_, .stream = campaign::StreamOf(campaign_, 0)}),
        .packing = PackingText(experiment, source_),
        .meshes = MeshContents(experiment, source_),
        .vtk = HasPictures(experiment) ? Below(options_.vtk, experiment.name) : "",
        .checkpoint = Below(options_.checkpoint, experiment.name + ".checkpoint")};
    std::error_code error;
    std::filesystem::create_directories(own, error);
    if (!error && !task.vtk.empty()) std::filesystem::create_directories(task.vtk, error);
    if (!error && !task.checkpoint.empty()) {
      std::filesystem::create_directories(options_.checkpoint, error);
    }
    if (error) {
      return absl::PermissionDeniedError(absl::StrCat(
          "a folder for ", experiment.name, " cannot be made in ",
          task.vtk.empty() ? options_.checkpoint : options_.vtk, ": ", error.message()));
    }
    ASSIGN_OR_RETURN(auto started, Evaluation::Start(program, task, own.string()));
    evaluations_.push_back(std::move(started));
    return absl::OkStatus();
  }

  void ShowProgress(client::ProgressLine& line) const {
    std::string text;
    int done = 0;
    int of = 0;
    for (std::size_t e = 0; e < evaluations_.size(); ++e) {
      const campaign::Experiment& experiment = campaign_.experiments[e];
      const int states = evaluations_[e].StatesSoFar();
      text += absl::StrCat(e > 0 ? "  " : "", experiment.name, " ", states, "/",
                           experiment.control.size());
      done += states;
    }
    for (const campaign::Experiment& experiment : campaign_.experiments) {
      of += static_cast<int>(experiment.control.size());
    }
    line.Show(text + " load steps", 5 * done / std::max(1, of));
  }

  const SourceFiles& source_;
  const campaign::Campaign& campaign_;
  std::vector<double> values_;
  const SimulateOptions& options_;
  std::vector<Evaluation> evaluations_;
};

void Declare(OptionList& list, SimulateOptions& options) {
  list.CampaignFile(options.file);
  list.Texts("--set", options.set,
             "NAME=VALUE with an optional unit; once per calibrated parameter");
  list.Text("-o,--output", options.output, "CSV file, a row per load step [standard output]");
  list.Text("--vtk", options.vtk,
            "folder for grains, contacts and walls after each load step, one below it "
            "per experiment: open grains.pvd in ParaView");
  list.Text("--checkpoint", options.checkpoint,
            "folder for a checkpoint per experiment, renewed after each load step: the "
            "same command again goes on from there, to the same bits");
}

absl::StatusOr<int> Simulate(const CommonOptions& common, const SimulateOptions& options) {
  const auto source = ReadSourceFiles(options.file, std::nullopt, common.json);
  if (!source) return kBadInput;
  campaign::Campaign campaign = source->outcome.campaign;
  if (campaign.precomputed) {
    return absl::InvalidArgumentError(
        options.file + " names runs made elsewhere (model.precomputed): there is no model to run");
  }
  ASSIGN_OR_RETURN(auto values, ApplyAssignments(options.set, campaign));
  std::optional<OutputFile> output;
  if (!options.output.empty()) {
    ASSIGN_OR_RETURN(auto opened, OutputFile::Open(options.output));
    output.emplace(std::move(opened));
  }
  ASSIGN_OR_RETURN(const auto program, client::FindWorkerProgram());
  ASSIGN_OR_RETURN(const auto folder, TemporaryFolder::Make());
  if (!options.vtk.empty()) SayWhatHasNoPictures(campaign);
  client::CatchInterrupts();
  Simulation simulation(*source, campaign, std::move(values), options);
  RETURN_IF_ERROR(simulation.RunAll(program, folder.path()));
  const std::string table = simulation.Table();
  if (output && simulation.HasStates()) {  // else an earlier table stays
    RETURN_IF_ERROR(output->Put(table));
  }
  if (common.json) {
    std::cout << report::StateTableJson(table);
  } else if (options.output.empty()) {
    std::cout << table;
  }
  return simulation.ReportFailures();
}

}  // namespace

Verb SimulateVerb() {
  return MakeVerb<SimulateOptions>(
      {.name = "simulate",
       .description = "One model evaluation of each experiment at given parameters",
       .example = "simulate sand.yaml --set young_modulus='2 GPa' --set friction_angle='30 deg' -o "
                  "states.csv"},
      &Declare, &Simulate);
}

}  // namespace calib::ctl
