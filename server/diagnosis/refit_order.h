#pragma once
// Which effects are refitted, and which refit the next batch of runs goes to.

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "dem/formula/user_effect.h"
#include "server/diagnosis/diagnosis.h"

namespace calib::diagnosis {

/// Two batches before a refit is judged: the first is blind, the second a first attempt.
inline constexpr int kLeastBatches = 2;

struct RefitOrder {
  struct Later {
    std::string effect{};
    bool hinted = false;  ///< the screen sees something of it
  };
  std::vector<std::string> first{};  ///< side by side
  std::vector<Later> later{};        ///< one after the other
  /// By effect, both ways: other laws of the same thing, and effects that the screen cannot tell
  /// from it.
  std::map<std::string, std::set<std::string>> alike{};
  /// rms error that the screen expects with an effect over that without, >= 0 (above 1: as 1): how
  /// close a refit may come yet. None: 1.
  std::map<std::string, double> promised{};
};

/// To begin with the first four by the screen, of several that are alike the first of them; then
/// the others by how much it expects of them, those for which another stands last. An effect of
/// which the screen sees nothing is worth a refit only where something is missing for certain: the
/// base model is not adequate. diagnosis: as screened, candidates by p value. level: of the tests.
RefitOrder OrderOfRefits(const Diagnosis& diagnosis, const std::vector<dem::UserEffect>& user,
                         double level);

/// How far a refit is.
struct RefitStanding {
  std::string effect{};
  double chi2 = 0;        ///< of the closest point so far, >= 0, may be infinite
  double batches = 0;     ///< that have been run, by their runs that came to an end: > 0
  bool stalled = false;   ///< several have brought nothing
  bool explains = false;  ///< the readings (WarmFit::Explains)
};

/// The effect that promises most: a batch more of a refit that does not explain the readings and
/// has not stalled, or the next of `later` that is not begun, if `may_begin`. Once three explain
/// the readings that are not alike, it has to be hinted at to be begun. One that is like an effect
/// that explains the readings is begun before anything else: it may do so better, and is named with
/// it in any case. Where there is none, a refit that explains them goes on, the closest last: it is
/// its rivals that are not known yet. None: all have stalled. base_chi2: of the model without any
/// of the effects, may be infinite.
std::optional<std::string> NextRefit(const RefitOrder& order,
                                     const std::vector<RefitStanding>& begun, double base_chi2,
                                     bool may_begin);

/// What orders the refits, the lowest first: the rms that is left to explain where the fit stands
/// or where the screen expects it to end, whichever is less, dearer with every batch that has been
/// made. Runs that diverge tell nothing of how close it comes. chi2, base: of the fit so far and of
/// the model without the effect, >= 0, may be infinite; promised: rms the screen expects over the
/// base model's, >= 0 (above 1: as 1).
double PriceOf(double chi2, double base, double promised, double batches);

}  // namespace calib::diagnosis
