// TMCMC on a physical problem: oblique impact of a steel sphere, model M1 of [Hadjidoukas 2014],
// restitution coefficients of its Table 2, against the quadrature of reference/restitution
// (conditions: README there).

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "inference/tmcmc/tmcmc.h"
#include "tests/data/inference/restitution_model.h"

namespace calib::inference {
namespace {

nlohmann::json ReadRestitution(const std::string& name) {
  std::ifstream file(std::string(CALIB_DATA_DIR) + "/../reference/restitution/" + name);
  return nlohmann::json::parse(file);
}

TEST(TmcmcRestitution, CollisionsAgreeWithTheReference) {
  int checked = 0;
  const auto reference = ReadRestitution("forward_model.json");
  for (const auto& one : reference.at("cases")) {
    if (one.at("model") != "M1") continue;
    for (std::size_t k = 0; k < kAngles; ++k) {
      const Restitution found = Collide({one.at("mu"), one.at("k_t"), one.at("gamma_n")},
                                        one.at("total_speed"), one.at("impact_angle_deg")[k]);
      EXPECT_NEAR(found.normal, one.at("cnr")[k].get<double>(), 3e-3);
      EXPECT_NEAR(found.tangential, one.at("ctr")[k].get<double>(), 3e-3);
      ++checked;
    }
  }
  EXPECT_EQ(checked, 3 * kAngles);
}

TEST(TmcmcRestitution, EvidenceOfModelOne) {
  const auto reference = ReadRestitution("evidence_M1.json").at("results")[0];
  const std::vector<Measurement> measurements = ReadTable2();
  ASSERT_EQ(measurements.size(), 2u * kAngles);
  const auto uniform = [](double min, double max) {
    return Prior{.kind = PriorKind::kUniform, .min = min, .max = max};
  };
  const std::vector<Prior> priors = {uniform(0.05, 0.2), uniform(0.1, 15), uniform(0.1, 15),
                                     uniform(0, 1e-2), uniform(0, 1e-2)};
  const auto state =
      RunTmcmc(priors, {.samples = 1500, .seed = 3}, [&](const Eigen::MatrixXd& rows) {
        Eigen::VectorXd result(rows.rows());
        for (Eigen::Index i = 0; i < rows.rows(); ++i) {
          result[i] =
              LogLikelihoodOfTable2(measurements, {rows(i, 0), 1e8 * rows(i, 1), 1e4 * rows(i, 2)},
                                    3, {rows(i, 3), rows(i, 4)});
        }
        return result;
      });
  ASSERT_TRUE(state.ok()) << state.status();
  std::cout << "M1: log evidence " << state->log_evidence << " +- "
            << state->LogEvidenceStandardError() << ", exact " << reference.at("log_evidence")
            << "; mean mu " << state->samples.col(0).mean() << ", k_t "
            << state->samples.col(1).mean() << "e8, gamma " << state->samples.col(2).mean()
            << "e4\n";
  EXPECT_NEAR(state->log_evidence, reference.at("log_evidence").get<double>(), 0.4);
  const std::array<const char*, 3> names = {"mu", "k_t_1e8", "gamma_n_1e4"};
  const std::array<const char*, 3> covs = {"mu", "k_t", "gamma_n"};
  for (std::size_t j = 0; j < 3; ++j) {
    const double mean = reference.at("mean").at(names[j]);
    const double sd = mean * reference.at("cov").at(covs[j]).get<double>();
    EXPECT_NEAR(state->samples.col(static_cast<Eigen::Index>(j)).mean(), mean, 0.25 * sd)
        << names[j];
  }
}

// Models M1 to M3 at several impact speeds, which the paper does not state. Columns: mu, k_t [1e8
// N/m], gamma [1e4], alpha, log evidence with its standard error, mean with coefficient of
// variation.
struct Fit {
  TmcmcState state;
  double Mean(Eigen::Index j) const { return state.samples.col(j).mean(); }
  double Cov(Eigen::Index j) const {
    return std::sqrt((state.samples.col(j).array() - Mean(j)).square().mean()) / Mean(j);
  }
};

Fit FitModel(int model, double speed, int samples) {
  const std::vector<Measurement> measurements = ReadTable2();
  const auto uniform = [](double min, double max) {
    return Prior{.kind = PriorKind::kUniform, .min = min, .max = max};
  };
  std::vector<Prior> priors = {uniform(0.05, 0.2), uniform(0.1, 15), uniform(0.1, 15),
                               uniform(0, 1e-2), uniform(0, 1e-2)};
  if (model == 3) priors.push_back(uniform(0.15, 1.35));
  auto state = RunTmcmc(priors, {.samples = samples, .seed = 3}, [&](const Eigen::MatrixXd& rows) {
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

// A study, not part of the suite: CALIB_RESTITUTION=quick takes more than five minutes, full hours. It
// has not been run to its end yet, so its limits are expectations.
TEST(TmcmcRestitution, ThreeModelsOverTheImpactSpeed) {
  const char* text = std::getenv("CALIB_RESTITUTION");
  if (text == nullptr) GTEST_SKIP() << "set CALIB_RESTITUTION to quick or full";
  const bool full = std::string(text) == "full";
  const std::vector<double> speeds =
      full ? std::vector<double>{1, 2, 2.5, 3, 4} : std::vector<double>{3};
  for (const double speed : speeds) {
    std::vector<Fit> fits;
    for (int model = 1; model <= 3; ++model) {
      fits.push_back(FitModel(model, speed, full ? 2000 : 40));
      const Fit& fit = fits.back();
      std::cout << "| " << speed << " | M" << model;
      for (const Eigen::Index j : {0, 1, 2}) {
        std::cout << " | " << fit.Mean(j) << " (" << std::round(100 * fit.Cov(j)) << " %)";
      }
      std::cout << " | "
                << (model == 3   ? fit.Mean(5)
                    : model == 2 ? 0.5
                                 : 0.25)
                << " | " << fit.state.log_evidence << " +- " << fit.state.LogEvidenceStandardError()
                << " |\n";
    }
    // Restitution that depends on the speed hardly at all tells the damping laws apart by the angle
    // alone: none of the three is favoured decisively (Bayes factor 150), within the errors stated.
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        const double error = std::hypot(fits[a].state.LogEvidenceStandardError(),
                                        fits[b].state.LogEvidenceStandardError());
        EXPECT_LT(fits[a].state.log_evidence - fits[b].state.log_evidence,
                  std::log(150) + 4 * error);
      }
    }
    // Friction is told by the gross sliding at small angles, whatever the damping [Table 4: 0.108
    // to 0.111, 10 to 13 %].
    for (const Fit& fit : fits) EXPECT_NEAR(fit.Mean(0), 0.109, 0.02) << "speed " << speed;
  }
}

}  // namespace
}  // namespace calib::inference
