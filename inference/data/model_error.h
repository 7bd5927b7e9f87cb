#pragma once
// What the model itself is off by, inferred with its parameters: its standard deviation joins the
// stated errors of the readings, and a quadrature over it takes the place of a sampled parameter,
// since no run depends on it.

#include <Eigen/Core>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "inference/prior/prior.h"

namespace calib::inference {

struct DataSet;

/// Prior of one standard deviation sigma >= 0.
struct ErrorScale {
  Prior prior{};             ///< of sigma, or of sigma^2; within [0, infinity)
  bool on_variance = false;  ///< true: of sigma^2                     [Hadjidoukas 2014, sec. 4.2]
};

/// A model error of standard deviation sigma_r |y| and sigma_a of each reading y, in the readings
/// of the members, all with the same sigma_r and sigma_a: the variance of a reading is
///   sd^2 + sigma_r^2 y^2 + sigma_a^2                               [Hadjidoukas 2014, Eqs. 4-8]
/// with the stated sd. What is stated of the errors' correlation holds for the sum.
struct ModelError {
  std::vector<std::pair<int, int>> members{};  ///< (experiment, observable), at least one
  std::optional<ErrorScale> relative{};        ///< sigma_r, of the size of a reading
  std::optional<ErrorScale> absolute{};        ///< sigma_a, in the readings' unit
};

/// Part of the range of a standard deviation, over which the likelihood hardly changes.
struct ErrorCell {
  double low = 0, high = 0;  ///< its ends, >= 0
  double at = 0;             ///< the node that stands for the cell
  double mass = 1;           ///< of the prior, (0, 1]
};

/// The cells of both standard deviations; one cell at zero where the model error has no such part.
struct ErrorCells {
  std::vector<ErrorCell> relative{};
  std::vector<ErrorCell> absolute{};

  /// Pairs of cells. Level k is relative[k % relative.size()] with absolute[k / relative.size()].
  Eigen::Index levels() const {
    return static_cast<Eigen::Index>(relative.size() * absolute.size());
  }
  const ErrorCell& RelativeOf(Eigen::Index level) const;
  const ErrorCell& AbsoluteOf(Eigen::Index level) const;
  /// ln of the prior mass of each level.
  Eigen::VectorXd LogMass() const;
};

/// Cells of a quadrature over a model error: the three nodes of Gauss and Legendre in each of
/// panels of equal width in asinh(sigma r), r the largest ratio of what sigma multiplies to the
/// stated sd of a reading. By this coordinate the logarithm of a variance changes at a rate of 2 at
/// most, so that n readings know it no better than to 1 / sqrt(2 n): a panel is as wide as that,
/// and a likelihood's mean over the prior is right to 1 %, also where the prior ends on its slope.
/// Panels are wider where they would make more than 4096 levels. Pure. in: data with readings of
/// the members, sd > 0; a prior that Validate accepts
ErrorCells CellsOf(const ModelError& error, const DataSet& data);

/// Standard deviation of a reading of size |y| and stated error sd at a level.
double RaisedError(const ErrorCells& cells, Eigen::Index level, double value, double sd);

/// The posterior of a standard deviation.
struct ErrorScaleSummary {
  double mean = 0, sd = 0;
  double q05 = 0, q50 = 0, q95 = 0;
  double mean_square = 0;  ///< of sigma, for predictions
};
/// The posterior of a model error.
struct ModelErrorSummary {
  std::vector<std::pair<int, int>> members{};
  std::optional<ErrorScaleSummary> relative{};
  std::optional<ErrorScaleSummary> absolute{};
};
/// Summarises a model error by the probabilities of its levels, which sum to one; within a cell the
/// density is taken for even. Pure.
ModelErrorSummary SummarizeModelError(const ModelError& error, const ErrorCells& cells,
                                      const Eigen::VectorXd& probabilities);

}  // namespace calib::inference
