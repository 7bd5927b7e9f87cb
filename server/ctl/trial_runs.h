#pragma once
// Two short runs whose answer is known: is what this node computes right, at the time steps that
// the engine chooses?

#include <string>

#include "dem/model/scenario.h"
#include "server/ctl/doctor.h"

namespace calib::ctl {

/// Two equal steel spheres, head-on and without friction.
struct TrialCollision {
  double radius = 0.01;           ///< [m]
  double speed = 1;               ///< [m/s]
  double young_modulus = 2.1e11;  ///< [Pa]
  double poisson_ratio = 0.3;
  double density = 7800;  ///< [kg/m^3]
  /// By Hertz' theory (Johnson 1985, sec. 11.4) the largest overlap [m] and how long the bodies
  /// touch [s].
  double PeakOverlap() const;
  double Duration() const;
};

/// The mean stress to which 64 grains are compressed [Pa].
double TrialStress();

/// Runs both by `program`, a calib-worker, in a folder of its own. Takes about a second.
TrialRuns MakeTrialRuns(const std::string& program);

}  // namespace calib::ctl
