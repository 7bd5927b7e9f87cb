#pragma once
// Oblique impact of a steel sphere on a steel wall and its measured restitution coefficients, under
// the conditions reconstructed in the data's README.

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

namespace calib::inference {

constexpr double kMass = 0.3538;
constexpr double kStiffness = 22948359831.04046;  // 4/3 E_eff sqrt(R)
constexpr int kAngles = 6;

struct Contact {
  double mu, k_t, gamma;
  double alpha = 0.25;  ///< of the overlap in the damping: M1 1/4, M2 1/2, M3 free
};
struct Restitution {
  double normal, tangential;
};

/// F_n = k xi^1.5 + gamma xi' xi^alpha, F_t = -k_t xi_t clipped at mu |F_n|, slip velocity v_t +
/// omega R of a sphere; second order in the step, `steps` of them per Hertzian contact time. A
/// strongly damped contact creeps back and, with alpha below 1/2, never opens in finite time: after
/// five Hertzian contact times it counts as it then is, its rebound being next to nothing.
inline Restitution Collide(const Contact& contact, double speed, double degrees, int steps = 100) {
  const double angle = degrees * std::numbers::pi / 180;
  double overlap = 0;
  double velocity = speed * std::cos(angle);
  double slip = speed * std::sin(angle);
  double tangential = slip;
  double spring = 0;
  const double impact = velocity;
  const double incident = tangential;
  const double dt =
      2.94 / steps * std::pow(1.25 * kMass / kStiffness, 0.4) * std::pow(impact, -0.2);
  const auto normal_force = [&](double xi, double v) {
    const double root = std::sqrt(xi);
    const double damping = contact.alpha == 0.25  ? std::sqrt(root)
                           : contact.alpha == 0.5 ? root
                                                  : std::pow(xi, contact.alpha);
    return kStiffness * xi * root + contact.gamma * v * damping;
  };
  for (int step = 0; step < 5 * steps; ++step) {
    const double half = std::max(overlap + 0.5 * dt * velocity, 0.0);
    // v at the middle from the force there, which is linear in it.
    const double elastic = normal_force(half, 0);
    const double damping = normal_force(half, 1) - elastic;
    const double middle =
        (velocity - 0.5 * dt * elastic / kMass) / (1 + 0.5 * dt * damping / kMass);
    const double force = elastic + damping * middle;
    const double next = overlap + dt * middle;
    const double share = next > 0 ? 1 : overlap / (overlap - next);  // of the step in contact
    const double limit = contact.mu * std::abs(force) / contact.k_t;
    spring = std::clamp(spring + 0.5 * dt * slip, -limit, limit);
    const double impulse = -contact.k_t * spring * dt * share / kMass;
    tangential += impulse;
    slip += 3.5 * impulse;  // 1 + m R^2 / I, I = 2/5 m R^2
    spring += 0.5 * dt * slip;
    velocity -= share * dt * force / kMass;
    overlap = next;
    if (overlap <= 0) break;
  }
  return {.normal = -velocity / impact, .tangential = tangential / incident};
}

struct Measurement {
  double angle, value, sd;
  bool tangential;
};

inline std::vector<Measurement> ReadTable2() {
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

/// ln p(Table 2 | model) with the error model of [Hadjidoukas 2014, Eq. 20], variance nu^2 + s y^2:
/// s[0] of the normal, s[1] of the tangential coefficients.
inline double LogLikelihoodOfTable2(const std::vector<Measurement>& measurements,
                                    const Contact& contact, double speed,
                                    const std::array<double, 2>& variance) {
  double result = 0;
  for (std::size_t k = 0; k < kAngles; ++k) {  // tangential, then normal ones of the same angles
    const Restitution model = Collide(contact, speed, measurements[k].angle);
    for (const Measurement& m : {measurements[k], measurements[k + kAngles]}) {
      const double residual = m.value - (m.tangential ? model.tangential : model.normal);
      const double total = m.sd * m.sd + variance[m.tangential ? 1 : 0] * m.value * m.value;
      result -= 0.5 * (std::log(2 * std::numbers::pi * total) + residual * residual / total);
    }
  }
  return result;
}

}  // namespace calib::inference
