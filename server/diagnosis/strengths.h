#pragma once
// Strengths of effects as people read them: units, and whether the catalogue admits them.

#include <map>
#include <string>

#include "dem/registry/catalog.h"

namespace calib::diagnosis {

/// SI units of the parameters of an effect under a contact law, by dotted name.
std::map<std::string, std::string> UnitsOf(const dem::EffectInfo& effect,
                                           const std::string& contact);

/// Why a strength (dotted name -> SI value) is none that the effect can have, in a clause; empty:
/// it is one. Names that are not the effect's are passed over.
std::string WhyNotAdmissible(const dem::EffectInfo& effect, const std::string& contact,
                             const std::map<std::string, double>& strength);

/// Why a strength lies beyond the priors with which an extension would look for it, in a clause;
/// empty: within. Names without a prior are passed over.
std::string WhyBeyondPrior(const std::map<std::string, dem::DefaultPrior>& priors,
                           const dem::EffectInfo& effect, const std::string& contact,
                           const std::map<std::string, double>& strength);

}  // namespace calib::diagnosis
