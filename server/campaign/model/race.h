#pragma once
// The race of a design: effects that each of its runs may have or lack, and numerics that a run may
// change, by the values of its parameters. An effect whose calibrated ray parameters all stand at
// their null is not in the run: not in the model, and none of its parameters is. So equal runs of a
// base, its design and its extensions are equal scenarios. Pure.

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Prefix of the parameters by which a design changes how staged tests are walked: factors on what
/// the engine takes for an experiment (dem::ResolveStaging), null 1, from 0.01 to 100.
/// numerics.rate: on the rate. numerics.step: on the step. numerics.damping: on the damping while
/// straining; where the product would pass 0.9 it is divided by the factor. Tests that are not read
/// at rest are left alone.
inline constexpr const char* kNumerics = "numerics";
/// The entry of such a parameter by its dotted name; nullptr: it is none.
const dem::ParameterInfo* FindNumerics(const std::string& name);
/// Whether a design changes by this parameter how the runs of the campaign are made: one of the
/// above or, where a program is the model, numerics.NAME of what that declares.
bool IsNumerics(const Campaign& campaign, const std::string& name);
/// What a program is told of its numerics: each at its null, or as the values of a design change
/// it.
std::map<std::string, double> NumericsOf(const Campaign& campaign, std::span<const double> values);

/// The effect that a dotted parameter name is of: X of "X.friction" and of "A-B.X.friction"; "" of
/// a plain name, and of a name with a label.
std::string EffectNamedIn(const std::string& parameter);

/// The model with all effects of the race: whose parameters a campaign may calibrate. It cannot run
/// where they exclude each other.
dem::Model ModelWithRace(const Campaign& campaign);

/// The value at which a parameter of the race or of the numerics changes nothing; empty: it has
/// none, or belongs to neither.
std::optional<double> NullOf(const Campaign& campaign, const std::string& parameter);

/// Names of the effect's parameters that turn it up from nothing and are calibrated, dotted.
std::vector<std::string> StrengthsOf(const Campaign& campaign, const std::string& effect);

/// Effects of the race that are in a run, in the order of the race. values: in the order of
/// Campaign::parameters.
std::vector<std::string> ActiveEffects(const Campaign& campaign, std::span<const double> values);

/// Contact law, effects and parameters of a run of an experiment. values: likewise.
dem::Model ModelOf(const Campaign& campaign, const Experiment& experiment,
                   std::span<const double> values);

/// Applies what a run's values say of the numerics to the scenario of an experiment that has
/// everything else but its packing.
void ChangeNumerics(const Campaign& campaign, const Experiment& experiment, const RunOf& run,
                    dem::Scenario& scenario);

/// Why these effects cannot join the model in one run, in a sentence; empty: they can.
std::string WhyNotTogether(const Campaign& campaign, const std::vector<std::string>& effects);

/// Why a design cannot run these values, in a sentence; empty: it can. They are finite, each within
/// its prior or at its null, what ties them holds, and their effects go together; of an effect that
/// is not in the run the other parameters may have any finite value.
std::string WhyNotRun(const Campaign& campaign, std::span<const double> values);

/// Medians of the priors, the race and the numerics at their null but for these effects.
std::vector<double> MiddleValues(const Campaign& campaign,
                                 const std::vector<std::string>& with = {});

}  // namespace calib::campaign
