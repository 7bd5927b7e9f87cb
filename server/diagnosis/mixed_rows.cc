#include "server/diagnosis/mixed_rows.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "inference/sampling/philox.h"
#include "inference/sampling/shuffle.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;
using inference::PhiloxStream;
using inference::StreamPurpose;

constexpr int kSetsTried = 200;
constexpr double kEvenUses = 10;  // weight of uses of effects over those of pairs

// What the streams of a main design are for: iteration of their key.
enum class DrawOf : std::uint64_t { kSets, kStrengths, kSigns, kShapes };

PhiloxStream StreamFor(const MixedDesign& design, DrawOf what, std::uint64_t number) {
  return PhiloxStream({.seed = design.seed,
                       .purpose = StreamPurpose::kMainDesign,
                       .iteration = static_cast<std::uint64_t>(what),
                       .sample = number});
}

// At most `wanted` effects by chance that may be together, ascending.
std::vector<int> SetByChance(int wanted, const Eigen::MatrixXi& apart, PhiloxStream& stream) {
  std::vector<int> left, chosen;
  for (int k = 0; k < apart.rows(); ++k) left.push_back(k);
  while (static_cast<int>(chosen.size()) < wanted && !left.empty()) {
    const auto place =
        static_cast<std::size_t>(stream.Uniform() * static_cast<double>(left.size()));
    const int effect = left[place];
    chosen.push_back(effect);
    std::erase_if(left, [&](int k) { return k == effect || apart(k, effect) != 0; });
  }
  std::sort(chosen.begin(), chosen.end());
  return chosen;
}

std::vector<std::vector<int>> EvenSets(const MixedDesign& design) {
  const auto k = static_cast<Index>(design.effects.size());
  Eigen::MatrixXi apart = Eigen::MatrixXi::Zero(k, k);
  for (const auto& [a, b] : design.apart) apart(a, b) = apart(b, a) = 1;
  Eigen::MatrixXi pairs = Eigen::MatrixXi::Zero(k, k);  // uses on the diagonal
  std::vector<std::vector<int>> sets;
  for (Index row = 0; row < design.base.rows(); ++row) {
    PhiloxStream stream = StreamFor(design, DrawOf::kSets, static_cast<std::uint64_t>(row));
    std::vector<int> best;
    double least = 0;
    const auto wanted = static_cast<int>(2 + row % 3);
    for (int tried = 0; tried < kSetsTried; ++tried) {
      std::vector<int> set = SetByChance(wanted, apart, stream);
      double score = 0;
      for (const int a : set) {
        for (const int b : set) score += (a == b ? kEvenUses : 1) * pairs(a, b) * pairs(a, b);
      }
      // Of sets of a size: one that met who excludes all others is smaller.
      score /= static_cast<double>(set.size());
      if (best.empty() || score < least) {
        least = score;
        best = std::move(set);
      }
    }
    for (const int a : best) {
      for (const int b : best) ++pairs(a, b);
    }
    sets.push_back(std::move(best));
  }
  return sets;
}

// Places 0 .. 1 of n uses: one in each of n equal cells, by chance which, the ends themselves in
// the outer cells.
std::vector<double> Strata(Index n, PhiloxStream stream, bool with_ends) {
  const std::vector<Index> order = inference::Shuffled(n, stream);
  for (Index i = 0; i < n; ++i) stream.Uniform();  // those that the order took
  std::vector<double> places;
  for (const Index cell : order) {
    const double u = stream.Uniform();
    const double inside = (static_cast<double>(cell) + u) / static_cast<double>(n);
    places.push_back(with_ends && n > 1 && cell == 0       ? 0
                     : with_ends && n > 1 && cell == n - 1 ? 1
                                                           : inside);
  }
  return places;
}

}  // namespace

inference::DesignPoints MixedRows(const MixedDesign& design) {
  const Index n = design.base.rows();
  const auto count = static_cast<int>(design.effects.size());
  Index shapes = 0;
  for (const inference::DesignEffect& effect : design.effects) shapes += effect.shapes;
  inference::DesignPoints points{.base = design.base,
                                 .strength = Eigen::MatrixXd::Zero(n, count),
                                 .shape = Eigen::MatrixXd::Zero(n, shapes)};
  const std::vector<std::vector<int>> sets = EvenSets(design);
  Index first_shape = 0;
  for (int k = 0; k < count; ++k) {
    const inference::DesignEffect& effect = design.effects[static_cast<std::size_t>(k)];
    std::vector<Index> rows;
    for (Index i = 0; i < n; ++i) {
      const std::vector<int>& set = sets[static_cast<std::size_t>(i)];
      if (std::binary_search(set.begin(), set.end(), k)) rows.push_back(i);
    }
    const auto uses = static_cast<Index>(rows.size());
    const auto number = static_cast<std::uint64_t>(k);
    // Each sign has strata of its own.
    const std::vector<Index> order =
        inference::Shuffled(uses, StreamFor(design, DrawOf::kSigns, number));
    for (const int side : {0, 1}) {
      std::vector<Index> own;
      for (Index u = 0; u < uses; ++u) {
        const bool negative = effect.two_sided && u % 2 == 1;
        if (negative == (side == 1))
          own.push_back(rows[static_cast<std::size_t>(order[static_cast<std::size_t>(u)])]);
      }
      const std::vector<double> places = Strata(
          static_cast<Index>(own.size()),
          StreamFor(design, DrawOf::kStrengths, 2 * number + static_cast<unsigned>(side)), true);
      const double low = side == 1 ? design.other_low[k] : design.low[k];
      const double high = side == 1 ? design.other_high[k] : design.high[k];
      for (std::size_t u = 0; u < own.size(); ++u) {
        // The upper end to the bit, which a posterior may not be beyond.
        const double s = places[u] == 1 ? high : low * std::pow(high / low, places[u]);
        points.strength(own[u], k) = side == 1 ? -s : s;
      }
    }
    for (int h = 0; h < effect.shapes; ++h) {
      const std::vector<double> places = Strata(
          uses, StreamFor(design, DrawOf::kShapes, static_cast<std::uint64_t>(first_shape + h)),
          false);
      for (Index u = 0; u < uses; ++u) {
        points.shape(rows[static_cast<std::size_t>(u)], first_shape + h) =
            2 * places[static_cast<std::size_t>(u)] - 1;
      }
    }
    first_shape += effect.shapes;
  }
  return points;
}

}  // namespace calib::diagnosis
