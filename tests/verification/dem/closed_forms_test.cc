// Further closed forms of contacts and packings: tangential loop, moduli of a lattice, energy.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <numbers>

#include "dem/dynamics/quasi_static.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

constexpr double kRadius = 1e-3;

/// Two equal spheres at a constant overlap, displaced along y in steps; returns the shear force on
/// j.
class ShearedPair {
 public:
  ShearedPair(const Model& model, double overlap) : model_(ContactModelOf(model)) {
    for (int k = 0; k < kBlock; ++k) {
      block_.radius_i[k] = block_.radius_j[k] = kRadius;
      block_.dx[k] = 2 * kRadius - overlap;
    }
    block_.sliding_friction = model_.sliding_friction();
    block_.dt = 1;
  }

  double Displace(double step) {
    for (int k = 0; k < kBlock; ++k) {  // slip counts on rigid arms
      block_.vy[k] = step * block_.dx[k] / (2 * kRadius);
    }
    model_.Evaluate(block_);
    return block_.fy[0];
  }

  [[nodiscard]] double normal_force() const { return block_.normal_force[0]; }

 private:
  ContactModel model_;
  ContactBlock block_{};
};

// Without partial slip the loop is Mindlin's initial stiffness between Coulomb's limits; it
// encloses 4 mu F (d - mu F/k) [Mindlin 1949; Cundall & Strack 1979].
TEST(TangentialLoop, MindlinStiffnessBetweenCoulombsLimits) {
  const Model model = test::HertzModel();  // E 0.8 GPa, nu 0.2, mu 0.55
  constexpr double kOverlap = 2e-6;
  ShearedPair pair(model, kOverlap);
  const double contact_radius = std::sqrt(kRadius / 2 * kOverlap);
  const double shear_modulus = 8e8 / (2 * 1.2);
  // 8 a G*, 1/G* = 2 (2 - nu)/G of two equal spheres
  const double stiffness = 8 * contact_radius * shear_modulus / (2 * (2 - 0.2));
  const double step = 1e-9;
  EXPECT_NEAR(-pair.Displace(step), stiffness * step, 1e-9 * stiffness * step);
  const double limit = 0.55 * pair.normal_force();
  const double largest = 3 * limit / stiffness;
  const int steps = 3000;
  const double d = largest / steps;
  double work = 0;
  double force = 0;
  const auto walk = [&](double direction, int count) {
    for (int s = 0; s < count; ++s) {
      const double next = pair.Displace(direction * d);
      work -= 0.5 * (force + next) * direction * d;
      force = next;
    }
  };
  walk(1, steps);
  EXPECT_NEAR(-force, limit, 1e-9 * limit);
  walk(-1, 100);  // unloading is elastic and as stiff as loading
  EXPECT_NEAR(-force, limit - stiffness * 100 * d, 1e-8 * limit);
  walk(-1, 2 * steps - 100);
  EXPECT_NEAR(force, limit, 1e-9 * limit);
  work = 0;  // one whole cycle from -largest
  walk(1, 2 * steps);
  walk(-1, 2 * steps);
  const double enclosed = 4 * limit * (largest - limit / stiffness);
  EXPECT_NEAR(work, enclosed, 1e-3 * enclosed);
}

/// Work of a cycle between -d and d at a constant normal force, with partial slip, over (mu F)^2/k.
/// x = d k/(mu F), k the initial stiffness. Loading follows T = mu F (1 - (1 - 2d/3)^1.5) to gross
/// sliding at x = 1.5, unloading and reloading are that curve twice as large [Mindlin & Deresiewicz
/// 1953; Johnson 1985, sec. 7.4].
double MindlinDeresiewiczLoop(double x) {
  constexpr int kSteps = 20000;
  const auto shear = [](double d) { return d < 1.5 ? 1 - std::pow(1 - 2 * d / 3, 1.5) : 1.0; };
  double work = 0;  // between the branches up from (-x, -T) and down from (x, T)
  for (int s = 0; s < kSteps; ++s) {
    const double d = -x + 2 * x * (s + 0.5) / kSteps;
    const double up = 2 * shear((d + x) / 2) - shear(x);
    const double down = shear(x) - 2 * shear((x - d) / 2);
    work += (up - down) * 2 * x / kSteps;
  }
  return work;
}

