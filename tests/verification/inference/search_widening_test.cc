// Where the next runs go while a model is far from its readings: how close four ways to choose them
// come in three iterations of thirty runs.

#include "inference/emulator/search_widening.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "inference/emulator/emulated_posterior.h"
#include "tests/verification/inference/hyperbolic_curve.h"

namespace calib::inference {
namespace {

constexpr int kRuns = 30;
constexpr std::size_t kIterations = 3;

/// The curve under priors as wide as users give who know next to nothing.
struct WideHyperbolicCurve : HyperbolicCurve {
  std::vector<Prior> Priors() const {
    return {{.kind = PriorKind::kLogUniform, .min = 1e7, .max = 2e9},
            {.kind = PriorKind::kUniform, .min = 10, .max = 60},
            {.kind = PriorKind::kUniform, .min = 0, .max = 30},
            {.kind = PriorKind::kUniform, .min = 0.4, .max = 1}};
  }
};

/// kWiderHalfClosest is what campaigns do.
enum class Way { kTemperedWeights, kReadingsErrors, kWiderErrors, kWiderHalfClosest };
constexpr std::array kWays = {Way::kTemperedWeights, Way::kReadingsErrors, Way::kWiderErrors,
                              Way::kWiderHalfClosest};
constexpr std::array kNames = {"tempered weights", "readings' errors", "wider errors",
                               "wider errors, half about the closest"};

double RmsMisfit(const DataSet& data, const Eigen::VectorXd& curve) {
  double squares = 0;
  for (Eigen::Index t = 0; t < curve.size(); ++t) {
    const Reading& reading = data.readings[static_cast<std::size_t>(t)];
    squares += std::pow((curve[t] - reading.value) / reading.sd, 2);
  }
  return std::sqrt(squares / static_cast<double>(curve.size()));
}

/// A run at parameters drawn from the middle of the prior, measured; `off`: what no parameters
/// reach, a wave along either observable [sd, rms].
struct Case {
  WideHyperbolicCurve curve;
  Eigen::VectorXd truth;
  DataSet data;

  Case(double noise, double off, std::uint64_t seed) : truth(HyperbolicCurve::d) {
    PhiloxStream stream(
        {.seed = 900 + seed, .purpose = StreamPurpose::kTest, .iteration = 3, .sample = 0});
    const std::vector<Prior> priors = curve.Priors();
    for (int j = 0; j < truth.size(); ++j) {
      truth[j] = priors[static_cast<std::size_t>(j)].Quantile(0.15 + 0.7 * stream.Uniform());
    }
    data = curve.Measure(truth, noise, 400 + seed);
    for (int t = 0; t < HyperbolicCurve::kSteps; ++t) {
      const double angle = 2 * std::numbers::pi * (t + 1) / HyperbolicCurve::kSteps;
      for (const auto& [first, wave] :
           {std::pair{0, std::sin(angle)}, std::pair{HyperbolicCurve::kSteps, std::cos(angle)}}) {
        Reading& reading =
            data.readings[static_cast<std::size_t>(first) + static_cast<std::size_t>(t)];
        reading.value += off * std::numbers::sqrt2 * wave * reading.sd;
      }
    }
  }

  /// The least misfit of a mean curve, by a random search about the truth that narrows.
  double Least() const {
    const std::vector<Prior> priors = curve.Priors();
    PhiloxStream stream({.seed = 0, .purpose = StreamPurpose::kTest, .iteration = 4, .sample = 0});
    Eigen::VectorXd best = truth;
    double least = RmsMisfit(data, curve.Mean(best));
    double reach = 1;
    for (int k = 0; k < 20000; ++k) {
      Eigen::VectorXd point(best.size());
      bool inside = true;
      for (Eigen::Index j = 0; j < best.size(); ++j) {
        const Prior& prior = priors[static_cast<std::size_t>(j)];
        point[j] = prior.FromStandard(prior.ToStandard(best[j]) + reach * (stream.Uniform() - 0.5));
        inside = inside && prior.InSupport(point[j]);
      }
      const double misfit =
          inside ? RmsMisfit(data, curve.Mean(point)) : std::numeric_limits<double>::infinity();
      if (misfit < least) {
        least = misfit;
        best = point;
      } else if (k % 500 == 499) {
        reach *= 0.8;
      }
    }
    return least;
  }

