#pragma once
// What the warm fits say together: which effect explains the readings, whether another may as well,
// and whether that depends on the width of a prior.

#include <map>
#include <string>

#include "inference/diagnosis/screen.h"
#include "server/diagnosis/diagnosis.h"
#include "server/diagnosis/warm_fit.h"

namespace calib::diagnosis {

class Verdict {
 public:
  /// diagnosis: with candidates, best first, and the base model judged. base: as the fits are
  /// judged. level: of the adequacy test. The references must outlive it.
  Verdict(Diagnosis& diagnosis, const std::map<std::string, WarmFit>& fits,
          const inference::FittedModel& base, double level)
      : diagnosis_(diagnosis), fits_(fits), base_(base), level_(level) {}

  /// Adequate, clearly better than the base model (or rid of nearly all the misfit of one that is
  /// wrong beyond doubt), and not worse on readings it was not fitted to.
  bool Explains(const CandidateEffect& candidate) const;

  /// Sets verdict, effect, best_partial, reason and the group of the first candidate. base_fits:
  /// the model without any effect is adequate.
  void Conclude(bool base_fits);

 private:
  const WarmFit* Find(const std::string& effect) const;
  bool Settles(const WarmFit& fit) const;
  bool Excluded(const CandidateEffect& other, const CandidateEffect& first) const;
  bool IsFarOff(const CandidateEffect& other, const CandidateEffect& first) const;
  static bool Ended(const WarmFit& fit);
  static bool PromisesLess(const CandidateEffect& other, const CandidateEffect& first);
  double Chi2OfDouble(const std::string& other, const CandidateEffect& first) const;
  std::string Closest() const;
  std::string WhyUnexplained() const;
  std::string WhyNotBetter(const WarmFit& fit) const;

  Diagnosis& diagnosis_;
  const std::map<std::string, WarmFit>& fits_;
  const inference::FittedModel& base_;
  double level_;
};

}  // namespace calib::diagnosis