// What the missing partial slip costs. Mindlin and Deresiewicz lose 36/5 (1 - (1-t)^(5/3) - 5t/6 (1
// + (1-t)^(2/3))) in a cycle to t = T/(mu F) < 1, and 4 (x - 6/5) beyond gross sliding; without
// partial slip it is nothing and 4 (x - 1).
TEST(TangentialLoop, WithoutPartialSlipSmallLoopsLoseNothingAndWideOnesALittleMore) {
  for (const double t : {0.2, 0.5, 0.9, 1.0}) {
    const double x = 1.5 * (1 - std::pow(1 - t, 2.0 / 3));
    const double closed =
        7.2 * (1 - std::pow(1 - t, 5.0 / 3) - 5 * t / 6 * (1 + std::pow(1 - t, 2.0 / 3)));
    EXPECT_NEAR(MindlinDeresiewiczLoop(x), closed, 1e-4 * closed) << t;
  }
  EXPECT_NEAR(MindlinDeresiewiczLoop(3), 4 * (3 - 1.2), 1e-4 * 7.2);

  const Model model = test::HertzModel();
  constexpr double kOverlap = 2e-6;
  ShearedPair pair(model, kOverlap);
  const double stiffness = -pair.Displace(1e-12) / 1e-12;
  const double limit = 0.55 * pair.normal_force();
  const auto loop = [&](double x) {  // over (mu F)^2/k, the second cycle
    constexpr int kSteps = 2000;
    const double d = x * limit / stiffness / kSteps;
    double force = pair.Displace(0);
    double work = 0;
    for (const int cycle : {0, 1}) {
      work = 0;
      for (const auto& [direction, count] :
           {std::pair(cycle == 0 ? 1 : 0, kSteps), std::pair(cycle == 0 ? 0 : 1, 2 * kSteps),
            std::pair(-1, 2 * kSteps)}) {
        for (int s = 0; s < count; ++s) {
          const double next = pair.Displace(direction * d);
          work -= 0.5 * (force + next) * direction * d;
          force = next;
        }
      }
    }
    return work * stiffness / (limit * limit);
  };
  EXPECT_NEAR(loop(0.9), 0, 1e-6);  // Mindlin and Deresiewicz: 0.196
  EXPECT_NEAR(loop(3), 4 * (3 - 1), 1e-2);
}

/// Simple cubic lattice of linear contacts, 4 x 4 x 4, just touching.
Packing Lattice(double overlap) {
  Packing p;
  const double d = 2 * kRadius - overlap;
  for (double& length : p.length) {
    length = 4 * d;
  }
  for (int c = 0; c < 64; ++c) {
    p.x.push_back((c % 4 + 0.5) * d);
    p.y.push_back((c / 4 % 4 + 0.5) * d);
    p.z.push_back((c / 16 + 0.5) * d);
    p.radius.push_back(kRadius);
    p.clump.push_back(-1);
  }
  return p;
}

// C11 = kn/d, C12 = 0, C44 = ks/(2 d) of a simple cubic lattice of diameter d; grains turn by half
// the shear [Digby 1981; Chang & Misra 1990].
TEST(EffectiveModuli, OfACubicPacking) {
  constexpr double kOverlap = 1e-8;
  constexpr double kStrain = 1e-6;
  const double kn = 2 * 1.2e8 * kRadius / 2;
  const double ks = 0.6 * kn;
  const double d = 2 * kRadius - kOverlap;
  StageOptions options;
  options.rate = 1e-3;
  options.unbalanced = 1e-9;
  Model model = test::LinearModel();
  model.parameters["friction_coefficient"] = 10;

  Assembly compressed(Lattice(kOverlap), 2650, ContactModelOf(model), 1);
  QuasiStatic stages(compressed, options, {});
  CellTarget target;
  for (std::size_t a = 0; a < 3; ++a) {
    target[a] = {.mode = AxisTarget::Mode::kLength, .value = 4 * d};
  }
  ASSERT_EQ(stages.MoveTo(target), StageEnd::kDone) << stages.reason();
  const auto before = compressed.stress();
  target[2].value = 4 * d * (1 - kStrain);
  ASSERT_EQ(stages.MoveTo(target), StageEnd::kDone) << stages.reason();
  const double c11 = (compressed.stress()[2] - before[2]) / kStrain;
  EXPECT_NEAR(c11, kn / d, 1e-4 * kn / d);
  EXPECT_NEAR(compressed.stress()[0] - before[0], 0, 1e-4 * kn / d * kStrain);

  Assembly sheared(Lattice(kOverlap), 2650, ContactModelOf(model), 1);
  options.unbalanced = 1e-3;
  QuasiStatic shearing(sheared, options, {});
  for (std::size_t a = 0; a < 3; ++a) {
    target[a].value = 4 * d;
  }
  target.displacement = 4 * d * kStrain;
  ASSERT_EQ(shearing.MoveTo(target), StageEnd::kDone) << shearing.reason();
  for (int k = 0; k < 40; ++k) {  // balance looks at forces; let the spins settle too
    ASSERT_EQ(shearing.Settle(target), StageEnd::kDone) << shearing.reason();
  }
  const double c44 = sheared.shear_stress() / kStrain;
  EXPECT_NEAR(c44, ks / (2 * d), 5e-3 * ks / (2 * d));
}

