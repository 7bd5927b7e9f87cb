#include "server/ctl/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/catalog/catalog.h"
#include "server/campaign/derive.h"
#include "server/ctl/extension.h"
#include "server/ctl/response.h"

namespace calib::ctl {
namespace {

using Eigen::Index;
using report::RunsOf;
using report::RunTable;

constexpr int kMostRuns = 4;           // of one effect in the screen, or
constexpr double kScreenShare = 0.25;  // of the campaign's evaluations over all effects
constexpr std::size_t kWarmFits = 3;
constexpr int kWarmIterations = 3;
constexpr int kWarmMore = 2;  // iterations at a time, where the fit cannot be judged yet
constexpr int kMostWarmIterations = 11;
constexpr int kWarmShare = 2;  // times the campaign's evaluations, for all of these
constexpr int kLeastWarmSamples = 16;
constexpr double kNotExcluded = 3;      // times the rms of the best: a fit not judged yet
constexpr double kClearlyCloser = 0.8;  // of the base model's rms
constexpr std::size_t kMostNames = 3;

// One step away from the model without the effect.
struct Step {
  const dem::StrengthRay* ray = nullptr;
  double step = 0;
};

std::vector<Step> StepsOf(const dem::EffectInfo& effect, std::size_t rows) {
  std::vector<Step> steps;
  for (const dem::StrengthRay& ray : effect.rays) {
    if (effect.rays.size() == 1 && rows > 1) steps.push_back({&ray, ray.steps[0]});
    steps.push_back({&ray, ray.steps[1]});
  }
  if (steps.size() > rows) steps.resize(rows);
  return steps;
}

class Inquiry {
 public:
  Inquiry(Laboratory& laboratory, const report::CampaignView& view, const DiagnosisOptions& options)
      : laboratory_(laboratory),
        view_(view),
        options_(options),
        table_(RunsOf(view)),
        state_(ReferenceOf(view)) {}

  absl::StatusOr<Diagnosis> Run() {
    diagnosis_.campaign = view_.status.campaign();
    if (auto possible = CheckPossible(); !possible.ok()) return possible;
    if (!options_.only_adequacy) {
      if (auto status = MeasureNuisance(); !status.ok()) return status;
    }
    auto base = RespondTo(view_, nuisance_);
    if (!base.ok()) return base.status();
    base_ = *std::move(base);
    const auto adequacy = inference::TestAdequacy(base_.model);
    if (!adequacy.ok()) return adequacy.status();
    diagnosis_.adequacy = *adequacy;
    diagnosis_.emulator_error = base_.emulator_error;
    diagnosis_.scatter = base_.scatter;
    const auto t = static_cast<double>(base_.model.histories.cols());
    diagnosis_.rms = base_.model.histories.row(adequacy->best).norm() / std::sqrt(t);
    if (!base_.trustworthy) {
      return absl::FailedPreconditionError(absl::StrCat(
          "the emulator misses the runs of ", diagnosis_.campaign,
          " by more than twice the noise beyond their scatter, too much to judge the model by; run "
          "more samples"));
    }
    const bool fits = adequacy->p_value >= options_.level;
    if (options_.only_adequacy) {
      diagnosis_.verdict = fits ? "adequate" : "unexplained";
      return diagnosis_;
    }
    if (auto status = ScreenEffects(); !status.ok()) return status;
    const bool hinted = !scores_.empty() && scores_.front().adjusted < options_.level;
    if (fits && !hinted) {
      diagnosis_.verdict = "adequate";
      return diagnosis_;
    }
    if (auto status = FitWarm(); !status.ok()) return status;
    Conclude(fits);
    if (options_.next_experiment && diagnosis_.verdict != "adequate") {
      if (auto status = PlanNext(); !status.ok()) return status;
    }
    return diagnosis_;
  }

