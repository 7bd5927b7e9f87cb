// STL in both forms, and what is refused.
#include "dem/geometry/stl_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "absl/strings/str_cat.h"

namespace calib::dem {
namespace {

using Triangle = std::array<Vec3, 3>;

std::vector<Triangle> Tetrahedron() {
  const Vec3 o{0, 0, 0};
  const Vec3 x{1, 0, 0};
  const Vec3 y{0, 1, 0};
  const Vec3 z{0, 0, 1};
  return {{o, y, x}, {o, x, z}, {o, z, y}, {x, y, z}};
}

std::string Text(const std::vector<Triangle>& triangles) {
  std::string text = "solid thing\n";
  for (const Triangle& t : triangles) {
    text += "facet normal 0 0 0\n outer loop\n";
    for (const Vec3& v : t) {
      absl::StrAppend(&text, "  vertex ", v.x, " ", v.y, " ", v.z, "\n");
    }
    text += " endloop\nendfacet\n";
  }
  return text + "endsolid thing\n";
}

std::string Binary(const std::vector<Triangle>& triangles) {
  std::string bytes(80, 's');
  const auto add = [&](std::uint32_t word) {
    for (int k = 0; k < 4; ++k) {
      bytes.push_back(static_cast<char>((word >> (8 * k)) & 0xFFU));
    }
  };
  const auto add_real = [&](double s) {
    const auto value = static_cast<float>(s);
    std::uint32_t word = 0;
    std::memcpy(&word, &value, sizeof word);
    add(word);
  };
  add(static_cast<std::uint32_t>(triangles.size()));
  for (const Triangle& t : triangles) {
    for (int k = 0; k < 3; ++k) add_real(0);
    for (const Vec3& v : t) {
      add_real(v.x);
      add_real(v.y);
      add_real(v.z);
    }
    bytes.append(2, '\0');
  }
  return bytes;
}

std::string FirstProblem(const std::string& content, bool closed) {
  std::vector<StlProblem> problems;
  ParseStl(content, 1, closed, problems);
  return problems.empty() ? "" : absl::StrCat(problems[0].line, ": ", problems[0].message);
}

TEST(StlFile, TextAndBinaryGiveTheSameMeshInMetres) {
  for (const std::string& content : {Text(Tetrahedron()), Binary(Tetrahedron())}) {
    std::vector<StlProblem> problems;
    const TriangleMesh mesh = ParseStl(content, 1e-3, true, problems);
    EXPECT_TRUE(problems.empty());
    ASSERT_EQ(mesh.size(), 4);
    EXPECT_DOUBLE_EQ(mesh.vertex[1].y, 1e-3);
  }
}

TEST(StlFile, HolesAreRefusedWhereTheSurfaceHasToBeClosed) {
  std::vector<Triangle> open = Tetrahedron();
  open.pop_back();
  EXPECT_THAT(FirstProblem(Text(open), true), testing::HasSubstr("has a hole"));
  EXPECT_EQ(FirstProblem(Text(open), false), "");
}

TEST(StlFile, DegenerateAndBranchingFacesAreRefused) {
  std::vector<Triangle> flat = Tetrahedron();
  flat.push_back({Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{2, 0, 0}});
  EXPECT_THAT(FirstProblem(Binary(flat), false), testing::HasSubstr("triangle 5 is degenerate"));
  std::vector<Triangle> fins = Tetrahedron();
  fins.push_back({Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{0, -1, 0}});
  EXPECT_THAT(FirstProblem(Binary(fins), false), testing::HasSubstr("belongs to 3 triangles"));
}

TEST(StlFile, WhatIsNoStlSaysWhy) {
  EXPECT_THAT(FirstProblem("", false), testing::HasSubstr("0 bytes"));
  EXPECT_THAT(FirstProblem(std::string(200, 'x'), false), testing::HasSubstr("announces"));
  EXPECT_THAT(FirstProblem(Binary(Tetrahedron()).substr(0, 180), false),
              testing::HasSubstr("announces 284 bytes, the file has 180"));
  EXPECT_EQ(FirstProblem("solid a\nfacet\nouter loop\nvertex 1 2\n", false),
            "4: a vertex line is: vertex x y z, with three numbers");
  EXPECT_THAT(FirstProblem("solid a\nvertex 1 2 3\nendloop\n", false),
              testing::HasSubstr("3: a facet has 1 vertices"));
  const std::string whole = Text(Tetrahedron());
  const std::size_t last = whole.rfind("facet normal");
  EXPECT_EQ(FirstProblem(whole.substr(0, last), false),
            "23: the file ends without endsolid after its last facet: it was cut off, or its last "
            "line is missing");
  EXPECT_EQ(FirstProblem(whole + whole.substr(0, last), false),
            "53: the file ends without endsolid after its last facet: it was cut off, or its last "
            "line is missing");
  EXPECT_EQ(FirstProblem("solid a\nendsolid a\n", false), "0: the mesh has no triangles");
  EXPECT_THAT(FirstProblem(Text({{Vec3{0, 0, 0}, Vec3{1e300 * 1e10, 0, 0}, Vec3{0, 1, 0}}}), false),
              testing::HasSubstr("not a finite number"));
}

}  // namespace
}  // namespace calib::dem
