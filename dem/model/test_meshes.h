#pragma once
// Meshes that users put in place of pieces of a test's boundary.

#include <string>
#include <vector>

#include "dem/model/parameter.h"
#include "dem/model/scenario.h"

namespace calib::dem {

/// Adds what is wrong with the scenario's meshes whatever its grains are, one sentence each: a
/// piece that the test does not let be replaced, a surface with the problems of MeshProblems(),
/// settings that the mesh leaves without meaning, a place out of the frame that MeshInfo states.
void CheckMeshes(const Scenario& scenario, const TestInfo& test,
                 std::vector<std::string>& problems);

/// Why the scenario's meshes do not go with grains whose largest diameter is this [m] > 0, in a
/// sentence; empty: they do. A mesh is at least one, at most ten thousand largest diameters long:
/// beyond that it is taken to be in another unit of length. A silo stands on the floor, z = 0,
/// within a largest diameter.
std::string MeshSizeProblem(const Scenario& scenario, double largest_diameter);

}  // namespace calib::dem
