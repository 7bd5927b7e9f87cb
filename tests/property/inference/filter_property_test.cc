// What must not change the posterior: the order of samples, of readings, of experiments; how a
// curve is split into load steps; runs that diverged.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "inference/data/gaussian_likelihood.h"
#include "inference/filter/iterative_filter.h"
#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

constexpr int kSamples = 40;

struct Problem {
  std::vector<Prior> priors{{.kind = PriorKind::kLogUniform, .min = 1, .max = 10},
                            {.kind = PriorKind::kUniform, .min = -1, .max = 2}};
  DataSet data;
  FilterOptions options;
  std::vector<Iteration> iterations;
};

// Two experiments of two observables, random sizes and noise, correlated or not; one iteration or
// two.
Problem SomeProblem() {
  Problem problem;
  const auto seed = static_cast<std::uint64_t>(*rc::gen::inRange(0, 1 << 30));
  PhiloxStream stream({.seed = seed});
  problem.options.seed = seed;
  const int modes = *rc::gen::inRange(0, 3);
  problem.options.noise = static_cast<NoiseMode>(modes);
  const int steps = *rc::gen::inRange(1, 6);
  for (int e = 0; e < 2; ++e) {
    for (int s = 0; s < steps; ++s) {
      for (int o = 0; o < 2; ++o) {
        problem.data.readings.push_back({.experiment = e,
                                         .observable = o,
                                         .load_step = s,
                                         .control = s + 0.5 * stream.Uniform(),
                                         .value = 1 + stream.Uniform(),
                                         .sd = 0.3 + stream.Uniform()});
      }
    }
  }
  if (*rc::gen::arbitrary<bool>())
    problem.data.correlations.push_back({.experiment = 1, .observable = 0, .length = 2});
  const int count = *rc::gen::inRange(1, 3);
  for (int k = 0; k < count; ++k) {
    Iteration iteration;
    if (k > 0) {
      iteration.proposal =
          FitProposal(problem.priors, problem.data, problem.options, problem.iterations).value();
    }
    iteration.parameters =
        DrawSamples(iteration.proposal, problem.priors, problem.options, k, kSamples).value();
    iteration.predictions.resize(kSamples, static_cast<Eigen::Index>(problem.data.readings.size()));
    for (int i = 0; i < kSamples; ++i) {
      for (std::size_t t = 0; t < problem.data.readings.size(); ++t) {
        const Reading& r = problem.data.readings[t];
        iteration.predictions(i, static_cast<Eigen::Index>(t)) =
            iteration.parameters(i, r.observable) * std::exp(-0.1 * r.control) + 0.1 * r.experiment;
      }
    }
    problem.iterations.push_back(std::move(iteration));
  }
  return problem;
}

Posterior Solve(const Problem& problem) {
  return ComputePosterior(problem.priors, problem.data, problem.options, problem.iterations)
      .value();
}

std::vector<int> SomePermutation(int n) {
  std::vector<int> order(n);
  std::iota(order.begin(), order.end(), 0);
  PhiloxStream stream({.seed = static_cast<std::uint64_t>(*rc::gen::inRange(0, 1 << 30))});
  for (int i = n - 1; i > 0; --i)
    std::swap(order[i], order[static_cast<int>(stream.Uniform() * (i + 1))]);
  return order;
}

bool Close(double a, double b) {
  return a == b || std::abs(a - b) <= 1e-8 * (1 + std::abs(a) + std::abs(b));
}

void ExpectSame(const Posterior& a, const Posterior& b) {
  RC_ASSERT(Close(a.log_evidence, b.log_evidence));
  RC_ASSERT(Close(a.ess, b.ess));
  RC_ASSERT(Close(a.pareto_k, b.pareto_k));
  for (std::size_t j = 0; j < a.parameters.size(); ++j) {
    RC_ASSERT(Close(a.parameters[j].mean, b.parameters[j].mean));
    RC_ASSERT(Close(a.parameters[j].sd, b.parameters[j].sd));
    RC_ASSERT(Close(a.parameters[j].q05, b.parameters[j].q05));
    RC_ASSERT(Close(a.parameters[j].q95, b.parameters[j].q95));
    RC_ASSERT(a.parameters[j].at_bound == b.parameters[j].at_bound);
  }
}

RC_GTEST_PROP(Posterior, OrderOfSamplesDoesNotMatter, ()) {
  const Problem problem = SomeProblem();
  Problem permuted = problem;
  const std::vector<int> order = SomePermutation(kSamples);
  for (std::size_t k = 0; k < problem.iterations.size(); ++k) {
    for (int i = 0; i < kSamples; ++i) {
      permuted.iterations[k].parameters.row(i) = problem.iterations[k].parameters.row(order[i]);
      permuted.iterations[k].predictions.row(i) = problem.iterations[k].predictions.row(order[i]);
    }
  }
  ExpectSame(Solve(problem), Solve(permuted));
}

