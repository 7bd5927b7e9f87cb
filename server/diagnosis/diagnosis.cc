#include "server/diagnosis/diagnosis.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "dem/registry/declared_effects.h"
#include "server/campaign/checks/noise_check.h"
#include "server/campaign/model/sha256.h"
#include "server/diagnosis/design_run.h"
#include "server/diagnosis/diagnosis_support.h"
#include "server/diagnosis/run_matrices.h"
#include "server/diagnosis/strengths.h"
#include "server/report/views/prior_conflict.h"
#include "server/report/views/run_table.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

// Of measurements that a right model makes one in a thousand is closer.
constexpr double kTooGood = 0.999;
// Four models are six pairs; each takes its runs in every test that is planned.
constexpr std::size_t kMostRivals = 4;

class Inquiry {
 public:
  Inquiry(client::Laboratory& laboratory, const report::CampaignView& view,
          const DiagnosisOptions& options)
      : laboratory_(laboratory), view_(view), options_(options) {}

  absl::StatusOr<Diagnosis> Run() {
    diagnosis_.campaign = view_.status.campaign();
    diagnosis_.only_adequacy = options_.only_adequacy;
    diagnosis_.left_out = options_.without;
    Doubt(campaign::Sentences(campaign::NoiseWarnings(view_.campaign)));
    for (const report::PriorConflict& conflict : report::PriorConflicts(view_))
      diagnosis_.warnings.push_back(report::InWords(conflict));
    RETURN_IF_ERROR(CheckDiagnosable(view_));
    diagnosis_.in_doubt = diagnosis_.in_doubt || HasFewReadings(view_.campaign);
    for (std::string& doubt : DoubtsOf(view_.campaign))
      diagnosis_.warnings.push_back(std::move(doubt));
    diagnosis_.packings = static_cast<int>(report::ReadingsWithScatter(view_).departures.rows());
    if (const std::string few = FewPackings(diagnosis_.packings, PackingsApart(view_.campaign));
        !few.empty())
      diagnosis_.warnings.push_back(few);
    if (options_.only_adequacy) {
      ASSIGN_OR_RETURN(diagnosis_.answer, AdequacyOf(view_, options_.level));
    } else {
      ASSIGN_OR_RETURN(
          designed_,
          AnswerOnServer(laboratory_, view_, {.without = options_.without, .level = options_.level},
                         options_.design, MostRuns()));
      diagnosis_.borrowed = options_.design;
      diagnosis_.answer = designed_.answer;
      diagnosis_.design = designed_.campaign;
      for (const auto& [stage, runs] : diagnosis_.answer.runs)
        diagnosis_.evaluations += static_cast<std::int64_t>(runs) * FittedExperiments();
    }
    if (options_.then) RETURN_IF_ERROR(TellMeasurement(*options_.then));
    for (const std::string& warning : diagnosis_.answer.warnings)
      diagnosis_.warnings.push_back(warning + ".");
    if (diagnosis_.answer.p_square > kTooGood) {
      Doubt(
          {"The model is closer to the readings than the stated errors and the scatter explain: "
           "they seem too large, and an effect can hide in them."});
    }
    NameUnits();
    if (options_.next_experiment && !options_.then && !options_.only_adequacy &&
        !view_.campaign.precomputed && diagnosis_.answer.verdict != AnswerVerdict::kAdequate) {
      const absl::Status planned = PlanNext();
      if (absl::IsCancelled(planned)) return planned;
      if (!planned.ok()) {
        diagnosis_.warnings.push_back(absl::StrCat(
            "The verdict stands; the next experiment could not be planned: ", planned.message()));
      }
    }
    return diagnosis_;
  }

 private:
  void Doubt(const std::vector<std::string>& warnings) {
    diagnosis_.in_doubt = diagnosis_.in_doubt || !warnings.empty();
    diagnosis_.warnings.insert(diagnosis_.warnings.end(), warnings.begin(), warnings.end());
  }

  int FittedExperiments() const {
    return static_cast<int>(
        std::count_if(view_.campaign.experiments.begin(), view_.campaign.experiments.end(),
                      [](const auto& e) { return e.role == campaign::Role::kCalibrate; }));
  }

  std::optional<std::int64_t> MostRuns() const {
    if (!options_.max_evaluations) return std::nullopt;
    return std::max<std::int64_t>(0, *options_.max_evaluations) / FittedExperiments();
  }

  void NameUnits() {
    const dem::Model& model = view_.campaign.model;
    for (const EffectAnswer& own : diagnosis_.answer.candidates) {
      diagnosis_.units.merge(
          UnitsOf(*dem::FindEffect(model.user_effects, own.effect), model.contact));
    }
  }

