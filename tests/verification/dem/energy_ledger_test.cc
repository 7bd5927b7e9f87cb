// Energy with losses: what straining a cell of grains costs is found again as motion, in springs,
// and in what friction or dashpots take, each computed here from places, velocities and forces
// alone.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "dem/dynamics/assembly.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

constexpr double kDensity = 2650;
constexpr double kModulus = 1.2e8;     // kn = 2 E r*
constexpr double kShearRatio = 0.6;    // ks/kn
constexpr double kDampingRatio = 0.2;  // c = 2 beta sqrt(m* kn)
constexpr double kRate = 40;           // [1/s]
constexpr double kStrain = 0.04;

struct Contact {
  Vec3 shear{};       ///< force on j [N]
  double damped = 0;  ///< force of the dashpot, repulsion positive [N]
  double stiffness = 0;
};

struct Ledger {
  double kinetic = 0, normal = 0, shear = 0;  ///< at a time [J]
  double friction = 0, dashpots = 0;          ///< lost since the start [J]
  double work = 0;                            ///< done since the start [J]
};

/// Compresses along z and stretches along x while booking; the dashpots act only without friction,
/// since what they add in shear cannot be told from the spring.
class Book {
 public:
  Book(const Model& model, double damping)
      : assembly_(test::SmallPacking(60), kDensity, ContactModelOf(model), 1), damping_(damping) {
    EXPECT_TRUE(assembly_.EvaluateForces().ok());
    Look(0);
  }

  [[nodiscard]] const Ledger& ledger() const { return ledger_; }

  void Step(double dt) {
    const double before = Power();
    assembly_.Move({.stretch = {0.5 * kRate, 0, -kRate}, .dt = dt});
    EXPECT_TRUE(assembly_.EvaluateForces().ok());
    ledger_.work += 0.5 * (before + Power()) * dt;
    Look(dt);
  }

 private:
  /// Of the mean stress on the cell that is strained [W].
  [[nodiscard]] double Power() const {
    const auto& s = assembly_.stress();
    return assembly_.cell().Volume() * kRate * (s[2] - 0.5 * s[0]);
  }

  void Look(double dt) {
    const ParticleArrays& p = assembly_.particles();
    ledger_.kinetic = 0;
    ledger_.normal = 0;
    ledger_.shear = 0;
    for (std::size_t g = 0; g < p.x.size(); ++g) {
      ledger_.kinetic +=
          0.5 / p.inverse_mass[g] * (p.vx[g] * p.vx[g] + p.vy[g] * p.vy[g] + p.vz[g] * p.vz[g]) +
          0.5 / p.inverse_inertia[g] * (p.wx[g] * p.wx[g] + p.wy[g] * p.wy[g] + p.wz[g] * p.wz[g]);
    }
    std::map<std::pair<int, int>, Contact> now;
    for (int s = 0; s < assembly_.neighbors().size(); ++s) {
      if (assembly_.touching(s)) {
        const auto i = static_cast<std::size_t>(assembly_.neighbors().first[s]);
        const auto j = static_cast<std::size_t>(assembly_.neighbors().second[s]);
        Take(s, i, j, dt, now[{p.id[i], p.id[j]}]);
      }
    }
    for (const auto& [pair, contact] : contacts_) {
      if (now.count(pair) == 0) {  // what its spring still held is gone
        ledger_.friction += 0.5 * Dot(contact.shear, contact.shear) / contact.stiffness;
      }
    }
    contacts_ = std::move(now);
  }

  /// Vector from grain i to the nearest image of j [m].
  [[nodiscard]] Vec3 Branch(std::size_t i, std::size_t j) const {
    const ParticleArrays& p = assembly_.particles();
    const auto& length = assembly_.cell().length;
    const double d[3] = {p.x[j] - p.x[i], p.y[j] - p.y[i], p.z[j] - p.z[i]};
    return {std::remainder(d[0], length[0]), std::remainder(d[1], length[1]),
            std::remainder(d[2], length[2])};
  }

