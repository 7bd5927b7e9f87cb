#include "server/campaign/file/read_meshes.h"

#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "dem/geometry/stl_file.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/model/sha256.h"

namespace calib::campaign {
namespace {

std::optional<MeshFile> ReadMesh(MapReader& map, ReadContext& context) {
  const auto path = map.RequiredText("file", "the STL file of the mesh");
  const auto unit = map.RequiredText("unit", "an STL file does not say its unit, e.g. mm");
  map.Finish();
  std::optional<double> scale;
  if (unit) {
    const auto parsed = ParseQuantity(absl::StrCat("1 ", *unit), "m");
    if (parsed.ok()) {
      scale = *parsed;
    } else {
      map.Problem("unit", std::string(parsed.status().message()));
    }
  }
  const std::string* content = path ? context.ReadNamedFile(map, "file", *path) : nullptr;
  if (content == nullptr || !scale) return std::nullopt;
  std::vector<dem::StlProblem> found;
  MeshFile file{.path = *path,
                .digest = Sha256Hex(*content),
                .scale = *scale,
                .mesh = dem::ParseStl(*content, *scale, false, found)};
  for (const dem::StlProblem& problem : found) {
    context.problems().AddIn(*path, problem.line, "", problem.message);
  }
  if (!found.empty()) return std::nullopt;
  return file;
}

}  // namespace

std::map<std::string, MeshFile> ReadMeshes(MapReader& experiment, const dem::TestInfo& test,
                                           ReadContext& context) {
  std::map<std::string, MeshFile> meshes;
  if (!experiment.Has("meshes")) {
    experiment.Ignore({"meshes"});
    return meshes;
  }
  std::vector<std::string> pieces;
  for (const dem::MeshInfo& info : test.meshes) pieces.push_back(info.name);
  if (pieces.empty()) {
    experiment.Ignore({"meshes"});
    experiment.Problem(
        "meshes", absl::StrCat(test.name, " has no piece that a mesh can replace; ", "remove it"));
    return meshes;
  }
  auto map = experiment.Map("meshes");
  if (!map) return meshes;
  for (const std::string& name : map->Keys()) {
    bool known = false;
    for (const std::string& piece : pieces) known = known || piece == name;
    if (!known) {
      map->Ignore({name});
      map->Problem(name, absl::StrCat("is no piece of ", test.name,
                                      " that a mesh can replace; there is ", Listed(pieces)));
      continue;
    }
    if (auto piece = map->Map(name)) {
      if (auto mesh = ReadMesh(*piece, context)) meshes.emplace(name, *std::move(mesh));
    }
  }
  map->Finish();
  return meshes;
}

}  // namespace calib::campaign