 private:
  absl::Status CheckPossible() const {
    const std::string& id = view_.status.campaign();
    if (view_.posterior.posterior_from().empty() || view_.posterior.posterior_from() == "none") {
      return absl::FailedPreconditionError(
          absl::StrCat("campaign ", id,
                       " has no posterior, so nothing can be said about its model: see "
                       "`calibctl posterior ",
                       id, "`"));
    }
    if (view_.campaign.filter.noise != inference::NoiseMode::kGiven) {
      return absl::FailedPreconditionError(
          absl::StrCat("campaign ", id,
                       " states no size of the errors (noise is inferred or "
                       "tempered), so its model cannot be judged; give the noise"));
    }
    if (view_.campaign.precomputed && !options_.only_adequacy) {
      return absl::FailedPreconditionError(absl::StrCat(
          "the runs of ", id, " were made elsewhere; effects cannot be tried on them"));
    }
    if (table_.sample.empty()) {
      return absl::FailedPreconditionError(absl::StrCat("no sample of ", id, " has finished"));
    }
    return absl::OkStatus();
  }

  int FittedExperiments() const {
    return static_cast<int>(
        std::count_if(view_.campaign.experiments.begin(), view_.campaign.experiments.end(),
                      [](const auto& e) { return e.role == campaign::Role::kCalibrate; }));
  }

