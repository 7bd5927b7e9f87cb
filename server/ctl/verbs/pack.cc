// A packing of spheres turned into one of rigid clumps, as a file that campaigns can name.
#include <fstream>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/strip.h"
#include "dem/simulation/shape_change.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/verbs.h"
#include "server/ctl/write_file.h"

namespace calib::ctl {
namespace {

constexpr const char* kDumbbell = "dumbbell:";

std::optional<std::string> ReadText(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    std::cerr << "calibctl: " << path << ": no such file\n";
    return std::nullopt;
  }
  return std::string(std::istreambuf_iterator<char>(file), {});
}

// Prints each with its file and line; whether there was any.
bool Print(const std::string& path, const std::vector<dem::PackingProblem>& problems) {
  for (const dem::PackingProblem& problem : problems) {
    std::cerr << path << (problem.line > 0 ? absl::StrCat(":", problem.line) : "") << ": "
              << problem.message << "\n";
  }
  return !problems.empty();
}

std::optional<dem::ClumpTemplate> ReadShape(const std::string& word) {
  if (word.starts_with(kDumbbell)) {
    double aspect = 0;
    const std::string number(absl::StripPrefix(word, kDumbbell));
    if (!absl::SimpleAtod(number, &aspect) || !(aspect > 1 && aspect <= 2)) {
      std::cerr << "calibctl: --clumps " << kDumbbell << " takes length over width, above 1 and at "
                << "most 2, where the two spheres just touch; found \"" << number << "\"\n";
      return std::nullopt;
    }
    return dem::DumbbellTemplate(aspect);
  }
  const auto text = ReadText(word);
  if (!text) return std::nullopt;
  std::vector<dem::PackingProblem> problems;
  dem::ClumpTemplate shape = dem::ParseClumpTemplate(*text, problems);
  if (Print(word, problems)) return std::nullopt;
  return shape;
}

}  // namespace

int Pack(const Arguments& arguments) {
  const auto shape = ReadShape(arguments.clumps);
  if (!shape) return kBadInput;
  const auto text = ReadText(arguments.file);
  if (!text) return kBadInput;
  std::vector<dem::PackingProblem> problems;
  const dem::Packing spheres = dem::ParsePacking(*text, problems);
  if (Print(arguments.file, problems)) return kBadInput;
  const auto made = dem::MakeClumps(spheres, *shape, arguments.seed.value_or(1), 1, {});
  if (!made.ok()) {
    return Fail(
        absl::Status(made.status().code(),
                     absl::StrCat(arguments.file, ": ", std::string(made.status().message()))));
  }
  if (auto written = WriteFile(arguments.output, dem::FormatPacking(made->packing));
      !written.ok()) {
    return Fail(written);
  }
  if (arguments.json) {
    const nlohmann::json answer = {{"clumps", spheres.x.size()},
                                   {"spheres", made->packing.x.size()},
                                   {"porosity", made->porosity},
                                   {"porosity_of_spheres", dem::PorosityOf(spheres)},
                                   {"largest_overlap", made->largest_overlap}};
    std::cout << answer.dump(2) << "\n";
    return kDone;
  }
  std::cout << absl::StrFormat(
      "%d clumps of %d spheres in %s: porosity %.4f (of the spheres %.4f), largest overlap of two "
      "clumps %.2g of a radius\n",
      spheres.x.size(), shape->spheres.size(), arguments.output, made->porosity,
      dem::PorosityOf(spheres), made->largest_overlap);
  return kDone;
}

}  // namespace calib::ctl
