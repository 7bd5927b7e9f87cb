// Text form of a packing: reading with line-numbered problems, and writing.
#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "dem/particles/packing.h"

namespace calib::dem {
namespace {

constexpr const char* kHeader = "##PERIODIC::";
/// What the lengths of a cell may be, and a radius at least [m]: far beyond any laboratory, and
/// little enough that volumes and places counted in radii are numbers.
constexpr double kShortest = 1e-9;
constexpr double kLongest = 1e6;
constexpr const char* kByteOrderMark = "\xEF\xBB\xBF";  // of editors

std::vector<std::string> Fields(const std::string& line) {
  return absl::StrSplit(line, absl::ByAnyChar(" \t\r,"), absl::SkipEmpty());
}

bool Number(const std::string& field, double& value) {
  return absl::SimpleAtod(field, &value) && std::isfinite(value);
}

bool ParseHeader(const std::string& line, int number, Packing& packing,
                 std::vector<PackingProblem>& problems) {
  const std::vector<std::string> fields = Fields(line.substr(std::string(kHeader).size()));
  bool ok = fields.size() == 3;
  for (std::size_t a = 0; ok && a < 3; ++a) {
    ok = Number(fields[a], packing.length[a]) && packing.length[a] >= kShortest &&
         packing.length[a] <= kLongest;
  }
  if (!ok) {
    problems.push_back({number, absl::StrCat(kHeader, " needs three lengths Lx Ly Lz from ",
                                             kShortest, " to ", kLongest, " [m]")});
  }
  return ok;
}

void ParseGrain(const std::string& line, int number, Packing& packing,
                std::vector<PackingProblem>& problems) {
  const std::vector<std::string> fields = Fields(line);
  if (fields.size() != 5 && fields.size() != 6) {
    problems.push_back(
        {number, absl::StrCat("found ", fields.size(),
                              " fields, a grain has five: x y z r clump, or six: x y z r clump "
                              "material")});
    return;
  }
  static constexpr std::array<const char*, 4> kNames = {"x", "y", "z", "r"};
  std::array<double, 4> values{};
  for (std::size_t f = 0; f < 4; ++f) {
    if (!Number(fields[f], values[f])) {
      problems.push_back(
          {number, absl::StrCat(kNames[f], " is \"", fields[f], "\", not a number")});
      return;
    }
  }
  int clump = 0;
  if (!absl::SimpleAtoi(fields[4], &clump) || clump < -1) {
    problems.push_back(
        {number, absl::StrCat("clump is \"", fields[4],
                              "\", it must be -1 (single sphere) or the number of a clump")});
    return;
  }
  if (!(values[3] >= kShortest)) {
    problems.push_back(
        {number, absl::StrCat("radius is ", values[3], ", it must be ", kShortest, " m or more")});
    return;
  }
  for (std::size_t a = 0; a < 3; ++a) {
    const double length = packing.length[a];
    if (4 * values[3] >= length) {
      problems.push_back(
          {number, absl::StrCat("radius ", values[3], " is too large for a cell of ", length,
                                " m: the cell must be longer than two grains")});
      return;
    }
    if (values[a] < -0.5 * length ||
        values[a] > 1.5 * length) {  // published packings hold centres a diameter outside
      problems.push_back(
          {number, absl::StrCat(kNames[a], " = ", values[a], " is outside the cell [0, ", length,
                                "] by more than half its length")});
      return;
    }
  }
  packing.x.push_back(values[0]);
  packing.y.push_back(values[1]);
  packing.z.push_back(values[2]);
  packing.radius.push_back(values[3]);
  packing.clump.push_back(clump);
  if (fields.size() == 6) {
    packing.material.resize(packing.clump.size() - 1);
    packing.material.push_back(fields[5]);
  } else if (!packing.material.empty()) {
    packing.material.emplace_back();
  }
}

}  // namespace

Packing ParsePacking(const std::string& text, std::vector<PackingProblem>& problems) {
  Packing packing;
  const std::size_t before = problems.size();
  std::istringstream lines(text);
  std::string line;
  bool header = false;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (number == 1 && line.rfind(kByteOrderMark, 0) == 0) {
      line.erase(0, std::string(kByteOrderMark).size());
    }
    line = std::string(absl::StripAsciiWhitespace(line));
    if (line.rfind(kHeader, 0) == 0) {
      if (header) {
        problems.push_back({number, absl::StrCat("a second ", kHeader, " line")});
      } else if (!ParseHeader(line, number, packing, problems)) {
        return packing;
      }
      header = true;
    } else if (!line.empty() && line[0] != '#') {
      if (!header) {
        problems.push_back({number, absl::StrCat("the first line must be ", kHeader, " Lx Ly Lz")});
        return packing;
      }
      ParseGrain(line, number, packing, problems);
    }
  }
  if (packing.x.size() < 2 && problems.size() == before) {
    problems.push_back(
        {0, absl::StrCat("found ", packing.x.size(), " grains, a packing has at least two")});
  }
  return packing;
}

std::string FormatPacking(const Packing& packing) {
  std::string text = absl::StrFormat("%s %.17g %.17g %.17g\n", kHeader, packing.length[0],
                                     packing.length[1], packing.length[2]);
  for (std::size_t i = 0; i < packing.x.size(); ++i) {
    absl::StrAppendFormat(&text, "%.17g %.17g %.17g %.17g %d", packing.x[i], packing.y[i],
                          packing.z[i], packing.radius[i], packing.clump[i]);
    const bool named = !packing.material.empty() && !packing.material[i].empty();
    absl::StrAppend(&text, named ? " " : "", named ? packing.material[i] : "", "\n");
  }
  return text;
}

}  // namespace calib::dem
