// A packing of spheres turned into one of rigid clumps, as a file that campaigns can name.
#include <cstdint>
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
#include "calib/return_if_error.h"
#include "dem/simulate/packing_generator.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/option_list.h"
#include "server/ctl/verb.h"
#include "server/ctl/write_file.h"

namespace calib::ctl {
namespace {

struct PackOptions {
  std::string file;    ///< packing of single spheres
  std::string clumps;  ///< dumbbell:ASPECT or the file of a template
  std::string output;
  std::optional<std::uint64_t> seed{};  ///< of the orientations
};

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

void Declare(OptionList& list, PackOptions& options) {
  list.Text("FILE", options.file, "packing of single spheres").Required();
  list.Text("--clumps", options.clumps,
            "dumbbell:LENGTH/WIDTH, above 1 and at most 2, or a file with a sphere `x y z r` "
            "per line, in any unit")
      .Required();
  list.Text("-o,--output", options.output, "packing file").Required();
  list.WholeNumber("--seed", options.seed, "of the orientations [1]");
}

absl::StatusOr<int> Pack(const CommonOptions& common, const PackOptions& options) {
  const auto shape = ReadShape(options.clumps);
  if (!shape) return kBadInput;
  const auto text = ReadText(options.file);
  if (!text) return kBadInput;
  std::vector<dem::PackingProblem> problems;
  const dem::Packing spheres = dem::ParsePacking(*text, problems);
  if (Print(options.file, problems)) return kBadInput;
  const auto made = dem::MakeClumps(spheres, *shape, options.seed.value_or(1), 1, {});
  if (!made.ok()) {
    return absl::Status(made.status().code(),
                        absl::StrCat(options.file, ": ", std::string(made.status().message())));
  }
  RETURN_IF_ERROR(WriteFile(options.output, dem::FormatPacking(made->packing)));
  if (common.json) {
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
      spheres.x.size(), shape->spheres.size(), options.output, made->porosity,
      dem::PorosityOf(spheres), made->largest_overlap);
  return kDone;
}

}  // namespace

Verb PackVerb() {
  return MakeVerb<PackOptions>(
      {.name = "pack",
       .description =
           "A packing of spheres as one of rigid clumps: same volumes, porosity and cell",
       .example = "pack spheres.txt --clumps dumbbell:1.4 -o clumps.txt"},
      &Declare, &Pack);
}

}  // namespace calib::ctl
