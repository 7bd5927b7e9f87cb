// Are p values right where the scatter between packings is known from few of them? Measurements on
// one more packing, of a model that lacks nothing, judged by four to sixteen others.
// deploy/bench/few-packings does the same with packings that were run.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "inference/diagnosis/screen.h"
#include "inference/sampling/philox.h"
#include "inference/scatter/chi_squared_law.h"
#include "inference/scatter/packing_scatter.h"
#include "inference/scatter/scatter.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr int kDraws = 400;

/// Curves in standard deviations of their readings' noise.
struct Packings {
  Eigen::MatrixXd runs;                // N x T, one parameter vector on N packings
  Eigen::MatrixXd responses;           // d x T, to the parameters
  Eigen::MatrixXd effects;             // q x T, signatures that a screen looks for
  std::vector<int> observable, stage;  // T
  Eigen::VectorXd control;             // T, path length since the start
};

/// Waves that observables share, of a size of its own for each packing: no chain.
Packings MadeUp(int count) {
  constexpr Index kReadings = 20;
  constexpr int kWaves = 4;
  Packings made{.runs = Eigen::MatrixXd(count, 2 * kReadings),
                .responses = Eigen::MatrixXd(2, 2 * kReadings),
                .effects = Eigen::MatrixXd(2, 2 * kReadings),
                .observable = {},
                .stage = {},
                .control = Eigen::VectorXd(2 * kReadings)};
  for (Index k = 0; k < 2 * kReadings; ++k) {
    const double x = static_cast<double>(k % kReadings) / kReadings;
    made.observable.push_back(static_cast<int>(k / kReadings));
    made.stage.push_back(x < 0.5 ? 0 : 1);
    made.control[k] = x;
    const double sign = k < kReadings ? 1 : -1;
    made.responses.col(k) << 10 * x, 10 * sign * (1 - x);
    made.effects.col(k) << 5 * std::exp(-8 * std::abs(x - 0.5)), 5 * sign * std::cos(9 * x);
  }
  for (int p = 0; p < count; ++p) {
    PhiloxStream stream({.seed = 11,
                         .purpose = StreamPurpose::kDiagnosisNull,
                         .iteration = 0,
                         .sample = static_cast<std::uint64_t>(p)});
    const double size = 3 * std::exp(0.3 * stream.Normal());
    Eigen::VectorXd amplitude(2 * kWaves);
    for (double& one : amplitude) one = stream.Normal();
    for (Index k = 0; k < 2 * kReadings; ++k) {
      double sum = 0;
      for (int w = 0; w < kWaves; ++w) {
        const double wave = std::sin((2 * w + 1) * made.control[k] + w) / (1 + w);
        sum += wave * (amplitude[w] + (k < kReadings ? 0.5 : -0.5) * amplitude[kWaves + w]);
      }
      made.runs(p, k) = size * std::sqrt(made.control[k]) * sum;
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

/// Of deploy/bench/few-packings.d/packings.py: runs, responses, effects, three rows.
Packings ReadPackings(const char* file) {
  std::ifstream in(file);
  Packings read{.runs = ReadMatrix(in),
                .responses = ReadMatrix(in),
                .effects = ReadMatrix(in),
                .observable = {},
                .stage = {},
                .control = {}};
  const Eigen::MatrixXd places = ReadMatrix(in);
  EXPECT_TRUE(in) << file;
  for (Index k = 0; k < places.cols(); ++k) {
    read.observable.push_back(static_cast<int>(places(0, k)));
    read.stage.push_back(static_cast<int>(places(1, k)));
  }
  read.control = places.row(2);
  return read;
}

PhiloxStream NumberedStream(std::uint64_t seed, int sample) {
  return PhiloxStream({.seed = seed,
                       .purpose = StreamPurpose::kDiagnosisNull,
                       .iteration = 0,
                       .sample = static_cast<std::uint64_t>(sample)});
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

/// The model as the first `count` of `order` know it, seen from a measurement on the next. Its
/// parameters are free: what they do is part of every measurement.
FittedModel ModelOf(const Packings& all, const std::vector<Index>& order, int count, int seed) {
  const Index t = all.runs.cols();
  const std::vector<Index> own(order.begin(), order.begin() + count);
  const Eigen::MatrixXd runs = all.runs(own, Eigen::all);
  const Eigen::RowVectorXd mean = runs.colwise().mean();
  const double packings = count;
  const Eigen::MatrixXd departures =
      std::sqrt((1 + 1 / packings) / (1 - 1 / packings)) * (runs.rowwise() - mean);
  std::vector<int> packing(own.size());
  std::iota(packing.begin(), packing.end(), 0);
  PackingScatter scatter = ScatterBetweenPackings(
      departures, packing,
      [&](std::optional<int> left_out) {
        std::vector<Index> rows;
        for (const int one : packing) {
          if (one != left_out) rows.push_back(one);
        }
        return ClosedForm(all, runs(rows, Eigen::all), packings);
      },
      Eigen::MatrixXd::Identity(t, t) + 1e4 * all.responses.transpose() * all.responses);
  PhiloxStream stream = NumberedStream(12, seed);
  Eigen::MatrixXd histories = mean - all.runs.row(order[own.size()]);
  for (double& reading : histories.reshaped()) reading += stream.Normal();
  FittedModel model{.histories = std::move(histories),
                    .covariance = std::move(scatter.covariance),
                    .parameters = static_cast<int>(all.responses.rows()),
                    .draws = Eigen::MatrixXd(kDraws, t),
                    .group = {},
                    .without = std::move(scatter.without),
                    .packings = count};
  for (Index s = 0; s < kDraws; ++s) {
    const Index run = s % count;
    const double sign = stream.Normal() < 0 ? -1 : 1;
    for (Index k = 0; k < t; ++k) {
      model.draws(s, k) = sign * departures(run, k) + stream.Normal();
    }
    model.group.push_back(static_cast<int>(run));
  }
  std::map<std::pair<int, int>, std::vector<Index>> stages;
  for (Index k = 0; k < t; ++k) {
    const auto at = static_cast<std::size_t>(k);
    stages[{all.observable[at], all.stage[at]}].push_back(k);
  }
  Eigen::MatrixXd constant = Eigen::MatrixXd::Zero(t, static_cast<Index>(stages.size()));
  Index q = 0;
  for (const auto& [stage, readings] : stages) constant(readings, q++).setOnes();
  model.shapes = {constant};
  return model;
}

/// p values of adequacy, and the smallest of a screen, adjusted.
struct Judged {
  std::vector<double> adequacy{}, screen{};
};

void Judge(const FittedModel& model, const Packings& all, Judged& judged) {
  judged.adequacy.push_back(TestAdequacy(model)->p_value);
  std::vector<Signature> effects;
  for (Index e = 0; e < all.effects.rows(); ++e) {
    effects.push_back({.name = std::to_string(e), .differences = {all.effects.row(e)}});
  }
  judged.screen.push_back(Screen(model, effects)->front().adjusted);
}

/// With each packing judged without itself, and with scatter taken as known from all of them.
std::pair<Judged, Judged> JudgeMany(const Packings& all, int count, int measurements) {
  std::pair<Judged, Judged> judged;
  std::vector<Index> order = InOrder(all);
  for (int m = 0; m < measurements; ++m) {
    Shuffle(order, count + 1, m);
    FittedModel model = ModelOf(all, order, count, m);
    Judge(model, all, judged.first);
    model.without.clear();
    model.packings = 0;
    Judge(model, all, judged.second);
  }
  return judged;
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

/// The same with runs whose scatter has the closed form: a chain along the path of either
/// observable.
Packings ChainsAsAsked() {
  Packings chains = PackingsAsAsked();
  if (std::getenv("CALIB_PACKINGS") != nullptr) return chains;
  constexpr double kSd = 3;
  constexpr double kLength = 0.3;
  for (Index p = 0; p < chains.runs.rows(); ++p) {
    PhiloxStream stream = NumberedStream(14, static_cast<int>(p));
    for (Index k = 0; k < chains.runs.cols(); ++k) {
      const double step = k == 0 ? 0 : chains.control[k] - chains.control[k - 1];
      const double kept = step > 0 ? std::exp(-step / kLength) : 0;  // else another observable
      const double before = k == 0 ? 0 : chains.runs(p, k - 1);
      chains.runs(p, k) = kept * before + kSd * std::sqrt(1 - kept * kept) * stream.Normal();
    }
  }
  return chains;
}

int MeasurementsAsAsked() {
  const char* number = std::getenv("CALIB_MEASUREMENTS");
  return number != nullptr ? std::atoi(number) : 100;
}

/// What chance allows of a right rate in one of a thousand.
double MostOf(double rate, int measurements) {
  return rate + 3.3 * std::sqrt(rate * (1 - rate) / measurements) + 1.0 / measurements;
}

TEST(FewPackings, MisfitOfARightModelIsAsRareAsItsPValueSays) {
  const Packings all = PackingsAsAsked();
  const int measurements = MeasurementsAsAsked();
  std::cout << "packings | known: p < 0.01, 0.05, 0.5, screen p < 0.01, 0.05"
               " | left out: the same\n";
  for (const int count : {4, 8, 16}) {
    if (std::getenv("CALIB_PACKINGS") == nullptr && count == 16) continue;
    const auto [without, known] = JudgeMany(all, count, measurements);
    std::cout << count;
    for (const Judged* judged : {&known, &without}) {
      std::cout << " | ";
      for (const double level : {0.01, 0.05, 0.5})
        std::cout << Below(judged->adequacy, level) << ' ';
      for (const double level : {0.01, 0.05}) std::cout << ' ' << Below(judged->screen, level);
    }
    std::cout << '\n';
    for (const double level : {0.01, 0.05}) {
      EXPECT_LE(Below(without.adequacy, level), MostOf(level, measurements))
          << count << " packings";
      EXPECT_LE(Below(without.screen, level), MostOf(level, measurements)) << count << " packings";
    }
    EXPECT_GT(Below(without.adequacy, 0.5), 0.25) << "no misfit would ever be seen";
    if (count == 4) {
      EXPECT_GT(Below(known.adequacy, 0.01), 0.1) << "what leaving out is for";
    }
  }
}

// What `compare` says of one observable: by the chain alone, no parameter fitted.
TEST(FewPackings, ChiSquaredOfAnObservableIsAsRareAsItsPValueSays) {
  const Packings all = ChainsAsAsked();
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

// A screen looks in one direction, chi-squared in all: what few packings leave uncertain hides less
// from it.
TEST(FewPackings, AnEffectIsSeenSoonerByItsSignatureThanByTheMisfit) {
  const Packings all = PackingsAsAsked();
  const bool made_up = std::getenv("CALIB_PACKINGS") == nullptr;
  const int measurements = made_up ? 40 : MeasurementsAsAsked();
  const Index effects = made_up ? 1 : all.effects.rows();
  std::cout << "effect, times its strength | seen (p < 0.01) by adequacy, by the screen\n";
  for (Index effect = 0; effect < effects; ++effect) {
    for (const double strength : {made_up ? 2.0 : 0.5, 1.0}) {
      Judged judged;
      std::vector<Index> order = InOrder(all);
      for (int m = 0; m < measurements; ++m) {
        Shuffle(order, 9, m);
        FittedModel model = ModelOf(all, order, 8, m);
        model.histories = model.histories.Values() - strength * all.effects.row(effect);
        Judge(model, all, judged);
      }
      const double misfit = Below(judged.adequacy, 0.01);
      const double signature = Below(judged.screen, 0.01);
      std::cout << effect << ", " << strength << " | " << misfit << ", " << signature << '\n';
      if (made_up && strength == 2) {
        EXPECT_GE(misfit, 0.5);
        EXPECT_GE(signature, 0.9);
      }
      if (made_up) {
        EXPECT_GE(signature, misfit);
      }
    }
  }
}

TEST(FewPackings, TwoOrThreePackingsProveNothing) {
  const Packings all = MadeUp(60);
  std::vector<Index> order = InOrder(all);
  int rejected = 0;
  for (int m = 0; m < 40; ++m) {
    std::rotate(order.begin(), order.begin() + 4, order.end());
    FittedModel model = ModelOf(all, order, 3, m);
    model.without.clear();
    rejected += TestAdequacy(model)->p_value < 0.01 ? 1 : 0;
    model.packings = 0;  // as if the scatter were known
    EXPECT_LE(TestAdequacy(model)->p_value, 1);
  }
  EXPECT_EQ(rejected, 0);
}

}  // namespace
}  // namespace calib::inference
