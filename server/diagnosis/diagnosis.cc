#include "server/diagnosis/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/registry/declared_effects.h"
#include "inference/numerics/decompositions.h"
#include "server/campaign/checks/noise_check.h"
#include "server/diagnosis/diagnosis_support.h"
#include "server/diagnosis/effect_screen.h"
#include "server/diagnosis/extension.h"
#include "server/diagnosis/fitted_campaign.h"
#include "server/diagnosis/reading_effects.h"
#include "server/diagnosis/refit_order.h"
#include "server/diagnosis/response.h"
#include "server/diagnosis/strengths.h"
#include "server/diagnosis/verdict.h"
#include "server/diagnosis/warm_fits.h"
#include "server/report/views/prior_conflict.h"

namespace calib::diagnosis {
namespace {

// Of measurements that a right model makes one in a thousand is closer.
constexpr double kTooGood = 0.999;
constexpr double kMostUnits = 10;  // of an effect that is calculated on readings

// A model with draws at some of the readings, ascending, to be screened.
inference::FittedModel At(const inference::FittedModel& model,
                          const std::vector<Eigen::Index>& readings) {
  if (std::ssize(readings) == model.histories.readings()) return model;
  inference::FittedModel part{.histories = model.histories.At(readings),
                              .covariance = model.covariance(readings, readings),
                              .parameters = model.parameters,
                              .draws = model.draws(Eigen::all, readings),
                              .group = model.group,
                              .without = {},
                              .packings = model.packings};
  for (const Eigen::MatrixXd& own : model.without) {
    part.without.emplace_back(own(readings, readings));
  }
  return part;
}

class Inquiry {
 public:
  Inquiry(client::Laboratory& laboratory, const report::CampaignView& view,
          const DiagnosisOptions& options)
      : laboratory_(laboratory),
        options_(options),
        base_(laboratory, view),
        screen_(base_),
        fits_(base_, screen_, response_, options.level) {}

