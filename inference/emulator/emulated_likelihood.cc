#include "inference/emulator/emulated_likelihood.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "inference/numerics/decompositions.h"

namespace calib::inference {
namespace {

using Eigen::Index;

const double kLogSqrtTwoPi = 0.5 * std::log(2 * std::numbers::pi);

// Place of the group whose members a curve is among; -1: none.
template <typename Group>
int PlaceOf(const std::pair<int, int>& curve, const std::vector<Group>& groups) {
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const auto& members = groups[g].members;
    if (std::find(members.begin(), members.end(), curve) != members.end()) {
      return static_cast<int>(g);
    }
  }
  return -1;
}

// Errors over stated ones, readings x levels.
Eigen::MatrixXd LargerErrors(const DataSet& data, const std::vector<int>& readings,
                             const ErrorCells& cells) {
  Eigen::MatrixXd larger(static_cast<Index>(readings.size()), cells.levels());
  for (Index i = 0; i < larger.rows(); ++i) {
    const Reading& reading =
        data.readings[static_cast<std::size_t>(readings[static_cast<std::size_t>(i)])];
    for (Index k = 0; k < larger.cols(); ++k) {
      larger(i, k) = RaisedError(cells, k, reading.value, reading.sd) / reading.sd;
    }
  }
  return larger;
}

}  // namespace

absl::StatusOr<EmulatedLikelihood> EmulatedLikelihood::Create(const DataSet& data,
                                                              const StateEmulator& emulator,
                                                              const Options& options) {
  EmulatedLikelihood likelihood;
  const PrincipalComponents& components = emulator.components();
  const auto place = [&](Index t) {  // of a reading in what the emulator learned from
    return options.reversed ? components.mean.size() - 1 - t : t;
  };
  likelihood.mean_ = components.mean;
  if (options.reversed) likelihood.mean_.reverseInPlace();
  likelihood.scatter_variance_ = options.scatter_share * emulator.scatter_sd().array().square();
  likelihood.correlation_factor_ = Eigen::LLT<Eigen::MatrixXd>(emulator.correlation()).matrixL();

  const std::vector<NoiseGroup> noise_groups = NoiseGroupsOf(data);
  likelihood.model_error_ = options.model_error;
  std::vector<ErrorCells> cells;
  for (const ModelError& error : data.model_errors) {
    cells.push_back(options.model_error ? CellsOf(error, data) : ErrorCells{});
  }
  for (const auto& [key, members] : GroupsOf(data)) {
    Form form;
    form.noise_group =
        options.model_error ? PlaceOf(key, data.model_errors) : PlaceOf(key, noise_groups);
    if (options.model_error && form.noise_group >= 0) {
      form.larger = LargerErrors(data, members, cells[static_cast<std::size_t>(form.noise_group)]);
    }
    const auto size = static_cast<Index>(members.size());
    Eigen::MatrixXd covariance = options.correlated_noise ? ErrorCorrelation(data, key, members)
                                                          : Eigen::MatrixXd::Identity(size, size);
    Eigen::MatrixXd basis(size, components.basis.cols());
    form.log_sd.resize(size);
    for (Index i = 0; i < size; ++i) {
      const int t = members[static_cast<std::size_t>(i)];
      covariance(i, i) += components.remainder[place(t)];
      basis.row(i) = components.basis.row(place(t));
      form.log_sd[i] = std::log(data.readings[static_cast<std::size_t>(t)].sd) + kLogSqrtTwoPi;
    }
    const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
    if (factor.info() != Eigen::Success) {
      return absl::InvalidArgumentError(
          absl::StrCat("readings of observable ", key.second, " of experiment ", key.first,
                       " lie too close for their correlation length: leave out some."));
    }
    form.log_pivots = factor.matrixLLT().diagonal().array().log();
    form.whitening = LowerSolved(factor, Eigen::MatrixXd::Identity(size, size));
    form.whitened_basis = form.whitening * basis;
    form.readings.assign(members.begin(), members.end());
    form.residual = likelihood.Whiten(form, Eigen::VectorXd::Zero(components.mean.size()));
    form.Sum();
    likelihood.forms_.push_back(std::move(form));
  }
  return likelihood;
}

