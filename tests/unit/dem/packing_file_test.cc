#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stop_token>

#include "dem/neighbor/packing_overlap.h"
#include "dem/particles/packing.h"
#include "dem/simulate/packing_generator.h"

namespace calib::dem {
namespace {

using testing::HasSubstr;

std::vector<PackingProblem> ProblemsOf(const std::string& text) {
  std::vector<PackingProblem> problems;
  ParsePacking(text, problems);
  return problems;
}

TEST(PackingFile, ReadsCommentsBlankLinesAndClumps) {
  std::vector<PackingProblem> problems;
  const Packing p = ParsePacking(
      "##PERIODIC:: 1 2 3\n# x y z r clump\n\n0.1 0.2 0.3 0.05 -1\n  0.5\t1.5 2.5 0.1 7\r\n",
      problems);
  ASSERT_TRUE(problems.empty()) << problems[0].message;
  EXPECT_EQ(p.length[2], 3);
  EXPECT_THAT(p.x, testing::ElementsAre(0.1, 0.5));
  EXPECT_THAT(p.clump, testing::ElementsAre(-1, 7));
}

TEST(PackingFile, AByteOrderMarkBeforeTheHeaderIsSkipped) {
  std::vector<PackingProblem> problems;
  const Packing packing = ParsePacking(
      "\xEF\xBB\xBF##PERIODIC:: 1 2 3\n0.1 0.2 0.3 0.05 -1\n0.5 1.5 2.5 0.1 7\n", problems);
  EXPECT_TRUE(problems.empty());
  EXPECT_EQ(packing.x.size(), 2U);
}

TEST(DeepOverlap, TellsTheDeepestPairAndHowManyThereAre) {
  Packing p{.length = {1, 1, 1},
            .x = {0.02, 0.98, 0.5, 0.5, 0.5},
            .y = {0.5, 0.5, 0.2, 0.2, 0.2},
            .z = {0.5, 0.5, 0.1, 0.18, 0.5},
            .radius = {0.1, 0.1, 0.05, 0.05, 0.05},
            .clump = {-1, -1, -1, -1, -1}};
  const auto found = DeepOverlap(p);  // 0 and 1 across the face x; 2 and 3 touch less deeply
  ASSERT_TRUE(found);
  EXPECT_EQ(found->first, 0);
  EXPECT_EQ(found->second, 1);
  EXPECT_NEAR(found->overlap, 0.16, 1e-12);
  EXPECT_EQ(found->pairs, 1);
  p.z[3] = 0.12;
  EXPECT_EQ(DeepOverlap(p)->pairs, 2);
  p.clump = {4, 4, 5, 5, -1};
  EXPECT_FALSE(DeepOverlap(p));  // spheres of one clump may
}

TEST(PackingFile, EveryProblemHasItsLine) {
  const auto problems = ProblemsOf(
      "##PERIODIC:: 1 1 1\n0.1 0.1 0.1 0.05 -1\n0.1 0.1 x 0.05 -1\n0.1 0.1 0.1\n0.1 0.1 0.1 -2 -1\n"
      "0.1 0.1 0.1 0.3 -1\n9 0.1 0.1 0.05 -1\n0.1 0.1 0.1 0.05 -3\n0.1 0.1 nan 0.05 -1\n");
  ASSERT_EQ(problems.size(), 7U);
  for (int k = 0; k < 7; ++k) {
    EXPECT_EQ(problems[k].line, k + 3) << problems[k].message;
  }
  EXPECT_THAT(problems[0].message, HasSubstr("z is \"x\""));
  EXPECT_THAT(problems[3].message, HasSubstr("too large"));
  EXPECT_THAT(problems[4].message, HasSubstr("outside"));
}

TEST(PackingFile, NeedsItsHeaderFirst) {
  EXPECT_EQ(ProblemsOf("0.1 0.1 0.1 0.05 -1\n").at(0).line, 1);
  EXPECT_EQ(ProblemsOf("##PERIODIC:: 1 1\n").at(0).line, 1);
  EXPECT_EQ(ProblemsOf("##PERIODIC:: 1 -1 1\n").at(0).line, 1);
  EXPECT_EQ(ProblemsOf("").at(0).line, 0);
  EXPECT_EQ(ProblemsOf("##PERIODIC:: 1 1 1\n").at(0).line, 0);
}

// Their volumes are no numbers, and no grid can be laid over them.
TEST(PackingFile, LengthsThatNoSpecimenHasAreRefused) {
  const std::string cell = "##PERIODIC:: 1 1 1\n";
  for (const char* lengths : {"1e-120 1e-120 1e-120", "1e200 1e200 1e200", "1e300 1 1"}) {
    EXPECT_THAT(ProblemsOf(std::string("##PERIODIC:: ") + lengths + "\n").at(0).message,
                HasSubstr("needs three lengths Lx Ly Lz from 1e-09 to 1e+06 [m]"));
  }
  EXPECT_EQ(ProblemsOf(cell + "0.1 0.1 0.1 1e-300 -1\n").at(0).message,
            "radius is 1e-300, it must be 1e-09 m or more");
}

TEST(PackingFile, WritesWhatItReads) {
  Packing p;
  p.length[0] = 1.0 / 3;
  p.length[1] = 1;
  p.length[2] = 2;
  p.x = {0.1, 0.2 / 3};
  p.y = {0.1, 0.7};
  p.z = {0.3, 1.1};
  p.radius = {0.01, 0.1 / 7};
  p.clump = {-1, 4};
  std::vector<PackingProblem> problems;
  const Packing q = ParsePacking(FormatPacking(p), problems);
  EXPECT_TRUE(problems.empty());
  EXPECT_EQ(q.length[0], p.length[0]);
  EXPECT_EQ(q.x, p.x);
  EXPECT_EQ(q.radius, p.radius);
  EXPECT_EQ(q.clump, p.clump);
}

TEST(GeneratePacking, RefusesImpossibleRecipes) {
  const auto packing =
      GeneratePacking({.particles = 5, .porosity = 0.65, .radius_spread = 1}, 1, {});
  EXPECT_EQ(packing.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(
      std::string(packing.status().message()),
      testing::AllOf(HasSubstr("particles"), HasSubstr("porosity"), HasSubstr("radius_spread")));
}

TEST(GeneratePacking, StopsWhenAsked) {
  std::stop_source source;
  source.request_stop();
  EXPECT_EQ(GeneratePacking({.particles = 50}, 1, source.get_token()).status().code(),
            absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace calib::dem
