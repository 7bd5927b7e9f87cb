#include "dem/model/test_meshes.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/geometry/mesh_rims.h"
#include "dem/geometry/triangle_mesh.h"
#include "dem/geometry/vessel_gap.h"

namespace calib::dem {
namespace {

/// Longest mesh over the largest grain diameter [-]. Chosen: beyond it the unit is taken to be
/// wrong.
constexpr double kLongest = 1e4;
/// How far below the floor a mesh may reach over its height [-]. Chosen: files hold single
/// precision.
constexpr double kRounding = 1e-6;

std::string PiecesOf(const TestInfo& test) {
  if (test.meshes.empty()) {
    return "has no piece that a mesh can replace";
  }
  return absl::StrCat("lets a mesh replace: ",
                      absl::StrJoin(test.meshes, ", ", [](std::string* out, const MeshInfo& m) {
                        out->append(m.name);
                      }));
}

/// What only holds for the silo; its other walls stay.
void CheckSilo(const Scenario& scenario, std::vector<std::string>& problems) {
  for (const char* setting : {"flat", "silo_width"}) {
    const auto it = scenario.settings.find(setting);
    if (it != scenario.settings.end() && it->second != 0) {
      problems.push_back(absl::StrCat("mesh silo says how wide the silo is: ", setting,
                                      " has no meaning with it, remove it"));
    }
  }
}

}  // namespace

void CheckMeshes(const Scenario& scenario, const TestInfo& test,
                 std::vector<std::string>& problems) {
  for (const auto& [name, mesh] : scenario.meshes) {
    const std::string& wanted = name;
    if (std::none_of(test.meshes.begin(), test.meshes.end(),
                     [&](const MeshInfo& info) { return info.name == wanted; })) {
      problems.push_back(
          absl::StrCat("no piece \"", name, "\" in test ", test.name, ", which ", PiecesOf(test)));
      continue;
    }
    const auto found = MeshProblems(mesh, false);
    for (const std::string& problem : found) {
      problems.push_back(absl::StrCat("mesh ", name, ": ", problem));
    }
    if (!found.empty()) {
      continue;
    }
    const Bounds bounds = BoundsOf(mesh);
    if (!(bounds.high.z > 0)) {
      problems.push_back(absl::StrCat("mesh ", name, " lies below its origin (highest z ",
                                      bounds.high.z, " m): ", test.name, " wants it above"));
    } else if (name != "slide" && bounds.low.z < -kRounding * bounds.high.z) {
      problems.push_back(
          absl::StrCat("mesh ", name, " reaches down to z = ", bounds.low.z,
                       " m, below its origin, the middle of its outlet: move it up"));
    }
    for (const auto& [piece, find] :
         {std::pair("funnel", &FunnelProblem), std::pair("slide", &SlideProblem)}) {
      if (const std::string problem = name == piece ? find(mesh) : ""; !problem.empty()) {
        problems.push_back(absl::StrCat("mesh ", name, " ", problem));
      }
    }
    if (name == "silo") {
      const std::string problem = bounds.high.z > 0 ? VesselProblem(mesh) : "";
      if (!problem.empty()) {
        problems.push_back(absl::StrCat("mesh silo ", problem));
      }
      CheckSilo(scenario, problems);
    }
  }
}

std::string MeshSizeProblem(const Scenario& scenario, double largest_diameter) {
  for (const auto& [name, mesh] : scenario.meshes) {
    const Bounds bounds = BoundsOf(mesh);
    const Vec3 size = bounds.high - bounds.low;
    const double length = std::max({size.x, size.y, size.z});
    if (!(length >= largest_diameter && length <= kLongest * largest_diameter)) {
      return absl::StrCat("mesh ", name, " is ", length, " m long, the largest grain ",
                          largest_diameter, " m: is the mesh's unit right?");
    }
    if (name == "silo" && bounds.low.z > largest_diameter) {
      return absl::StrCat("mesh silo ends ", bounds.low.z,
                          " m above the floor, more than the "
                          "largest grain, ",
                          largest_diameter,
                          " m, which would leave below it: move it down to z = 0");
    }
  }
  return "";
}

}  // namespace calib::dem
