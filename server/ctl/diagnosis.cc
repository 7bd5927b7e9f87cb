#include "server/ctl/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/ctl/effect_screen.h"
#include "server/ctl/fitted_campaign.h"
#include "server/ctl/reading_effects.h"
#include "server/ctl/response.h"
#include "server/ctl/warm_fits.h"

namespace calib::ctl {
namespace {

constexpr std::size_t kWarmFits = 3;
constexpr double kClearlyCloser = 0.8;  // of the base model's rms
constexpr std::size_t kMostNames = 3;
constexpr double kMostUnits = 10;  // of an effect that is calculated on readings

class Inquiry {
 public:
  Inquiry(Laboratory& laboratory, const report::CampaignView& view, const DiagnosisOptions& options)
      : laboratory_(laboratory),
        options_(options),
        base_(laboratory, view),
        screen_(base_),
        fits_(base_, response_.run_covariance, response_.parts) {}

  absl::StatusOr<Diagnosis> Run() {
    diagnosis_.campaign = base_.id();
    if (auto possible = CheckPossible(); !possible.ok()) return possible;
    const bool elsewhere = base_.view().campaign.precomputed.has_value();
    if (!options_.only_adequacy && !elsewhere) {
      auto nuisance = screen_.MeasureNuisance();
      if (!nuisance.ok()) return nuisance.status();
      nuisance_ = *std::move(nuisance);
    }
    if (auto status = JudgeBase(); !status.ok()) return status;
    const bool fits = diagnosis_.adequacy.p_value >= options_.level;
    if (options_.only_adequacy) {
      diagnosis_.verdict = fits ? "adequate" : "unexplained";
      return diagnosis_;
    }
    if (auto status = elsewhere ? ScreenReadings() : ScreenEffects(); !status.ok()) return status;
    const bool hinted =
        !diagnosis_.candidates.empty() && diagnosis_.candidates.front().p_value < options_.level;
    if (fits && !hinted) {
      diagnosis_.verdict = "adequate";
      return diagnosis_;
    }
    diagnosis_.left_out_error = LeftOut(elsewhere ? response_.model : fits_.BaseByRuns());
    if (auto status = FitWarm(); !status.ok()) return status;
    Conclude(fits);
    if (options_.next_experiment && !elsewhere && diagnosis_.verdict != "adequate") {
      if (auto status = PlanNext(); !status.ok()) return status;
    }
    return diagnosis_;
  }

 private:
  absl::Status CheckPossible() const {
    const report::CampaignView& view = base_.view();
    const std::string& id = base_.id();
    if (view.posterior.posterior_from().empty() || view.posterior.posterior_from() == "none") {
      return absl::FailedPreconditionError(
          absl::StrCat("campaign ", id,
                       " has no posterior, so nothing can be said about its model: see "
                       "`calibctl posterior ",
                       id, "`"));
    }
    if (view.campaign.filter.noise != inference::NoiseMode::kGiven) {
      return absl::FailedPreconditionError(
          absl::StrCat("campaign ", id,
                       " states no size of the errors (noise is inferred or "
                       "tempered), so its model cannot be judged; give the noise"));
    }
    if (base_.runs().sample.empty()) {
      return absl::FailedPreconditionError(absl::StrCat("no sample of ", id, " has finished"));
    }
    return absl::OkStatus();
  }

  absl::Status JudgeBase() {
    auto response = RespondTo(base_.view(), nuisance_);
    if (!response.ok()) return response.status();
    response_ = *std::move(response);
    const auto adequacy = inference::TestAdequacy(response_.model);
    if (!adequacy.ok()) return adequacy.status();
    diagnosis_.adequacy = *adequacy;
    diagnosis_.emulator_error = response_.emulator_error;
    diagnosis_.scatter = response_.scatter;
    diagnosis_.rms = response_.model.histories.row(adequacy->best).norm() /
                     std::sqrt(static_cast<double>(response_.model.histories.cols()));
    if (!response_.trustworthy) {
      return absl::FailedPreconditionError(absl::StrCat(
          "the emulator misses the runs of ", base_.id(),
          " by more than twice the noise beyond their scatter, too much to judge the model by; run "
          "more samples"));
    }
    return absl::OkStatus();
  }

