#include "inference/data/model_error.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "inference/data/data_set.h"
#include "inference/numerics/standard_normal.h"

namespace calib::inference {
namespace {

constexpr double kMostLevels = 4096;   // of both parts; chosen: a likelihood's cost goes with them
constexpr double kFewestPanels = 6;    // of one part; chosen: a prior's own shape is seen
constexpr double kBeyondCells = 1e-9;  // of a prior without an end, beyond the last cell; chosen

// Gauss-Legendre of three nodes on [0, 1].                        [Abramowitz & Stegun, Table 25.4]
constexpr std::array kNodes = {0.5 - 0.5 * 0.7745966692414834, 0.5, 0.5 + 0.5 * 0.7745966692414834};
constexpr std::array kWeights = {5.0 / 18, 8.0 / 18, 5.0 / 18};

// What a standard deviation is multiplied by in a reading.
enum class Part { kRelative, kAbsolute };

struct Axis {
  double rate = 0;           // largest ratio of what sigma multiplies to a stated sd
  double low = 0, high = 0;  // ends of the range of sigma
  double panels = 0;         // wanted

  // The coordinate of equal panels; sigma itself where the readings tell nothing of it.
  double ToCoordinate(double sigma) const { return rate > 0 ? std::asinh(sigma * rate) : sigma; }
  double ToSigma(double u) const { return rate > 0 ? std::sinh(u) / rate : u; }
};

double ToSigma(const ErrorScale& scale, double x) {
  return scale.on_variance ? std::sqrt(std::max(0.0, x)) : x;
}
double FromSigma(const ErrorScale& scale, double sigma) {
  return scale.on_variance ? sigma * sigma : sigma;
}

// The prior's probability below sigma.
double Below(const ErrorScale& scale, double sigma) {
  const double x = FromSigma(scale, sigma);
  if (x <= scale.prior.min) return 0;
  if (x >= scale.prior.max) return 1;
  return std::exp(LogNormalCdf(scale.prior.NormalScore(x)));
}

Axis AxisOf(const ErrorScale& scale, const ModelError& error, const DataSet& data, Part part) {
  Axis axis;
  double readings = 0;
  for (const Reading& reading : data.readings) {
    const std::pair<int, int> key{reading.experiment, reading.observable};
    if (std::find(error.members.begin(), error.members.end(), key) == error.members.end()) continue;
    ++readings;
    const double size = part == Part::kRelative ? std::abs(reading.value) : 1;
    axis.rate = std::max(axis.rate, size / reading.sd);
  }
  axis.low = ToSigma(scale, std::max(0.0, scale.prior.min));
  axis.high =
      ToSigma(scale, std::isfinite(scale.prior.max) ? scale.prior.max
                                                    : scale.prior.Quantile(1 - kBeyondCells));
  const double width = axis.ToCoordinate(axis.high) - axis.ToCoordinate(axis.low);
  axis.panels = std::max(kFewestPanels, width * std::sqrt(2 * readings));
  return axis;
}

std::vector<ErrorCell> CellsAlong(const ErrorScale& scale, const Axis& axis) {
  const auto panels = static_cast<int>(std::ceil(axis.panels));
  const double begin = axis.ToCoordinate(axis.low);
  const double width = (axis.ToCoordinate(axis.high) - begin) / panels;
  std::vector<ErrorCell> cells;
  double low = axis.low;
  double below = 0;
  for (int k = 0; k < panels; ++k) {
    double share = 0;  // of the panel, up to the end of the cell
    for (std::size_t i = 0; i < kNodes.size(); ++i) {
      share += kWeights[i];
      const bool last = k + 1 == panels && i + 1 == kNodes.size();
      const double high = last ? axis.high : axis.ToSigma(begin + width * (k + share));
      const double above = last ? 1 : Below(scale, high);
      const double at = axis.ToSigma(begin + width * (k + kNodes[i]));
      if (above > below) {
        cells.push_back(
            {.low = low, .high = high, .at = std::clamp(at, low, high), .mass = above - below});
      }
      low = high;
      below = above;
    }
  }
  return cells;
}

ErrorScaleSummary Summarize(const std::vector<ErrorCell>& cells, const Eigen::VectorXd& p) {
  ErrorScaleSummary summary;
  for (std::size_t k = 0; k < cells.size(); ++k) {
    const double mass = p[static_cast<Eigen::Index>(k)];
    const double middle = 0.5 * (cells[k].low + cells[k].high);
    const double width = cells[k].high - cells[k].low;
    summary.mean += mass * middle;
    summary.mean_square += mass * (middle * middle + width * width / 12);
  }
  summary.sd = std::sqrt(std::max(0.0, summary.mean_square - summary.mean * summary.mean));
  const auto quantile = [&](double wanted) {
    double below = 0;
    for (std::size_t k = 0; k < cells.size(); ++k) {
      const double mass = p[static_cast<Eigen::Index>(k)];
      if (below + mass >= wanted && mass > 0) {
        return cells[k].low + (wanted - below) / mass * (cells[k].high - cells[k].low);
      }
      below += mass;
    }
    return cells.back().high;
  };
  summary.q05 = quantile(0.05);
  summary.q50 = quantile(0.5);
  summary.q95 = quantile(0.95);
  return summary;
}

}  // namespace

const ErrorCell& ErrorCells::RelativeOf(Eigen::Index level) const {
  return relative[static_cast<std::size_t>(level) % relative.size()];
}

const ErrorCell& ErrorCells::AbsoluteOf(Eigen::Index level) const {
  return absolute[static_cast<std::size_t>(level) / relative.size()];
}

Eigen::VectorXd ErrorCells::LogMass() const {
  Eigen::VectorXd log_mass(levels());
  for (Eigen::Index k = 0; k < log_mass.size(); ++k) {
    log_mass[k] = std::log(RelativeOf(k).mass) + std::log(AbsoluteOf(k).mass);
  }
  return log_mass;
}

ErrorCells CellsOf(const ModelError& error, const DataSet& data) {
  std::optional<Axis> relative;
  std::optional<Axis> absolute;
  double levels = 1;
  if (error.relative) {
    relative = AxisOf(*error.relative, error, data, Part::kRelative);
    levels *= static_cast<double>(kNodes.size()) * relative->panels;
  }
  if (error.absolute) {
    absolute = AxisOf(*error.absolute, error, data, Part::kAbsolute);
    levels *= static_cast<double>(kNodes.size()) * absolute->panels;
  }
  if (levels > kMostLevels) {
    const double narrower =
        relative && absolute ? std::sqrt(levels / kMostLevels) : levels / kMostLevels;
    for (auto* axis : {&relative, &absolute}) {
      if (*axis) (*axis)->panels = std::max(kFewestPanels, (*axis)->panels / narrower);
    }
  }
  const std::vector<ErrorCell> none(1);
  return {.relative = relative ? CellsAlong(*error.relative, *relative) : none,
          .absolute = absolute ? CellsAlong(*error.absolute, *absolute) : none};
}

double RaisedError(const ErrorCells& cells, Eigen::Index level, double value, double sd) {
  return std::hypot(sd, cells.RelativeOf(level).at * value, cells.AbsoluteOf(level).at);
}

ModelErrorSummary SummarizeModelError(const ModelError& error, const ErrorCells& cells,
                                      const Eigen::VectorXd& probabilities) {
  Eigen::VectorXd relative =
      Eigen::VectorXd::Zero(static_cast<Eigen::Index>(cells.relative.size()));
  Eigen::VectorXd absolute =
      Eigen::VectorXd::Zero(static_cast<Eigen::Index>(cells.absolute.size()));
  for (Eigen::Index k = 0; k < probabilities.size(); ++k) {
    relative[k % relative.size()] += probabilities[k];
    absolute[k / relative.size()] += probabilities[k];
  }
  ModelErrorSummary summary{.members = error.members};
  if (error.relative) summary.relative = Summarize(cells.relative, relative);
  if (error.absolute) summary.absolute = Summarize(cells.absolute, absolute);
  return summary;
}

}  // namespace calib::inference