  // Rows of the table, best first: runs that exist and fit best; the emulator's best point is near.
  std::vector<Index> BestRuns(std::size_t count) const {
    std::vector<Index> order(table_.sample.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Index>(i);
    std::stable_sort(order.begin(), order.end(), [this](Index a, Index b) {
      return table_.histories.row(a).squaredNorm() < table_.histories.row(b).squaredNorm();
    });
    order.resize(std::min(order.size(), count));
    return order;
  }

  campaign::Derivation::Row RowLike(Index run) const {
    campaign::Derivation::Row row{.like = table_.sample[static_cast<std::size_t>(run)],
                                  .values = {}};
    for (std::size_t j = 0; j < view_.campaign.parameters.size(); ++j) {
      row.values[view_.campaign.parameters[j].name] = table_.parameters(run, static_cast<Index>(j));
    }
    return row;
  }

  campaign::Derivation Derived(const std::string& purpose, const std::string& what) const {
    return {.name = absl::StrCat(view_.campaign.name, ": ", what),
            .lineage = {.parent = view_.status.campaign(), .purpose = purpose},
            .effects = {},
            .parameters = {},
            .fixed = {},
            .held_out = false,
            .samples = std::nullopt,
            .max_iterations = std::nullopt,
            .first_proposal = std::nullopt,
            .rows = {}};
  }

  absl::StatusOr<report::CampaignView> RunDerived(const campaign::Derivation& derivation,
                                                  const std::string& what) {
    const auto text = campaign::Derive(view_.source.campaign_file(), derivation);
    if (!text.ok()) return text.status();
    return laboratory_.Run(view_, *text, what);
  }

  // Curves depend on the rate of staging: what twice the rate changes is no physics.
  absl::Status MeasureNuisance() {
    const bool given = std::any_of(
        view_.campaign.experiments.begin(), view_.campaign.experiments.end(),
        [](const auto& e) { return e.staging.rate && e.role == campaign::Role::kCalibrate; });
    if (!given) return absl::OkStatus();
    const Index best = BestRuns(1).front();
    campaign::Derivation derivation = Derived("nuisance", "twice the rate");
    derivation.rate_factor = 2;
    derivation.rows = {RowLike(best)};
    const auto view = RunDerived(derivation, "influence of the loading rate");
    if (!view.ok()) return view.status();
    diagnosis_.screen_evaluations += FittedExperiments();
    const RunTable runs = RunsOf(*view);
    if (!runs.sample.empty()) {
      nuisance_.emplace_back((runs.histories.row(0) - table_.histories.row(best)).transpose());
    }
    return absl::OkStatus();
  }

  // Why the tests cannot show an effect; empty: they can.
  std::string WhyNotExcitable(const dem::EffectInfo& effect) const {
    std::set<double> pressures;
    bool excited = false;
    for (const campaign::Experiment& e : view_.campaign.experiments) {
      if (e.role != campaign::Role::kCalibrate) continue;
      const auto pressure = e.settings.find("confining_pressure");
      if (pressure != e.settings.end()) pressures.insert(pressure->second);
      excited = excited || effect.excited_by.empty() ||
                std::find(effect.excited_by.begin(), effect.excited_by.end(), e.test) !=
                    effect.excited_by.end();
    }
    if (!excited) return "none of the fitted tests can show it";
    if (effect.across_pressures && pressures.size() < 2) {
      return "it shows only between tests at different pressures";
    }
    return effect.rays.empty() ? "the catalogue gives no strength to try" : "";
  }

  absl::Status ScreenEffects() {
    std::vector<const dem::EffectInfo*> effects;
    for (const dem::EffectInfo* info : dem::AllEffects(view_.campaign.model.user_effects)) {
      const dem::EffectInfo& effect = *info;
      if (!WhyNotJoin(view_.campaign, effect.name).empty()) continue;
      if (std::find(options_.without.begin(), options_.without.end(), effect.name) !=
          options_.without.end()) {
        diagnosis_.not_excitable.emplace_back(effect.name, "left out as asked for");
        continue;
      }
      const std::string why = WhyNotExcitable(effect);
      if (!why.empty()) {
        diagnosis_.not_excitable.emplace_back(effect.name, why);
      } else {
        effects.push_back(&effect);
      }
    }
    if (effects.empty()) return absl::OkStatus();
    const int experiments = std::max(1, FittedExperiments());
    const double share = kScreenShare * static_cast<double>(table_.sample.size()) * experiments /
                         static_cast<double>(effects.size());
    const auto rows = static_cast<std::size_t>(
        std::clamp(static_cast<int>(std::max<double>(kMostRuns, share)) / experiments, 1, 2));
    const std::vector<Index> runs = BestRuns(rows);
    std::vector<inference::Signature> signatures;
    for (const dem::EffectInfo* effect : effects) {
      auto signature = SignatureOf(*effect, runs, rows);
      if (!signature.ok()) return signature.status();
      if (signature->differences.empty()) {
        diagnosis_.not_excitable.emplace_back(effect->name, "runs with it diverge");
      } else {
        signatures.push_back(*std::move(signature));
      }
    }
    auto scores = inference::Screen(base_.model, signatures,
                                    {.level = options_.level, .seed = view_.campaign.filter.seed});
    if (!scores.ok()) return scores.status();
    scores_ = *std::move(scores);
    for (const inference::Score& score : scores_) AddCandidate(score);
    return absl::OkStatus();
  }

  // Pairs of runs with and without the effect. Parameters of the ray are given by the rows; what it
  // holds goes along.
  absl::StatusOr<inference::Signature> SignatureOf(const dem::EffectInfo& effect,
                                                   const std::vector<Index>& runs,
                                                   std::size_t rows) {
    inference::Signature signature{
        .name = effect.name, .differences = {}, .two_sided = effect.two_sided};
    std::vector<Step>& tried = steps_[effect.name];
    const std::vector<Step> steps = StepsOf(effect, rows);
    for (std::size_t k = 0; k < steps.size(); ++k) {
      // A campaign for each step: rays set different parameters.
      const Index run = runs[std::min(k, runs.size() - 1)];
      campaign::Derivation derivation =
          Derived("screen", absl::StrCat(effect.name, ", step ", k + 1));
      derivation.effects = {effect.name};
      derivation.fixed = dem::ParametersOnRay(effect, *steps[k].ray, steps[k].step,
                                              view_.campaign.model.contact, state_);
      derivation.rows = {RowLike(run)};
      const auto view = RunDerived(
          derivation, absl::StrCat("screen of ", effect.name, " (", k + 1, "/", steps.size(), ")"));
      if (!view.ok()) return view.status();
      diagnosis_.screen_evaluations += FittedExperiments();
      const RunTable with = RunsOf(*view);
      if (with.sample.empty()) continue;
      signature.differences.emplace_back(
          (with.histories.row(0) - table_.histories.row(run)).transpose());
      tried.push_back(steps[k]);
    }
    return signature;
  }

  // Strength in SI of a multiple of what was tried; held parameters are part of it.
  std::map<std::string, double> StrengthOf(const std::string& name, std::size_t which,
                                           double multiple) const {
    const dem::EffectInfo* effect = dem::FindEffect(view_.campaign.model.user_effects, name);
    const Step& step = steps_.at(name)[which];
    return dem::ParametersOnRay(*effect, *step.ray, step.step * multiple,
                                view_.campaign.model.contact, state_);
  }

  void AddCandidate(const inference::Score& score) {
    diagnosis_.candidates.push_back(
        {.effect = score.name,
         .p_value = score.adjusted,
         .explained_fraction = score.explained,
         .amplitude =
             StrengthOf(score.name, static_cast<std::size_t>(score.difference), score.amplitude),
         .predicted_rms_error = score.rms,
         .confusable_with = score.confusable_with,
         .campaign = "",
         .refit_p_value = -1,
         .refit_chi2 = 0,
         .over_base = {}});
    if (std::isfinite(score.detectable)) {
      const std::size_t last = steps_.at(score.name).size() - 1;
      diagnosis_.detectable[score.name] = StrengthOf(score.name, last, score.detectable);
    }
  }

  absl::Status FitWarm() {
    const std::size_t count = std::min(kWarmFits, diagnosis_.candidates.size());
    if (count == 0) return absl::OkStatus();
    const auto runs = static_cast<int>(table_.sample.size());
    const int samples =
        std::max(kLeastWarmSamples, runs / (static_cast<int>(count) * kWarmIterations));
    for (std::size_t c = 0; c < count; ++c) {
      if (auto s = FitOne(diagnosis_.candidates[c], samples, kWarmIterations); !s.ok()) return s;
    }
    // Where the emulator is not good enough to judge by, more iterations for the closest of them.
    const std::int64_t limit = diagnosis_.warm_evaluations +
                               static_cast<std::int64_t>(kWarmShare) * runs * FittedExperiments();
    const std::int64_t cost = static_cast<std::int64_t>(samples) * kWarmMore * FittedExperiments();
    std::map<std::string, int> iterations;
    const bool misses = diagnosis_.adequacy.p_value < options_.level;
    while (misses && diagnosis_.warm_evaluations + cost <= limit) {
      CandidateEffect* closest = nullptr;
      for (std::size_t c = 0; c < count; ++c) {
        CandidateEffect& candidate = diagnosis_.candidates[c];
        if (candidate.refit_p_value >= 0 ||
            kWarmIterations + iterations[candidate.effect] + kWarmMore > kMostWarmIterations) {
          continue;
        }
        if (closest == nullptr || candidate.predicted_rms_error < closest->predicted_rms_error) {
          closest = &candidate;
        }
      }
      // With an adequate one at hand the others need not be pursued.
      if (closest == nullptr || AnyAdequate()) break;
      iterations[closest->effect] += kWarmMore;
      if (auto s = FitOne(*closest, samples, kWarmIterations + iterations[closest->effect]);
          !s.ok()) {
        return s;
      }
    }
    // Those that explain the readings, by how well; then the other fits, by how close they come.
    const auto rank = [this](const CandidateEffect& c) {
      return Explains(c) ? 0 : (c.campaign.empty() ? 2 : 1);
    };
    std::stable_sort(diagnosis_.candidates.begin(), diagnosis_.candidates.end(),
                     [&rank](const CandidateEffect& a, const CandidateEffect& b) {
                       if (rank(a) != rank(b)) return rank(a) < rank(b);
                       if (rank(a) == 0) return a.over_base.nats > b.over_base.nats;
                       return rank(a) == 1 && a.predicted_rms_error < b.predicted_rms_error;
                     });
    return absl::OkStatus();
  }

  bool Explains(const CandidateEffect& candidate) const {
    return candidate.refit_p_value >= options_.level &&
           candidate.over_base.nats > 2 * candidate.over_base.sd;
  }
  bool AnyAdequate() const {
    return std::any_of(diagnosis_.candidates.begin(), diagnosis_.candidates.end(),
                       [this](const CandidateEffect& c) { return Explains(c); });
  }

  // The model with the effect, refitted; refit_p_value stays below zero where the emulator of its
  // runs is not good enough to judge by, predicted_rms_error is then that of the best run.
  absl::Status FitOne(CandidateEffect& candidate, int samples, int iterations) {
    const auto text = ExtensionText(view_, {.effects = {candidate.effect},
                                            .purpose = "warm_fit",
                                            .held_out = false,
                                            .samples = samples,
                                            .iterations = iterations});
    if (!text.ok()) return text.status();
    const auto view =
        laboratory_.Run(view_, *text, absl::StrCat("warm fit with ", candidate.effect));
    if (!view.ok()) return view.status();
    candidate.campaign = view->status.campaign();
    diagnosis_.warm_evaluations += view->status.model_evaluations();
    const RunTable own = RunsOf(*view);
    const auto readings = static_cast<double>(table_.histories.cols());
    if (own.histories.rows() > 0) {
      Index best = 0;
      candidate.predicted_rms_error =
          std::sqrt(own.histories.rowwise().squaredNorm().minCoeff(&best) / readings);
      std::map<std::string, double> values;
      for (Index j = 0; j < own.parameters.cols(); ++j) {
        values[view->campaign.parameters[static_cast<std::size_t>(j)].name] =
            own.parameters(best, j);
      }
      warm_.insert_or_assign(candidate.effect, WarmFit{.view = *view, .best = values});
      for (const auto& [name, value] : values) {
        if (name.starts_with(candidate.effect + ".")) candidate.amplitude[name] = value;
      }
    }
    const auto response =
        RespondTo(*view, nuisance_, RunsWithoutEffect(table_, view_.campaign, view->campaign));
    if (!response.ok() || !response->trustworthy) return absl::OkStatus();
    const auto adequacy = inference::TestAdequacy(response->model);
    const auto advantage = inference::Compare(response->model, base_.model);
    if (!adequacy.ok() || !advantage.ok()) return absl::OkStatus();
    candidate.refit_p_value = adequacy->p_value;
    candidate.refit_chi2 = adequacy->chi2;
    candidate.over_base = *advantage;
    candidate.predicted_rms_error =
        response->model.histories.row(adequacy->best).norm() / std::sqrt(readings);
    candidate.explained_fraction =
        std::clamp((diagnosis_.adequacy.chi2 - adequacy->chi2) /
                       std::max(1.0, diagnosis_.adequacy.chi2 - diagnosis_.adequacy.degrees),
                   0.0, 1.0);
    for (Index j = 0; j < response->points.cols(); ++j) {
      const std::string& name = view->campaign.parameters[static_cast<std::size_t>(j)].name;
      if (name.starts_with(candidate.effect + ".")) {
        candidate.amplitude[name] = response->points(adequacy->best, j);
      }
    }
    warm_.insert_or_assign(
        candidate.effect,
        WarmFit{.view = *view, .best = PointOf(*view, *response, adequacy->best)});
    fitted_.insert_or_assign(candidate.effect, response->model);
    return absl::OkStatus();
  }

  static std::map<std::string, double> PointOf(const report::CampaignView& view,
                                               const Response& response, Index row) {
    std::map<std::string, double> values;
    for (Index j = 0; j < response.points.cols(); ++j) {
      values[view.campaign.parameters[static_cast<std::size_t>(j)].name] = response.points(row, j);
    }
    return values;
  }

  // The named effect, or the best, against what comes next; the base model where there is no
  // second.
  absl::Status PlanNext() {
    std::vector<Rival> rivals;
    for (const CandidateEffect& candidate : diagnosis_.candidates) {
      const auto found = warm_.find(candidate.effect);
      if (found == warm_.end() || rivals.size() >= kMostNames) continue;
      const bool named =
          diagnosis_.verdict != "ambiguous" || rivals.empty() ||
          std::find(diagnosis_.candidates.front().confusable_with.begin(),
                    diagnosis_.candidates.front().confusable_with.end(),
                    candidate.effect) != diagnosis_.candidates.front().confusable_with.end();
      if (!named) continue;
      rivals.push_back(
          {.name = candidate.effect, .view = &found->second.view, .values = found->second.best});
      if (diagnosis_.verdict != "ambiguous" && rivals.size() == 2) break;
    }
    if (rivals.size() == 1) {
      rivals.push_back({.name = "base",
                        .view = &view_,
                        .values = PointOf(view_, base_, diagnosis_.adequacy.best)});
    }
    auto next = PlanNextExperiment(laboratory_, rivals,
                                   table_.sample[static_cast<std::size_t>(BestRuns(1).front())],
                                   base_.scatter);
    if (!next.ok()) return next.status();
    diagnosis_.next_experiment = *std::move(next);
    return absl::OkStatus();
  }

  bool ClearlyBetter(const std::string& a, const std::string& b) const {
    const auto advantage = inference::Compare(fitted_.at(a), fitted_.at(b));
    return advantage.ok() && advantage->nats > 2 * advantage->sd && advantage->nats > 0;
  }

  void Conclude(bool base_fits) {
    std::vector<std::string> adequate;
    for (const CandidateEffect& candidate : diagnosis_.candidates) {
      if (Explains(candidate)) {
        adequate.push_back(candidate.effect);
      }
    }
    if (adequate.empty()) {
      diagnosis_.verdict = base_fits ? "adequate" : "unexplained";
      // Judged or not: the one that comes closest, if it comes clearly closer than the base model.
      const CandidateEffect* closest = nullptr;
      for (const CandidateEffect& candidate : diagnosis_.candidates) {
        if (candidate.campaign.empty()) continue;
        const bool worse =
            closest != nullptr && candidate.predicted_rms_error >= closest->predicted_rms_error;
        if (!worse && candidate.predicted_rms_error < kClearlyCloser * diagnosis_.rms) {
          closest = &candidate;
        }
      }
      if (!base_fits && closest != nullptr) diagnosis_.best_partial = closest->effect;
      return;
    }
    std::vector<std::string> rivals;
    for (std::size_t k = 1; k < adequate.size(); ++k) {
      if (!ClearlyBetter(adequate.front(), adequate[k])) rivals.push_back(adequate[k]);
    }
    CandidateEffect& first =
        *std::find_if(diagnosis_.candidates.begin(), diagnosis_.candidates.end(),
                      [&](const CandidateEffect& c) { return c.effect == adequate.front(); });
    if (rivals.empty()) {
      diagnosis_.verdict = "missing_effect";
      diagnosis_.effect = first.effect;
    } else {
      diagnosis_.verdict = "ambiguous";
      if (rivals.size() > kMostNames - 1) rivals.resize(kMostNames - 1);
      first.confusable_with = rivals;
    }
    std::rotate(diagnosis_.candidates.begin(),
                diagnosis_.candidates.begin() + (&first - diagnosis_.candidates.data()),
                diagnosis_.candidates.begin() + (&first - diagnosis_.candidates.data()) + 1);
  }

  Laboratory& laboratory_;
  const report::CampaignView& view_;
  const DiagnosisOptions& options_;
  RunTable table_;
  dem::ReferenceState state_;
  std::vector<Eigen::VectorXd> nuisance_;
  Response base_;
  std::map<std::string, std::vector<Step>> steps_;
  std::vector<inference::Score> scores_;
  std::map<std::string, inference::FittedModel> fitted_;
  struct WarmFit {
    report::CampaignView view;
    std::map<std::string, double> best;
  };
  std::map<std::string, WarmFit> warm_;
  Diagnosis diagnosis_;
};

}  // namespace

absl::StatusOr<Diagnosis> Diagnose(Laboratory& laboratory, const report::CampaignView& view,
                                   const DiagnosisOptions& options) {
  return Inquiry(laboratory, view, options).Run();
}

}  // namespace calib::ctl
