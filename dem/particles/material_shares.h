#pragma once
// A mixture of grains by shares of their number.

#include <cstdint>
#include <map>
#include <string>

#include "dem/particles/packing.h"

namespace calib::dem {

/// Gives each material its share of the number of grains, rounded, drawn among them; the other
/// grains are of the model's own material. The same seed and number of grains give the same draw.
/// Preconditions: shares are positive and at most 1 in all.
void DrawMaterials(const std::map<std::string, double>& shares, std::uint64_t seed,
                   Packing& packing);

}  // namespace calib::dem
