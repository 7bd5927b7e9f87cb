// TMCMC on a physical problem: oblique impact of a steel sphere, models M1 to M3 of [Hadjidoukas
// 2014] on the restitution coefficients of its Table 2, beside its Table 4 and, M1, against the
// quadrature of reference/restitution (conditions: README there).

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "inference/tmcmc/tmcmc.h"
#include "tests/data/inference/restitution_model.h"

namespace calib::inference {
namespace {

nlohmann::json ReadRestitution(const std::string& name) {
  std::ifstream file(std::string(CALIB_DATA_DIR) + "/../reference/restitution/" + name);
  return nlohmann::json::parse(file);
}

// The reference has a thousand times the steps; those of the default cost a tenth of the smallest
// measurement error, 0.005.
TEST(TmcmcRestitution, CollisionsAgreeWithTheReference) {
  std::size_t checked = 0;
  const auto reference = ReadRestitution("forward_model.json");
  for (const auto& one : reference.at("cases")) {
    const Contact contact{one.at("mu"), one.at("k_t"), one.at("gamma_n"), one.at("alpha_n")};
    for (std::size_t k = 0; k < kAngles; ++k) {
      const double degrees = one.at("impact_angle_deg")[k];
      for (const auto& [steps, limit] : {std::pair(100, 5e-4), std::pair(800, 5e-5)}) {
        const Restitution found = Collide(contact, one.at("total_speed"), degrees, steps);
        EXPECT_NEAR(found.normal, one.at("cnr")[k].get<double>(), limit) << steps;
        EXPECT_NEAR(found.tangential, one.at("ctr")[k].get<double>(), limit) << steps;
      }
      ++checked;
    }
  }
  EXPECT_EQ(checked, 4u * kAngles);
}

// Where damping is so strong that the contact only creeps back, M3 at the lower end of alpha.
TEST(TmcmcRestitution, OverdampedCollisionEnds) {
  const Restitution found = Collide({.mu = 0.1, .k_t = 1e8, .gamma = 15e4, .alpha = 0.15}, 3, 30);
  EXPECT_NEAR(found.normal, 0, 0.01);
  EXPECT_GT(found.tangential, 0);
}

struct Fit {
  TmcmcState state;
  double Mean(Eigen::Index j) const { return state.samples.col(j).mean(); }
  double Cov(Eigen::Index j) const {
    return std::sqrt((state.samples.col(j).array() - Mean(j)).square().mean()) / Mean(j);
  }
};

Fit FitModel(int model, double speed, int samples, std::uint64_t seed = 3) {
  const std::vector<Measurement> measurements = ReadTable2();
  const auto uniform = [](double min, double max) {
    return Prior{.kind = PriorKind::kUniform, .min = min, .max = max};
  };
  std::vector<Prior> priors = {uniform(0.05, 0.2), uniform(0.1, 15), uniform(0.1, 15),
                               uniform(0, 1e-2), uniform(0, 1e-2)};
  if (model == 3) priors.push_back(uniform(0.15, 1.35));
  auto state =
      RunTmcmc(priors, {.samples = samples, .seed = seed}, [&](const Eigen::MatrixXd& rows) {
        Eigen::VectorXd result(rows.rows());
        for (Eigen::Index i = 0; i < rows.rows(); ++i) {
          const double alpha = model == 1 ? 0.25 : model == 2 ? 0.5 : rows(i, 5);
          result[i] = LogLikelihoodOfTable2(measurements,
                                            {rows(i, 0), 1e8 * rows(i, 1), 1e4 * rows(i, 2), alpha},
                                            speed, {rows(i, 3), rows(i, 4)});
        }
        return result;
      });
  EXPECT_TRUE(state.ok()) << state.status();
  return {.state = *std::move(state)};
}

std::vector<Fit> FitAndPrint(double speed, int samples) {
  std::vector<Fit> fits;
  for (int model = 1; model <= 3; ++model) {
    fits.push_back(FitModel(model, speed, samples));
    const Fit& fit = fits.back();
    const auto percent = [&](Eigen::Index j) { return std::round(100 * fit.Cov(j)); };
    std::cout << "| " << speed << " | M" << model << std::setprecision(3);
    for (const Eigen::Index j : {0, 1, 2})
      std::cout << " | " << fit.Mean(j) << " (" << percent(j) << " %)";
    if (model == 3) {
      std::cout << " | " << fit.Mean(5) << " (" << percent(5) << " %)";
    } else {
      std::cout << " | " << (model == 1 ? 0.25 : 0.5);
    }
    std::cout << " | " << fit.Mean(3) << " | " << fit.Mean(4) << std::setprecision(4) << " | "
              << fit.state.log_evidence << " +- " << std::setprecision(2)
              << fit.state.LogEvidenceStandardError() << " |" << std::endl;
  }
  return fits;
}

// Friction is told by the gross sliding at small angles, whatever the damping: Table 4 has 0.108 to
// 0.111, with 10 to 13 %. gamma's unit goes with alpha, so that M2's is an order above M1's.
void ExpectTheShapesOfTable4(const std::vector<Fit>& fits) {
  for (const Fit& fit : fits) EXPECT_NEAR(fit.Mean(0), 0.109, 0.12 * 0.109);
  EXPECT_NEAR(fits[0].Mean(2), 0.81, 2 * 0.172 * 0.81);
  EXPECT_NEAR(fits[1].Mean(2), 8.41, 2 * 0.187 * 8.41);
}

TEST(TmcmcRestitution, EvidenceOfModelOne) {
  const auto reference = ReadRestitution("evidence_M1.json").at("results")[0];
  // CALIB_SEEDS sets how many. The few chains that found the needle of small errors descend from
  // few draws, and so does the estimate of how few: over 64 seeds errors are 1.3 times what is
  // stated.
  const char* text = std::getenv("CALIB_SEEDS");
  const std::uint64_t seeds = text != nullptr ? std::max(2, std::atoi(text)) : 4;
  double mean_error = 0;
  double squared_error = 0;
  double stated = 0;
  for (std::uint64_t seed = 4; seed < 4 + seeds; ++seed) {
    const TmcmcState state = FitModel(1, 3, 1500, seed).state;
    const double error = state.log_evidence - reference.at("log_evidence").get<double>();
    const double standard_error = state.LogEvidenceStandardError();
    std::cout << "M1, seed " << seed << ": log evidence off by " << error << " +- "
              << standard_error << "\n";
    EXPECT_LE(std::abs(error), 0.6);
    const auto share = 1 / static_cast<double>(seeds);
    mean_error += share * error;
    squared_error += share * error * error;
    stated += share * standard_error * standard_error;
  }
  std::cout << "M1, " << seeds << " seeds: off by " << std::sqrt(squared_error) << " (rms), stated "
            << std::sqrt(stated) << ", mean " << mean_error << "\n";
  EXPECT_LE(std::abs(mean_error), 0.3);
  EXPECT_LE(std::sqrt(squared_error), 2 * std::sqrt(stated));
  const Fit fit = FitModel(1, 3, 1500);
  std::cout << std::setprecision(4) << "M1: log evidence " << fit.state.log_evidence << " +- "
            << fit.state.LogEvidenceStandardError() << ", exact " << reference.at("log_evidence")
            << "; mean mu " << fit.Mean(0) << ", k_t " << fit.Mean(1) << "e8, gamma " << fit.Mean(2)
            << "e4\n";
  const std::array<const char*, 3> names = {"mu", "k_t_1e8", "gamma_n_1e4"};
  const std::array<const char*, 3> covs = {"mu", "k_t", "gamma_n"};
  for (std::size_t j = 0; j < 3; ++j) {
    const double mean = reference.at("mean").at(names[j]);
    const double sd = mean * reference.at("cov").at(covs[j]).get<double>();
    EXPECT_NEAR(fit.Mean(static_cast<Eigen::Index>(j)), mean, 0.25 * sd) << names[j];
  }
}

// Of the samples' values in this column, the share in [low, high).
double ShareWithin(const Fit& fit, Eigen::Index j, double low, double high) {
  const auto column = fit.state.samples.col(j).array();
  return static_cast<double>((column >= low && column < high).count()) /
         static_cast<double>(column.size());
}

// The two shapes that the paper reports [Hadjidoukas 2014, Figs. 2 and 4]: k_t with one mode near
// 0.45e8 N/m and one near 1.4e8 (it has 0.4 and 1.33), and gamma u^alpha, known at the overlaps of
// these impacts alone, so that ln gamma grows with alpha along a ridge: by ln(1/u), u the largest
// overlap, 1e-4 m or so.
TEST(TmcmcRestitution, StiffnessHasTwoModesAndDampingARidge) {
  const Fit one = FitModel(1, 3, 4000);
  std::cout << "M1, share of k_t [1e8 N/m]:";
  for (int bin = 1; bin < 20; ++bin) {
    std::cout << " " << 0.1 * bin << ": " << ShareWithin(one, 1, 0.1 * bin, 0.1 * (bin + 1));
  }
  std::cout << "\n";
  const double lower = ShareWithin(one, 1, 0.35, 0.6);
  const double valley = ShareWithin(one, 1, 0.7, 0.95);
  const double upper = ShareWithin(one, 1, 1.3, 1.55);
  EXPECT_GT(lower, 2 * valley) << lower << ", valley " << valley;
  EXPECT_GT(upper, 5 * lower) << upper << ", lower mode " << lower;

  const Fit three = FitModel(3, 3, 1500);
  const Eigen::ArrayXd alpha = three.state.samples.col(5).array();
  const Eigen::ArrayXd log_gamma = three.state.samples.col(2).array().log();
  const Eigen::ArrayXd a = alpha - alpha.mean();
  const Eigen::ArrayXd g = log_gamma - log_gamma.mean();
  const double correlation = (a * g).sum() / std::sqrt(a.square().sum() * g.square().sum());
  const double slope = (a * g).sum() / a.square().sum();
  std::cout << "M3: correlation of ln gamma with alpha " << correlation << ", slope " << slope
            << "\n";
  EXPECT_GT(correlation, 0.9);
  EXPECT_NEAR(slope, std::log(1e4), 2);
}

// Columns: speed, model, mu, k_t [1e8 N/m], gamma [1e4], alpha, variances of the normal and the
// tangential coefficients, log evidence with its standard error; RESULTS.md beside this file.
// The impact speeds are those that the paper leaves open; CALIB_RESTITUTION sets the number of
// samples.
TEST(TmcmcRestitution, ThreeModelsOverTheImpactSpeed) {
  const char* text = std::getenv("CALIB_RESTITUTION");
  const int samples = text != nullptr ? std::max(100, std::atoi(text)) : 400;
  const auto reference = ReadRestitution("evidence_M1.json").at("results")[0];
  for (const double speed : {1.0, 2.0, 2.5, 3.0, 4.0}) {
    const std::vector<Fit> fits = FitAndPrint(speed, samples);
    ExpectTheShapesOfTable4(fits);
    if (speed != 3) continue;  // the speed of the quadrature
    EXPECT_NEAR(fits[0].state.log_evidence, reference.at("log_evidence").get<double>(),
                4 * fits[0].state.LogEvidenceStandardError());
  }
}

}  // namespace
}  // namespace calib::inference