  void Take(int slot, std::size_t i, std::size_t j, double dt, Contact& contact) {
    const ParticleArrays& p = assembly_.particles();
    const Vec3 d = Branch(i, j);
    const Vec3 n = (1.0 / Length(d)) * d;
    const double ri = p.radius[i];
    const double rj = p.radius[j];
    const double kn = 2 * kModulus * ri * rj / (ri + rj);
    const double overlap = ri + rj - Length(d);
    const Vec3 force = assembly_.force_on_j(slot);
    contact.stiffness = kShearRatio * kn;
    contact.shear = force - Dot(force, n) * n;
    ledger_.normal += 0.5 * kn * overlap * overlap;
    ledger_.shear += 0.5 * Dot(contact.shear, contact.shear) / contact.stiffness;
    const Vec3 spin = ri * Vec3{p.wx[i], p.wy[i], p.wz[i]} + rj * Vec3{p.wx[j], p.wy[j], p.wz[j]};
    const Vec3 v = Vec3{p.vx[j] - p.vx[i] + 0.5 * kRate * d.x, p.vy[j] - p.vy[i],
                        p.vz[j] - p.vz[i] - kRate * d.z} -
                   Cross(spin, n);
    const double opening = Dot(v, n);
    const double mass = 1.0 / (p.inverse_mass[i] + p.inverse_mass[j]);
    const double c = 2 * damping_ * std::sqrt(mass * kn);
    contact.damped = std::max(kn * overlap - c * opening, 0.0) - kn * overlap;
    if (dt == 0) {
      return;
    }
    const auto before = contacts_.find({p.id[i], p.id[j]});
    const Contact old =
        before == contacts_.end() ? Contact{} : before->second;  // new: from nothing
    ledger_.dashpots -= 0.5 * (contact.damped + old.damped) * opening * dt;
    // Slip less what the spring has taken up of it is sliding.
    const Vec3 sliding =
        dt * (v - opening * n) + (1.0 / contact.stiffness) * (contact.shear - old.shear);
    ledger_.friction -= 0.5 * Dot(contact.shear + old.shear, sliding);
  }

  Assembly assembly_;
  double damping_ = 0;
  Ledger ledger_;
  std::map<std::pair<int, int>, Contact> contacts_;
};

Ledger Strained(Model model, double damping, const char* what) {
  model.density = kDensity;
  Book book(model, damping);
  const Ledger start = book.ledger();
  const double dt = 1e-7;
  const int steps = static_cast<int>(std::lround(kStrain / kRate / dt));
  for (int step = 0; step < steps; ++step) {
    book.Step(dt);
  }
  Ledger end = book.ledger();
  end.kinetic -= start.kinetic;
  end.normal -= start.normal;
  end.shear -= start.shear;
  std::printf(
      "%s: of the work %.4g J moves %.4f, is in normal springs %.4f, in shear springs %.4f; "
      "friction took %.4f, dashpots %.4f\n",
      what, end.work, end.kinetic / end.work, end.normal / end.work, end.shear / end.work,
      end.friction / end.work, end.dashpots / end.work);
  return end;
}

double Found(const Ledger& l) { return l.kinetic + l.normal + l.shear + l.friction + l.dashpots; }

TEST(EnergyLedger, WorkIsFoundAgainWithFriction) {
  const Ledger end = Strained(test::LinearModel(), 0, "friction");
  EXPECT_GT(end.friction, 0.1 * end.work);
  EXPECT_EQ(end.dashpots, 0);
  EXPECT_NEAR(Found(end), end.work, 1e-2 * end.work);
}

TEST(EnergyLedger, WorkIsFoundAgainWithDashpots) {
  Model model = test::LinearModel();
  model.parameters["friction_coefficient"] = 0;
  model.effects = {"viscous_damping"};
  model.parameters["viscous_damping.ratio"] = kDampingRatio;
  const Ledger end = Strained(model, kDampingRatio, "dashpots");
  EXPECT_GT(end.dashpots, 0.1 * end.work);
  EXPECT_NEAR(Found(end), end.work, 1e-2 * end.work);
}

}  // namespace
}  // namespace calib::dem