  std::optional<double> LeftOut(const inference::FittedModel& model) const {
    const auto error = inference::LeftOutError(model, response_.parts);
    return error.ok() ? std::optional<double>(*error) : std::nullopt;
  }

  absl::Status ScreenEffects() {
    const auto signatures = screen_.MeasureSignatures(options_.without);
    if (!signatures.ok()) return signatures.status();
    diagnosis_.not_excitable = screen_.not_excitable();
    diagnosis_.screen_evaluations = screen_.evaluations();
    if (signatures->empty()) return absl::OkStatus();
    const auto scores =
        inference::Screen(response_.model, *signatures,
                          {.level = options_.level, .seed = base_.view().campaign.filter.seed});
    if (!scores.ok()) return scores.status();
    for (const inference::Score& score : *scores) AddCandidate(score);
    return absl::OkStatus();
  }

  // Runs that were made elsewhere cannot be repeated with an effect; what happens to their readings
  // can be calculated.
  absl::Status ScreenReadings() {
    const campaign::Campaign& campaign = base_.view().campaign;
    const std::vector<ReadingEffect> effects =
        EffectsOnReadings(campaign, response_.model.histories, diagnosis_.not_excitable);
    std::vector<inference::Signature> signatures;
    for (const ReadingEffect& effect : effects) {
      if (signatures.empty() || signatures.back().name != effect.effect) {
        signatures.push_back({.name = effect.effect,
                              .differences = {},
                              .two_sided = dem::FindEffect(effect.effect)->two_sided});
      }
      signatures.back().differences.emplace_back(
          effect.change.row(diagnosis_.adequacy.best).transpose());
      steps_on_readings_[effect.effect].push_back(&effect);
      AdoptJoined(effect);
    }
    for (const dem::EffectInfo& effect : dem::Effects()) {
      const auto judged = [&](const auto& entry) { return entry.first == effect.name; };
      if (steps_on_readings_.count(effect.name) > 0 ||
          std::any_of(diagnosis_.not_excitable.begin(), diagnosis_.not_excitable.end(), judged)) {
        continue;
      }
      diagnosis_.not_excitable.emplace_back(
          effect.name, "the runs were made elsewhere, none can be made with it");
    }
    const auto scores = inference::Screen(
        response_.model, signatures,
        {.max_amplitude = kMostUnits, .level = options_.level, .seed = campaign.filter.seed});
    if (!scores.ok()) return scores.status();
    for (const inference::Score& score : *scores) AddCandidate(score);
    steps_on_readings_.clear();
    return absl::OkStatus();
  }

  // Of several strengths of an effect the one that comes closest is kept.
  void AdoptJoined(const ReadingEffect& effect) {
    const bool two_sided = dem::FindEffect(effect.effect)->two_sided;
    Eigen::VectorXd strengths;
    WarmFit fit;
    fit.stalled = true;  // there is nothing to continue
    fit.model = Join(response_.model, effect, two_sided ? -kMostUnits : 0, kMostUnits, strengths);
    const auto adequacy = inference::TestAdequacy(fit.model);
    const auto advantage = inference::Compare(fit.model, response_.model);
    if (!adequacy.ok() || !advantage.ok()) return;
    const WarmFit* before = fits_.Find(effect.effect);
    if (before != nullptr && before->adequacy.chi2 <= adequacy->chi2) return;
    fit.adequacy = *adequacy;
    fit.over_base = *advantage;
    fit.rms = fit.model.histories.row(adequacy->best).norm() /
              std::sqrt(static_cast<double>(fit.model.histories.cols()));
    fit.left_out_error = LeftOut(fit.model);
    fit.best = PointOf(base_.view(), response_.points, adequacy->best);
    fit.best[effect.parameter] = strengths[adequacy->best] * effect.unit;
    fits_.Adopt(effect.effect, std::move(fit));
  }