void EmulatedLikelihood::Form::Sum() {
  // One after the other: the last bits of a likelihood move proposals, and runs that follow them
  // part.
  double sds = 0;
  for (const double log_of_sd : log_sd) sds -= log_of_sd;
  double pivots = 0;
  for (const double log_of_pivot : log_pivots) pivots += log_of_pivot;
  stated = {.gram = whitened_basis.transpose() * whitened_basis,
            .projection = whitened_basis.transpose() * residual,
            .square = residual.squaredNorm(),
            .log_normaliser = sds - pivots};
  at_level.clear();
  if (larger.cols() == 0) return;
  const auto whitener = whitening.triangularView<Eigen::Lower>();
  const Eigen::MatrixXd basis = whitener.solve(whitened_basis);
  const Eigen::VectorXd plain = whitener.solve(residual);
  for (const auto& errors : larger.colwise()) {
    const Eigen::VectorXd inverse = errors.cwiseInverse();
    Eigen::MatrixXd own_basis = inverse.asDiagonal() * basis;
    Eigen::VectorXd own_residual = inverse.cwiseProduct(plain);
    // Of a group without readings yet; Eigen's triangular product reads the first number even then.
    if (own_basis.size() > 0) own_basis = (whitener * own_basis).eval();
    if (own_residual.size() > 0) own_residual = (whitener * own_residual).eval();
    at_level.push_back({.gram = own_basis.transpose() * own_basis,
                        .projection = own_basis.transpose() * own_residual,
                        .square = own_residual.squaredNorm(),
                        .log_normaliser = stated.log_normaliser - errors.array().log().sum()});
  }
}

// W is lower: what the first readings of a group are whitened by does not depend on the others.
EmulatedLikelihood EmulatedLikelihood::First(Index readings) const {
  EmulatedLikelihood first = *this;
  for (Form& form : first.forms_) {
    const auto end = std::lower_bound(form.readings.begin(), form.readings.end(), readings);
    const Index kept = end - form.readings.begin();
    form.readings.resize(static_cast<std::size_t>(kept));
    form.whitening = form.whitening.topLeftCorner(kept, kept).eval();
    form.whitened_basis.conservativeResize(kept, Eigen::NoChange);
    form.log_sd.conservativeResize(kept);
    form.larger.conservativeResize(kept, Eigen::NoChange);
    form.log_pivots.conservativeResize(kept);
    form.residual.conservativeResize(kept);
    form.Sum();
  }
  return first;
}

EmulatedLikelihood EmulatedLikelihood::Of(const std::vector<Index>& readings) const {
  EmulatedLikelihood part = *this;
  for (Form& form : part.forms_) {
    std::vector<Index> kept;  // places in the group
    for (std::size_t i = 0; i < form.readings.size(); ++i) {
      if (std::binary_search(readings.begin(), readings.end(), form.readings[i])) {
        kept.push_back(static_cast<Index>(i));
      }
    }
    if (kept.empty()) {
      form.readings.clear();
      continue;
    }
    const auto whitening = form.whitening.triangularView<Eigen::Lower>();
    const Eigen::MatrixXd root = whitening.solve(  // of the covariance, and the rest unwhitened
        Eigen::MatrixXd::Identity(form.whitening.rows(), form.whitening.cols()));
    const Eigen::MatrixXd rows = root(kept, Eigen::all);
    const Eigen::MatrixXd basis = rows * form.whitened_basis;
    const Eigen::VectorXd residual = rows * form.residual;
    const Eigen::MatrixXd covariance = rows * rows.transpose();
    const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
    const auto size = static_cast<Index>(kept.size());
    form.log_pivots = factor.matrixLLT().diagonal().array().log();
    form.whitening = LowerSolved(factor, Eigen::MatrixXd::Identity(size, size));
    form.whitened_basis = form.whitening * basis;
    form.residual = form.whitening * residual;
    form.log_sd = form.log_sd(kept).eval();
    if (form.larger.cols() > 0) form.larger = form.larger(kept, Eigen::all).eval();
    std::vector<Index> own;
    own.reserve(kept.size());
    for (const Index i : kept) own.push_back(form.readings[static_cast<std::size_t>(i)]);
    form.readings = std::move(own);
    form.Sum();
  }
  std::erase_if(part.forms_, [](const Form& form) { return form.readings.empty(); });
  return part;
}

Eigen::VectorXd EmulatedLikelihood::Whiten(const Form& form, const Eigen::VectorXd& z) const {
  Eigen::VectorXd residual(static_cast<Index>(form.readings.size()));
  for (Index i = 0; i < residual.size(); ++i) {
    const Index t = form.readings[static_cast<std::size_t>(i)];
    residual[i] = z[t] - mean_[t];
  }
  return form.whitening * residual;
}

