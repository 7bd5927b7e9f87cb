#include "server/campaign/read_specimen.h"

#include <algorithm>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "dem/neighbor/packing_overlap.h"
#include "dem/particles/packing.h"
#include "server/campaign/sha256.h"
#include "server/campaign/suggestion.h"

namespace calib::campaign {
namespace {

constexpr int kMostRealizations = 1000;
constexpr int kFewestGrains = 20;
constexpr std::size_t kMostProblems = 10;
constexpr Range kPorosity{.min = 0.2, .max = 0.6, .min_open = true, .max_open = true};

// Number of the line on which a grain stands.
int LineOfGrain(const std::string& text, int grain) {
  std::istringstream lines(text);
  std::string line;
  int number = 0;
  for (int seen = -1; seen < grain && std::getline(lines, line); ++number) {
    const std::size_t begin = line.find_first_not_of(" \t\r");
    const bool holds_grain = begin != std::string::npos && line[begin] != '#' && number > 0;
    seen += holds_grain ? 1 : 0;
  }
  return number;
}

// False after the problem.
bool CheckOverlaps(const PackingFile& file, const std::string& text, ReadContext& context) {
  const auto found = dem::DeepOverlap(file.packing);
  if (!found) return true;
  const int others = found->pairs - 1;
  context.problems().AddIn(
      file.path, LineOfGrain(text, found->second), "",
      absl::StrCat("overlaps the grain of line ", LineOfGrain(text, found->first), " by ",
                   found->overlap, " m, more than half the smaller radius",
                   others == 0   ? ""
                   : others == 1 ? ", as another pair does too"
                                 : absl::StrCat(", as ", others, " other pairs do too")));
  return false;
}

std::optional<Specimen> ReadFile(const MapReader& packing, const std::string& key,
                                 const std::string& path, bool poured, ReadContext& context) {
  const std::string* text = context.ReadNamedFile(packing, key, path);
  if (text == nullptr) return std::nullopt;
  std::vector<dem::PackingProblem> found;
  PackingFile file{
      .path = path, .digest = Sha256Hex(*text), .packing = dem::ParsePacking(*text, found)};
  for (std::size_t i = 0; i < std::min(found.size(), kMostProblems); ++i) {
    context.problems().AddIn(path, found[i].line, "", found[i].message);
  }
  if (found.size() > kMostProblems) {
    context.problems().AddIn(path, 0, "",
                             absl::StrCat("has ", found.size() - kMostProblems, " more problems"));
  }
  if (!found.empty()) return std::nullopt;
  if (!context.is_new()) return file;
  if (static_cast<int>(file.packing.x.size()) < kFewestGrains) {
    context.problems().AddIn(path, 0, "",
                             absl::StrCat("holds ", file.packing.x.size(), " grains, at least ",
                                          kFewestGrains, " are needed"));
    return std::nullopt;
  }
  if (!poured && !CheckOverlaps(file, *text, context)) return std::nullopt;
  return file;
}

std::optional<dem::PackingRecipe> ReadRecipe(MapReader& map, bool poured) {
  const std::size_t before = map.problems().size();
  dem::PackingRecipe recipe;
  recipe.particles = static_cast<int>(
      map.Integer("particles", kFewestGrains, 1'000'000).value_or(recipe.particles));
  const auto porosity = map.Quantity("porosity", "1", kPorosity);
  const auto void_ratio = map.Quantity(
      "void_ratio", "1", {.min = 0.25, .max = 1.5, .min_open = true, .max_open = true});
  if (poured) {
    for (const char* key : {"porosity", "void_ratio", "aspect", "pressure"}) {
      if (map.Has(key)) map.Problem(key, "has no meaning here: the test pours the grains itself");
    }
  } else if (map.Has("porosity") == map.Has("void_ratio")) {
    map.Problem("porosity", map.Has("porosity")
                                ? "and void_ratio say the same thing; give one of them"
                                : "is missing; give porosity or void_ratio");
  }
  if (porosity) recipe.porosity = *porosity;
  if (void_ratio) recipe.porosity = *void_ratio / (1 + *void_ratio);
  if (map.Require("radii", "e.g. {mean: 1 mm, spread: 0.3}") != nullptr) {
    if (auto radii = map.Map("radii")) {
      radii->Require("mean", "the mean radius of the grains, e.g. 1 mm");
      recipe.mean_radius = radii->Quantity("mean", "m", {.min = 0, .max = 10, .min_open = true})
                               .value_or(recipe.mean_radius);
      recipe.radius_spread = radii->Quantity("spread", "1", {.min = 0, .max = 1, .max_open = true})
                                 .value_or(recipe.radius_spread);
      radii->Finish();
    }
  }
  recipe.aspect = map.Quantity("aspect", "1", {.min = 0.2, .max = 5}).value_or(recipe.aspect);
  recipe.pressure =
      map.Quantity("pressure", "Pa", {.min = 0, .min_open = true}).value_or(recipe.pressure);
  recipe.seed = map.Seed("seed").value_or(recipe.seed);
  map.Finish();
  if (map.problems().size() > before) return std::nullopt;
  return recipe;
}

std::vector<Specimen> ReadFiles(MapReader& experiment, MapReader& packing, const std::string& key,
                                std::optional<std::int64_t> realizations, bool poured,
                                ReadContext& context) {
  std::vector<std::string> paths = packing.TextList(key).value_or(std::vector<std::string>{});
  if (paths.empty()) {
    packing.Problem(key, "names no file");
    return {};
  }
  if (realizations && *realizations > static_cast<std::int64_t>(paths.size())) {
    experiment.Problem(
        "realizations",
        absl::StrCat("is ", *realizations, ", but ",
                     paths.size() == 1 ? "one packing file is"
                                       : absl::StrCat(paths.size(), " packing files are"),
                     " given; name one file per realization in packing.files, or generate them"));
    return {};
  }
  if (realizations) paths.resize(static_cast<std::size_t>(*realizations));
  std::vector<Specimen> specimens;
  for (const std::string& path : paths) {
    if (auto specimen = ReadFile(packing, key, path, poured, context)) {
      specimens.push_back(*std::move(specimen));
    }
  }
  return specimens;
}

}  // namespace

std::vector<Specimen> ReadSpecimens(MapReader& experiment, bool poured, ReadContext& context) {
  const auto realizations = experiment.Integer("realizations", 1, kMostRealizations);
  if (experiment.Require("packing", "{file: ...}, {files: [...]} or {generate: {...}}") ==
      nullptr) {
    return {};
  }
  auto packing = experiment.Map("packing");
  if (!packing) return {};
  const int given = static_cast<int>(packing->Has("file")) +
                    static_cast<int>(packing->Has("files")) +
                    static_cast<int>(packing->Has("generate"));
  packing->Ignore({"file", "files", "generate"});
  packing->Finish();
  if (given != 1) {
    experiment.Problem("packing", "needs exactly one of file, files and generate");
    return {};
  }
  if (packing->Has("file"))
    return ReadFiles(experiment, *packing, "file", realizations, poured, context);
  if (packing->Has("files"))
    return ReadFiles(experiment, *packing, "files", realizations, poured, context);
  auto generate = packing->Map("generate");
  if (!generate) return {};
  auto recipe = ReadRecipe(*generate, poured);
  if (!recipe) return {};
  std::vector<Specimen> specimens;
  for (std::int64_t i = 0; i < realizations.value_or(1); ++i) {
    specimens.emplace_back(*recipe);
    ++recipe->seed;
  }
  return specimens;
}

}  // namespace calib::campaign