  absl::StatusOr<Diagnosis> Run() {
    diagnosis_.campaign = base_.id();
    diagnosis_.only_adequacy = options_.only_adequacy;
    diagnosis_.warnings = campaign::Sentences(campaign::NoiseWarnings(base_.view().campaign));
    diagnosis_.in_doubt = !diagnosis_.warnings.empty();
    for (const report::PriorConflict& conflict : report::PriorConflicts(base_.view())) {
      diagnosis_.warnings.push_back(report::InWords(conflict));
    }
    RETURN_IF_ERROR(CheckDiagnosable(base_));
    const bool elsewhere = base_.view().campaign.precomputed.has_value();
    diagnosis_.in_doubt = diagnosis_.in_doubt || HasFewReadings(base_);
    for (std::string& doubt : DoubtsOf(base_)) diagnosis_.warnings.push_back(std::move(doubt));
    if (!options_.only_adequacy && !elsewhere) {
      RETURN_IF_ERROR(CheckBudget());
      const std::string left_out = screen_.WhatIsLeftOut(options_.without);
      if (!left_out.empty()) diagnosis_.warnings.push_back(left_out);
      ASSIGN_OR_RETURN(auto nuisance, screen_.MeasureNuisance(options_.without));
      nuisance_ = std::move(nuisance);
    } else if (options_.only_adequacy) {
      nuisance_ = options_.nuisance;
    }
    diagnosis_.nuisance = nuisance_;
    RETURN_IF_ERROR(JudgeBase());
    const bool fits = diagnosis_.adequacy.p_value >= options_.level;
    if (options_.only_adequacy) {
      diagnosis_.verdict = fits ? "adequate" : "unexplained";
      return diagnosis_;
    }
    RETURN_IF_ERROR(elsewhere ? ScreenReadings() : ScreenEffects());
    const bool hinted =
        !diagnosis_.candidates.empty() && diagnosis_.candidates.front().p_value < options_.level;
    if (fits && !hinted) {
      diagnosis_.verdict = "adequate";
      return diagnosis_;
    }
    const inference::FittedModel base = elsewhere ? response_.model : fits_.Base();
    diagnosis_.left_out_error = LeftOut(base);
    RETURN_IF_ERROR(FitWarm(base));
    Verdict(diagnosis_, fits_.all(), base, options_.level).Conclude(fits);
    if (options_.next_experiment && !elsewhere && diagnosis_.verdict != "adequate") {
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
  absl::Status CheckBudget() const {
    if (!options_.max_evaluations) return absl::OkStatus();
    const std::int64_t screen = screen_.Planned(options_.without);
    if (screen + fits_.Least() <= *options_.max_evaluations) return absl::OkStatus();
    return absl::ResourceExhaustedError(
        absl::StrCat("the screen of effects takes ", screen, " model evaluations and a refit ",
                     fits_.Least(), ", and ", std::max<std::int64_t>(0, *options_.max_evaluations),
                     " are left (what an earlier diagnosis has run counts too)"));
  }

  absl::Status JudgeBase() {
    ASSIGN_OR_RETURN(auto response, RespondTo(base_, nuisance_));
    response_ = std::move(response);
    ASSIGN_OR_RETURN(const auto adequacy, inference::TestAdequacy(response_.model));
    diagnosis_.adequacy = adequacy;
    diagnosis_.emulator_error = response_.emulator_error;
    diagnosis_.scatter = response_.scatter;
    diagnosis_.packings = static_cast<int>(base_.readings().departures.rows());
    const std::string few = FewPackings(response_.model, diagnosis_.packings);
    if (!few.empty()) diagnosis_.warnings.push_back(few);
    if (adequacy.p_chi2 > kTooGood) {
      diagnosis_.in_doubt = true;
      diagnosis_.warnings.emplace_back(
          "The model is closer to the readings than the stated errors and the scatter explain: "
          "they seem too large, and an effect can hide in them.");
    }
    diagnosis_.rms = response_.model.histories.Rms(adequacy.best);
    // A misfit beyond all that the emulator does not know is one however little that is.
    if (!response_.trustworthy && adequacy.p_value >= options_.level) {
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
    const inference::FittedModel model = At(response_.model, screen_.Readings(options_.without));
    const auto adequacy = inference::TestAdequacy(model);
    if (!adequacy.ok()) return adequacy.status();
    const Eigen::LLT<Eigen::MatrixXd> factor(model.covariance);
    const auto signatures = screen_.MeasureSignatures(
        options_.without, [&adequacy, &factor](const Eigen::VectorXd& difference) {
          return factor.matrixL().solve(difference).squaredNorm() / adequacy->degrees;
        });
    if (!signatures.ok()) return signatures.status();
    diagnosis_.not_excitable = screen_.not_excitable();
    diagnosis_.screen_evaluations = screen_.evaluations();
    if (signatures->empty()) return absl::OkStatus();
    ASSIGN_OR_RETURN(auto scores, inference::Screen(model, *signatures,
                                                    {.level = options_.level,
                                                     .seed = base_.view().campaign.filter.seed}));
    // The share of the error that an effect leaves in what was screened, of the error in all.
    const double screened = model.histories.Rms(adequacy->best);
    for (inference::Score& score : scores) {
      if (screened > 0) score.rms *= diagnosis_.rms / screened;
      AddCandidate(score);
    }
    return absl::OkStatus();
  }

  bool LeftOutAsAskedFor(const std::string& effect) const {
    return std::find(options_.without.begin(), options_.without.end(), effect) !=
           options_.without.end();
  }

  // Runs that were made elsewhere cannot be repeated with an effect; what happens to their readings
  // can be calculated.
  absl::Status ScreenReadings() {
    const campaign::Campaign& campaign = base_.view().campaign;
    const std::vector<ReadingEffect> effects =
        EffectsOnReadings(campaign, response_.model.histories.Values(), diagnosis_.not_excitable);
    std::vector<inference::Signature> signatures;
    for (const ReadingEffect& effect : effects) {
      if (LeftOutAsAskedFor(effect.effect)) continue;
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
          effect.name, LeftOutAsAskedFor(effect.name)
                           ? "left out as asked for"
                           : "the runs were made elsewhere, none can be made with it");
    }
    ASSIGN_OR_RETURN(const auto scores, inference::Screen(response_.model, signatures,
                                                          {.max_amplitude = kMostUnits,
                                                           .level = options_.level,
                                                           .seed = campaign.filter.seed}));
    for (const inference::Score& score : scores) AddCandidate(score);
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
    fit.rms = fit.model.histories.Rms(adequacy->best);
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

  void AddCandidate(const inference::Score& score) {
    diagnosis_.candidates.push_back(
        {.effect = score.name,
         .p_value = score.adjusted,
         .explained_fraction = score.explained,
         .screen_explained = score.explained,
         .amplitude =
             StrengthOf(score.name, static_cast<std::size_t>(score.difference), score.amplitude),
         .predicted_rms_error = score.rms,
         .confusable_with = score.confusable_with,
         .campaign = "",
         .closest = {},
         .refit_p_value = -1,
         .refit_chi2 = 0,
         .over_base = {},
         .gain_p_value = {},
         .left_out_error = {},
         .over_base_evidence = {},
         .angles = score.angles});
    const dem::Model& model = base_.view().campaign.model;
    const dem::EffectInfo& effect = *dem::FindEffect(model.user_effects, score.name);
    diagnosis_.units.merge(UnitsOf(effect, model.contact));
    if (!std::isfinite(score.detectable)) {
      diagnosis_.undetectable.emplace_back(
          score.name,
          "the parameters imitate it, or what it changes is another at another strength");
      return;
    }
    const std::map<std::string, double> strength = StrengthOf(
        score.name, static_cast<std::size_t>(score.detectable_difference), score.detectable);
    std::string why = WhyNotAdmissible(effect, model.contact, strength);
    if (why.empty()) {
      why =
          WhyBeyondPrior(PriorsOfExtension(base_.view(), effect), effect, model.contact, strength);
    }
    if (why.empty()) {
      diagnosis_.detectable[score.name] = strength;
    } else {
      diagnosis_.undetectable.emplace_back(score.name, why);
    }
  }

  absl::Status FitWarm(const inference::FittedModel& base) {
    if (!base_.view().campaign.precomputed) {
      std::optional<std::int64_t> most = options_.max_evaluations;
      if (most) *most -= screen_.evaluations();
      const RefitOrder order =
          OrderOfRefits(diagnosis_, base_.view().campaign.model.user_effects, options_.level);
      RETURN_IF_ERROR(fits_.Fit(order, most));
    }
    diagnosis_.warm_evaluations = fits_.evaluations();
    for (CandidateEffect& candidate : diagnosis_.candidates) Describe(candidate);
    const Verdict verdict(diagnosis_, fits_.all(), base, options_.level);
    WeighEvidence(verdict);
    // Those that explain the readings, by how well; then the other fits, by how close they come.
    const auto rank = [&verdict](const CandidateEffect& c) {
      return verdict.Explains(c) ? 0 : (c.refit_p_value < 0 ? 2 : 1);
    };
    std::stable_sort(diagnosis_.candidates.begin(), diagnosis_.candidates.end(),
                     [&rank](const CandidateEffect& a, const CandidateEffect& b) {
                       if (rank(a) != rank(b)) return rank(a) < rank(b);
                       if (rank(a) == 0) return a.over_base.nats > b.over_base.nats;
                       return rank(a) == 1 && a.refit_chi2 < b.refit_chi2;
                     });
    return absl::OkStatus();
  }

  // Looked at where one of the fits explains the readings.
  void WeighEvidence(const Verdict& verdict) {
    if (std::none_of(diagnosis_.candidates.begin(), diagnosis_.candidates.end(),
                     [&verdict](const CandidateEffect& c) { return verdict.Explains(c); })) {
      return;
    }
    fits_.WeighEvidence();
    const std::optional<double> base = fits_.BaseLogEvidence();
    for (CandidateEffect& candidate : diagnosis_.candidates) {
      const WarmFit* fit = fits_.Find(candidate.effect);
      if (fit == nullptr || !base || !fit->evidence) continue;
      candidate.over_base_evidence = fit->evidence;
      for (double& value : candidate.over_base_evidence->log_evidence) value -= *base;
    }
  }

  // What the warm fit of a candidate says.
  void Describe(CandidateEffect& candidate) const {
    if (fits_.Find(candidate.effect) == nullptr) return;
    const WarmFit& fit = *fits_.Find(candidate.effect);
    candidate.campaign = fit.view.status.campaign();
    if (fit.Found()) {
      candidate.predicted_rms_error = fit.rms;
      candidate.predicted_by = "refit";
    }
    for (const auto& [name, value] : fit.best) {
      if (name.starts_with(candidate.effect + ".")) candidate.amplitude[name] = value;
    }
    candidate.closest = fit.best;
    if (!fit.Judged()) return;  // the screen knows more
    candidate.refit_p_value = fit.adequacy.p_value;
    candidate.refit_chi2 = fit.adequacy.chi2;
    candidate.over_base = fit.over_base;
    candidate.gain_p_value = fit.gain_p_value;
    candidate.left_out_error = fit.left_out_error;
    candidate.explained_fraction = std::clamp((diagnosis_.adequacy.chi2 - fit.adequacy.chi2) /
                                                  inference::ExplainableMisfit(diagnosis_.adequacy),
                                              0.0, 1.0);
  }

  // Its refit where it came closest; of an effect without one the base model joined by it, as
  // strong as the screen expects. None where it has neither.
  std::optional<Rival> RivalOf(const CandidateEffect& candidate) const {
    const WarmFit* fit = fits_.Find(candidate.effect);
    if (fit != nullptr && !fit->best.empty() && !candidate.campaign.empty()) {
      return Rival{
          .name = candidate.effect, .view = &fit->view, .values = fit->best, .near = fit->near};
    }
    const dem::Model& model = base_.view().campaign.model;
    const dem::EffectInfo& effect = *dem::FindEffect(model.user_effects, candidate.effect);
    if (fit != nullptr || !(candidate.screen_explained > 0) ||
        !WhyNotAdmissible(effect, model.contact, candidate.amplitude).empty()) {
      return std::nullopt;
    }
    Rival rival = BaseRival();
    rival.name = candidate.effect;
    rival.effects = {candidate.effect};
    rival.fixed = candidate.amplitude;
    return rival;
  }
  Rival BaseRival() const {
    return {.name = "base",
            .view = &base_.view(),
            .values = PointOf(base_.view(), response_.points, diagnosis_.adequacy.best)};
  }

  // The group that is named together.
  std::vector<Rival> RivalsOfGroup() {
    const CandidateEffect& first = diagnosis_.candidates.front();
    const auto& group = first.confusable_with;
    std::vector<Rival> rivals;
    for (const CandidateEffect& candidate : diagnosis_.candidates) {
      if (&candidate != &first &&
          std::find(group.begin(), group.end(), candidate.effect) == group.end()) {
        continue;
      }
      if (auto rival = RivalOf(candidate)) {
        rivals.push_back(*std::move(rival));
      } else {
        diagnosis_.warnings.push_back(absl::StrCat(
            "The next experiment does not separate ", candidate.effect,
            " from the others: no run is known at which it comes close. More samples tell."));
      }
    }
    return rivals;
  }

  // The named effect, or the best, against what comes next; the base model where there is no
  // second.
  std::vector<Rival> BestTwo() const {
    std::vector<Rival> rivals;
    for (const CandidateEffect& candidate : diagnosis_.candidates) {
      if (fits_.Find(candidate.effect) == nullptr) continue;
      if (auto rival = RivalOf(candidate)) rivals.push_back(*std::move(rival));
      if (rivals.size() == 2) return rivals;
    }
    if (rivals.size() == 1) {
      rivals.push_back(BaseRival());
      rivals.back().near = PointsNear(base_.view(), response_.points, response_.model);
    }
    return rivals;
  }

  // Where the base model is not one of the rivals itself.
  std::optional<NoneOfThese> None(const std::vector<Rival>& rivals) const {
    if (!rivals.empty() && rivals.back().name == BaseRival().name) return std::nullopt;
    const std::vector<inference::Reading>& readings = base_.readings().of_mean.readings;
    const std::vector<inference::Reading> plain =
        campaign::MakeDataSet(base_.view().campaign).readings;
    std::map<std::string, std::pair<double, int>> squares;  // and how many
    const Eigen::VectorXd fitted = response_.model.histories[diagnosis_.adequacy.best];
    for (std::size_t k = 0; k < readings.size(); ++k) {
      const campaign::Experiment& experiment =
          base_.view().campaign.experiments[static_cast<std::size_t>(readings[k].experiment)];
      const double missed = fitted[static_cast<Eigen::Index>(k)] * readings[k].sd / plain[k].sd;
      auto& [sum, count] =
          squares[experiment.observables[static_cast<std::size_t>(readings[k].observable)].name];
      sum += missed * missed;
      ++count;
    }
    NoneOfThese none{.base = BaseRival()};
    for (const auto& [observable, of] : squares) {
      none.missed[observable] = std::sqrt(std::max(0.0, of.first / of.second - 1));
    }
    return none;
  }

  absl::Status PlanNext() {
    const std::vector<Rival> rivals =
        diagnosis_.verdict == "ambiguous" ? RivalsOfGroup() : BestTwo();
    const auto like = static_cast<std::size_t>(base_.BestRuns(1).front());
    ASSIGN_OR_RETURN(auto next, PlanNextExperiment(laboratory_, rivals, None(rivals),
                                                   base_.runs().sample[like], response_.scatter));
    diagnosis_.next_experiment = std::move(next.next);
    if (!next.warning.empty()) diagnosis_.warnings.push_back(next.warning + ".");
    if (!diagnosis_.next_experiment) {
      diagnosis_.warnings.push_back(
          absl::StrCat("No next experiment is planned: ", next.why_none, "."));
    }
    return absl::OkStatus();
  }

  client::Laboratory& laboratory_;
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

absl::StatusOr<Diagnosis> Diagnose(client::Laboratory& laboratory, const report::CampaignView& view,
                                   const DiagnosisOptions& options) {
  return Inquiry(laboratory, view, options).Run();
}

}  // namespace calib::diagnosis
