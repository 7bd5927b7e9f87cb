// The emulator on the authors' oedometric runs of glass beads [Cheng 2019],
// data/glass_beads_oedometric: 4 x 100 runs of 101 states. There is no known posterior at an honest
// noise; checked is that the emulator predicts runs it has not seen as well as it claims, and that
// its posterior agrees between the iterations.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <ctime>
#include <iostream>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "inference/emulator/emulated_posterior.h"
#include "inference/emulator/state_emulator.h"
#include "tests/data/inference/reference_files.h"

namespace calib::inference {
namespace {

constexpr double kNoise = 0.01;  // of p and q
constexpr double kPorosityNoise =
    0.002;  // absolute: the void ratio of a specimen is not known better

std::vector<Prior> Priors() {
  return {{.kind = PriorKind::kUniform, .min = 100e9, .max = 200e9},
          {.kind = PriorKind::kUniform, .min = 0.3, .max = 0.5},
          {.kind = PriorKind::kUniform, .min = 0, .max = 1e4},
          {.kind = PriorKind::kUniform, .min = 0.1, .max = 0.5}};
}

// Iteration k with what was simulated: absolute values [README of the data].
Iteration ReadIteration(int k) {
  const std::string name = "glass_beads_oedometric/ensemble_iter" + std::to_string(k);
  const Table parameters = ReadTable(name + "_parameters.csv");
  const Table states = ReadTable(name + "_states.csv");
  Iteration iteration;
  iteration.parameters = parameters.values.middleCols(1, 4).cwiseAbs();
  const Eigen::Index runs = parameters.values.rows();
  const Eigen::Index steps = states.values.rows() / runs;
  iteration.predictions.resize(runs, 3 * steps);
  const Eigen::VectorXd p = states.Column("p_MPa");
  const Eigen::VectorXd q = states.Column("q_MPa");
  const Eigen::VectorXd n = states.Column("porosity");
  for (Eigen::Index i = 0; i < runs; ++i) {
    for (Eigen::Index t = 0; t < steps; ++t) {
      iteration.predictions.row(i).segment(3 * t, 3) << p[i * steps + t], q[i * steps + t],
          n[i * steps + t];
    }
  }
  return iteration;
}

DataSet ReadMeasurement() {
  const Table table = ReadTable("glass_beads_oedometric/experiment.dat");
  const Eigen::VectorXd strain = table.Column("e_a");
  const std::vector<Eigen::VectorXd> observables = {table.Column("p"), table.Column("q"),
                                                    table.Column("n")};
  DataSet data;
  double control = 0;
  for (Eigen::Index t = 0; t < strain.size(); ++t) {
    if (t > 0) control += std::abs(strain[t] - strain[t - 1]);
    for (int j = 0; j < 3; ++j) {
      const double value = observables[static_cast<std::size_t>(j)][t];
      // q passes zero on unloading: its error is relative to p there.
      const double scale = j == 1 ? std::max(std::abs(value), observables[0][t]) : value;
      data.readings.push_back({.observable = j,
                               .load_step = static_cast<int>(t),
                               .control = control,
                               .value = value,
                               .sd = j == 2 ? kPorosityNoise : kNoise * scale});
    }
  }
  // Errors of load cells and of the packing drift, they are not drawn anew at each of 101 readings.
  for (int j = 0; j < 3; ++j)
    data.correlations.push_back({.experiment = 0, .observable = j, .length = 0.003});
  return data;
}

void Print(const std::string& name, const EmulatedResult& result) {
  std::cout << name << ": cross-validated error " << result.cross_validated_error
            << " noise sd (scatter " << result.scatter << ", calibration " << result.calibration
            << "), unknown over the posterior " << result.emulator_sd << ", " << result.components
            << " components, " << result.runs << " runs, " << (result.local ? "local" : "broad")
            << ", log evidence " << result.log_evidence << " +- " << result.log_evidence_se
            << (result.adequate ? "" : ", NOT adequate: " + result.reason) << '\n';
  for (const ParameterSummary& p : result.parameters)
    std::cout << "    " << p.mean << " +- " << p.sd << '\n';
}

TEST(EmulatorGlassBeads, ErrorsAreAsLargeAsClaimedAndIterationsAgree) {
  constexpr int kIterations = 4;
  std::vector<Iteration> iterations;
  iterations.reserve(kIterations);
  for (int k = 0; k < kIterations; ++k) iterations.push_back(ReadIteration(k));
  const DataSet data = ReadMeasurement();
  const auto first = EmulatedPosterior(Priors(), data, {.seed = 1}, std::span(iterations).first(1));
  const std::clock_t start = std::clock();
  const auto all = EmulatedPosterior(Priors(), data, {.seed = 1}, iterations);
  const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  ASSERT_TRUE(first.ok() && all.ok()) << first.status() << all.status();
  Print("iteration 0", *first);
  Print("iterations 0-3", *all);
  std::cout << "400 runs, 303 readings: " << seconds << " s of one core\n";
  EXPECT_LT(first->calibration, 2);
  EXPECT_LT(all->calibration, 2);
  EXPECT_TRUE(first->adequate) << first->reason;
  // Four iterations that are not quite one model (README.md of the data) leave a posterior only
  // where no run is.
  EXPECT_FALSE(all->adequate);
  EXPECT_NE(all->reason.find("where few runs are"), std::string::npos) << all->reason;
  for (std::size_t j = 0; j < 4; ++j) {
    const ParameterSummary& a = first->parameters[j];
    const ParameterSummary& b = all->parameters[j];
    EXPECT_LT(std::abs(a.mean - b.mean), 3 * std::hypot(a.sd, b.sd)) << "parameter " << j;
  }
  EXPECT_LT(seconds, 5);
}

// The emulated histories of iteration 0 in the place of the DEM: what two more iterations gain from
// a mixture fitted to parameters and states (README.md of inference/filter).
TEST(EmulatorGlassBeads, EffectiveSamplesWithAndWithoutStatesInTheMixture) {
  constexpr int kSeeds = 20;
  constexpr int kSamples = 100;
  constexpr double kWider = 5;  // errors, so that weights hold more than a sample or two
  const std::vector<Prior> priors = Priors();
  DataSet data = ReadMeasurement();
  for (Reading& reading : data.readings) reading.sd *= kWider;
  const Iteration runs = ReadIteration(0);
  const auto standard = [&priors](const Eigen::MatrixXd& p) {
    Eigen::MatrixXd inputs = p;
    for (Eigen::Index j = 0; j < p.cols(); ++j) {
      for (double& x : inputs.col(j)) x = priors[static_cast<std::size_t>(j)].ToStandard(x);
    }
    return inputs;
  };
  Eigen::RowVectorXd value(data.readings.size());
  Eigen::RowVectorXd sd(data.readings.size());
  for (Eigen::Index t = 0; t < value.size(); ++t) {
    value[t] = data.readings[static_cast<std::size_t>(t)].value;
    sd[t] = data.readings[static_cast<std::size_t>(t)].sd;
  }
  std::vector<Eigen::Index> all(static_cast<std::size_t>(runs.parameters.rows()));
  std::iota(all.begin(), all.end(), 0);
  const Eigen::MatrixXd histories =
      (runs.predictions.rowwise() - value).array().rowwise() / sd.array();
  const auto emulator = StateEmulator::Fit(standard(runs.parameters), histories, all, {});
  ASSERT_TRUE(emulator.ok()) << emulator.status();
  const auto predict = [&](const Eigen::MatrixXd& parameters) {
    const PrincipalComponents& components = emulator->components();
    Eigen::MatrixXd states =
        emulator->Predict(standard(parameters)).mean * components.basis.transpose();
    states.rowwise() += components.mean;
    states = (states.array().rowwise() * sd.array()).matrix().rowwise() + value;
    return states;
  };
  double log_ess[2] = {0, 0};
  for (int seed = 1; seed <= kSeeds; ++seed) {
    for (const MixtureOver over : {MixtureOver::kParameters, MixtureOver::kParametersAndStates}) {
      const FilterOptions options{.mixture = over, .seed = static_cast<std::uint64_t>(seed)};
      std::vector<Iteration> iterations;
      for (int k = 0; k < 3; ++k) {
        Iteration iteration;
        if (k > 0) iteration.proposal = FitProposal(priors, data, options, iterations).value();
        iteration.parameters =
            DrawSamples(iteration.proposal, priors, options, k, kSamples).value();
        iteration.predictions = predict(iteration.parameters);
        iterations.push_back(std::move(iteration));
      }
      const auto posterior = ComputePosterior(priors, data, options, iterations);
      ASSERT_TRUE(posterior.ok()) << posterior.status();
      log_ess[static_cast<int>(over)] += std::log(posterior->ess) / kSeeds;
    }
  }
  std::cout << "effective of 3 x " << kSamples << " samples, geometric mean of " << kSeeds
            << " seeds: parameters " << std::exp(log_ess[0]) << ", parameters and states "
            << std::exp(log_ess[1]) << '\n';
  EXPECT_NEAR(log_ess[1], log_ess[0], std::log(1.5));
}

TEST(EmulatorGlassBeads, SameSeedSameBits) {
  const std::vector<Iteration> iterations = {ReadIteration(0)};
  const DataSet data = ReadMeasurement();
  const auto first = EmulatedPosterior(Priors(), data, {.draws = 500, .seed = 7}, iterations);
  const auto again = EmulatedPosterior(Priors(), data, {.draws = 500, .seed = 7}, iterations);
  ASSERT_TRUE(first.ok() && again.ok());
  EXPECT_EQ(first->draws, again->draws);
}

}  // namespace
}  // namespace calib::inference
