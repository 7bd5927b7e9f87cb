#include "server/diagnosis/then_answer.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "server/campaign/file/derive.h"
#include "server/diagnosis/plan_words.h"
#include "server/diagnosis/program_plans.h"
#include "server/diagnosis/proposed_runs.h"
#include "server/diagnosis/proposed_test.h"
#include "server/diagnosis/setting_plans.h"
#include "server/methods/registry.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

constexpr double kAsPlanned = 0.02;  // of the range of the control

int TurnsOf(const std::vector<double>& path) {
  int turns = 0;
  for (std::size_t i = 1; i + 1 < path.size(); ++i)
    turns += (path[i] - path[i - 1]) * (path[i + 1] - path[i]) < 0 ? 1 : 0;
  return turns;
}

// Empty: it is the planned one.
std::string WhyNotPlanned(const PlannedExperiment& planned, const std::vector<double>& path) {
  PlannedExperiment measured = planned;
  measured.path = path;
  const auto [low, high] = std::minmax_element(planned.path.begin(), planned.path.end());
  const auto [own_low, own_high] = std::minmax_element(path.begin(), path.end());
  const double most = kAsPlanned * (*high - *low);
  // The first reading may lie anywhere on the way to the first planned one.
  const bool reaches = std::abs(*own_high - *high) <= most && std::abs(*own_low - *low) <= most;
  if (reaches && TurnsOf(path) == TurnsOf(planned.path)) return "";
  return absl::StrCat(WayInWords(measured), ", and not ", WayInWords(planned));
}

const campaign::Experiment& ExperimentNamed(const campaign::Campaign& campaign,
                                            const std::string& name) {
  return *std::find_if(campaign.experiments.begin(), campaign.experiments.end(),
                       [&name](const auto& experiment) { return experiment.name == name; });
}

// A measured history (n = 1) of a repeat on the scale of the first, where it has the very readings.
std::optional<Eigen::MatrixXd> HistoryOfRepeat(const campaign::Experiment& first,
                                               const HistoryScale& scale,
                                               const campaign::Campaign& measured) {
  const inference::DataSet data = campaign::MakeDataSet(measured);
  if (first.control != measured.experiments.front().control ||
      data.readings.size() != scale.order().size())
    return std::nullopt;
  Eigen::MatrixXd readings(1, static_cast<Index>(data.readings.size()));
  for (Index k = 0; k < readings.cols(); ++k)
    readings(0, k) = data.readings[static_cast<std::size_t>(k)].value;
  return scale.Scaled(readings);
}

class SecondInquiry {
 public:
  SecondInquiry(client::Laboratory& laboratory, const report::CampaignView& base,
                const AnsweredDesign& answered, const MadeMeasurement& made)
      : laboratory_(laboratory),
        base_(base),
        answered_(answered),
        made_(made),
        leading_(LeadingOf(answered)) {}

  absl::StatusOr<ThenAnswer> Run() {
    RETURN_IF_ERROR(ReadFile());
    RETURN_IF_ERROR(LearnSets());
    SetCompetingModels();
    const Knowledge& known = *answered_.known;
    ASSIGN_OR_RETURN(asked_, Ask(*answered_.before, known, Effort::kToAnswer, &further_));
    const ChanceElsewhere elsewhere = [this](const inference::ModelEvidence& model) {
      return ChanceInTest(model);
    };
    const auto answer_by = [&](const VerificationChances& verification) {
      return AnswerOfDesign(*answered_.before, known, asked_, answered_.misfit, verification,
                            answered_.level, elsewhere);
    };
    ASSIGN_OR_RETURN(result_.answer, answer_by(std::nullopt));
    ASSIGN_OR_RETURN(const VerificationChances chances, Verified());
    if (chances) {
      ASSIGN_OR_RETURN(result_.answer, answer_by(chances));
    }
    if (runs_) {
      result_.campaign = runs_->campaign();
      result_.evaluations = runs_->runs();
    }
    return std::move(result_);
  }

 private:
  absl::Status NotPlanned(const std::string& why) const {
    return absl::InvalidArgumentError(
        absl::StrCat(made_.file, " is not the proposed test (", InWords(made_.plan), "): ", why));
  }

  // What the measurement follows in everything that its plan does not change; nullptr: there is no
  // such test.
  const campaign::Experiment* Followed() const {
    const campaign::Campaign& campaign = base_.campaign;
    if (!made_.plan.of_next && made_.plan.repeats.empty()) return &PatternOf(campaign);
    const auto& list = made_.plan.of_next ? campaign.next : campaign.experiments;
    const std::string& name = made_.plan.of_next ? made_.plan.test : made_.plan.repeats;
    const auto found = std::find_if(list.begin(), list.end(),
                                    [&name](const auto& one) { return one.name == name; });
    return found == list.end() ? nullptr : &*found;
  }

  absl::Status ReadFile() {
    const campaign::Experiment* pattern = Followed();
    if (pattern == nullptr) return NotPlanned("the campaign file names it no more");
    PlannedExperiment changed = made_.plan;
    if (!made_.plan.repeats.empty()) changed = AsMeasured(*pattern);
    // A program may go by the name of an experiment.
    const std::string name = base_.campaign.program ? pattern->name : "next";
    auto entry =
        EntryOfPlan(base_, {.experiment = changed, .name = name, .file = made_.file}, *pattern);
    if (!entry) return absl::InternalError("the pattern has no entry in the campaign file");
    test_ = {.entry = *std::move(entry), .file = made_.file, .data = made_.content};
    ASSIGN_OR_RETURN(
        const std::string text,
        campaign::Derive(
            methods::All(), base_.source.campaign_file(),
            {.name = "next", .lineage = {}, .held_out = false, .experiments = {test_.entry}}));
    auto read = laboratory_.Read(base_, text, {{test_.file, test_.data}});
    if (!read.ok()) return NotPlanned(std::string(read.status().message()));
    measured_ = *std::move(read);
    const std::string why = WhyNotPlanned(made_.plan, measured_.experiments.front().control);
    return why.empty() ? absl::OkStatus() : NotPlanned(why);
  }

