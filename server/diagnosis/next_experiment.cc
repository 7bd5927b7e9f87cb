#include "server/diagnosis/next_experiment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/diagnosis/design_caps.h"
#include "server/diagnosis/plan_words.h"
#include "server/diagnosis/program_plans.h"
#include "server/diagnosis/proposed_runs.h"
#include "server/diagnosis/proposed_test.h"
#include "server/diagnosis/setting_plans.h"

namespace calib::diagnosis {
namespace {

using campaign::YamlNode;

// Each costs some forty runs; the best at first sight may fail its check.
constexpr int kPlansWithRuns = 2;

constexpr const char* kSnippetHead =
    "  # Behind the last entry of `experiments:`. The measured curve goes into the file named in "
    "`data`,\n"
    "  # columns named as our observables, SI units unless `units:` says otherwise.\n";

// A plan that may be proposed.
struct Proposal {
  PlannedExperiment experiment;
  std::vector<std::string> separates;
  YamlNode entry;
};

double Told(const PlannedExperiment& planned) {
  return planned.forecast ? planned.forecast->bits : -1;
}

std::string SnippetOf(const Proposal& proposal) {
  YamlNode entry = proposal.entry;
  campaign::YamlAt(campaign::YamlAt(entry, "data"), "file") =
      campaign::YamlScalar("measurement_to_be_made.csv");
  const std::string section = campaign::ToYaml(
      campaign::YamlMap({{"experiments", campaign::YamlList({std::move(entry)})}}));
  return absl::StrCat(kSnippetHead, "  # Control: ", WayInWords(proposal.experiment), ".\n",
                      section.substr(section.find('\n') + 1));
}

void Forecasted(const inference::Forecast& forecast, int runs, PlannedExperiment& planned) {
  planned.forecast = {.bits = std::max(0.0, forecast.information) / std::numbers::ln2,
                      .decides = forecast.decided,
                      .wrong = forecast.named_wrong,
                      .runs = runs};
  planned.expected_power = forecast.decided;
}

class Choice {
 public:
  Choice(client::Laboratory& laboratory, const report::CampaignView& base,
         const AnsweredDesign& answered)
      : laboratory_(laboratory), base_(base), answered_(answered), leading_(LeadingOf(answered)) {}

  absl::StatusOr<NextPlan> Plan(const ScreenQuestion& question) {
    if (leading_.models.size() < 2) {
      plan_.why_none = "one model is certain, and there are no two to tell apart";
      return std::move(plan_);
    }
    ASSIGN_OR_RETURN(PlanScreen screen, Screen(question));
    evaluations_ = screen.evaluations;
    if (!screen.warning.empty()) plan_.warnings.push_back(screen.warning + ".");
    Repeats();
    for (std::size_t i = 0; i < screen.plans.size(); ++i) {
      ScreenedPlan& one = screen.plans[i];
      if (IsOfProgram() || i < kPlansWithRuns) RETURN_IF_ERROR(Run(one));
      if (IsOfProgram()) one.separates = LeadingNames();
      proposals_.push_back({.experiment = std::move(one.experiment),
                            .separates = std::move(one.separates),
                            .entry = std::move(one.entry)});
    }
    std::stable_sort(proposals_.begin(), proposals_.end(), [](const auto& a, const auto& b) {
      return Told(a.experiment) > Told(b.experiment);
    });
    if (proposals_.empty() ||
        Told(proposals_.front().experiment) * std::numbers::ln2 < kDesignCaps.told) {
      plan_.why_none = absl::StrCat(
          screen.why_none.empty()
              ? fmt::format("of the {} measurements that were tried", proposals_.size())
              : screen.why_none + "; of the repeats of the fitted tests on another specimen",
          " none is expected to tell these models apart");
      return std::move(plan_);
    }
    const Proposal& best = proposals_.front();
    NextExperiment next{.best = best.experiment,
                        .separates = best.separates,
                        .snippet = SnippetOf(best),
                        .evaluations = evaluations_};
    for (Proposal& one : proposals_) next.considered.push_back(std::move(one.experiment));
    plan_.next = std::move(next);
    return std::move(plan_);
  }

 private:
  bool IsOfProgram() const { return base_.campaign.program.has_value(); }

  absl::StatusOr<PlanScreen> Screen(const ScreenQuestion& question) {
    if (IsOfProgram()) return PlansOfProgram(laboratory_, base_, question.like);
    return ScreenPlans(laboratory_, question.rivals, question.none, question.like,
                       question.scatter);
  }