// Any order of presentation, reversed time included: the path differs, its end does not.
RC_GTEST_PROP(Posterior, OrderOfReadingsDoesNotMatter, ()) {
  const Problem problem = SomeProblem();
  Problem permuted = problem;
  const auto readings = static_cast<int>(problem.data.readings.size());
  const std::vector<int> order = SomePermutation(readings);
  for (int t = 0; t < readings; ++t) permuted.data.readings[t] = problem.data.readings[order[t]];
  for (std::size_t k = 0; k < problem.iterations.size(); ++k) {
    for (int t = 0; t < readings; ++t) {
      permuted.iterations[k].predictions.col(t) = problem.iterations[k].predictions.col(order[t]);
    }
  }
  ExpectSame(Solve(problem), Solve(permuted));
}

RC_GTEST_PROP(Posterior, PathEndsInThePosterior, ()) {
  const Problem problem = SomeProblem();
  const Posterior posterior = Solve(problem);
  const Eigen::Index last = posterior.path.ess.size() - 1;
  RC_ASSERT(Close(posterior.path.log_evidence[last], posterior.log_evidence));
  const bool last_only = problem.options.noise == NoiseMode::kEssTarget;
  const auto total =
      static_cast<double>(last_only ? kSamples : kSamples * problem.iterations.size());
  RC_ASSERT(Close(posterior.path.ess[last] * total, posterior.ess));
  for (Eigen::Index j = 0; j < 2; ++j)
    RC_ASSERT(Close(posterior.path.mean(last, j), posterior.parameters[j].mean));
}

// A diverged sample has weight zero, and what its other predictions were does not matter.
RC_GTEST_PROP(Posterior, DivergedSamplesHaveNoWeight, ()) {
  Problem problem = SomeProblem();
  Iteration& last = problem.iterations.back();
  const int row = *rc::gen::inRange(0, kSamples);
  const int column = *rc::gen::inRange(0, static_cast<int>(last.predictions.cols()));
  last.predictions(row, column) = *rc::gen::element(double{NAN}, double{INFINITY});
  const Posterior posterior = Solve(problem);
  const auto index = static_cast<Eigen::Index>((problem.iterations.size() - 1) * kSamples + row);
  RC_ASSERT(posterior.log_weights[index] == -INFINITY);
  RC_ASSERT(!posterior.warnings.empty());
  last.predictions.row(row).setConstant(NAN);
  ExpectSame(posterior, Solve(problem));
}

RC_GTEST_PROP(Posterior, SameInputGivesTheSameBits, ()) {
  const Problem problem = SomeProblem();
  RC_ASSERT(Solve(problem).log_weights == Solve(problem).log_weights);
  const auto a = FitProposal(problem.priors, problem.data, problem.options, problem.iterations);
  const auto b = FitProposal(problem.priors, problem.data, problem.options, problem.iterations);
  RC_ASSERT(a->components.size() == b->components.size());
  for (std::size_t k = 0; k < a->components.size(); ++k)
    RC_ASSERT(a->components[k].covariance == b->components[k].covariance);
  const Eigen::MatrixXd few = DrawSamples(*a, problem.priors, problem.options, 2, 10).value();
  const Eigen::MatrixXd many = DrawSamples(*a, problem.priors, problem.options, 2, 30).value();
  RC_ASSERT(few == many.topRows(10));
  for (Eigen::Index i = 0; i < many.rows(); ++i) {
    for (std::size_t j = 0; j < 2; ++j)
      RC_ASSERT(problem.priors[j].InSupport(many(i, static_cast<Eigen::Index>(j))));
  }
}

// The bound never falls below what the sample ends with, and never rises as readings arrive.
RC_GTEST_PROP(Likelihood, BoundFallsTowardsTheFinalValue, ()) {
  const Problem problem = SomeProblem();
  RC_PRE(problem.options.noise != NoiseMode::kEssTarget);
  Eigen::MatrixXd partial = problem.iterations[0].predictions;
  const Eigen::VectorXd final = LogLikelihood(problem.data, problem.options, partial).value();
  Eigen::VectorXd before = final;
  for (Eigen::Index t = partial.cols() - 1; t >= 0; --t) {
    partial.col(t).setConstant(NAN);
    const Eigen::VectorXd bound =
        LogLikelihoodBound(problem.data, problem.options, partial).value();
    for (Eigen::Index i = 0; i < kSamples; ++i)
      RC_ASSERT(bound[i] >= before[i] - 1e-9 * (1 + std::abs(before[i])));
    before = bound;
  }
}

}  // namespace
}  // namespace calib::inference