  // The sets of the new measurement, and what they share with the first ones.
  absl::Status LearnSets() {
    if (!made_.plan.repeats.empty()) {
      ASSIGN_OR_RETURN(KnownTest known, LearnRepeat(answered_, base_.campaign, made_.plan.repeats));
      const auto history = HistoryOfRepeat(ExperimentNamed(base_.campaign, made_.plan.repeats),
                                           known.base.scale, measured_);
      if (history) {
        const inference::DiagnosisSet* set = known.known.set.get();
        history_ = history->row(0);
        const Eigen::VectorXd z = set->coordinates()->Of(*history).row(0);
        further_.sets = {{.set = set, .z = 0.5 * (known.known.z + z), .specimens = 2},
                         {.set = set, .z = known.known.z, .taken_out = true}};
        known_.emplace(std::move(known));
        return absl::OkStatus();
      }
    }
    RETURN_IF_ERROR(OpenRuns());
    ASSIGN_OR_RETURN(KnownTest known, runs_->Learn());
    known_.emplace(std::move(known));
    columns_ = known_->columns;
    if (!known_->unknown.empty()) {
      result_.warnings.push_back(
          absl::StrCat("Too few runs of the new test with ", absl::StrJoin(known_->unknown, ", "),
                       " come to their ends: who has them competes no longer."));
    }
    history_ = Eigen::VectorXd::Zero(known_->base.histories.cols());
    if (!known_->holds) {
      result_.warnings.push_back(
          absl::StrCat("An emulator of ", runs_->runs(),
                       " runs of the new test does not predict them as well as it says."));
    }
    further_.sets = {{.set = known_->known.set.get(), .z = known_->known.z, .columns = columns_}};
    return absl::OkStatus();
  }

  absl::Status OpenRuns() {
    if (runs_) return absl::OkStatus();
    ASSIGN_OR_RETURN(ProposedRuns runs,
                     ProposedRuns::Open(laboratory_, base_, answered_, leading_, test_));
    runs_.emplace(std::move(runs));
    return absl::OkStatus();
  }

  // Those that led, the base model and none of these, in the order in which they were asked.
  void SetCompetingModels() {
    const inference::ModelSpace& space = answered_.asked->space;
    const Eigen::VectorXd prior = space.LogPrior();
    std::vector<Index> places;
    for (Index i = 0; i < prior.size(); ++i) {
      const inference::EffectModel& model = space.models[static_cast<std::size_t>(i)];
      if (!model.effects.empty() &&
          std::count(leading_.models.begin(), leading_.models.end(), i) == 0)
        continue;
      const auto is_known = [this](int k) {
        return !columns_ || std::count(columns_->strength.begin(), columns_->strength.end(), k) > 0;
      };
      if (!std::all_of(model.effects.begin(), model.effects.end(), is_known)) continue;
      places.push_back(i);
      further_.models.push_back(model);
    }
    further_.log_prior = prior(places);
  }

  double ChanceInTest(const inference::ModelEvidence& model) const {
    if (model.draws.rows() == 0) return 0;
    // Its parameters were free in the first tests.
    return ChanceOfMisfit(*known_->known.set, history_, inference::ColumnsOf(model.draws, columns_),
                          0);
  }

  // Of fresh runs of what would be named, with those of the design; none: nothing would be.
  absl::StatusOr<VerificationChances> Verified() {
    VerificationQuestion question{.most = 1};
    for (const EffectAnswer& own : result_.answer.candidates) {
      if (own.alone) question.named.push_back(own.effect);
    }
    if (question.named.empty()) return VerificationChances();
    const std::vector<VerifiedModel> models = ModelsToVerify(*answered_.known, asked_, question);
    RETURN_IF_ERROR(OpenRuns());
    ASSIGN_OR_RETURN(auto chances, runs_->Verify(*known_, models));
    if (answered_.verification) {
      for (const auto& [effect, chance] : *answered_.verification) {
        const auto [place, fresh] = chances.try_emplace(effect, chance);
        if (!fresh) place->second = std::min(place->second, chance);
      }
    }
    return VerificationChances(std::move(chances));
  }

  client::Laboratory& laboratory_;
  const report::CampaignView& base_;
  const AnsweredDesign& answered_;
  const MadeMeasurement& made_;
  const LeadingModels leading_;
  TestEntry test_;
  campaign::Campaign measured_;
  std::optional<ProposedRuns> runs_;
  std::optional<KnownTest> known_;
  inference::PartOfColumns columns_;
  Eigen::VectorXd history_;  // measured, on the scale of the set
  FurtherMeasured further_;
  Asked asked_;
  ThenAnswer result_;
};

}  // namespace

absl::StatusOr<ThenAnswer> AnswerWith(client::Laboratory& laboratory,
                                      const report::CampaignView& base,
                                      const AnsweredDesign& answered, const MadeMeasurement& made) {
  return SecondInquiry(laboratory, base, answered, made).Run();
}

}  // namespace calib::diagnosis
