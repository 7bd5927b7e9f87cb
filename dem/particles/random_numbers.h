#pragma once
// Random numbers that depend on nothing but what they are asked for.

#include <Random123/philox.h>

#include <array>
#include <cstdint>

namespace calib::dem {

/// Three numbers in [0, 1): draw `draw` of grain `grain` for a purpose. Philox with key = seed,
/// counter = (purpose, grain, draw). Pure.
/// [Salmon et al. 2011]
inline std::array<double, 3> Uniform(std::uint64_t seed, std::uint32_t purpose, int grain,
                                     int draw) {
  const r123::Philox4x32::key_type key = {
      {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)}};
  const r123::Philox4x32::ctr_type counter = {
      {purpose, static_cast<std::uint32_t>(grain), static_cast<std::uint32_t>(draw), 0}};
  const auto bits = r123::Philox4x32()(counter, key);
  return {bits[0] / 4294967296.0, bits[1] / 4294967296.0, bits[2] / 4294967296.0};
}

/// Purposes of Uniform(), one number for each kind of draw. Two kinds share a number where no run
/// makes both: elongation and crushing happen in the periodic cell only, fill and order where
/// grains are poured.
inline constexpr std::uint32_t kRadiusDraw = 1;
inline constexpr std::uint32_t kPositionDraw = 2;
inline constexpr std::uint32_t kElongationDraw = 3;
inline constexpr std::uint32_t kFillDraw = 3;
inline constexpr std::uint32_t kCrushingDraw = 4;
inline constexpr std::uint32_t kOrderDraw = 4;
inline constexpr std::uint32_t kFeedDraw = 5;
inline constexpr std::uint32_t kMaterialDraw = 6;
inline constexpr std::uint32_t kOrientationDraw = 7;

}  // namespace calib::dem
