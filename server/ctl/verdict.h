#pragma once
// What the warm fits say together: which effect explains the readings, whether another may as well,
// and whether that depends on the width of a prior.

#include <optional>
#include <string>

#include "server/ctl/diagnosis.h"
#include "server/ctl/warm_fits.h"

namespace calib::ctl {

class Verdict {
 public:
  /// diagnosis: with candidates, best first, and the base model judged. level: of the adequacy
  /// test. Both references must outlive it.
  Verdict(Diagnosis& diagnosis, WarmFits& fits, double level)
      : diagnosis_(diagnosis), fits_(fits), level_(level) {}

  /// Adequate, clearly better than the base model, and not worse on readings it was not fitted to.
  bool Explains(const CandidateEffect& candidate) const;

  /// How the fitted effects stand to the base model and to each other for three widths of the prior
  /// on their strength; looked at where one of them explains the readings.
  void WeighEvidence();

  /// Sets verdict, effect, best_partial and the group of the first candidate. base_fits: the model
  /// without any effect is adequate.
  void Conclude(bool base_fits);

 private:
  bool Excluded(const CandidateEffect& other, const CandidateEffect& first) const;
  bool IsFarOff(const CandidateEffect& other, const CandidateEffect& first) const;
  std::string Closest() const;

  Diagnosis& diagnosis_;
  WarmFits& fits_;
  double level_;
};

}  // namespace calib::ctl
