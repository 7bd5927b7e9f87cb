// Is the p value of `compare` right where the scatter between packings is known from few of them?
// Measurements on one more packing, of a model that lacks nothing, judged by two to sixteen others.
// deploy/bench/few-packings does the same with packings that were run.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include "inference/sampling/philox.h"
#include "inference/scatter/chi_squared_law.h"
#include "inference/scatter/scatter.h"

namespace calib::inference {
namespace {

using Eigen::Index;

PhiloxStream NumberedStream(std::uint64_t seed, int sample) {
  return PhiloxStream({.seed = seed,
                       .purpose = StreamPurpose::kDiagnosisNull,
                       .iteration = 0,
                       .sample = static_cast<std::uint64_t>(sample)});
}

/// Curves in standard deviations of their readings' noise.
struct Packings {
  Eigen::MatrixXd runs;                // N x T, one parameter vector on N packings
  std::vector<int> observable, stage;  // T
  Eigen::VectorXd control;             // T, path length since the start
};

/// Chains along the path of either of two observables: their scatter has the closed form.
Packings MadeUp(int count) {
  constexpr Index kReadings = 20;
  constexpr double kSd = 3, kLength = 0.3;
  Packings made{.runs = Eigen::MatrixXd(count, 2 * kReadings),
                .observable = {},
                .stage = {},
                .control = Eigen::VectorXd(2 * kReadings)};
  for (Index k = 0; k < 2 * kReadings; ++k) {
    const double x = static_cast<double>(k % kReadings) / kReadings;
    made.observable.push_back(static_cast<int>(k / kReadings));
    made.stage.push_back(x < 0.5 ? 0 : 1);
    made.control[k] = x;
  }
  for (Index p = 0; p < count; ++p) {
    PhiloxStream stream = NumberedStream(14, static_cast<int>(p));
    for (Index k = 0; k < 2 * kReadings; ++k) {
      const double step = k == 0 ? 0 : made.control[k] - made.control[k - 1];
      const double kept = step > 0 ? std::exp(-step / kLength) : 0;  // else another observable
      const double before = k == 0 ? 0 : made.runs(p, k - 1);
      made.runs(p, k) = kept * before + kSd * std::sqrt(1 - kept * kept) * stream.Normal();
    }
  }
  return made;
}

Eigen::MatrixXd ReadMatrix(std::istream& in) {
  Index rows = 0;
  Index columns = 0;
  in >> rows >> columns;
  Eigen::MatrixXd matrix(rows, columns);
  for (double& value : matrix.transpose().reshaped()) in >> value;
  return matrix;
}

/// Of deploy/bench/few-packings.d/packings.py: runs, three rows.
Packings ReadPackings(const char* file) {
  std::ifstream in(file);
  Packings read{.runs = ReadMatrix(in), .observable = {}, .stage = {}, .control = {}};
  const Eigen::MatrixXd places = ReadMatrix(in);
  EXPECT_TRUE(in) << file;
  for (Index k = 0; k < places.cols(); ++k) {
    read.observable.push_back(static_cast<int>(places(0, k)));
    read.stage.push_back(static_cast<int>(places(1, k)));
  }
  read.control = places.row(2);
  return read;
}

std::vector<Index> InOrder(const Packings& all) {
  std::vector<Index> order(static_cast<std::size_t>(all.runs.rows()));
  std::iota(order.begin(), order.end(), Index{0});
  return order;
}

/// The first `count` of them, drawn anew.
void Shuffle(std::vector<Index>& order, int count, int number) {
  PhiloxStream stream = NumberedStream(13, number);
  for (int i = 0; i < count; ++i) {
    const auto place = static_cast<std::size_t>(i);
    const auto left = static_cast<double>(order.size() - place);
    const auto step = static_cast<std::size_t>(stream.Uniform() * left);
    std::swap(order[place], order[std::min(place + step, order.size() - 1)]);
  }
}

std::vector<Index> ReadingsOf(const Packings& all, int observable) {
  std::vector<Index> own;
  for (std::size_t k = 0; k < all.observable.size(); ++k) {
    if (all.observable[k] == observable) own.push_back(static_cast<Index>(k));
  }
  return own;
}

/// A chain for each observable, about the mean over `count` packings.
Eigen::MatrixXd ClosedForm(const Packings& all, const Eigen::MatrixXd& runs, double count) {
  Eigen::MatrixXd form = Eigen::MatrixXd::Zero(runs.cols(), runs.cols());
  for (const int one : std::set<int>(all.observable.begin(), all.observable.end())) {
    const std::vector<Index> own = ReadingsOf(all, one);
    std::vector<int> stage;
    stage.reserve(own.size());
    for (const Index k : own) stage.push_back(all.stage[static_cast<std::size_t>(k)]);
    form(own, own) =
        (1 + 1 / count) * ScatterCovariance(FitScatter(MomentsOfReplicates(runs(Eigen::all, own)),
                                                       stage, all.control(own)));
  }
  return form;
}

double Below(const std::vector<double>& p_values, double level) {
  return static_cast<double>(std::count_if(p_values.begin(), p_values.end(),
                                           [level](double p) { return p < level; })) /
         static_cast<double>(p_values.size());
}

Packings PackingsAsAsked() {
  const char* file = std::getenv("CALIB_PACKINGS");
  return file != nullptr ? ReadPackings(file) : MadeUp(60);
}

int MeasurementsAsAsked() {
  const char* number = std::getenv("CALIB_MEASUREMENTS");
  return number != nullptr ? std::atoi(number) : 100;
}

/// What chance allows of a right rate in one of a thousand.
double MostOf(double rate, int measurements) {
  return rate + 3.3 * std::sqrt(rate * (1 - rate) / measurements) + 1.0 / measurements;
}

// What `compare` says of one observable: by the chain alone, no parameter fitted.
TEST(FewPackings, ChiSquaredOfAnObservableIsAsRareAsItsPValueSays) {
  const Packings all = PackingsAsAsked();
  const int measurements = 2 * MeasurementsAsAsked();
  std::cout << "packings | covariance known: p < 0.01, 0.05, 0.5 | from the packings: the same\n";
  for (const int count : {2, 4, 8, 16}) {
    std::vector<double> known;
    std::vector<double> judged;
    std::vector<Index> order = InOrder(all);
    for (int m = 0; m < measurements; ++m) {
      Shuffle(order, count + 1, m);
      const std::vector<Index> own(order.begin(), order.begin() + count);
      const Eigen::MatrixXd runs = all.runs(own, Eigen::all);
      const Eigen::MatrixXd scatter = ClosedForm(all, runs, count);
      PhiloxStream stream = NumberedStream(12, m);
      Eigen::VectorXd residual = all.runs.row(order[own.size()]) - runs.colwise().mean();
      for (double& one : residual) one += stream.Normal();
      for (const int observable : std::set<int>(all.observable.begin(), all.observable.end())) {
        const std::vector<Index> readings = ReadingsOf(all, observable);
        const Eigen::MatrixXd part = scatter(readings, readings);
        const Eigen::MatrixXd covariance =
            part + Eigen::MatrixXd::Identity(part.rows(), part.cols());
        const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
        const double chi2 = factor.matrixL().solve(residual(readings)).squaredNorm();
        const auto n = static_cast<double>(readings.size());
        known.push_back(UpperTail(chi2, n, WhatIsKnown(covariance, part, 0)));
        judged.push_back(UpperTail(chi2, n, WhatIsKnown(covariance, part, count)));
      }
    }
    std::cout << count;
    for (const std::vector<double>* p : {&known, &judged}) {
      std::cout << " | ";
      for (const double level : {0.01, 0.05, 0.5}) std::cout << Below(*p, level) << ' ';
    }
    std::cout << '\n';
    // Observables of one packing go together: as many witnesses as measurements.
    for (const double level : {0.01, 0.05}) {
      EXPECT_LE(Below(judged, level), MostOf(level, measurements)) << count << " packings";
    }
    EXPECT_GT(Below(judged, 0.5), 0.2) << "no misfit would ever be seen";
  }
}

}  // namespace
}  // namespace calib::inference
