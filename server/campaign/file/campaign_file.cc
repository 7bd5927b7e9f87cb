#include "server/campaign/file/campaign_file.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "dem/registry/scenario_problems.h"
#include "server/campaign/checks/campaign_warnings.h"
#include "server/campaign/checks/grain_check.h"
#include "server/campaign/checks/setting_ends.h"
#include "server/campaign/file/parameters/setting_names.h"
#include "server/campaign/file/program/read_next.h"
#include "server/campaign/file/program/read_program.h"
#include "server/campaign/file/read_experiment.h"
#include "server/campaign/file/read_inference.h"
#include "server/campaign/file/read_joint_prior.h"
#include "server/campaign/file/read_materials.h"
#include "server/campaign/file/read_model.h"
#include "server/campaign/file/read_noise_groups.h"
#include "server/campaign/file/read_precomputed.h"
#include "server/campaign/file/read_resources.h"
#include "server/campaign/file/read_rows.h"
#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/file/shared/read_context.h"
#include "server/campaign/file/text/workbook.h"
#include "server/campaign/file/text/yaml_tree.h"
#include "server/campaign/model/excitation.h"

namespace calib::campaign {
namespace {

absl::StatusOr<std::string> ExpandPath(const std::string& path) {
  constexpr const char* kVariable = "$CALIB_DATA";
  const std::size_t at = path.find(kVariable);
  if (at == std::string::npos) return path;
  const char* value = std::getenv("CALIB_DATA");
  if (value == nullptr || *value == '\0') {
    return absl::NotFoundError("the environment variable CALIB_DATA is not set");
  }
  return path.substr(0, at) + value + path.substr(at + std::string(kVariable).size());
}

// "t.xlsx[Data]" as "t.xlsx" and "Data".
std::pair<std::string, std::string> PartsOfSheetPath(const std::string& path) {
  const std::size_t open = path.find('[');
  if (open == std::string::npos || !path.ends_with(']')) return {path, ""};
  const std::string file = path.substr(0, open);
  if (!IsWorkbookPath(file)) return {path, ""};
  return {file, path.substr(open + 1, path.size() - open - 2)};
}

absl::Status ProblemOfFile(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return absl::NotFoundError("no such file");
  if (!std::filesystem::is_regular_file(path, error)) return absl::NotFoundError("not a file");
  return absl::OkStatus();
}

absl::StatusOr<std::string> ReadFromDisk(const std::filesystem::path& path) {
  RETURN_IF_ERROR(ProblemOfFile(path));
  std::ifstream file(path, std::ios::binary);
  std::ostringstream content;
  content << file.rdbuf();
  if (!file) return absl::NotFoundError("no permission to read it");
  return std::move(content).str();
}

/// Files of a folder at most; a folder that holds more was not meant.
constexpr std::size_t kMostListed = 20000;

bool MayBeExecuted(const std::filesystem::path& file) {
  constexpr auto kBits = std::filesystem::perms::owner_exec;
  std::error_code error;
  return (std::filesystem::status(file, error).permissions() & kBits) !=
         std::filesystem::perms::none;
}

// What FileReader answers to a path that ends in '/'.
absl::StatusOr<std::string> ListFromDisk(const std::filesystem::path& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  const auto line = [](const fs::path& file, const std::string& name) {
    return absl::StrCat(MayBeExecuted(file) ? "x " : "- ", name, "\n");
  };
  if (fs::is_regular_file(path, error)) return line(path, "");
  if (!fs::exists(path, error)) return absl::NotFoundError("no such file or folder");
  std::vector<std::string> lines;
  fs::recursive_directory_iterator at(path, error);
  for (const fs::recursive_directory_iterator end; !error && at != end; at.increment(error)) {
    if (!at->is_regular_file(error)) continue;
    if (lines.size() == kMostListed) {
      return absl::OutOfRangeError(absl::StrCat("a folder of more than ", kMostListed, " files"));
    }
    lines.push_back(line(at->path(), at->path().lexically_relative(path).string()));
  }
  if (error) return absl::NotFoundError("no permission to read it");
  if (lines.empty()) return absl::NotFoundError("a folder without a file");
  std::sort(lines.begin(), lines.end(),
            [](const std::string& a, const std::string& b) { return a.substr(2) < b.substr(2); });
  return absl::StrJoin(lines, "");
}

void ReadName(MapReader& map, Campaign& campaign) {
  constexpr std::size_t kLongest = 200;
  campaign.name =
      map.RequiredText("name", "what the campaign is called, e.g. toyoura-0.2MPa").value_or("");
  const auto control = [](unsigned char c) { return std::iscntrl(c) != 0; };
  const bool printable = std::none_of(campaign.name.begin(), campaign.name.end(), control);
  if (map.Has("name") && (campaign.name.empty() || campaign.name.size() > kLongest || !printable)) {
    map.Problem("name", "has to be one line of 1 to 200 characters");
  }
}

// What the engine itself would refuse. Asked last, at the middle of the priors, where only rare
// things are left.
// with: effects of the race that the run has.
void AskEngine(const MapReader& map, const Campaign& campaign,
               const std::vector<std::string>& with) {
  for (const Experiment& experiment : campaign.experiments) {
    dem::Scenario scenario = MiddleScenario(campaign, experiment, with);
    std::set<std::string> said;
    const auto say = [&](const std::string& path, const std::string& problem) {
      if (!said.insert(problem).second) return;
      map.Problem("experiments",
                  absl::StrCat(experiment.name, ": ", path, path.empty() ? "" : ": ", problem),
                  "impossible");
    };
    const auto ask = [&](const dem::Packing& packing, const std::string& path) {
      scenario.packing = packing;
      for (const std::string& problem : dem::ScenarioProblems(scenario)) say(path, problem);
    };
    // Without a file first, in place of a recipe's packing, which does not exist yet: what is wrong
    // with any packing is not said of a file.
    ask({.length = {1, 1, 1},
         .x = {0, 0.5},
         .y = {0, 0.5},
         .z = {0, 0.5},
         .radius = {0.1, 0.1},
         .clump = {-1, -1}},
        "");
    for (const Specimen& specimen : experiment.specimens) {
      if (const auto* file = std::get_if<PackingFile>(&specimen)) ask(file->packing, file->path);
    }
    if (!said.empty()) continue;
    for (const SpecimenRemarks& grains : GrainRemarksOf(experiment, scenario)) {
      for (const std::string& problem : grains.remarks.refused) say(grains.path, problem);
    }
  }
}

// Errors that go together over very much more than the whole path are one number, and their
// covariance is singular.
void CheckCorrelationLengths(const MapReader& map, const Campaign& campaign) {
  constexpr double kMost = 1e6;  // times the path
  for (const Experiment& experiment : campaign.experiments) {
    const std::vector<double> travelled = TravelledControl(experiment, 0);
    const double path = travelled.empty() ? 0 : travelled.back();
    for (const MeasuredObservable& observable : experiment.observables) {
      if (!(observable.correlation_length > kMost * path) || !(path > 0)) continue;
      map.Problem("experiments",
                  absl::StrCat(experiment.name, ", ", observable.name,
                               ": noise.correlation_length is ", observable.correlation_length,
                               ", more than a million times the path of the readings, ", path));
    }
  }
}

}  // namespace

std::string SheetPath(const std::string& path, const std::string& sheet) {
  return sheet.empty() || !IsWorkbookPath(path) ? path : absl::StrCat(path, "[", sheet, "]");
}

FileReader DiskReader(const std::string& campaign_file_path) {
  const std::filesystem::path folder = std::filesystem::path(campaign_file_path).parent_path();
  return [folder](const std::string& path) -> absl::StatusOr<std::string> {
    ASSIGN_OR_RETURN(const auto expanded, ExpandPath(path));
    if (expanded.ends_with('/'))
      return ListFromDisk(folder / expanded.substr(0, expanded.size() - 1));
    const auto [name, sheet] = PartsOfSheetPath(expanded);
    const std::filesystem::path file = folder / name;  // an absolute path replaces the folder
    if (!IsWorkbookPath(name)) return ReadFromDisk(file);
    RETURN_IF_ERROR(ProblemOfFile(file));
    return SheetAsText(file.string(), sheet);
  };
}

ReadOutcome ReadCampaign(const MethodList& methods, const std::string& yaml_text,
                         const std::string& file_name, const FileReader& reader,
                         std::optional<std::uint64_t> seed_override, CampaignIs is,
                         const ReadLimits& limits) {
  ReadOutcome outcome;
  ProblemList problems(file_name);
  YamlParse parse = ParseYaml(yaml_text);
  if (parse.error) {
    problems.Add(parse.error->line, "", parse.error->message);
    outcome.problems = problems.Sorted();
    return outcome;
  }
  Campaign& campaign = outcome.campaign;
  const bool is_new = is == CampaignIs::kNew;
  ReadContext context(reader, problems, is, limits);
  MapReader map(*parse.root, "", SectionOf("campaign"), problems);
  if (parse.root->kind == YamlNode::Kind::kMap) {
    ReadName(map, campaign);
    ReadModel(map, context, campaign);
    ReadInference(map, methods, campaign);
    ReadResources(map, campaign);
    const std::size_t sound = problems.size();
    ReadParameters(map, is_new, campaign);
    if (problems.size() == sound) {
      ReadJointPrior(map, campaign);
      if (is_new && problems.size() == sound) CheckTied(map, campaign);
    } else {
      map.Ignore({"prior_correlation", "constraints"});  // of parameters that could not be read
    }
    CheckSamples(map, campaign);
    ReadStart(map, methods, campaign);
    if (problems.size() == sound) {
      StateNominalDensity(*parse.root, campaign);
      StateNominalValues(*parse.root, campaign);
    }
    const std::size_t before = problems.size();
    ReadExperiments(map, context, campaign);
    if (problems.size() == before) ReadNoiseGroups(map, campaign);
    if (is_new && problems.size() == before) CheckCorrelationLengths(map, campaign);
    if (campaign.program && problems.size() == before) ReadNext(map, context, campaign);
    if (is_new && campaign.program && problems.size() == before) CheckProgram(map, campaign);
    if (is_new && !campaign.precomputed) CheckBudget(map, campaign);
    if (is_new) CheckReplicates(map, campaign);
    if (is_new && RunsAreAdded(campaign) && problems.size() == 0) {
      CheckDesign(map, campaign);
    }
    if (campaign.precomputed) {
      ReadPrecomputed(map, context, campaign);
      if (campaign.table || campaign.first_proposal) {
        map.Problem("inference", "runs that exist already can neither be a table nor be proposed");
      }
    }
    map.Finish();
    if (is_new && problems.size() == 0 && !campaign.precomputed && !campaign.program) {
      for (const std::string& inert : EffectsWithoutPart(campaign)) map.Problem("model", inert);
      CheckMaterialsUsed(map, campaign);
      AskEngine(map, campaign, {});
      for (const std::string& effect : campaign.race) {
        if (problems.size() == 0) AskEngine(map, campaign, {effect});
      }
      for (const ImpossibleEnd& end : ImpossibleEnds(campaign)) {
        if (problems.size() > 0) break;
        const std::string key = absl::StrCat("parameters.", end.parameter);
        problems.Add(map.LineOf("parameters"), key, end.problem, "impossible");
      }
    }
  }
  if (seed_override) campaign.seed = campaign.filter.seed = *seed_override;
  outcome.problems = problems.Sorted();
  if (is_new && outcome.problems.empty()) {
    outcome.warnings = context.warnings();
    for (Warning& warning : WarningsOf(campaign)) outcome.warnings.push_back(std::move(warning));
  }
  outcome.files = context.files();
  return outcome;
}

}  // namespace calib::campaign