  std::map<std::string, double> StrengthOf(const std::string& effect, std::size_t which,
                                           double multiple) const {
    const auto found = steps_on_readings_.find(effect);
    if (found == steps_on_readings_.end()) return screen_.StrengthOf(effect, which, multiple);
    const ReadingEffect& step = *found->second[which];
    return {{step.parameter, step.unit * multiple}};
  }
  std::size_t DifferencesOf(const std::string& effect) const {
    const auto found = steps_on_readings_.find(effect);
    return found == steps_on_readings_.end() ? screen_.DifferencesOf(effect) : found->second.size();
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
         .over_base = {},
         .left_out_error = {},
         .over_base_evidence = {}});
    if (std::isfinite(score.detectable)) {
      diagnosis_.detectable[score.name] =
          StrengthOf(score.name, DifferencesOf(score.name) - 1, score.detectable);
    }
  }

  absl::Status FitWarm() {
    const std::size_t count = std::min(kWarmFits, diagnosis_.candidates.size());
    std::vector<std::string> effects;
    for (std::size_t c = 0; c < count; ++c) effects.push_back(diagnosis_.candidates[c].effect);
    if (!base_.view().campaign.precomputed) {
      if (auto status = fits_.Fit(effects); !status.ok()) return status;
    }
    diagnosis_.warm_evaluations = fits_.evaluations();
    for (std::size_t c = 0; c < count; ++c) Describe(diagnosis_.candidates[c]);
    WeighEvidence();
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

  // What the warm fit of a candidate says.
  void Describe(CandidateEffect& candidate) const {
    if (fits_.Find(candidate.effect) == nullptr) return;
    const WarmFit& fit = *fits_.Find(candidate.effect);
    candidate.campaign = fit.view.status.campaign();
    candidate.predicted_rms_error = fit.rms;
    for (const auto& [name, value] : fit.best) {
      if (name.starts_with(candidate.effect + ".")) candidate.amplitude[name] = value;
    }
    candidate.refit_p_value = fit.adequacy.p_value;
    candidate.refit_chi2 = fit.adequacy.chi2;
    candidate.over_base = fit.over_base;
    candidate.left_out_error = fit.left_out_error;
    candidate.explained_fraction =
        std::clamp((diagnosis_.adequacy.chi2 - fit.adequacy.chi2) /
                       std::max(1.0, diagnosis_.adequacy.chi2 - diagnosis_.adequacy.degrees),
                   0.0, 1.0);
  }

  // How the fitted effects stand to the base model and to each other for three widths of the prior
  // on their strength; asked for where one of them explains the readings.
  void WeighEvidence() {
    if (std::none_of(diagnosis_.candidates.begin(), diagnosis_.candidates.end(),
                     [this](const CandidateEffect& c) { return Explains(c); })) {
      return;
    }
    const std::optional<double> base = fits_.BaseLogEvidence();
    for (CandidateEffect& candidate : diagnosis_.candidates) {
      if (fits_.Find(candidate.effect) == nullptr) continue;
      fits_.WeighEvidence(candidate.effect);
      if (!base) continue;
      candidate.over_base_evidence = fits_.Find(candidate.effect)->evidence;
      if (!candidate.over_base_evidence) continue;
      for (double& value : candidate.over_base_evidence->log_evidence) value -= *base;
    }
  }

  // Whatever the width of the prior on the strengths. An evidence is unknown where the emulator
  // does not know what the model can do: nothing is favoured over that.
  static bool EvidenceFavours(const std::optional<ScaledEvidence>& a,
                              const std::optional<ScaledEvidence>& b) {
    return a && b &&
           std::equal(a->log_evidence.begin(), a->log_evidence.end(), b->log_evidence.begin(),
                      [](double x, double y) { return x > y; });
  }

  // Adequate, clearly better than the base model, and not worse on readings it was not fitted to.
  bool Explains(const CandidateEffect& candidate) const {
    const WarmFit* fit = fits_.Find(candidate.effect);
    return fit != nullptr && fit->Explains(options_.level) &&
           !(fit->left_out_error && diagnosis_.left_out_error &&
             *fit->left_out_error > *diagnosis_.left_out_error);
  }

  bool ClearlyBetter(const WarmFit& a, const WarmFit& b) const {
    const auto advantage = inference::Compare(a.model, b.model);
    return advantage.ok() && advantage->nats > 2 * advantage->sd && advantage->nats > 0;
  }

  // Beaten, at its end or with the evidence against it. A fit that was made without runs has no
  // evidence and needs none: all its points are known.
  bool Excluded(const CandidateEffect& other, const WarmFit& best) const {
    const WarmFit& fit = *fits_.Find(other.effect);
    const bool outweighed = EvidenceFavours(best.evidence, fit.evidence);
    if (!Explains(other)) return fit.stalled || outweighed;
    return ClearlyBetter(best, fit) && (outweighed || fit.runs.histories.rows() == 0);
  }

  void Conclude(bool base_fits) {
    if (diagnosis_.candidates.empty() || !Explains(diagnosis_.candidates.front())) {
      diagnosis_.verdict = base_fits ? "adequate" : "unexplained";
      if (!base_fits) diagnosis_.best_partial = Closest();
      return;
    }
    CandidateEffect& first = diagnosis_.candidates.front();
    const WarmFit& best = *fits_.Find(first.effect);
    if (base_fits && first.over_base_evidence &&
        !EvidenceFavours(first.over_base_evidence, ScaledEvidence{})) {
      diagnosis_.verdict = "adequate";  // a hint that depends on the prior of its strength
      return;
    }
    // Those that do as well, and those of which it is not known yet how well they can do.
    std::vector<std::string> rivals;
    for (const CandidateEffect& other : diagnosis_.candidates) {
      const WarmFit* fit = fits_.Find(other.effect);
      if (fit == nullptr || fit == &best) continue;
      if (!Excluded(other, best) && rivals.size() + 1 < kMostNames) rivals.push_back(other.effect);
    }
    if (rivals.empty()) {
      diagnosis_.verdict = "missing_effect";
      diagnosis_.effect = first.effect;
    } else {
      diagnosis_.verdict = "ambiguous";
      first.confusable_with = rivals;
    }
  }

  // Judged or not: the fit that comes closest, if it comes clearly closer than the base model.
  std::string Closest() const {
    std::string name;
    double lowest = kClearlyCloser * diagnosis_.rms;
    for (const CandidateEffect& candidate : diagnosis_.candidates) {
      if (candidate.campaign.empty() || candidate.predicted_rms_error >= lowest) continue;
      name = candidate.effect;
      lowest = candidate.predicted_rms_error;
    }
    return name;
  }

  // The named effect, or the best, against what comes next; the base model where there is no
  // second.
  absl::Status PlanNext() {
    std::vector<Rival> rivals;
    for (const CandidateEffect& candidate : diagnosis_.candidates) {
      const WarmFit* fit = fits_.Find(candidate.effect);
      if (fit == nullptr || rivals.size() >= kMostNames) continue;
      const auto& group = diagnosis_.candidates.front().confusable_with;
      const bool named = diagnosis_.verdict != "ambiguous" || rivals.empty() ||
                         std::find(group.begin(), group.end(), candidate.effect) != group.end();
      if (!named) continue;
      rivals.push_back({.name = candidate.effect, .view = &fit->view, .values = fit->best});
      if (diagnosis_.verdict != "ambiguous" && rivals.size() == 2) break;
    }
    if (rivals.size() == 1) {
      rivals.push_back(
          {.name = "base",
           .view = &base_.view(),
           .values = PointOf(base_.view(), response_.points, diagnosis_.adequacy.best)});
    }
    const auto like = static_cast<std::size_t>(base_.BestRuns(1).front());
    auto next =
        PlanNextExperiment(laboratory_, rivals, base_.runs().sample[like], response_.scatter);
    if (!next.ok()) return next.status();
    diagnosis_.next_experiment = *std::move(next);
    return absl::OkStatus();
  }

  Laboratory& laboratory_;
  const DiagnosisOptions& options_;
  FittedCampaign base_;
  std::vector<Eigen::VectorXd> nuisance_;
  Response response_;
  EffectScreen screen_;
  WarmFits fits_;
  std::map<std::string, std::vector<const ReadingEffect*>> steps_on_readings_;
  Diagnosis diagnosis_;
};

}  // namespace

absl::StatusOr<Diagnosis> Diagnose(Laboratory& laboratory, const report::CampaignView& view,
                                   const DiagnosisOptions& options) {
  return Inquiry(laboratory, view, options).Run();
}

}  // namespace calib::ctl
