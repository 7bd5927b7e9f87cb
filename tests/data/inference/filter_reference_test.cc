// The sequential filter against independent double-precision results on the authors' ensembles:
// glass beads, iterations 0 and 1 [Cheng 2019], and the triaxial example whose weights the authors'
// own program wrote.

#include <gtest/gtest.h>

#include <cmath>

#include "inference/data/gaussian_likelihood.h"
#include "inference/filter/iterative_filter.h"
#include "inference/filter/log_weights.h"
#include "inference/filter/sequential_filter.h"
#include "inference/filter/tempering.h"
#include "tests/data/inference/reference_files.h"

namespace calib::inference {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Problem {
  DataSet data;                 // processing order of the case
  Eigen::MatrixXd predictions;  // N x T
  Eigen::MatrixXd parameters;   // N x d
  StepOffsets steps;
};

// One experiment whose readings are taken step by step from `observation` and `states`
// (sample-major).
Problem MakeProblem(const std::vector<Eigen::VectorXd>& observation,
                    const std::vector<Eigen::VectorXd>& states, const std::vector<double>& weights,
                    bool reverse) {
  Problem problem;
  const auto steps = static_cast<int>(observation[0].size());
  const auto observables = static_cast<int>(observation.size());
  const auto n = static_cast<int>(states[0].size()) / steps;
  problem.predictions.resize(n, steps * observables);
  problem.data.ess_weights = {weights};
  for (int s = 0; s < steps; ++s) {
    const int step = reverse ? steps - 1 - s : s;
    problem.steps.offsets.push_back(s * observables);
    for (int o = 0; o < observables; ++o) {
      problem.data.readings.push_back(
          {.observable = o, .load_step = step, .value = observation[o][step], .sd = 1});
      for (int i = 0; i < n; ++i)
        problem.predictions(i, s * observables + o) = states[o][i * steps + step];
    }
  }
  problem.steps.offsets.push_back(steps * observables);
  return problem;
}

Problem GlassBeads(int iteration, const std::vector<double>& weights, bool reverse) {
  const std::string folder = "glass_beads_oedometric/";
  const Table experiment = ReadTable(folder + "experiment.dat");
  const std::string ensemble = folder + "ensemble_iter" + std::to_string(iteration);
  const Table states = ReadTable(ensemble + "_states.csv");
  const Table parameters = ReadTable(ensemble + "_parameters.csv");
  Problem problem =
      MakeProblem({experiment.Column("p"), experiment.Column("q"), experiment.Column("n")},
                  {states.Column("p_MPa"), states.Column("q_MPa"), states.Column("porosity")},
                  weights, reverse);
  problem.parameters.resize(problem.predictions.rows(), 4);
  int column = 0;
  for (const char* name : {"young_modulus_Pa", "friction_mu", "rolling_stiffness_nNm_per_rad",
                           "rolling_friction_eta"}) {
    problem.parameters.col(column++) = parameters.Column(name).cwiseAbs();
  }
  return problem;
}

Eigen::VectorXd StartWeights(const std::string& kind, int n, const nlohmann::json& reference) {
  if (kind == "uniform") return Eigen::VectorXd::Constant(n, -std::log(n));
  const bool variational = kind.find("variational") != std::string::npos;
  return -ToVector(reference.at("proposal")
                       .at(variational ? "log_density_variational_at_samples"
                                       : "log_density_mixture_at_samples"));
}

double LargestRelative(const Eigen::MatrixXd& found, const Eigen::MatrixXd& expected) {
  return ((found - expected).array() / expected.array().abs().max(1e-300)).abs().maxCoeff();
}

void ExpectCase(const SequentialResult& found, const nlohmann::json& result) {
  const int last = static_cast<int>(found.ess.size()) - 1;
  const Eigen::VectorXd weights = found.log_weights.col(last).array().exp();
  EXPECT_LE((weights - ToVector(result.at("final_weights"))).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_NEAR(found.ess[last], result.at("ess_final").get<double>(), 1e-10);
  EXPECT_LE(LargestRelative(found.mean.row(last).transpose(), ToVector(result.at("mean_final"))),
            1e-9);
  const Eigen::VectorXd cov = ToVector(result.at("cov_final"));
  EXPECT_LE((found.cov.row(last).transpose() - cov).cwiseAbs().maxCoeff(),
            1e-9 * std::max(cov.maxCoeff(), 1e-3));
  const double log_evidence = result.at("log_evidence").get<double>();
  EXPECT_NEAR(found.log_evidence_increments.sum(), log_evidence,
              1e-8 * std::max(1.0, 1e-4 * std::abs(log_evidence)));
  if (!result.contains("mean")) return;
  EXPECT_LE((found.ess - ToVector(result.at("ess"))).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_LE(LargestRelative(found.mean, ToMatrix(result.at("mean"))), 1e-9);
  EXPECT_LE(LargestRelative(found.cov, ToMatrix(result.at("cov"))), 1e-9);
  EXPECT_LE((found.log_evidence_increments - ToVector(result.at("log_evidence_increments")))
                .cwiseAbs()
                .maxCoeff(),
            1e-8);
}

class GlassBeadFilter : public testing::TestWithParam<int> {
 protected:
  const nlohmann::json reference_ =
      ReadReference("smc_iter" + std::to_string(GetParam()) + ".json");
};
INSTANTIATE_TEST_SUITE_P(Iterations, GlassBeadFilter, testing::Values(0, 1));

TEST_P(GlassBeadFilter, WeightsMomentsAndEvidenceOfEveryCase) {
  for (const auto& item : reference_.at("cases")) {
    SCOPED_TRACE(item.at("case").get<std::string>());
    const auto weights = item.at("obs_variance_weights").get<std::vector<double>>();
    const Problem problem = GlassBeads(GetParam(), weights, item.at("reverse").get<bool>());
    const auto likelihood = GaussianLikelihood::Create(
        WithRelativeErrors(problem.data, item.at("sigma").get<double>()), NoiseMode::kGiven);
    ASSERT_TRUE(likelihood.ok()) << likelihood.status();
    const Eigen::VectorXd start =
        StartWeights(item.at("initial_weights").get<std::string>(),
                     static_cast<int>(problem.parameters.rows()), reference_);
    ExpectCase(SequentialFilter(start, likelihood->Increments(problem.predictions), problem.steps,
                                problem.parameters),
               item.at("result"));
  }
}

Eigen::VectorXd UnitLogLikelihood(const Problem& problem) {
  return GaussianLikelihood::Create(WithRelativeErrors(problem.data, 1), NoiseMode::kGiven)
      ->LogLikelihood(problem.predictions);
}

TEST_P(GlassBeadFilter, SigmaOfTheEffectiveSampleSizeTarget) {
  const Problem problem = GlassBeads(GetParam(), {1, 1, 0.01}, false);
  const Eigen::VectorXd start = Eigen::VectorXd::Zero(100);
  const Eigen::VectorXd log_likelihood = UnitLogLikelihood(problem);
  for (const auto& item : reference_.at("cases")) {
    const auto name = item.at("case").get<std::string>();
    const bool target_20 = name == "ess_target_0.20_uniform_start";
    if (!target_20 && name != "ess_target_0.30_uniform_start") continue;
    const Tempering found = FindExponent({.log_start = start,
                                          .log_likelihood = log_likelihood,
                                          .target = target_20 ? 20.0 : 30.0,
                                          .max_exponent = kInfinity});
    const double sigma = item.at("sigma").get<double>();
    EXPECT_TRUE(found.reached);
    EXPECT_NEAR(1 / found.exponent, sigma, 1e-6 * sigma);
  }
}

// With 1/p start weights 20 % is out of reach; the highest hump is taken.
TEST_P(GlassBeadFilter, HighestHumpWhenTheTargetIsOutOfReach) {
  if (GetParam() == 0) GTEST_SKIP() << "iteration 0 has no proposal";
  const Problem problem = GlassBeads(1, {1, 1, 0.01}, true);
  const Eigen::VectorXd log_likelihood = UnitLogLikelihood(problem);
  for (const std::string kind : {"variational", "mixture"}) {
    const Eigen::VectorXd start = StartWeights("1/p, " + kind, 100, reference_);
    const Tempering found = FindExponent({.log_start = start,
                                          .log_likelihood = log_likelihood,
                                          .target = 20,
                                          .max_exponent = kInfinity});
    const auto& curve = reference_.at("ess_curve_inverse_proposal_" + kind);
    const auto& highest = curve.at("local_maxima").at(1);
    EXPECT_FALSE(found.reached);
    EXPECT_NEAR(1 / found.exponent, highest.at("sigma").get<double>(),
                1e-6 * highest.at("sigma").get<double>());
    EXPECT_NEAR(found.ess / 100, highest.at("ess").get<double>(), 1e-10);
    EXPECT_NEAR(EffectiveSampleSize(start) / 100, curve.at("limit_sigma_to_infinity").get<double>(),
                1e-10);
  }
}

TEST_P(GlassBeadFilter, EffectiveSampleSizeAndEvidenceOverSigma) {
  for (const std::string start_kind :
       {"uniform_start", "inverse_proposal_variational", "inverse_proposal_mixture"}) {
    if (!reference_.contains("ess_curve_" + start_kind)) continue;
    const auto& curve = reference_.at("ess_curve_" + start_kind);
    const Problem problem = GlassBeads(GetParam(), {1, 1, 0.01}, false);
    const Eigen::VectorXd start = NormalizedLogWeights(
        StartWeights(start_kind == "uniform_start" ? "uniform" : start_kind, 100, reference_));
    const Eigen::VectorXd sigma = ToVector(curve.at("sigma"));
    const Eigen::VectorXd ess = ToVector(curve.at("ess"));
    for (Eigen::Index k = 0; k < sigma.size(); ++k) {
      const auto likelihood =
          GaussianLikelihood::Create(WithRelativeErrors(problem.data, sigma[k]), NoiseMode::kGiven);
      const Eigen::VectorXd log_weights = start + likelihood->LogLikelihood(problem.predictions);
      EXPECT_NEAR(EffectiveSampleSize(log_weights) / 100, ess[k], 1e-10) << "sigma " << sigma[k];
      if (!curve.contains("log_evidence")) continue;
      EXPECT_NEAR(LogSumExp(log_weights), curve.at("log_evidence").at(k).get<double>(), 1e-8)
          << "sigma " << sigma[k];
    }
  }
}

// At the sigma of GrainLearning's own search our weights are its weights.
TEST_P(GlassBeadFilter, GrainLearningAtItsSigma) {
  const auto& head = reference_.at("grainlearning_head");
  const auto weights = head.at("obs_variance_weights_normalised").get<std::vector<double>>();
  const Problem problem = GlassBeads(GetParam(), weights, false);
  const auto likelihood = GaussianLikelihood::Create(
      WithRelativeErrors(problem.data, head.at("sigma_found").get<double>()), NoiseMode::kGiven);
  const Eigen::VectorXd log_weights =
      NormalizedLogWeights(likelihood->LogLikelihood(problem.predictions));
  EXPECT_LE((log_weights.array().exp().matrix() - ToVector(head.at("final_weights")))
                .cwiseAbs()
                .maxCoeff(),
            1e-8);
}

// The same through the interface that the server calls: a table of runs from the uniform prior of
// Table 2.
TEST(GlassBeadCampaign, EffectiveSampleSizeTargetOfTheFirstIteration) {
  const Problem problem = GlassBeads(0, {1, 1, 0.01}, false);
  const std::vector<Prior> priors{{.kind = PriorKind::kUniform, .min = 1e11, .max = 2e11},
                                  {.kind = PriorKind::kUniform, .min = 0.3, .max = 0.5},
                                  {.kind = PriorKind::kUniform, .min = 0, .max = 1e4},
                                  {.kind = PriorKind::kUniform, .min = 0.1, .max = 0.5}};
  Iteration iteration;
  iteration.parameters = problem.parameters;
  iteration.predictions = problem.predictions;
  const auto posterior = ComputePosterior(priors, problem.data, {.noise = NoiseMode::kEssTarget},
                                          std::span(&iteration, 1));
  ASSERT_TRUE(posterior.ok()) << posterior.status();
  const nlohmann::json reference = ReadReference("smc_iter0.json");
  const auto& item = reference.at("cases").at(1);
  ASSERT_EQ(item.at("case"), "ess_target_0.20_uniform_start");
  const double sigma = item.at("sigma").get<double>();
  EXPECT_NEAR(posterior->sigma.value(), sigma, 1e-6 * sigma);
  EXPECT_NEAR(posterior->ess, 20, 1e-8);
  const Eigen::VectorXd mean = ToVector(item.at("result").at("mean_final"));
  const Eigen::VectorXd cov = ToVector(item.at("result").at("cov_final"));
  for (Eigen::Index j = 0; j < 4; ++j) {
    EXPECT_NEAR(posterior->parameters[j].mean, mean[j], 1e-8 * mean[j]);
    EXPECT_NEAR(posterior->parameters[j].cov, cov[j], 1e-8);
  }
  EXPECT_NEAR(posterior->log_evidence, item.at("result").at("log_evidence").get<double>(), 1e-6);
}

TEST(TriaxialFilter, WeightsOfTheAuthorsProgramAtEveryStep) {
  const nlohmann::json reference = ReadReference("smc_triaxial_example.json");
  const auto& item = reference.at("cases").at(0);
  const std::string folder = "triaxial_sqmc_example/";
  const Table observation = ReadTable(folder + "observation.csv");
  const Table states = ReadTable(folder + "ensemble_states.csv");
  const Table parameters = ReadTable(folder + "ensemble_parameters.csv");
  // Columns: step, three observables; sample, step, the same three.
  Problem problem = MakeProblem(
      {observation.values.col(1), observation.values.col(2), observation.values.col(3)},
      {states.values.col(2), states.values.col(3), states.values.col(4)}, {1, 1, 1}, false);
  problem.parameters = parameters.values.rightCols(5);
  const auto variances = item.at("variances").get<std::vector<double>>();
  for (Reading& reading : problem.data.readings)
    reading.sd = std::sqrt(variances[reading.observable]);
  const auto likelihood = GaussianLikelihood::Create(problem.data, NoiseMode::kGiven);
  const SequentialResult found =
      SequentialFilter(Eigen::VectorXd::Zero(100), likelihood->Increments(problem.predictions),
                       problem.steps, problem.parameters);
  ExpectCase(found, item.at("result"));
  const auto& authors = item.at("authors_output");
  EXPECT_LE(
      (found.log_weights.array().exp().matrix() - ToMatrix(authors.at("weights_sample_by_step")))
          .cwiseAbs()
          .maxCoeff(),
      1e-12);
  EXPECT_LE(
      LargestRelative(found.mean, ToMatrix(authors.at("identified_parameters_step_by_param"))),
      1e-6);
}

}  // namespace
}  // namespace calib::inference
