#include "server/diagnosis/verdict.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "server/diagnosis/left_out_error.h"

namespace calib::diagnosis {
namespace {

constexpr double kClearlyCloser = 0.64;  // of another model's chi-squared
constexpr double kClearlyLess = 0.25;    // of the misfit explained
constexpr double kFarOff = 4;            // times the chi-squared of the best: twice its rms
constexpr std::size_t kMostNames = 3;
constexpr double kNearlyAll = 0.9;  // of the misfit

// In errors that are the same for both.
bool ClearlyBetter(const WarmFit& a, const WarmFit& b, const Eigen::MatrixXd& errors) {
  const auto judged = [&errors](const WarmFit& fit) {
    return inference::FittedModel{
        .histories = fit.model.histories, .covariance = errors, .parameters = fit.model.parameters};
  };
  const auto advantage = inference::Compare(judged(a), judged(b));
  return advantage.ok() && advantage->nats > 2 * advantage->sd && advantage->nats > 0;
}

// Whatever the width of the prior on the strengths, by more than two standard errors. An evidence
// is unknown where the emulator does not know what the model can do: nothing is favoured over that.
bool EvidenceFavours(const std::optional<ScaledEvidence>& a,
                     const std::optional<ScaledEvidence>& b) {
  if (!a || !b) return false;
  const double margin = 2 * std::hypot(a->standard_error, b->standard_error);
  return std::equal(a->log_evidence.begin(), a->log_evidence.end(), b->log_evidence.begin(),
                    [margin](double x, double y) { return x - y > margin; });
}

}  // namespace

const WarmFit* Verdict::Find(const std::string& effect) const {
  const auto found = fits_.find(effect);
  return found == fits_.end() ? nullptr : &found->second;
}

bool Verdict::Explains(const CandidateEffect& candidate) const {
  const WarmFit* fit = Find(candidate.effect);
  return fit != nullptr && (fit->Explains(level_, fits_.size()) || Settles(*fit)) &&
         !WorseLeftOut(diagnosis_.left_out_error, fit->left_out_error);
}

// The model without it is wrong beyond doubt, and with it adequate and rid of nearly all the
// misfit, by the errors of the model without it (its own hold what its emulator does not know). The
// advantage in nats of a misfit that sits in one stage of loading is never twice its bootstrapped
// deviation.
bool Verdict::Settles(const WarmFit& fit) const {
  const inference::Adequacy& base = diagnosis_.adequacy;
  const double misfit = inference::ExplainableMisfit(base);
  return fit.adequacy.p_value >= level_ && 2 * fit.over_base.nats >= kNearlyAll * misfit &&
         base.p_value * static_cast<double>(fits_.size()) < level_ * level_;
}

// Explains clearly less than the best does, and is far off from where the best was after as many
// batches, or one more. Further off than the base model, which it contains, it has merely not been
// found: what it can explain the screen knows better.
bool Verdict::IsFarOff(const CandidateEffect& other, const CandidateEffect& first) const {
  const WarmFit& fit = *Find(other.effect);
  const WarmFit& best = *Find(first.effect);
  if (!fit.Judged() || !fit.Found()) return PromisesLess(other, first);
  if (fit.chi2_after.empty() || best.chi2_after.empty()) return false;
  const std::size_t batches = std::min(fit.chi2_after.size() + 1, best.chi2_after.size());
  return other.explained_fraction < first.explained_fraction - kClearlyLess &&
         fit.adequacy.chi2 >
             kFarOff * std::max(best.chi2_after[batches - 1], best.adequacy.degrees);
}

// Beaten clearly, at its end or with the evidence against it. One that was never judged, or never
// found, has no end: the screen knows more of it. A fit that was made without runs has no evidence
// and needs none: all its points are known. Of one that does not explain the readings a fall of
// chi-squared says it too: on two sides of a level two fits can be next to each other.
bool Verdict::Excluded(const CandidateEffect& other, const CandidateEffect& first) const {
  const WarmFit& best = *Find(first.effect);
  const WarmFit& fit = *Find(other.effect);
  const bool outweighed = EvidenceFavours(best.evidence, fit.evidence);
  const bool beaten = ClearlyBetter(best, fit, base_.covariance);
  if (Explains(other)) return beaten && (outweighed || fit.runs.histories.rows() == 0);
  const bool fell_behind = best.adequacy.chi2 < kClearlyCloser * fit.adequacy.chi2;
  return (Ended(fit) && (beaten || fell_behind)) || outweighed || IsFarOff(other, first);
}

bool Verdict::Ended(const WarmFit& fit) { return fit.stalled && fit.Judged() && fit.Found(); }

// To the screen, clearly.
bool Verdict::PromisesLess(const CandidateEffect& other, const CandidateEffect& first) {
  return other.screen_explained < first.screen_explained - kClearlyLess;
}

// At an angle to what the first explains a share of that is left.
double Verdict::Chi2OfDouble(const std::string& other, const CandidateEffect& first) const {
  const double best = Find(first.effect)->adequacy.chi2;
  const auto angle = first.angles.find(other);
  if (angle == first.angles.end()) return best;
  const double sine = std::sin(angle->second * std::numbers::pi / 180);
  return best + sine * sine * std::max(0.0, diagnosis_.adequacy.chi2 - best);
}

void Verdict::Conclude(bool base_fits) {
  if (diagnosis_.candidates.empty() || !Explains(diagnosis_.candidates.front())) {
    diagnosis_.verdict = base_fits ? "adequate" : "unexplained";
    if (base_fits) return;
    diagnosis_.best_partial = Closest();
    diagnosis_.reason = WhyUnexplained();
    return;
  }
  CandidateEffect& first = diagnosis_.candidates.front();
  const WarmFit& best = *Find(first.effect);
  if (base_fits && first.over_base_evidence &&
      !EvidenceFavours(first.over_base_evidence, ScaledEvidence{})) {
    diagnosis_.verdict = "adequate";  // a hint that depends on the prior of its strength
    return;
  }
  // Those that do as well, and those that the screen cannot tell from it, which were not fitted for
  // that reason; then those of which it is not known yet how well they can do.
  std::vector<std::pair<double, std::string>> as_good;  // chi-squared, measured or expected
  std::vector<const CandidateEffect*> unknown;
  for (const CandidateEffect& other : diagnosis_.candidates) {
    const WarmFit* fit = Find(other.effect);
    if (fit == nullptr) {  // there were no runs left for it
      const auto& alike = first.confusable_with;
      const bool named = std::find(alike.begin(), alike.end(), other.effect) != alike.end();
      if (!named && other.p_value < level_ && !PromisesLess(other, first)) {
        unknown.push_back(&other);
      }
      continue;
    }
    if (fit == &best || Excluded(other, first)) continue;
    if (Explains(other) || Ended(*fit)) {
      as_good.emplace_back(fit->adequacy.chi2, other.effect);
    } else {
      unknown.push_back(&other);
    }
  }
  for (const std::string& other : first.confusable_with) {
    const auto seen = std::find_if(diagnosis_.candidates.begin(), diagnosis_.candidates.end(),
                                   [&other](const auto& c) { return c.effect == other; });
    const bool refuted = seen != diagnosis_.candidates.end() && PromisesLess(*seen, first);
    if (Find(other) == nullptr && !refuted) {
      as_good.emplace_back(Chi2OfDouble(other, first), other);
    }
  }
  std::stable_sort(as_good.begin(), as_good.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  // How close those have come is luck so far; the screen knows more of them.
  std::stable_sort(unknown.begin(), unknown.end(),
                   [](const auto* a, const auto* b) { return a->p_value < b->p_value; });
  std::vector<std::string> rivals;
  rivals.reserve(as_good.size() + unknown.size());
  for (const auto& [chi2, other] : as_good) rivals.push_back(other);
  for (const CandidateEffect* other : unknown) rivals.push_back(other->effect);
  rivals.resize(std::min(rivals.size(), kMostNames - 1));
  if (rivals.empty()) {
    diagnosis_.verdict = "missing_effect";
    diagnosis_.effect = first.effect;
  } else {
    diagnosis_.verdict = "ambiguous";
    first.confusable_with = rivals;
    for (const CandidateEffect* other : unknown) {
      if (std::find(rivals.begin(), rivals.end(), other->effect) == rivals.end()) continue;
      diagnosis_.unfinished.push_back(other->effect);
    }
  }
}

// A clause: that no refit fits, or that one does but not clearly better; and why none is the best.
std::string Verdict::WhyUnexplained() const {
  const std::pair<const std::string, WarmFit>* closest = nullptr;
  const std::pair<const std::string, WarmFit>* fitting = nullptr;
  for (const CandidateEffect& candidate : diagnosis_.candidates) {
    const auto fit = fits_.find(candidate.effect);
    if (fit == fits_.end() || fit->second.model.histories.points() == 0) continue;
    const inference::Adequacy& adequacy = fit->second.adequacy;
    if (closest == nullptr || adequacy.chi2 < closest->second.adequacy.chi2) closest = &*fit;
    if (fitting == nullptr && adequacy.p_value >= level_) fitting = &*fit;
  }
  if (closest == nullptr) return "no effect could be refitted";
  if (fitting != nullptr) {
    const WarmFit& fit = fitting->second;
    return absl::StrFormat("with %s it fits (p = %.2g), but is not clearly better than without: %s",
                           fitting->first, fit.adequacy.p_value, WhyNotBetter(fit));
  }
  std::string text = absl::StrFormat("with none of the %d effects that were refitted does it fit",
                                     static_cast<int>(fits_.size()));
  const auto base = inference::TestAdequacy(base_);
  if (diagnosis_.best_partial.empty() && base.ok()) {
    const double share = closest->second.adequacy.chi2 / base->chi2;
    if (share >= 1) {
      absl::StrAppend(&text, ", and with none does it come closer than the model's own runs do");
    } else {
      absl::StrAppendFormat(&text,
                            ", and none comes clearly closer: %s lowers chi-squared to %.0f %%, "
                            "clearly is below %.0f %%",
                            closest->first, 100 * share, 100 * kClearlyCloser);
    }
  }
  return text;
}

// Of an adequate fit that does not explain.
std::string Verdict::WhyNotBetter(const WarmFit& fit) const {
  if (WorseLeftOut(diagnosis_.left_out_error, fit.left_out_error)) {
    return absl::StrFormat("it misses data it was not fitted to by %.3g sd, %.3g without",
                           *fit.left_out_error, *diagnosis_.left_out_error);
  }
  if (fit.gain_p_value) {
    return absl::StrFormat("so much better is chance with p = %.2g, of the best of %d refits",
                           std::min(1.0, *fit.gain_p_value * static_cast<double>(fits_.size())),
                           static_cast<int>(fits_.size()));
  }
  return absl::StrFormat("its advantage is %.3g ± %.3g nats, two standard deviations are asked for",
                         fit.over_base.nats, fit.over_base.sd);
}

// Judged or not: the fit that comes closest, if it comes clearly closer than the base model.
std::string Verdict::Closest() const {
  std::string name;
  const auto base = inference::TestAdequacy(base_);
  if (!base.ok()) return name;
  double lowest = kClearlyCloser * base->chi2;
  for (const CandidateEffect& candidate : diagnosis_.candidates) {
    const WarmFit* fit = Find(candidate.effect);
    if (fit == nullptr || !fit->Judged() || candidate.refit_chi2 >= lowest) continue;
    name = candidate.effect;
    lowest = candidate.refit_chi2;
  }
  return name;
}

}  // namespace calib::diagnosis
