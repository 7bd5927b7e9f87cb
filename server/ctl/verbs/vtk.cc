// Grains, contacts and cell of a sample for ParaView: its runs are made once more, to the same
// bits.
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "calib/return_if_error.h"
#include "server/client/child_process.h"
#include "server/client/interrupt.h"
#include "server/client/kept_grains.h"
#include "server/client/load_view.h"
#include "server/client/session.h"
#include "server/client/temporary_folder.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/simulation.h"
#include "server/ctl/verb.h"

namespace calib::ctl {
namespace {

using KnownStates = std::map<std::pair<std::string, int>, report::StateHistory>;

struct VtkOptions {
  std::string campaign;
  int sample = 0;
  std::vector<std::string> experiments{};  ///< empty: all with a packing
  std::optional<int> load_step{};
  std::string output;  ///< folder
  bool keep = false;   ///< at the server too
};

void Declare(OptionList& list, VtkOptions& options) {
  list.Campaign(options.campaign);
  list.WholeNumber("SAMPLE", options.sample, "index, as shown by `calibctl samples`").Required();
  list.Texts("--experiment", options.experiments, "name of one that is wanted [all]");
  list.WholeNumber("--load-step", options.load_step, "the only one that is wanted, from 0 [all]");
  list.Text("-o,--output", options.output,
            "folder, created if need be; one below it per experiment: open grains.pvd, "
            "contacts.pvd and cell.pvd in ParaView")
      .Required();
  list.Flag("--keep", options.keep,
            "some of the load steps are kept at the server too, for the live page to draw");
}

absl::StatusOr<v1::Sample> SampleOf(client::Client& client, const VtkOptions& options) {
  ASSIGN_OR_RETURN(auto samples, client.GetSamples(options.campaign));
  for (v1::Sample& sample : samples) {
    if (sample.index() == options.sample) return std::move(sample);
  }
  return absl::NotFoundError(absl::StrCat("campaign ", options.campaign, " has no sample ",
                                          options.sample, "; `calibctl samples ", options.campaign,
                                          "` shows those it has"));
}

absl::StatusOr<std::map<std::string, std::string>> ContentsOf(client::Client& client,
                                                              const v1::CampaignSource& source) {
  std::map<std::string, std::string> contents;
  for (const auto& [path, digest] : source.files()) {
    ASSIGN_OR_RETURN(contents[path], client.GetBlob(digest));
  }
  return contents;
}

// Those that are wanted, by their places in the campaign.
absl::StatusOr<std::vector<int>> Wanted(const campaign::Campaign& campaign,
                                        const VtkOptions& options) {
  if (campaign.precomputed) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the runs of ", options.campaign, " were made elsewhere: there is no packing to draw"));
  }
  std::vector<int> wanted;
  std::vector<std::string> names;
  for (std::size_t e = 0; e < campaign.experiments.size(); ++e) {
    const campaign::Experiment& one = campaign.experiments[e];
    names.push_back(one.name);
    const auto& asked = options.experiments;
    if (!asked.empty() && std::find(asked.begin(), asked.end(), one.name) == asked.end()) continue;
    if (HasPictures(one)) {
      wanted.push_back(static_cast<int>(e));
    } else if (!asked.empty()) {
      return absl::InvalidArgumentError(
          absl::StrCat("--experiment ", one.name, ": ", one.test, " has no packing to draw"));
    }
  }
  for (const std::string& name : options.experiments) {
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      return absl::InvalidArgumentError(absl::StrCat("--experiment ", name, ": ", options.campaign,
                                                     " has ", absl::StrJoin(names, ", ")));
    }
  }
  if (wanted.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat("no experiment of ", options.campaign, " has a packing to draw"));
  }
  for (const int e : wanted) {
    const campaign::Experiment& one = campaign.experiments[static_cast<std::size_t>(e)];
    const auto steps = static_cast<int>(one.control.size());
    if (options.load_step.value_or(0) >= steps) {
      return absl::InvalidArgumentError(absl::StrCat(
          "--load-step ", *options.load_step, ": those of ", one.name, " are 0 to ", steps - 1));
    }
  }
  return wanted;
}

// Makes the folder and tries it, before anything is run.
absl::Status MakeFolder(const std::string& folder) {
  std::error_code error;
  const std::filesystem::path trial = std::filesystem::path(folder) / ".part";
  std::filesystem::create_directories(trial, error);
  if (!error) std::filesystem::remove(trial, error);
  return error ? absl::PermissionDeniedError(
                     absl::StrCat(folder, " cannot be written: ", error.message()))
               : absl::OkStatus();
}

// Load steps whose states are in a table; whether those that the server has of them are the same
// to the last bit.
struct Drawn {
  std::vector<int> load_steps{};
  bool is_same = true;
};