  /// Misfit of the closest run after each iteration.
  std::array<double, kIterations> Search(Way way, std::uint64_t seed) const {
    const JointPrior priors(curve.Priors());
    const FilterOptions options{.seed = seed};
    std::array<double, kIterations> closest{};
    double least = std::numeric_limits<double>::infinity();
    std::vector<Iteration> iterations;
    Proposal proposal;
    std::uint64_t runs = 0;
    for (std::size_t k = 0; k < kIterations; ++k) {
      const auto drawn = DrawSamples(proposal, priors, options, static_cast<int>(k), kRuns);
      EXPECT_TRUE(drawn.ok()) << drawn.status();
      Iteration iteration{.proposal = proposal,
                          .parameters = *drawn,
                          .predictions = Eigen::MatrixXd(kRuns, HyperbolicCurve::readings),
                          .log_proposal = {}};
      for (int i = 0; i < kRuns; ++i) {
        iteration.predictions.row(i) = curve.Run(iteration.parameters.row(i), seed, runs++);
        least = std::min(least, RmsMisfit(data, iteration.predictions.row(i)));
      }
      closest.at(k) = least;
      iterations.push_back(std::move(iteration));
      proposal = Next(way, priors, options, iterations);
    }
    return closest;
  }

 private:
  Proposal Next(Way way, const JointPrior& priors, const FilterOptions& options,
                const std::vector<Iteration>& iterations) const {
    if (way != Way::kTemperedWeights) {
      const double widening = way == Way::kReadingsErrors ? 1 : SearchWidening(data, iterations);
      const auto emulated = EmulatedPosterior(priors, WithLargerErrors(data, widening),
                                              {.seed = options.seed}, iterations);
      EXPECT_TRUE(emulated.ok()) << emulated.status();
      if (emulated->draws.rows() > 0) {
        const bool closest = way == Way::kWiderHalfClosest && widening > 1;
        return FitProposalToDraws(priors, options, emulated->draws, iterations.size(), {},
                                  closest ? ClosestDraws(*emulated) : Eigen::MatrixXd())
            .value();
      }
    }
    return FitProposal(priors, data, options, iterations).value();
  }
};

double GeometricMean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += std::log(value);
  return std::exp(sum / static_cast<double>(values.size()));
}

// CALIB_SEARCH sets the number of campaigns of each case.
TEST(SearchWideningSlow, ComesCloserThanOtherWays) {
  const char* text = std::getenv("CALIB_SEARCH");
  const int campaigns = text != nullptr ? std::max(2, std::atoi(text)) : 2;
  struct Setting {
    double noise, off;
  };
  using Misfits = std::array<std::vector<double>, kIterations>;  // over the least there is
  for (const auto& [noise, off] : {Setting{0.02, 3}, Setting{0.01, 0}, Setting{0.005, 4}}) {
    std::array<Misfits, kWays.size()> misfits;
    for (int r = 0; r < campaigns; ++r) {
      const auto seed = static_cast<std::uint64_t>(r);
      const Case one(noise, off, seed);
      const double least = one.Least();
      for (std::size_t way = 0; way < kWays.size(); ++way) {
        const auto closest = one.Search(kWays.at(way), seed);
        for (std::size_t k = 0; k < kIterations; ++k) {
          misfits.at(way).at(k).push_back(closest.at(k) / least);
        }
      }
    }
    std::cout << "noise " << 100 * noise << " %, out of reach " << off
              << " sd: misfit of the closest run over the least there is, geometric mean (largest)"
              << " after each iteration\n";
    for (std::size_t way = 0; way < kWays.size(); ++way) {
      std::cout << "  " << kNames.at(way) << ":";
      for (const std::vector<double>& values : misfits.at(way)) {
        std::cout << " " << GeometricMean(values) << " ("
                  << *std::max_element(values.begin(), values.end()) << ")";
      }
      std::cout << '\n';
    }
    const Misfits& own = misfits.back();
    EXPECT_LT(GeometricMean(own[2]), 1.1);
    for (std::size_t way = 0; way + 1 < kWays.size(); ++way) {
      EXPECT_LT(GeometricMean(own[1]), GeometricMean(misfits.at(way)[1])) << kNames.at(way);
    }
  }
}

}  // namespace
}  // namespace calib::inference