/// Kinetic and elastic energy of frictionless Hertz grains.
double Energy(const Assembly& assembly, double modulus) {
  const ParticleArrays& p = assembly.particles();
  double e = 0;
  for (std::size_t g = 0; g < p.x.size(); ++g) {
    e += 0.5 / p.inverse_mass[g] * (p.vx[g] * p.vx[g] + p.vy[g] * p.vy[g] + p.vz[g] * p.vz[g]);
  }
  for (int s = 0; s < assembly.neighbors().size(); ++s) {
    if (!assembly.touching(s)) continue;
    const auto i = static_cast<std::size_t>(assembly.neighbors().first[s]);
    const auto j = static_cast<std::size_t>(assembly.neighbors().second[s]);
    const double force = Length(assembly.force_on_j(s));
    const double r = p.radius[i] * p.radius[j] / (p.radius[i] + p.radius[j]);
    const double overlap = std::pow(force / (modulus * std::sqrt(r)), 2.0 / 3.0);
    e += 0.4 * force * overlap;
  }
  return e;
}

// A gas of elastic grains: energy within the order of the leapfrog (velocities half a step behind
// positions make it flicker with the step), momentum to rounding.
TEST(Balance, ElasticGrainsKeepEnergyAndMomentum) {
  Model model = test::HertzModel();
  model.parameters["friction_coefficient"] = 0;
  const double modulus = 2 * 8e8 / (3 * (1 - 0.04));
  for (int half = 0; half < 2; ++half) {
    Assembly assembly(test::SmallPacking(200), 2650, ContactModelOf(model), 1);
    ParticleArrays& p = assembly.mutable_particles();
    for (std::size_t g = 0; g < p.x.size(); ++g) {
      const double phase = 2.399963 * p.id[g];
      p.vx[g] = 2 * std::cos(phase);
      p.vy[g] = 2 * std::sin(phase);
      p.vz[g] = std::cos(3 * phase);
    }
    const auto momentum = [&p](const std::vector<double>& v) {
      double sum = 0;
      for (std::size_t g = 0; g < v.size(); ++g) sum += v[g] / p.inverse_mass[g];
      return sum;
    };
    ASSERT_TRUE(assembly.EvaluateForces().ok());
    const double before[3] = {momentum(p.vx), momentum(p.vy), momentum(p.vz)};
    double scale = 0;
    for (std::size_t g = 0; g < p.x.size(); ++g) scale += 2 / p.inverse_mass[g];
    const double start = Energy(assembly, modulus);
    const double dt = 2e-8 / (1 + half);
    const int steps = 20000 * (1 + half);
    double largest = 0;
    double lowest = 1e300;
    for (int s = 0; s < steps; ++s) {
      assembly.Move({.dt = dt});
      ASSERT_TRUE(assembly.EvaluateForces().ok());
      if (s % (steps / 50) != 0) continue;
      const double e = Energy(assembly, modulus);
      largest = std::max(largest, e);
      lowest = std::min(lowest, e);
    }
    EXPECT_NEAR(momentum(p.vx), before[0], 1e-12 * scale);
    EXPECT_NEAR(momentum(p.vy), before[1], 1e-12 * scale);
    EXPECT_NEAR(momentum(p.vz), before[2], 1e-12 * scale);
    std::printf("dt %.2g s: energy %.6f .. %.6f of the start\n", dt, lowest / start,
                largest / start);
    EXPECT_NEAR(lowest / start, 1, 2e-3);
    EXPECT_NEAR(largest / start, 1, 2e-3);
  }
}

}  // namespace
}  // namespace calib::dem