// What depends on the prediction: with G = (WB)^T WB, g = (WB)^T W r - G m, S = D chol(C), M = I +
// S^T G S,
//   -1/2 (m^T G m - 2 m^T (WB)^T W r - |M^{-1/2} S^T g|^2 + ln det M)         [matrix inversion and
//   determinant lemmas]
EmulatedLikelihood::Combined EmulatedLikelihood::Combine(const Eigen::VectorXd& mean,
                                                         const Eigen::VectorXd& sd,
                                                         const Eigen::MatrixXd& gram,
                                                         const Eigen::VectorXd& projection) const {
  const Eigen::VectorXd along = gram * mean;
  const Eigen::VectorXd left = projection - along;
  const Eigen::VectorXd spread = (sd.array().square() + scatter_variance_.array()).sqrt();
  const Eigen::MatrixXd factor = spread.asDiagonal() * correlation_factor_;
  Eigen::MatrixXd inner = factor.transpose() * gram * factor;
  inner.diagonal().array() += 1;
  const Eigen::LLT<Eigen::MatrixXd> cholesky(inner);
  const Eigen::VectorXd explained = cholesky.matrixL().solve(factor.transpose() * left);
  return {.quadratic = mean.dot(along) - 2 * mean.dot(projection) - explained.squaredNorm(),
          .log_determinant = 2 * cholesky.matrixLLT().diagonal().array().log().sum()};
}

Eigen::VectorXd EmulatedLikelihood::LogLikelihood(const ScorePrediction& prediction,
                                                  const Eigen::MatrixXd& noise) const {
  const Index q = prediction.mean.cols();
  Eigen::VectorXd result(prediction.mean.rows());
  Eigen::MatrixXd gram(q, q);
  Eigen::VectorXd projection(q);
  for (Index i = 0; i < result.size(); ++i) {
    gram.setZero();
    projection.setZero();
    double sum = 0;
    for (const Form& form : forms_) {
      const bool stated = noise.cols() == 0 || form.noise_group < 0;
      if (stated || model_error_) {
        const Sums& sums =
            stated ? form.stated
                   : form.at_level[static_cast<std::size_t>(noise(i, form.noise_group))];
        gram += sums.gram;
        projection += sums.projection;
        sum += sums.log_normaliser - 0.5 * sums.square;
        continue;
      }
      const double factor = noise(i, form.noise_group);
      gram += form.stated.gram / factor;
      projection += form.stated.projection / factor;
      sum += form.stated.log_normaliser - 0.5 * form.stated.square / factor -
             0.5 * static_cast<double>(form.readings.size()) * std::log(factor);
    }
    result[i] =
        sum + Combine(prediction.mean.row(i), prediction.sd.row(i), gram, projection).LogDensity();
  }
  return result;
}

Eigen::VectorXd EmulatedLikelihood::Misfit(const ScorePrediction& prediction) const {
  const Index q = prediction.mean.cols();
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(q, q);
  Eigen::VectorXd projection = Eigen::VectorXd::Zero(q);
  double square = 0;
  for (const Form& form : forms_) {
    gram += form.stated.gram;
    projection += form.stated.projection;
    square += form.stated.square;
  }
  Eigen::VectorXd misfit(prediction.mean.rows());
  for (Index i = 0; i < misfit.size(); ++i) {
    misfit[i] =
        square + Combine(prediction.mean.row(i), prediction.sd.row(i), gram, projection).quadratic;
  }
  return misfit;
}

double EmulatedLikelihood::LogDensity(const ScorePrediction& prediction, Index row,
                                      const Eigen::VectorXd& z) const {
  const Index q = prediction.mean.cols();
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(q, q);
  Eigen::VectorXd projection = Eigen::VectorXd::Zero(q);
  double sum = 0;
  for (const Form& form : forms_) {
    const Eigen::VectorXd residual = Whiten(form, z);
    gram += form.stated.gram;
    projection += form.whitened_basis.transpose() * residual;
    sum += form.stated.log_normaliser - 0.5 * residual.squaredNorm();
  }
  return sum +
         Combine(prediction.mean.row(row), prediction.sd.row(row), gram, projection).LogDensity();
}

}  // namespace calib::inference
