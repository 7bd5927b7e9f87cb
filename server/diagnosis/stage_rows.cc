#include "server/diagnosis/stage_rows.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "inference/diagnosis/next_runs.h"
#include "inference/sampling/sobol.h"
#include "server/campaign/model/race.h"
#include "server/diagnosis/mixed_rows.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;
using inference::DesignPoints;

DesignPoints PointsOfBase(const DesignRows& rows, const Eigen::MatrixXd& base) {
  return {.base = base,
          .strength = Eigen::MatrixXd::Zero(base.rows(), rows.unit().size()),
          .shape = Eigen::MatrixXd::Zero(base.rows(), rows.shape_count())};
}

// Strengths of a scout: the two steps, or one to each side.
std::vector<double> StepsOfScout(const DesignRows& rows, int entry) {
  const RacingEffect& own = rows.race().effects[static_cast<std::size_t>(entry)];
  const double unit = rows.unit()[entry];
  const double near = std::abs(own.near) / unit, far = std::abs(own.far) / unit;
  if (own.design.two_sided)
    return {std::min(far, rows.Most()[entry]), -std::min(far, rows.MostOther()[entry])};
  return {near, std::min(far, rows.Most()[entry])};
}

// n points without effects to be filled.
DesignPoints PointsLike(const DesignPoints& points, Index n) {
  return {.base = Eigen::MatrixXd(n, points.base.cols()),
          .strength = Eigen::MatrixXd(n, points.strength.cols()),
          .shape = Eigen::MatrixXd(n, points.shape.cols())};
}

// Base parameters of n main runs.
Eigen::MatrixXd MainBase(const KnownBefore& before, Index n) {
  const BaseRegion& region = before.region;
  Eigen::MatrixXd base(n, region.centre.size());
  const Eigen::MatrixXd net =
      inference::ScrambledSobol(static_cast<int>(n), static_cast<int>(base.cols()), before.seed);
  double spread = 0;
  for (Index i = 0; i < n; ++i) {
    spread += kDesignCaps.spread_share;
    if (spread >= 1) {
      spread -= 1;
      base.row(i) = 2 * net.row(i).array() - 1;
    } else {
      base.row(i) = region.draws.row(i * region.draws.rows() / n);
    }
  }
  return base;
}

}  // namespace

Eigen::VectorXd UnitsOfCatalogue(const Race& race) {
  Eigen::VectorXd unit(static_cast<Index>(race.effects.size()));
  for (Index k = 0; k < unit.size(); ++k) {
    const RacingEffect& entry = race.effects[static_cast<std::size_t>(k)];
    unit[k] = std::min(std::sqrt(entry.near * entry.far), entry.most);
  }
  return unit;
}

DesignPoints ScoutPoints(const DesignRows& rows, const BaseRegion& region,
                         const std::vector<int>& entries, double part) {
  const auto count = static_cast<Index>(entries.size());
  DesignPoints points =
      PointsOfBase(rows, region.centre.transpose().replicate(kDesignCaps.scout_runs * count, 1));
  Index row = 0;
  for (int s = 0; s < kDesignCaps.scout_runs; ++s) {
    for (const int k : entries)
      points.strength(row++, k) = part * StepsOfScout(rows, k)[static_cast<std::size_t>(s)];
  }
  return points;
}

std::vector<campaign::RunOf> NumericsRows(const DesignRows& rows, const KnownBefore& before) {
  const Index nearest = before.region.nearest, d = before.base.values.cols();
  std::vector<double> values = rows.WithoutEffects();
  // To the bit, so that it is the same run but for its numerics.
  for (Index j = 0; j < d; ++j)
    values[static_cast<std::size_t>(j)] = before.base.values(nearest, j);
  std::vector<campaign::RunOf> result;
  result.reserve(rows.race().numerics.size());
  for (int c = 0; c < static_cast<int>(rows.race().numerics.size()); ++c) {
    result.push_back({.values = rows.WithNumerics(values, c),
                      .stream = before.base.stream[static_cast<std::size_t>(nearest)]});
  }
  return result;
}

