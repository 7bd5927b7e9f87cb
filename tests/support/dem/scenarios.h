#pragma once
// Scenarios and specimens that several tests of the engine start from.

#include <map>
#include <string>
#include <vector>

#include "dem/dynamics/contact_model.h"
#include "dem/model/scenario.h"
#include "dem/model/state.h"

namespace calib::dem::test {

/// A Hertz-Mindlin model: E 0.8 GPa, nu 0.2, mu 0.55, density scaled by 1000.
Model HertzModel();

/// Linear contacts: E 0.12 GPa, ks/kn 0.6, mu 0.5, density scaled by 1000.
Model LinearModel();

/// A loose random packing of `particles` grains of about 1 mm at 10 kPa, made once per process.
const Packing& SmallPacking(int particles = 60);

/// Drained triaxial test on SmallPacking at 0.2 MPa to 1 % axial strain, a load step every 0.5 %.
Scenario SmallTriaxial(const Model& model);

/// The scenario with one effect more; values: its parameters without their prefix.
Scenario With(Scenario scenario, const std::string& effect,
              const std::map<std::string, double>& values);

/// Runs and collects the states; fails the calling test when the run is an error.
struct Run {
  Summary summary;
  std::vector<State> states;
};
Run RunAll(const Scenario& scenario);

/// Two spheres of radius r with centres `distance` apart along the unit vector n in a cell of 100
/// r.
Packing TwoSpheres(double r, double distance, const double n[3]);

/// Mean acceleration down a slope of a grain of 5 mm that starts at rest on a plane of the
/// material, over 0.05 s [m/s^2]; gravity 9.81, angle [rad]. NaN: the flow failed.
double AccelerationDownASlope(const Model& model, const std::string& material, double angle);

/// File as text; empty when it cannot be read.
std::string ReadFile(const std::string& path);

/// Packing from a file; aborts with its problems.
Packing LoadPacking(const std::string& path);

}  // namespace calib::dem::test
