// TMCMC on a physical problem: oblique impact of a steel sphere, model M1 of [Hadjidoukas 2014],
// restitution coefficients of its Table 2, against the quadrature of reference/restitution
// (conditions: README there).

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "inference/tmcmc/tmcmc.h"

namespace calib::inference {
namespace {

constexpr double kMass = 0.3538;
constexpr double kStiffness = 22948359831.04046;  // 4/3 E_eff sqrt(R)
constexpr int kAngles = 6;

struct Contact {
  double mu, k_t, gamma;
};
struct Restitution {
  double normal, tangential;
};

// F_n = k xi^1.5 + gamma xi' xi^0.25, F_t = -k_t xi_t clipped at mu |F_n|, slip velocity v_t +
// omega R of a sphere; midpoint rule, 400 steps per Hertzian contact time.
Restitution Collide(const Contact& contact, double speed, double degrees) {
  const double angle = degrees * std::numbers::pi / 180;
  double overlap = 0;
  double velocity = speed * std::cos(angle);
  double slip = speed * std::sin(angle);
  double tangential = slip;
  double spring = 0;
  const double impact = velocity;
  const double incident = tangential;
  const double dt = 2.94 / 400 * std::pow(1.25 * kMass / kStiffness, 0.4) * std::pow(impact, -0.2);
  const auto normal_force = [&](double xi, double v) {
    const double root = std::sqrt(std::max(xi, 0.0));
    return kStiffness * std::max(xi, 0.0) * root + contact.gamma * v * std::sqrt(root);
  };
  do {
    const double middle = velocity - 0.5 * dt * normal_force(overlap, velocity) / kMass;
    const double half = overlap + 0.5 * dt * velocity;
    const double force = normal_force(half, middle);
    spring += dt * slip;
    const double limit = contact.mu * std::abs(force) / contact.k_t;
    spring = std::clamp(spring, -limit, limit);
    const double impulse = -contact.k_t * spring * dt / kMass;
    tangential += impulse;
    slip += 3.5 * impulse;  // 1 + m R^2 / I, I = 2/5 m R^2
    overlap += dt * middle;
    velocity -= dt * force / kMass;
  } while (overlap > 0);
  return {.normal = -velocity / impact, .tangential = tangential / incident};
}

struct Measurement {
  double angle, value, sd;
  bool tangential;
};

std::vector<Measurement> ReadTable2() {
  std::ifstream file(std::string(CALIB_DATA_DIR) + "/steel_disk_restitution/table2.csv");
  std::vector<Measurement> measurements;
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::array<std::string, 4> fields;
    std::istringstream stream(line);
    for (std::string& field : fields) std::getline(stream, field, ',');
    measurements.push_back(
        {std::stod(fields[0]), std::stod(fields[2]), std::stod(fields[3]), fields[1] == "ctr"});
  }
  return measurements;
}

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
        Eigen::VectorXd result = Eigen::VectorXd::Zero(rows.rows());
        for (Eigen::Index i = 0; i < rows.rows(); ++i) {
          for (std::size_t k = 0; k < kAngles;
               ++k) {  // tangential, then normal coefficients of the same angles
            const Restitution model =
                Collide({rows(i, 0), 1e8 * rows(i, 1), 1e4 * rows(i, 2)}, 3, measurements[k].angle);
            for (const Measurement& m : {measurements[k], measurements[k + kAngles]}) {
              const double residual = m.value - (m.tangential ? model.tangential : model.normal);
              const double variance =
                  m.sd * m.sd + rows(i, m.tangential ? 4 : 3) * m.value * m.value;
              result[i] -= 0.5 * (std::log(2 * std::numbers::pi * variance) +
                                  residual * residual / variance);
            }
          }
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

}  // namespace
}  // namespace calib::inference
