// An STL file, text or binary. The first byte: odd for a closed surface; "s" begins an open one of
// text and is part of it. A mesh that can be read is then the silo of a campaign.
#include <cmath>

#include "dem/geometry/mesh_interior.h"
#include "dem/geometry/mesh_rims.h"
#include "dem/geometry/stl_file.h"
#include "tests/fuzz/campaign_checks.h"
#include "tests/fuzz/fuzz_target.h"

namespace {

constexpr const char* kCampaign = R"(name: mesh
model:
  contact: hertz_mindlin
  density: 2500
  fixed: {young_modulus: 1e7, poisson_ratio: 0.25}
parameters:
  friction_coefficient: {prior: uniform, min: 0.2, max: 0.9}
experiments:
  - name: outlet
    test: silo_discharge
    meshes: {silo: {file: silo.stl, unit: mm}}
    packing: {generate: {particles: 200, radii: {mean: 2 mm, spread: 0.1}, seed: 4}}
    data: {file: silo.csv, units: {opening: mm}}
    control: opening
    observables: {mass_flow_rate: {noise: {relative: 0.05}}}
inference: {samples: 10}
)";

}  // namespace

// NOLINTNEXTLINE(readability-identifier-naming)
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace calib;
  if (size == 0) {
    return 0;
  }
  const bool plain = data[0] == 's';
  const bool closed = !plain && data[0] % 2 == 1;
  const std::string content = plain ? fuzz::TextOf(data, size) : fuzz::TextOf(data + 1, size - 1);
  std::vector<dem::StlProblem> problems;
  const dem::TriangleMesh mesh = dem::ParseStl(content, 1e-3, closed, problems);
  for (const dem::StlProblem& problem : problems) {
    fuzz::Expect(!problem.message.empty() && problem.line >= 0, "a problem says what and where");
  }
  fuzz::last_was_good = problems.empty();
  if (!problems.empty()) {
    return 0;
  }
  const int vertices = static_cast<int>(mesh.vertex.size());
  fuzz::Expect(mesh.size() > 0, "a mesh has triangles");
  for (const auto& triangle : mesh.triangle) {
    for (const int corner : triangle) {
      fuzz::Expect(corner >= 0 && corner < vertices, "corners are vertices");
    }
  }
  for (const dem::Vec3& vertex : mesh.vertex) {
    fuzz::Expect(std::isfinite(vertex.x) && std::isfinite(vertex.y) && std::isfinite(vertex.z),
                 "vertices are finite");
  }
  fuzz::Expect(dem::MeshProblems(mesh, closed).empty(), "a mesh that was read has no problem");
  const dem::Bounds box = dem::BoundsOf(mesh);
  fuzz::Expect(!dem::MeshInterior(mesh).Holds(box.high, 1e-3),
               "a corner of the box of a mesh has no room for a sphere");
  if (!closed) {
    dem::FunnelProblem(mesh);
    if (dem::SlideProblem(mesh).empty()) dem::SlideProblemAcross(mesh, 0.01);
  }
  fuzz::Expect(dem::PlacesOf(mesh).size() == mesh.vertex.size(), "every vertex has a place");
  if (!closed) fuzz::ReadAndCheck(kCampaign, {{"silo.stl", content}});
  return 0;
}
