#pragma once
// Who takes part in a diagnosis: effects that may be missing, along which parameter each is turned
// up, how far, and who may not act together; and why the others do not take part. The one place
// where the diagnosis asks what an engine offers.

#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/diagnosis/design_runs.h"
#include "inference/prior/prior.h"
#include "server/campaign/file/derive.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// A parameter that shapes an effect and does not turn it up.
struct ShapeParameter {
  std::string name{};  ///< dotted
  inference::Prior prior{};
  double absent = 0;   ///< value where the effect is not in a run, SI
  bool whole = false;  ///< only whole numbers are admissible
};

/// An effect along one parameter that turns it up from nothing. An effect whose strengths act each
/// by itself (gain and offset of a load cell) has an entry for each.
struct RacingEffect {
  std::string name{};      ///< of the effect
  std::string family{};    ///< dem::EffectInfo::family
  std::string strength{};  ///< dotted name of the parameter
  double null = 0;         ///< its value without the effect, SI
  /// Two moderate distances from the null, the nearer first, SI; their sign is that of positive
  /// strengths.
  double near = 0, far = 0;
  /// Largest distances to the side of `near` and to the other, SI, >= 0; 0: none.
  double most = 0, most_other = 0;
  /// Whether the parameter itself ends there, and not merely its prior.
  bool ends = false, other_ends = false;
  /// power, two_sided, shapes as inference::DesignEffect.
  inference::DesignEffect design{};
  std::vector<ShapeParameter> shapes{};
};

/// A numerical choice that should not matter.
struct NumericalChoice {
  std::string name{};  ///< of a parameter of the design
  double null = 1, tried = 1;
};

/// K entries and what ties them.
struct Race {
  std::vector<std::string> base{};      ///< names of the parameters that the base calibrates, d
  std::vector<RacingEffect> effects{};  ///< K; entries of one effect stand together
  std::vector<std::pair<int, int>> excluded{};  ///< entries that may not act in one run
  std::vector<std::pair<int, int>> kin{};       ///< entries of different effects of one family
  std::vector<NumericalChoice> numerics{};
  /// Effects that do not take part, and why, in a clause.
  std::vector<std::pair<std::string, std::string>> not_excitable{};
  std::vector<std::string> left_out{};  ///< as asked for

  /// Names of effects, each once, in the order of the entries.
  std::vector<std::string> Names() const;
};

/// Why the calibrated experiments cannot show an effect, in a clause; empty: they can.
std::string WhyNotShown(const campaign::Campaign& campaign, const dem::EffectInfo& effect);

/// Who can join the model of a calibrated campaign and be seen in its fitted experiments. without:
/// effects that are left out as asked for. Where the runs were made elsewhere: effects that their
/// rows hold, the strengths that EffectsOnReadings calculates, without shapes, which it holds, and
/// no numerics; those of a program are the ones that it declares, tried one sd off. Errors:
/// FAILED_PRECONDITION with a sentence where nobody can.
absl::StatusOr<Race> RaceOf(const report::CampaignView& view,
                            const std::vector<std::string>& without);

/// The design of a race as a campaign derived from its base: parameters are uniform between their
/// ends, so that every row of the race is one of the design.
campaign::Derivation DesignOf(const report::CampaignView& view, const Race& race);

/// The same as the program holds it, for campaign::WhyNotRun: parameters in the order of
/// DesignRows::names().
campaign::Campaign CampaignOfDesign(const campaign::Campaign& base, const Race& race);

}  // namespace calib::diagnosis
