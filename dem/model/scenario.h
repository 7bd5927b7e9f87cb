#pragma once
// One model evaluation: everything that determines its result. SI units, compression positive.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dem/geometry/triangle_mesh.h"
#include "dem/model/model.h"
#include "dem/particles/packing.h"

namespace calib::dem {

/// What is not of the model's own material. Grains of a packing may also name theirs themselves
/// (Packing::material).
struct MaterialUse {
  std::map<std::string, std::string> bodies{};  ///< by name: `walls` of tests under gravity (all of
                                                ///< them), `intruder` of shaken_box, `partner` of
                                                ///< collision, its wall included
  std::map<std::string, double> grains{};       ///< share of the number of grains, (0, 1] in all
  std::uint64_t seed = 0;  ///< of the draw of `grains`: the seed of the specimen
};

/// Friction during consolidation, restored before loading. At most one is set; none: the model's
/// own friction.
struct Consolidation {
  std::optional<double> friction_coefficient;  ///< tan(phi) [-] >= 0
  std::optional<double> porosity;  ///< friction is lowered until the specimen has this porosity [-]
};

/// Principal stresses that replace the isotropic start [Pa].
struct InitialStress {
  double axial = 0;
  double lateral = 0;
};

/// How a quasi-static path is walked. Unset fields are chosen by the engine from the model (and
/// said in the Summary): DEM curves depend on staging by percents at low pressure, so comparisons
/// with another code fix all of them.
struct Staging {
  std::optional<double> rate;  ///< axial strain rate while straining [1/s] > 0
  std::optional<double> step;  ///< largest axial strain between two settlings [-] > 0
  std::optional<double>
      damping_loading;  ///< local (Cundall) damping while straining [-], default 0.2
  std::optional<double> damping_settling;  ///< while settling [-], default 0.9
  std::optional<double>
      unbalanced;         ///< mean unbalanced force / mean contact force that ends a settling [-]
  bool adaptive = false;  ///< fewer steps to the same curve: strains up to eight times as fast as
                          ///< `rate` where forces stay balanced, and settles at readings only, with
                          ///< less damping, unless step and damping_settling say otherwise
};

/// One point of the control path. Points are visited in order; the control may go down again.
struct ControlPoint {
  double target =
      0;  ///< of the test's control (TestInfo::control): logarithmic axial strain from the end of
          ///< consolidation, compression positive [-], or mean stress [Pa] (isotropic)
  int load_step = -1;  ///< index of the state reported here; -1: a turning point without a reading
};

/// One model evaluation. The same scenario gives the same bits for any number of threads.
struct Scenario {
  Model model;
  std::string test;  ///< a name of Tests()
  std::map<std::string, double>
      settings;  ///< the test's settings by name, e.g. confining_pressure [Pa]
  Packing packing;
  std::map<std::string, TriangleMesh> meshes = {};  ///< by name of TestInfo::meshes, with the
                                                    ///< origin and axes that stand there [m]
  MaterialUse materials{};
  Consolidation consolidation;
  std::optional<InitialStress> initial_stress;
  std::optional<double> loading_rate;  ///< [1/s]: real-rate loading instead of staged quasi-static
  Staging staging;
  std::vector<ControlPoint> path;
  int threads = 1;         ///< >= 1; changes no result
  std::uint64_t seed = 0;  ///< for effects that draw random numbers
};

}  // namespace calib::dem
