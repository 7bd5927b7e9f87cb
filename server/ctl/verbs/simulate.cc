// One model evaluation of each experiment at given parameters, by calib-worker processes, as many
// at a time as cores.
#include <iostream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/file/text/data_file.h"
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
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"

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
  tables.reserve(simulation.size());
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

// The states of a run beside what was measured, as far as it has come.
void PrintBeside(const campaign::Experiment& experiment, const std::string& csv) {
  std::vector<campaign::TableProblem> ignored;
  const campaign::DataTable states(csv, {}, ignored);
  std::vector<std::string> columns = {
      "step", experiment.control_name.empty() ? "reading" : experiment.control_name};
  std::vector<std::vector<double>> values;
  for (const campaign::MeasuredObservable& observable : experiment.observables) {
    columns.push_back(observable.name);
    columns.emplace_back("measured");
    values.push_back(states.rows() > 0 ? states.ColumnWithGaps(observable.name, ignored)
                                       : std::vector<double>());
  }
  report::TextTable table(columns);
  for (std::size_t row = 0; row < states.rows() && row < experiment.control.size(); ++row) {
    std::vector<std::string> cells = {std::to_string(row),
                                      report::Number(experiment.control[row], 5)};
    for (std::size_t j = 0; j < values.size(); ++j) {
      const std::vector<double>& measured = experiment.observables[j].values;
      cells.push_back(report::Number(values[j][row], 6));
      cells.push_back(measured.empty() ? "" : report::Number(measured[row], 6));
    }
    table.AddRow(std::move(cells));
  }
  std::cerr << table.ToString();
}

// The dry run of a program: what it was asked, what it answered, what that cost.
void PrintDryRun(const Simulation& simulation) {
  constexpr double kMib = 1048576;
  for (std::size_t e = 0; e < simulation.size(); ++e) {
    const campaign::Experiment& experiment = simulation.experiment(e);
    const auto report = nlohmann::json::parse(simulation.run(e).Report(), nullptr, false);
    if (!report.is_object()) continue;  // it could not begin: said with what failed
    std::cerr << "\n"
              << experiment.name << " was asked:\n  " << report.value("request", "") << "\n";
    PrintBeside(experiment, simulation.run(e).Table());
    const auto lines = report.value("ignored_lines", 0);
    std::cerr << simulation.run(e).StatesSoFar() << " of " << experiment.control.size()
              << " states (SI) in " << report::Duration(report.value("wall_seconds", 0.0)) << ", "
              << report::Number(report.value("core_seconds", 0.0), 3) << " core seconds, at most "
              << report::Number(report.value("peak_memory", 0.0) / kMib, 3) << " MiB; " << lines
              << " line(s) of its output were no answer and are ignored"
              << (lines > 0 ? ", the first:" : ".") << "\n";
    for (const auto& line : report.value("ignored", nlohmann::json::array())) {
      if (line.is_string()) std::cerr << "  | " << line.get<std::string>() << "\n";
    }
    for (const auto& sentence : report.value("not_kept", nlohmann::json::array())) {
      if (sentence.is_string()) std::cerr << "! " << sentence.get<std::string>() << "\n";
    }
    if (report.value("all_at_once", false)) {
      std::cerr << "! All states came at once, at its end: no run of it can be stopped early. Let "
                   "the program flush what it prints after each load step.\n";
    }
    std::istringstream words(report.value("words", ""));
    for (std::string line; std::getline(words, line);) std::cerr << "  stderr | " << line << "\n";
  }
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
  if (campaign.program && !common.json) PrintDryRun(simulation);
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
