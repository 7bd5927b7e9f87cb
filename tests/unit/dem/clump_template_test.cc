// Templates of clumps: reading, scaling to the volume of a sphere, the way from a sphere to them.
#include "dem/particles/clump_template.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

namespace calib::dem {
namespace {

using testing::HasSubstr;

constexpr double kUnitVolume = 4.0 / 3.0 * std::numbers::pi;

std::vector<PackingProblem> ProblemsOf(const std::string& text) {
  std::vector<PackingProblem> problems;
  ParseClumpTemplate(text, problems);
  return problems;
}

TEST(ClumpTemplate, IsScaledToTheVolumeOfASphereAboutTheOrigin) {
  std::vector<PackingProblem> problems;
  const ClumpTemplate row = ParseClumpTemplate(
      "# three in a row, in mm\n10 5 5 2\n\n14 5 5 2  # touches\n18,5,5,2\n", problems);
  ASSERT_TRUE(problems.empty()) << problems[0].message;
  ASSERT_EQ(row.spheres.size(), 3U);
  const double radius = std::cbrt(1.0 / 3.0);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(row.spheres[k].radius, radius, 1e-12);
    EXPECT_NEAR(row.spheres[k].centre[0], 2 * radius * (static_cast<double>(k) - 1), 1e-12);
    EXPECT_NEAR(row.spheres[k].centre[1], 0, 1e-12);
  }
  EXPECT_NEAR(ReachOf(row), 3 * radius, 1e-12);
}

TEST(ClumpTemplate, DumbbellHasItsAspectAndVolume) {
  for (const double aspect : {1.01, 1.4, 2.0}) {
    const ClumpTemplate shape = DumbbellTemplate(aspect);
    EXPECT_NEAR(MomentsOfUnion(shape.spheres).volume, kUnitVolume, 1e-9);
    EXPECT_NEAR(ReachOf(shape) / shape.spheres[0].radius, aspect, 1e-12);
  }
}

TEST(ClumpTemplate, KeepsItsVolumeOnTheWayFromASphere) {
  std::vector<PackingProblem> problems;
  const ClumpTemplate corner =
      ParseClumpTemplate("0 0 0 1\n1.5 0 0 0.8\n0 1.2 0 0.9\n0 0 1 0.5\n", problems);
  ASSERT_TRUE(problems.empty());
  for (const double share : {1e-3, 0.3, 0.7, 1.0}) {
    const ClumpTemplate shape = Between(corner, share);
    EXPECT_NEAR(MomentsOfUnion(shape.spheres).volume, kUnitVolume, 1e-9) << share;
    double mean = 0;
    for (const Sphere& sphere : shape.spheres) {
      mean += sphere.centre[0];
    }
    EXPECT_NEAR(mean, 0, 1e-12);
  }
  EXPECT_NEAR(ReachOf(Between(corner, 1e-3)), 1, 2e-3);
}

TEST(ClumpTemplate, SaysWhatIsWrongAndWhere) {
  const auto problems = ProblemsOf("0 0 0 1\n1 0 0\n1 0 x 1\n0 1 0 -2\n");
  ASSERT_EQ(problems.size(), 3U);
  EXPECT_EQ(problems[0].line, 2);
  EXPECT_THAT(problems[0].message, HasSubstr("\"1 0 0\" is not a sphere, four numbers: x y z r"));
  EXPECT_EQ(problems[1].line, 3);
  EXPECT_EQ(problems[2].line, 4);
  EXPECT_THAT(problems[2].message, HasSubstr("radius is -2"));
  EXPECT_THAT(ProblemsOf("0 0 0 1\n").at(0).message,
              HasSubstr("found 1 spheres, a clump has 2 to"));
  EXPECT_THAT(ProblemsOf("").at(0).message, HasSubstr("found 0 spheres"));
  const auto apart = ProblemsOf("0 0 0 1\n1 0 0 1\n9 0 0 1\n");
  ASSERT_EQ(apart.size(), 1U);
  EXPECT_EQ(apart[0].line, 3);
  EXPECT_THAT(apart[0].message, HasSubstr("apart"));
  EXPECT_THAT(ProblemsOf("0 0 0 1\n0.1 0 0 0.5\n").at(0).message,
              HasSubstr("the clump is a sphere"));
}

}  // namespace
}  // namespace calib::dem