DesignPoints MainPoints(const KnownBefore& before, const Knowledge& known) {
  const Race& race = known.rows.race();
  const std::vector<int> kept = EntriesRun(race, known.part.kept);
  const auto count = static_cast<int>(kept.size());
  const int wanted = (kDesignCaps.uses_of_entry * count + kDesignCaps.entries_of_run - 1) /
                     kDesignCaps.entries_of_run;
  const int n = std::clamp(wanted, kDesignCaps.main_least, kDesignCaps.main_most);
  MixedDesign design{.base = MainBase(before, n),
                     .low = Eigen::VectorXd(count),
                     .high = Eigen::VectorXd(count),
                     .other_low = Eigen::VectorXd::Ones(count),
                     .other_high = Eigen::VectorXd::Ones(count),
                     .seed = before.seed};
  const Eigen::VectorXd most = known.rows.Most(), other = known.rows.MostOther();
  for (int i = 0; i < count; ++i) {
    const int k = kept[static_cast<std::size_t>(i)];
    const StrengthWidth& width = kDesignCaps.strengths;
    design.effects.push_back(race.effects[static_cast<std::size_t>(k)].design);
    design.high[i] = std::min(width.high, most[k]);
    design.low[i] = std::min(width.low, design.high[i] / 2);
    if (!design.effects.back().two_sided) continue;
    design.other_high[i] = std::min(width.high, other[k]);
    design.other_low[i] = std::min(width.low, design.other_high[i] / 2);
  }
  for (int a = 0; a < count; ++a) {
    for (int b = a + 1; b < count; ++b) {
      const std::pair own(kept[static_cast<std::size_t>(a)], kept[static_cast<std::size_t>(b)]);
      for (const auto* list : {&race.excluded, &race.kin}) {
        if (std::find(list->begin(), list->end(), own) != list->end())
          design.apart.emplace_back(a, b);
      }
    }
  }
  return WholePoints(known.rows, {.kept = kept, .flat = {}}, MixedRows(design));
}

DesignPoints SequentialCandidates(const Asked& asked) {
  constexpr int kOfEach = 12;
  std::vector<DesignPoints> parts;
  const inference::NextRunsOptions defaults;
  for (const Index i : inference::LeadingModels(asked.evidence[0], asked.probabilities[0],
                                                defaults.leading, defaults.most_models)) {
    const DesignPoints& draws = asked.evidence[0][static_cast<std::size_t>(i)].draws;
    std::vector<Index> rows;
    const Index n = std::min<Index>(kOfEach, draws.rows());
    rows.reserve(static_cast<std::size_t>(n));
    for (Index j = 0; j < n; ++j) rows.push_back((2 * j + 1) * draws.rows() / (2 * n));
    parts.push_back(inference::RowsOf(draws, rows));
  }
  Index total = 0;
  for (const DesignPoints& part : parts) total += part.rows();
  DesignPoints all{.base = Eigen::MatrixXd(total, parts[0].base.cols()),
                   .strength = Eigen::MatrixXd(total, parts[0].strength.cols()),
                   .shape = Eigen::MatrixXd(total, parts[0].shape.cols())};
  Index row = 0;
  for (const DesignPoints& part : parts) {
    all.base.middleRows(row, part.rows()) = part.base;
    all.strength.middleRows(row, part.rows()) = part.strength;
    all.shape.middleRows(row, part.rows()) = part.shape;
    row += part.rows();
  }
  return all;
}

DesignPoints VerificationPoints(const std::vector<VerifiedModel>& models) {
  const auto n = static_cast<Index>(models.size()) * kDesignCaps.verification_runs;
  DesignPoints points = PointsLike(models.front().optimum, n);
  for (Index i = 0; i < n; ++i) {
    const DesignPoints& own =
        models[static_cast<std::size_t>(i / kDesignCaps.verification_runs)].optimum;
    points.base.row(i) = own.base.row(0);
    points.strength.row(i) = own.strength.row(0);
    points.shape.row(i) = own.shape.row(0);
  }
  return points;
}

std::vector<campaign::RunOf> AdmissibleRows(const campaign::Campaign& design,
                                            const DesignRows& rows, const BaseRegion& region,
                                            DesignPoints points, int first_stream) {
  std::vector<campaign::RunOf> result;
  for (Index i = 0; i < points.rows(); ++i) {
    std::vector<double> values = rows.Values(points, i);
    const auto refused = [&] { return !campaign::WhyNotRun(design, values).empty(); };
    if (refused()) {
      const Eigen::RowVectorXd strength = points.strength.row(i);
      for (Index k = strength.size(); k-- > 0 && refused();) {
        points.strength(i, k) = 0;
        values = rows.Values(points, i);
      }
      if (refused()) {
        points.strength.row(i) = strength;
        points.base.row(i) = region.draws.row(i % region.draws.rows());
        values = rows.Values(points, i);
      }
    }
    result.push_back({.values = std::move(values), .stream = first_stream + static_cast<int>(i)});
  }
  return result;
}

}  // namespace calib::diagnosis
