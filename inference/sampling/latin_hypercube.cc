#include "inference/sampling/latin_hypercube.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/numerics/decompositions.h"
#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Uniform in 0 ... n - 1; the bias of the product is below n / 2^53.
int Below(PhiloxStream& stream, int n) {
  return std::min(n - 1, static_cast<int>(stream.Uniform() * n));
}

// Fisher-Yates.
std::vector<int> Permutation(PhiloxStream& stream, int n) {
  std::vector<int> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  for (int i = n - 1; i > 0; --i) {
    std::swap(order[static_cast<std::size_t>(i)],
              order[static_cast<std::size_t>(Below(stream, i + 1))]);
  }
  return order;
}

// Cells of one column. Symmetric: rows i and n - 1 - i hold mirrored cells, so each pair of cells
// (c, n - 1 - c) goes to a pair of rows, either way round; the middle row of an odd design holds
// the middle cell.
std::vector<int> Column(PhiloxStream& stream, const LatinHypercubeOptions& options) {
  const int n = options.points;
  if (!options.symmetric) return Permutation(stream, n);
  std::vector<int> cells(static_cast<std::size_t>(n), n / 2);
  const std::vector<int> pairs = Permutation(stream, n / 2);
  for (int i = 0; i < n / 2; ++i) {
    const int cell = pairs[static_cast<std::size_t>(i)];
    const bool swapped = stream.Uniform() < 0.5;
    cells[static_cast<std::size_t>(i)] = swapped ? n - 1 - cell : cell;
    cells[static_cast<std::size_t>(n - 1 - i)] = swapped ? cell : n - 1 - cell;
  }
  return cells;
}

Eigen::MatrixXd Candidate(const LatinHypercubeOptions& options, int candidate) {
  Eigen::MatrixXd points(options.points, options.dimensions);
  for (Index j = 0; j < points.cols(); ++j) {
    PhiloxStream stream({.seed = options.seed,
                         .purpose = StreamPurpose::kLatinHypercube,
                         .iteration = static_cast<std::uint64_t>(candidate),
                         .sample = static_cast<std::uint64_t>(j)});
    const std::vector<int> cells = Column(stream, options);
    for (Index i = 0; i < points.rows(); ++i) {
      const double within = options.centred || options.symmetric ? 0.5 : stream.Uniform();
      points(i, j) = (cells[static_cast<std::size_t>(i)] + within) / options.points;
    }
  }
  return points;
}

// The smallest distance between two points, or one that is no larger than `enough`, the first
// found. Points are looked at in the order of their first coordinate: those further along it than
// the smallest distance so far cannot be nearer.
double SmallestAbove(const Eigen::MatrixXd& points, double enough) {
  std::vector<Index> order(static_cast<std::size_t>(points.rows()));
  std::iota(order.begin(), order.end(), Index{0});
  std::stable_sort(order.begin(), order.end(),
                   [&points](Index a, Index b) { return points(a, 0) < points(b, 0); });
  const Eigen::MatrixXd columns = points(order, Eigen::all).transpose();  // a point is contiguous
  double smallest = std::numeric_limits<double>::infinity();
  double reach = smallest;
  for (Index i = 0; i < columns.cols(); ++i) {
    for (Index k = i + 1; k < columns.cols() && columns(0, k) - columns(0, i) <= reach; ++k) {
      const double squared = (columns.col(i) - columns.col(k)).squaredNorm();
      if (squared >= smallest) continue;
      smallest = squared;
      reach = std::sqrt(squared);
      if (reach <= enough) return reach;
    }
  }
  return reach;
}

}  // namespace

absl::Status LatinHypercubeOptions::Validate() const {
  const auto wrong = [](const char* name, int found, const char* allowed) {
    return absl::InvalidArgumentError(
        absl::StrCat("Latin hypercube: ", name, " is ", found, "; allowed is ", allowed, "."));
  };
  if (points < 2) return wrong("points", points, "2 or more");
  if (dimensions < 1) return wrong("dimensions", dimensions, "1 or more");
  if (candidates < 1) return wrong("candidates", candidates, "1 or more");
  return absl::OkStatus();
}

absl::StatusOr<Eigen::MatrixXd> LatinHypercube(const LatinHypercubeOptions& options) {
  RETURN_IF_ERROR(options.Validate());
  Eigen::MatrixXd best = Candidate(options, 0);
  if (options.candidates == 1) return best;
  double largest = SmallestDistance(best);
  for (int c = 1; c < options.candidates; ++c) {
    Eigen::MatrixXd points = Candidate(options, c);
    const double distance = SmallestAbove(points, largest);
    if (distance <= largest) continue;
    largest = distance;
    best = std::move(points);
  }
  return best;
}

double SmallestDistance(const Eigen::MatrixXd& points) {
  return SmallestAbove(points, -std::numeric_limits<double>::infinity());
}

bool SpansLinearFunctions(const Eigen::MatrixXd& points) {
  Eigen::MatrixXd tail(points.rows(), points.cols() + 1);
  tail << Eigen::VectorXd::Ones(points.rows()), points;
  return Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(tail).rank() == tail.cols();
}

}  // namespace calib::inference