Drawn DrawnOf(const std::string& table, const KnownStates& states, const std::string& experiment,
              int sample, std::optional<int> only) {
  std::map<int, std::vector<double>> known;
  if (const auto found = states.find({experiment, sample}); found != states.end()) {
    for (const v1::State& state : found->second.states) {
      known[state.load_step()].assign(state.values().begin(), state.values().end());
    }
  }
  Drawn drawn;
  std::vector<std::string> lines = absl::StrSplit(table, '\n', absl::SkipEmpty());
  for (std::size_t i = 1; i < lines.size(); ++i) {
    std::vector<double> values;
    for (const auto& cell : absl::StrSplit(lines[i], ',')) {
      double value = 0;
      (void)absl::SimpleAtod(cell, &value);  // NaN and numbers, as calib-worker writes them
      values.push_back(value);
    }
    const int step = static_cast<int>(values.front());
    values.erase(values.begin());
    const auto before = known.find(step);
    drawn.is_same = drawn.is_same && (before == known.end() || before->second == values);
    if (step == only.value_or(step)) drawn.load_steps.push_back(step);
  }
  return drawn;
}

absl::StatusOr<int> Vtk(const CommonOptions& common, const VtkOptions& options) {
  client::CatchInterrupts();
  ASSIGN_OR_RETURN(const auto session, client::Session::Open(common.server));
  client::Client& client = session->client();
  ASSIGN_OR_RETURN(const auto sample, SampleOf(client, options));
  ASSIGN_OR_RETURN(const auto source, client.GetSource(options.campaign));
  ASSIGN_OR_RETURN(const auto campaign, client::LoadCampaign(client, source));
  ASSIGN_OR_RETURN(auto wanted, Wanted(campaign, options));
  ASSIGN_OR_RETURN(const auto contents, ContentsOf(client, source));
  ASSIGN_OR_RETURN(const auto states, client::LoadStates(client, options.campaign, options.sample));
  RETURN_IF_ERROR(MakeFolder(options.output));
  ASSIGN_OR_RETURN(const auto program, client::FindWorkerProgram());
  ASSIGN_OR_RETURN(const auto folder, client::TemporaryFolder::Make());
  Simulation simulation(
      campaign, contents,
      {.run = {.values = {sample.parameters().begin(), sample.parameters().end()},
               .stream = sample.has_stream() ? sample.stream()
                                             : campaign::StreamOf(campaign, sample.index())},
       .experiments = std::move(wanted),
       .vtk = options.output,
       .load_step = options.load_step});
  RETURN_IF_ERROR(simulation.RunAll(program, folder.path()));
  int code = kDone;
  nlohmann::ordered_json written = nlohmann::ordered_json::array();
  for (std::size_t e = 0; e < simulation.size(); ++e) {
    const std::string& name = simulation.experiment(e).name;
    const Drawn drawn =
        DrawnOf(simulation.run(e).Table(), states, name, options.sample, options.load_step);
    if (const absl::Status result = simulation.run(e).Result(); !result.ok()) {
      std::cerr << "calibctl: " << name << " after " << simulation.run(e).StatesSoFar()
                << " states: " << result.message() << "\n";
      const bool as_before = absl::IsAborted(result) && sample.status() == "diverged";
      if (!as_before) code = kFailed;
    }
    if (!drawn.is_same) {
      std::cerr << "calibctl: " << name << ": what was drawn is not the run of sample "
                << options.sample << ", whose states differ: its mechanics was another\n";
      code = kFailed;
    }
    const std::string path = (std::filesystem::path(options.output) / name).string();
    std::vector<int> kept;
    if (options.keep && drawn.is_same && !drawn.load_steps.empty()) {
      ASSIGN_OR_RETURN(
          kept,
          client::KeepGrains(
              client, {.campaign = options.campaign, .sample = options.sample, .experiment = name},
              path, drawn.load_steps));
    }
    written.push_back({{"experiment", name}, {"folder", path}, {"load_steps", drawn.load_steps}});
    if (options.keep) written.back()["kept"] = kept;
    if (!common.json) {
      std::cout << path << ": " << drawn.load_steps.size()
                << " load step(s); open grains.pvd, contacts.pvd and cell.pvd in ParaView"
                << (kept.empty() ? "" : absl::StrCat("; ", kept.size(), " kept for the page"))
                << "\n";
    }
  }
  if (common.json) {
    std::cout << nlohmann::ordered_json{{"campaign", options.campaign},
                                        {"sample", options.sample},
                                        {"written", written}}
                     .dump(2)
              << "\n";
  }
  return code;
}

}  // namespace

Verb VtkVerb() {
  return MakeVerb<VtkOptions>(
      {.name = "vtk",
       .description =
           "Grains, contacts and cell of one sample for ParaView; its runs are made again",
       .example = "vtk c1 17 --load-step 12 -o pictures --state calib-state"},
      &Declare, &Vtk);
}

}  // namespace calib::ctl