  absl::Status TellMeasurement(const MadeMeasurement& made) {
    if (options_.only_adequacy || view_.campaign.precomputed) {
      return absl::FailedPreconditionError(
          "a further measurement is told by runs of its test, and here none are made");
    }
    ASSIGN_OR_RETURN(const AnsweredDesign answered, designed_.chain->Answered());
    ASSIGN_OR_RETURN(ThenAnswer then, AnswerWith(laboratory_, view_, answered, made));
    // What an effect does by itself is known from before where it no longer competes by itself.
    for (EffectAnswer& own : then.answer.candidates) {
      if (!own.amplitude.empty()) continue;
      for (const EffectAnswer& before : diagnosis_.answer.candidates) {
        if (before.effect != own.effect) continue;
        own.amplitude = before.amplitude;
        own.p_value = before.p_value;
        own.explained = before.explained;
        own.rms = before.rms;
        own.curves = before.curves;
      }
    }
    then.answer.runs = diagnosis_.answer.runs;
    then.answer.borrowed_runs = diagnosis_.answer.borrowed_runs;
    diagnosis_.answer = std::move(then.answer);
    for (std::string& warning : then.warnings) diagnosis_.warnings.push_back(std::move(warning));
    diagnosis_.then = {.plan = made.plan,
                       .file = made.file,
                       .digest = campaign::Sha256Hex(made.content),
                       .campaign = std::move(then.campaign),
                       .evaluations = then.evaluations};
    return absl::OkStatus();
  }

  Rival RivalOf(const NamedModel& model) const {
    Rival rival{.name = model.effects.empty() ? "base" : absl::StrJoin(model.effects, " with "),
                .view = &view_,
                .values = model.points.front(),
                .near = {model.points.begin() + 1, model.points.end()},
                .effects = model.effects};
    for (const auto& [name, prior] : designed_.parameters) {
      if (rival.values.count(name) > 0) rival.parameters[name] = prior;
    }
    return rival;
  }

  // The models of the credible set; of one alone or none the two that are most probable.
  std::vector<Rival> Rivals() const {
    std::vector<Rival> rivals;
    double held = 0;
    for (const NamedModel& model : diagnosis_.answer.probabilities) {
      const bool enough = held >= inference::AnswerLevels().set && rivals.size() >= 2;
      if (enough || rivals.size() == kMostRivals) break;
      held += model.probability;
      if (!model.points.empty()) rivals.push_back(RivalOf(model));
    }
    return rivals;
  }

  std::optional<NoneOfThese> None(const std::vector<Rival>& rivals) const {
    const auto base = std::find_if(
        diagnosis_.answer.probabilities.begin(), diagnosis_.answer.probabilities.end(),
        [](const NamedModel& model) { return model.effects.empty() && !model.none_of_these; });
    if (base == diagnosis_.answer.probabilities.end() || base->points.empty() ||
        std::any_of(rivals.begin(), rivals.end(),
                    [](const Rival& rival) { return rival.effects.empty(); }))
      return std::nullopt;
    return NoneOfThese{.base = RivalOf(*base), .missed = diagnosis_.answer.missed};
  }

  absl::Status PlanNext() {
    const std::vector<Rival> rivals = Rivals();
    const report::RunTable runs = report::RunsOf(view_);
    Index like = 0;  // the run that comes closest
    runs.histories.rowwise().squaredNorm().minCoeff(&like);
    ASSIGN_OR_RETURN(const AnsweredDesign answered, designed_.chain->Answered());
    ASSIGN_OR_RETURN(NextPlan plan,
                     PlanNextExperiment(laboratory_, view_, answered,
                                        {.rivals = rivals,
                                         .none = None(rivals),
                                         .like = runs.sample[static_cast<std::size_t>(like)],
                                         .scatter = diagnosis_.answer.scatter}));
    diagnosis_.next_experiment = std::move(plan.next);
    for (std::string& warning : plan.warnings) diagnosis_.warnings.push_back(std::move(warning));
    if (!diagnosis_.next_experiment) {
      diagnosis_.warnings.push_back(
          absl::StrCat("No next experiment is planned: ", plan.why_none, "."));
    }
    return absl::OkStatus();
  }

  client::Laboratory& laboratory_;
  const report::CampaignView& view_;
  const DiagnosisOptions& options_;
  DesignedAnswer designed_;
  Diagnosis diagnosis_;
};

}  // namespace

absl::StatusOr<Diagnosis> Diagnose(client::Laboratory& laboratory, const report::CampaignView& view,
                                   const DiagnosisOptions& options) {
  return Inquiry(laboratory, view, options).Run();
}

}  // namespace calib::diagnosis
