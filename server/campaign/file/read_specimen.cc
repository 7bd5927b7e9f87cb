#include "server/campaign/file/read_specimen.h"

#include <algorithm>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "dem/neighbor/packing_overlap.h"
#include "dem/particles/packing.h"
#include "dem/particles/random_cloud.h"
#include "server/campaign/file/read_recipe.h"
#include "server/campaign/keys/bounds.h"
#include "server/campaign/model/sha256.h"

namespace calib::campaign {
namespace {

constexpr std::size_t kMostProblems = 10;

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

std::optional<PackingFile> ReadFile(const MapReader& packing, const std::string& key,
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

// Why no other packing can be made of a file's grains; empty: one can.
std::string NoOtherLike(const PackingFile& file) {
  for (const int clump : file.packing.clump) {
    if (clump >= 0) return absl::StrCat(file.path, " holds clumps, which are not thrown anew");
  }
  if (!file.packing.material.empty()) {
    return absl::StrCat(file.path,
                        " says which grains are of which material, which other packings would not "
                        "keep; give shares of the grains instead");
  }
  const dem::PackingRecipe recipe = dem::RecipeLike(file.packing);
  if (!kRecipePorosity.Contains(recipe.porosity) && !(recipe.porosity >= dem::kCloudPorosity)) {
    return absl::StrFormat(
        "the porosity of %s is %.3g, neither that of a packing (%s) nor that of a cloud (%.3g or "
        "more)",
        file.path, recipe.porosity, kRecipePorosity.Describe(), dem::kCloudPorosity);
  }
  for (const double ratio : {recipe.aspect, recipe.depth_ratio}) {
    if (!kRecipeAspect.Contains(ratio)) {
      return absl::StrFormat(
          "the cell of %s is %.3g times as wide in one direction as in another, and cells are made "
          "with a ratio %s",
          file.path, ratio, kRecipeAspect.Describe());
    }
  }
  return "";
}

// A test that pours takes the sizes alone.
PackingLike OtherLike(const PackingFile& file, std::int64_t realization, bool poured) {
  PackingLike like{
      .path = file.path, .digest = file.digest, .recipe = dem::RecipeLike(file.packing)};
  if (poured) {
    like.recipe = {.particles = like.recipe.particles,
                   .mean_radius = like.recipe.mean_radius,
                   .radius_spread = 0};
  }
  like.recipe.radii.clear();
  const std::string drawn = Sha256Hex(absl::StrCat(file.digest, " realization ", realization));
  like.recipe.seed = std::stoull(drawn.substr(0, 16), nullptr, 16);
  return like;
}

// Realizations beyond the files are other packings of the files' grains, of each in turn.
void AddOthers(const MapReader& experiment, std::int64_t realizations, bool poured,
               std::vector<Specimen>& specimens) {
  const std::size_t files = specimens.size();
  specimens.reserve(static_cast<std::size_t>(realizations));
  for (std::size_t i = files; i < static_cast<std::size_t>(realizations); ++i) {
    const auto& file = std::get<PackingFile>(specimens[i % files]);
    const std::string why_not = poured ? "" : NoOtherLike(file);
    if (!why_not.empty()) {
      experiment.Problem(
          "realizations",
          absl::StrCat(
              "is ", realizations, ", but ",
              files == 1 ? "one packing file is" : absl::StrCat(files, " packing files are"),
              " given, and ", why_not,
              "; name one file per realization in packing.files, or generate them"));
      return;
    }
    specimens.emplace_back(OtherLike(file, static_cast<std::int64_t>(i) + 1, poured));
  }
}

std::vector<Specimen> ReadFiles(MapReader& experiment, MapReader& packing, const std::string& key,
                                std::optional<std::int64_t> realizations, bool poured,
                                ReadContext& context) {
  std::vector<std::string> paths = packing.TextList(key).value_or(std::vector<std::string>{});
  if (paths.empty()) {
    packing.Problem(key, "names no file");
    return {};
  }
  const std::int64_t count = realizations.value_or(static_cast<std::int64_t>(paths.size()));
  paths.resize(std::min(paths.size(), static_cast<std::size_t>(count)));
  std::vector<Specimen> specimens;
  for (const std::string& path : paths) {
    if (auto specimen = ReadFile(packing, key, path, poured, context)) {
      specimens.push_back(*std::move(specimen));
    }
  }
  if (specimens.size() == paths.size()) AddOthers(experiment, count, poured, specimens);
  return specimens;
}

}  // namespace

std::vector<Specimen> ReadSpecimens(MapReader& experiment, bool poured, ReadContext& context) {
  const auto realizations = experiment.Integer("realizations");
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
