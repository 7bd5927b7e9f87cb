#include "dem/geometry/stl_file.h"

#include <cstdint>
#include <cstring>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace calib::dem {
namespace {

// Bytes of the header and of each triangle of a binary STL file, as the format has them.
constexpr std::size_t kHeader = 80;
constexpr std::size_t kPerTriangle = 50;

/// Little-endian whatever the machine.
std::uint32_t Word(const std::string& content, std::size_t at) {
  std::uint32_t word = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    word |= static_cast<std::uint32_t>(static_cast<unsigned char>(content[at + k])) << (8 * k);
  }
  return word;
}

double Real(const std::string& content, std::size_t at) {
  const std::uint32_t word = Word(content, at);
  float value = 0;
  std::memcpy(&value, &word, sizeof value);
  return static_cast<double>(value);
}

void AddTriangle(TriangleMesh& mesh) {
  const int n = static_cast<int>(mesh.vertex.size());
  mesh.triangle.push_back({n - 3, n - 2, n - 1});
}

TriangleMesh ParseBinary(const std::string& content, double scale) {
  TriangleMesh mesh;
  const std::size_t count = Word(content, kHeader);
  for (std::size_t t = 0; t < count; ++t) {
    const std::size_t at = kHeader + 4 + t * kPerTriangle + 12;  // behind the normal
    for (std::size_t v = 0; v < 3; ++v) {
      const std::size_t p = at + 12 * v;
      mesh.vertex.push_back(
          {scale * Real(content, p), scale * Real(content, p + 4), scale * Real(content, p + 8)});
    }
    AddTriangle(mesh);
  }
  return mesh;
}

TriangleMesh ParseText(const std::string& content, double scale,
                       std::vector<StlProblem>& problems) {
  TriangleMesh mesh;
  int line_number = 0;
  int corners = 0;
  bool ended = false;  // by an endsolid that nothing follows
  for (const auto line : absl::StrSplit(content, '\n')) {
    ++line_number;
    const std::vector<std::string> words =
        absl::StrSplit(absl::StripAsciiWhitespace(line), absl::ByAnyChar(" \t"), absl::SkipEmpty());
    if (words.empty()) {
      continue;
    }
    const std::string word = absl::AsciiStrToLower(words[0]);
    ended = word == "endsolid";
    if (word == "vertex") {
      Vec3 v;
      if (words.size() != 4 || !absl::SimpleAtod(words[1], &v.x) ||
          !absl::SimpleAtod(words[2], &v.y) || !absl::SimpleAtod(words[3], &v.z)) {
        problems.push_back({line_number, "a vertex line is: vertex x y z, with three numbers"});
        return mesh;
      }
      mesh.vertex.push_back(scale * v);
      ++corners;
    } else if (word == "endloop") {
      if (corners != 3) {
        problems.push_back(
            {line_number, absl::StrCat("a facet has ", corners, " vertices, it needs three")});
        return mesh;
      }
      AddTriangle(mesh);
      corners = 0;
    } else if (word != "solid" && word != "facet" && word != "outer" && word != "endfacet" &&
               word != "endsolid") {
      problems.push_back({line_number, absl::StrCat("\"", words[0], "\" is not a word of STL")});
      return mesh;
    }
  }
  if (corners != 0) {
    problems.push_back({line_number, "the file ends within a facet"});
  } else if (!ended) {
    problems.push_back({line_number,
                        "the file ends without endsolid after its last facet: it was cut off, or "
                        "its last line is missing"});
  }
  return mesh;
}

}  // namespace

TriangleMesh ParseStl(const std::string& content, double scale, bool closed,
                      std::vector<StlProblem>& problems) {
  const std::size_t before = problems.size();
  const bool long_enough = content.size() >= kHeader + 4;
  const std::size_t announced =
      long_enough ? kHeader + 4 + kPerTriangle * std::size_t{Word(content, kHeader)} : 0;
  TriangleMesh mesh;
  if (long_enough && announced == content.size()) {
    mesh = ParseBinary(content, scale);
  } else if (absl::StartsWith(absl::AsciiStrToLower(content.substr(0, 5)), "solid")) {
    mesh = ParseText(content, scale, problems);
  } else {
    problems.push_back(
        {0, long_enough ? absl::StrCat("is neither text STL (it does not begin with "
                                       "\"solid\") nor binary STL: its count announces ",
                                       announced, " bytes, the file has ", content.size())
                        : absl::StrCat("is no STL file: it has ", content.size(), " bytes")});
  }
  if (problems.size() == before) {
    for (std::string& problem : MeshProblems(mesh, closed)) {
      problems.push_back({0, std::move(problem)});
    }
  }
  return mesh;
}

}  // namespace calib::dem
