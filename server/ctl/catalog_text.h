#pragma once
// The parameters of contacts, effects and tests as tables.

#include <string>
#include <vector>

#include "dem/registry/catalog.h"

namespace calib::ctl {

/// "  young_modulus  Pa  10000 .. 1e+13  log_uniform 100 MPa .. 100 GPa", one line each, then what
/// each is, and of those that have one the default prior in units of its reference scale. A default
/// of 0 that lets the test choose reads "chosen".
std::string ParameterTable(const std::vector<dem::ParameterInfo>& parameters);

/// The scale as a product of p, d and E: "0.01 p^-1"; of a plain number only that.
std::string ScaleText(const dem::ReferenceScale& scale);

/// An effect or a test with all that the catalogue says of it, in lines of at most 100 columns.
std::string EffectText(const dem::EffectInfo& effect);
std::string TestText(const dem::TestInfo& test);

}  // namespace calib::ctl
