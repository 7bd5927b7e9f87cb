// One model evaluation of each experiment at given parameters, by calib-worker processes, as many
// at a time as cores.
#include <iostream>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/client/child_process.h"
#include "server/client/interrupt.h"
#include "server/client/temporary_folder.h"
#include "server/ctl/assignments.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/simulation.h"
#include "server/ctl/source_files.h"
#include "server/ctl/state_table.h"
#include "server/ctl/verb.h"
#include "server/ctl/write_file.h"
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

std::vector<int> AllOf(const campaign::Campaign& campaign) {
  std::vector<int> experiments(campaign.experiments.size());
  std::iota(experiments.begin(), experiments.end(), 0);
  return experiments;
}

std::string TableOf(const Simulation& simulation) {
  std::vector<std::pair<std::string, std::string>> tables;
  for (std::size_t e = 0; e < simulation.size(); ++e) {
    tables.emplace_back(simulation.experiment(e).name, simulation.run(e).Table());
  }
  return JoinStateTables(tables);
}

bool HasStates(const Simulation& simulation) {
  for (std::size_t e = 0; e < simulation.size(); ++e) {
    if (simulation.run(e).StatesSoFar() > 0) return true;
  }
  return false;
}

// Prints what went wrong with single experiments; returns the exit code.
int ReportFailures(Simulation& simulation) {
  int code = kDone;
  for (std::size_t e = 0; e < simulation.size(); ++e) {
    const absl::Status result = simulation.run(e).Result();
    if (result.ok()) continue;
    std::cerr << "calibctl: " << simulation.experiment(e).name << " after "
              << simulation.run(e).StatesSoFar() << " states: " << result.message() << "\n";
    code = kFailed;
  }
  return code;
}

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
  ASSIGN_OR_RETURN(const auto folder, client::TemporaryFolder::Make());
  if (!options.vtk.empty()) SayWhatHasNoPictures(campaign);
  client::CatchInterrupts();
  Simulation simulation(
      campaign, source->contents,
      {.run = {.values = std::move(values), .stream = campaign::StreamOf(campaign, 0)},
       .experiments = AllOf(campaign),
       .vtk = options.vtk,
       .checkpoint = options.checkpoint});
  RETURN_IF_ERROR(simulation.RunAll(program, folder.path()));
  const std::string table = TableOf(simulation);
  if (output && HasStates(simulation)) {  // else an earlier table stays
    RETURN_IF_ERROR(output->Put(table));
  }
  if (common.json) {
    std::cout << report::StateTableJson(table);
  } else if (options.output.empty()) {
    std::cout << table;
  }
  return ReportFailures(simulation);
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
