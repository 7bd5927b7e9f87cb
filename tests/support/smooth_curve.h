#pragma once
// A closed formula in place of the mechanics, for tests of what is around it.

#include <cmath>
#include <string>

#include "calib/v1/worker.pb.h"

namespace calib::testing {

/// What a run of young_modulus and friction_angle shows at a load step, from 0: a smooth curve.
/// packing_scatter: relative change from one packing file to another; repeat_scatter: the same by
/// digits of the modulus that no measurement knows; both times a number from -1 to 1.
inline double SmoothCurve(const v1::AttemptSpec& spec, int load_step, double packing_scatter,
                          double repeat_scatter) {
  const double stiffness = std::log(spec.parameters().at("young_modulus") / 5e7);
  const double friction = spec.parameters().at("friction_angle");
  const double packing =
      spec.packing_digest().empty()
          ? 0
          : std::stoi(spec.packing_digest().substr(0, 4), nullptr, 16) / 32768.0 - 1;
  const double repeat = 2 * std::fmod(1e9 * std::abs(stiffness), 1) - 1;
  return (1 + friction * 2 * (1 - std::exp(-0.3 * stiffness * (load_step + 1)))) *
         (1 + packing_scatter * packing + repeat_scatter * repeat);
}

}  // namespace calib::testing
