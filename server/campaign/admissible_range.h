#pragma once
// What a parameter of the catalogue may be, for whoever reads a number for it.

#include "dem/registry/catalog.h"
#include "server/campaign/map_reader.h"

namespace calib::campaign {

/// In the parameter's SI unit; infinite values are admissible where the catalogue has no bound.
inline Range AdmissibleRange(const dem::ParameterInfo& info) {
  return {.min = info.min, .max = info.max, .min_open = info.min_open, .infinite_allowed = true};
}

}  // namespace calib::campaign