  // Names of the leading models.
  std::vector<std::string> LeadingNames() const {
    std::vector<std::string> names;
    for (const Eigen::Index i : leading_.models) {
      const inference::EffectModel& model =
          answered_.asked->evidence[0][static_cast<std::size_t>(i)].model;
      const std::vector<std::string> effects = EffectsNamed(*answered_.known, model);
      std::string name = model.none_of_these ? "none of these"
                         : effects.empty()   ? "base"
                                             : absl::StrJoin(effects, " with ");
      if (std::find(names.begin(), names.end(), name) == names.end())
        names.push_back(std::move(name));
    }
    return names;
  }

  // Of a run of the base, mean over those that are known; 0: of none.
  double CoreSecondsOf(const std::string& experiment) const {
    double sum = 0;
    int runs = 0;
    for (const auto& [of, states] : base_.states) {
      if (of.first != experiment || !(states.core_seconds > 0)) continue;
      sum += states.core_seconds;
      ++runs;
    }
    return runs > 0 ? sum / runs : 0;
  }

  absl::StatusOr<inference::Forecast> ForecastOfRepeat(const std::string& experiment) const {
    ASSIGN_OR_RETURN(const KnownTest test, LearnRepeat(answered_, base_.campaign, experiment));
    return ForecastOf(answered_, {.set = test.known.set.get(), .measured = test.known.z});
  }

  // One whose test by itself cannot be learnt is left out, and what a program would only run again.
  void Repeats() {
    for (const campaign::Experiment& experiment : base_.campaign.experiments) {
      if (experiment.role != campaign::Role::kCalibrate ||
          (IsOfProgram() && experiment.specimens.size() < 2))
        continue;
      Proposal repeat{.experiment = RepeatOf(experiment), .separates = LeadingNames(), .entry = {}};
      const std::string name = experiment.name + "_again";
      const auto entry = EntryOfPlan(
          base_, {.experiment = AsMeasured(experiment), .name = name, .file = name + ".csv"},
          experiment);
      if (!entry) continue;
      repeat.entry = *entry;
      const auto forecast = ForecastOfRepeat(experiment.name);
      if (!forecast.ok()) {
        plan_.warnings.push_back(
            absl::StrCat("What ", InWords(repeat.experiment),
                         " would tell is not known: ", forecast.status().message(), "."));
        continue;
      }
      Forecasted(*forecast, 0, repeat.experiment);
      repeat.experiment.core_seconds = CoreSecondsOf(experiment.name);
      proposals_.push_back(std::move(repeat));
    }
  }

  // A plan that cannot be run stays without a forecast.
  absl::Status Run(ScreenedPlan& screened) {
    auto runs =
        ProposedRuns::Open(laboratory_, base_, answered_, leading_,
                           {.entry = screened.entry, .file = screened.file, .data = screened.data});
    absl::StatusOr<KnownTest> known =
        runs.ok() ? runs->Learn() : absl::StatusOr<KnownTest>(runs.status());
    if (absl::IsCancelled(known.status())) return known.status();
    const std::string words = InWords(screened.experiment);
    if (!known.ok()) {
      plan_.warnings.push_back(absl::StrCat(
          "What ", words, " would tell is not known: ", known.status().message(), "."));
      return absl::OkStatus();
    }
    evaluations_ += runs->runs();
    if (!known->unknown.empty()) {
      plan_.warnings.push_back(
          absl::StrCat("What ", words, " would tell of ", absl::StrJoin(known->unknown, ", "),
                       " is not known: too few of its runs with it come to their ends."));
    }
    if (!known->holds) {
      plan_.warnings.push_back(absl::StrCat("What ", words,
                                            " would tell cannot be promised: an emulator of ",
                                            runs->runs(), " runs of it does not predict them."));
      return absl::OkStatus();
    }
    ASSIGN_OR_RETURN(
        const inference::Forecast forecast,
        ForecastOf(answered_,
                   {.set = known->known.set.get(), .measured = {}, .columns = known->columns}));
    Forecasted(forecast, static_cast<int>(runs->runs()), screened.experiment);
    return absl::OkStatus();
  }

  client::Laboratory& laboratory_;
  const report::CampaignView& base_;
  const AnsweredDesign& answered_;
  const LeadingModels leading_;
  std::vector<Proposal> proposals_;
  std::int64_t evaluations_ = 0;
  NextPlan plan_;
};

}  // namespace

PlannedExperiment RepeatOf(const campaign::Experiment& experiment) {
  PlannedExperiment planned = AsMeasured(experiment);
  planned.settings = experiment.settings;
  planned.told = experiment.told;
  planned.repeats = experiment.name;
  return planned;
}

absl::StatusOr<NextPlan> PlanNextExperiment(client::Laboratory& laboratory,
                                            const report::CampaignView& base,
                                            const AnsweredDesign& answered,
                                            const ScreenQuestion& question) {
  return Choice(laboratory, base, answered).Plan(question);
}

}  // namespace calib::diagnosis
