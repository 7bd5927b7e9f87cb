#include "inference/sampling/latin_hypercube.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "inference/filter/iterative_filter.h"

namespace calib::inference {
namespace {

// One point in each of n cells of every column.
void ExpectLatin(const Eigen::MatrixXd& points) {
  for (Eigen::Index j = 0; j < points.cols(); ++j) {
    std::set<int> cells;
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      EXPECT_GT(points(i, j), 0);
      EXPECT_LT(points(i, j), 1);
      cells.insert(static_cast<int>(points(i, j) * static_cast<double>(points.rows())));
    }
    EXPECT_EQ(cells.size(), static_cast<std::size_t>(points.rows())) << "column " << j;
  }
}

TEST(LatinHypercube, HasOnePointInEveryCell) {
  for (const bool centred : {true, false}) {
    for (const int n : {2, 7, 20}) {
      const auto points =
          LatinHypercube({.points = n, .dimensions = 3, .centred = centred, .seed = 4});
      ASSERT_TRUE(points.ok());
      ExpectLatin(*points);
    }
  }
}

TEST(LatinHypercube, SymmetricOnesMirrorEveryPoint) {
  for (const int n : {8, 9}) {
    const auto points =
        LatinHypercube({.points = n, .dimensions = 4, .symmetric = true, .seed = 2});
    ASSERT_TRUE(points.ok());
    ExpectLatin(*points);
    for (Eigen::Index i = 0; i < n; ++i) {
      EXPECT_LT((points->row(i) + points->row(n - 1 - i) - Eigen::RowVectorXd::Ones(4)).norm(),
                1e-12);
    }
  }
}

TEST(LatinHypercube, MoreCandidatesNeverLieCloser) {
  double before = 0;
  for (const int candidates : {1, 10, 1000}) {
    const auto points = LatinHypercube(
        {.points = 11, .dimensions = 4, .symmetric = true, .candidates = candidates, .seed = 7});
    ASSERT_TRUE(points.ok());
    const double distance = SmallestDistance(*points);
    EXPECT_GE(distance, before);
    before = distance;
  }
  const auto one = LatinHypercube({.points = 11, .dimensions = 4, .symmetric = true, .seed = 7});
  EXPECT_GT(before, 1.2 * SmallestDistance(*one));
}

TEST(LatinHypercube, TheSmallestDistanceIsThatOfAllPairs) {
  for (const int n : {2, 9, 200}) {
    const auto points = LatinHypercube({.points = n, .dimensions = 3, .centred = false, .seed = 5});
    ASSERT_TRUE(points.ok());
    double smallest = INFINITY;
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < i; ++k)
        smallest = std::min(smallest, (points->row(i) - points->row(k)).norm());
    }
    EXPECT_NEAR(SmallestDistance(*points), smallest, 1e-14);
  }
}

// The size of a production set: candidates are given up at their first pair that is too close.
TEST(LatinHypercube, AFilterStartsFromTheBestOfAThousandOfTwoThousandPoints) {
  constexpr int kPoints = 2000;
  const std::vector<Prior> priors(5, {.kind = PriorKind::kUniform, .min = 0, .max = 1});
  const auto samples = DrawSamples(
      Proposal{}, priors, {.design = Design::kSymmetricLatinHypercube, .seed = 3}, 0, kPoints);
  ASSERT_TRUE(samples.ok()) << samples.status();
  LatinHypercubeOptions options{
      .points = kPoints, .dimensions = 5, .symmetric = true, .candidates = 1000, .seed = 3};
  const auto best = LatinHypercube(options);
  options.candidates = 200;
  const auto of_fewer = LatinHypercube(options);
  EXPECT_NEAR(SmallestDistance(*samples), SmallestDistance(*best), 1e-12);
  EXPECT_GT(SmallestDistance(*best), SmallestDistance(*of_fewer));
}

TEST(LatinHypercube, DependsOnTheSeedAlone) {
  const LatinHypercubeOptions options{.points = 9, .dimensions = 2, .candidates = 20, .seed = 3};
  EXPECT_EQ(*LatinHypercube(options), *LatinHypercube(options));
  LatinHypercubeOptions other = options;
  other.seed = 4;
  EXPECT_NE(*LatinHypercube(options), *LatinHypercube(other));
}

TEST(LatinHypercube, KnowsWhetherALinearTailIsDetermined) {
  EXPECT_TRUE(
      SpansLinearFunctions(*LatinHypercube({.points = 9, .dimensions = 4, .symmetric = true})));
  Eigen::MatrixXd line(3, 2);
  line << 0.1, 0.1, 0.5, 0.5, 0.9, 0.9;
  EXPECT_FALSE(SpansLinearFunctions(line));
}

TEST(LatinHypercube, SaysWhatIsWrong) {
  EXPECT_EQ(LatinHypercube({.points = 1, .dimensions = 2}).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(LatinHypercube({.points = 5, .dimensions = 0}).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(LatinHypercube({.points = 5, .dimensions = 2, .candidates = 0}).status().code(),
            absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace calib::inference
