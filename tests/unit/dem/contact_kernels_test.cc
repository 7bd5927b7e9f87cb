// The contact kernels one block at a time, against the formulas they implement.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dem/contact/contact_kinematics.h"
#include "dem/dynamics/contact_model.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

constexpr double kRadiusI = 2e-3;
constexpr double kRadiusJ = 3e-3;
constexpr double kOverlap = 1e-5;

/// Every lane the same contact along x with the given relative velocity, at rest otherwise.
ContactBlock Block(double vy = 0) {
  ContactBlock b{};
  b.count = kBlock;
  b.dt = 1e-6;
  b.sliding_friction = 0.5;
  for (int k = 0; k < kBlock; ++k) {
    b.radius_i[k] = kRadiusI;
    b.radius_j[k] = kRadiusJ;
    b.dx[k] = kRadiusI + kRadiusJ - kOverlap;
    b.vy[k] = vy;
  }
  return b;
}

TEST(HertzMindlin, NormalForceFollowsHertz) {
  const ContactModel model = ContactModelOf(test::HertzModel());
  ContactBlock b = Block();
  model.Evaluate(b);
  const double modulus = 8e8 / (2 * (1 - 0.2 * 0.2));
  const double radius = kRadiusI * kRadiusJ / (kRadiusI + kRadiusJ);
  const double hertz = 4.0 / 3.0 * modulus * std::sqrt(radius) * std::pow(kOverlap, 1.5);
  EXPECT_NEAR(b.normal_force[0], hertz, 1e-9 * hertz);
  EXPECT_NEAR(b.normal_stiffness[0], 1.5 * hertz / kOverlap, 1e-9 * hertz / kOverlap);
  EXPECT_NEAR(b.force_x[0], hertz, 1e-9 * hertz);
}

TEST(HertzMindlin, TangentialStiffnessFollowsMindlin) {
  const ContactModel model = ContactModelOf(test::HertzModel());
  ContactBlock b = Block(1e-3);
  model.Evaluate(b);
  const double shear_modulus = 8e8 / (2 * 1.2);
  const double radius = kRadiusI * kRadiusJ / (kRadiusI + kRadiusJ);
  const double ks = 4 * shear_modulus * std::sqrt(radius * kOverlap) / (2 - 0.2);
  EXPECT_NEAR(b.tangential_stiffness[0], ks, 1e-9 * ks);
  // j moves along +y against i: the force on j points along -y.
  const double rigid = (kRadiusI + kRadiusJ) / (kRadiusI + kRadiusJ - kOverlap);
  EXPECT_NEAR(b.force_y[0], -ks * 1e-3 * 1e-6 * rigid, 1e-6 * ks * 1e-9);
}

TEST(Linear, StiffnessesGrowWithTheRadii) {
  const ContactModel model = ContactModelOf(test::LinearModel());
  ContactBlock b = Block();
  model.Evaluate(b);
  const double kn = 2 * 1.2e8 * kRadiusI * kRadiusJ / (kRadiusI + kRadiusJ);
  EXPECT_NEAR(b.normal_force[0], kn * kOverlap, 1e-9 * kn * kOverlap);
  EXPECT_NEAR(b.tangential_stiffness[0], 0.6 * kn, 1e-9 * kn);
}

// Held across a gap, as by a liquid bridge: no spring is there, and no dashpot beside it.
TEST(Linear, NothingActsAcrossAGap) {
  Model damped = test::LinearModel();
  damped.effects = {"viscous_damping"};
  damped.parameters["viscous_damping.ratio"] = 1;
  for (const Model& m : {damped, test::LinearModel(), test::HertzModel()}) {
    const ContactModel model = ContactModelOf(m);
    ContactBlock b = Block(1e-3);
    for (int k = 0; k < kBlock; ++k) {
      b.dx[k] = kRadiusI + kRadiusJ + kOverlap;
      b.vx[k] = -0.1;
    }
    model.Evaluate(b);
    EXPECT_EQ(b.normal_force[0], 0);
    EXPECT_EQ(b.normal_stiffness[0], 0);
    EXPECT_EQ(b.tangential_stiffness[0], 0);
    EXPECT_EQ(b.normal_damping[0], 0);
  }
}

TEST(Sliding, ForceStaysOnCoulombLimit) {
  for (const Model& m : {test::HertzModel(), test::LinearModel()}) {
    const ContactModel model = ContactModelOf(m);
    ContactBlock b = Block(1e3);
    for (int step = 0; step < 5; ++step) {
      model.Evaluate(b);
      EXPECT_NEAR(std::abs(b.fy[0]), 0.5 * b.normal_force[0], 1e-12 * b.normal_force[0]);
    }
  }
}

TEST(Sliding, ShearForceIsNotRescaledWhenTheOverlapShrinks) {
  const ContactModel model = ContactModelOf(test::HertzModel());
  ContactBlock b = Block(1e-3);
  model.Evaluate(b);
  const double before = b.fy[0];
  for (int k = 0; k < kBlock; ++k) {
    b.vy[k] = 0;
    b.dx[k] += 0.5 * kOverlap;
  }
  model.Evaluate(b);
  EXPECT_DOUBLE_EQ(b.fy[0], before);
}

TEST(Kinematics, RollingWithoutSlipHasNoSlip) {
  ContactBlock b = Block();
  for (int k = 0; k < kBlock; ++k) {  // gears: surface velocities agree at the contact
    b.wiz[k] = 10 / kRadiusI;
    b.wjz[k] = -10 / kRadiusJ;
  }
  ComputeKinematics(b);
  EXPECT_NEAR(b.slip_y[0], 0, 1e-18);
  EXPECT_NEAR(b.roll_z[0], b.dt * (-10 / kRadiusJ - 10 / kRadiusI), 1e-15);
}

TEST(Kinematics, RigidRotationOfThePairHasNoSlip) {
  ContactBlock b = Block();
  for (int k = 0; k < kBlock; ++k) {
    b.vy[k] = 7 * b.dx[k];
    b.wiz[k] = b.wjz[k] = 7;
  }
  ComputeKinematics(b);
  EXPECT_NEAR(b.slip_y[0], 0, 1e-18);
  EXPECT_EQ(b.roll_z[0], 0);
  EXPECT_EQ(b.twist[0], 0);
}

TEST(Kinematics, HomogeneousDeformationActsOverTheBranch) {
  ContactBlock b = Block();
  b.stretch[0] = -0.1;
  ComputeKinematics(b);
  EXPECT_DOUBLE_EQ(b.normal_velocity[0], -0.1 * b.dx[0]);
}

TEST(Transport, ShearForceTurnsWithThePairByAQuarter) {
  // A pair turns rigidly about z from x to y; a force along y at the start must end along -x with
  // the same size.
  constexpr int kSteps = 2000;
  const double angle = std::acos(-1.0) / 2 / kSteps;
  ContactBlock b = Block();
  b.dt = 1;
  const double length = b.dx[0];
  std::fill(b.history[1], b.history[1] + kBlock, 3.0);
  for (int step = 1; step <= kSteps; ++step) {
    const double c = std::cos(angle * step);
    const double s = std::sin(angle * step);
    const double c0 = std::cos(angle * (step - 1));
    const double s0 = std::sin(angle * (step - 1));
    for (int k = 0; k < kBlock; ++k) {
      b.dx[k] = length * c;
      b.dy[k] = length * s;
      b.vx[k] = length * (c - c0);
      b.vy[k] = length * (s - s0);
      b.wiz[k] = b.wjz[k] = angle;
    }
    ComputeKinematics(b);
    TransportTangential(b, 0);
  }
  EXPECT_NEAR(b.history[0][0], -3.0, 1e-5);
  EXPECT_NEAR(b.history[1][0], 0.0, 1e-5);
}

TEST(Transport, SpinAboutTheNormalTurnsTheShearForce) {
  constexpr int kSteps = 2000;
  ContactBlock b = Block();
  b.dt = std::acos(-1.0) / 2 / kSteps;
  std::fill(b.history[1], b.history[1] + kBlock, 3.0);
  for (int k = 0; k < kBlock; ++k) {
    b.wix[k] = b.wjx[k] = 1;
  }
  ComputeKinematics(b);
  for (int step = 0; step < kSteps; ++step) {
    TransportTangential(b, 0);
  }
  EXPECT_NEAR(b.history[1][0], 0.0, 1e-5);
  EXPECT_NEAR(b.history[2][0], 3.0, 1e-5);
}

TEST(RollingResistance, MomentGrowsElasticallyToItsLimit) {
  Model m = test::HertzModel();
  m.effects = {"rolling_resistance"};
  m.parameters["rolling_resistance.stiffness"] = 0.6;
  m.parameters["rolling_resistance.friction"] = 0.08;
  const ContactModel model = ContactModelOf(m);
  ContactBlock b = Block();
  for (int k = 0; k < kBlock; ++k) {
    b.wjz[k] = 1;
  }
  model.Evaluate(b);
  EXPECT_NEAR(b.mz[0], -0.6 * b.dt, 1e-12 * b.dt);
  b.dt = 1;
  model.Evaluate(b);
  EXPECT_NEAR(b.mz[0], -0.08 * b.normal_force[0] * 0.5 * (kRadiusI + kRadiusJ), 1e-12);
}

TEST(RollingResistance, LinearLawScalesWithRadiiAndSmallerGrain) {
  Model m = test::LinearModel();
  m.effects = {"rolling_resistance"};
  m.parameters["rolling_resistance.stiffness"] = 0.13;
  m.parameters["rolling_resistance.friction"] = 0.2;
  const ContactModel model = ContactModelOf(m);
  ContactBlock b = Block();
  for (int k = 0; k < kBlock; ++k) {
    b.wjz[k] = 1;
  }
  model.Evaluate(b);
  const double km = 0.13 * kRadiusI * kRadiusJ * b.tangential_stiffness[0];
  EXPECT_NEAR(b.mz[0], -km * b.dt, 1e-9 * km * b.dt);
  b.dt = 10;
  model.Evaluate(b);
  EXPECT_NEAR(b.mz[0], -0.2 * b.normal_force[0] * kRadiusI, 1e-12);
}

TEST(TwistingResistance, ActsAboutTheNormalOnly) {
  Model m = test::HertzModel();
  m.effects = {"twisting_resistance"};
  m.parameters["twisting_resistance.stiffness_ratio"] = 0.5;
  m.parameters["twisting_resistance.friction"] = std::numeric_limits<double>::infinity();
  const ContactModel model = ContactModelOf(m);
  ContactBlock b = Block();
  for (int k = 0; k < kBlock; ++k) {
    b.wjx[k] = 1;
    b.wjy[k] = 1;
  }
  model.Evaluate(b);
  const double kt = 0.5 * kRadiusI * kRadiusJ * b.tangential_stiffness[0];
  EXPECT_NEAR(b.mx[0], -kt * b.dt, 1e-9 * kt * b.dt);
  EXPECT_EQ(b.my[0], 0);
}

TEST(ContactModel, OrderOfEffectsDoesNotMatter) {
  Model m = test::LinearModel();
  for (const char* effect : {"rolling_resistance", "twisting_resistance"}) {
    m.parameters[std::string(effect) + ".stiffness"] = 0.13;
    m.parameters[std::string(effect) + ".friction"] = 0.2;
  }
  double mx[2];
  for (int order = 0; order < 2; ++order) {
    m.effects = {"rolling_resistance", "twisting_resistance"};
    if (order == 1) {
      std::swap(m.effects[0], m.effects[1]);
    }
    ContactBlock b = Block();
    for (int k = 0; k < kBlock; ++k) {
      b.dy[k] = 1e-4;
      b.wjx[k] = 0.3;
      b.wjz[k] = 0.7;
    }
    ContactModelOf(m).Evaluate(b);
    mx[order] = b.mx[0];
  }
  EXPECT_EQ(mx[0], mx[1]);
}

TEST(ContactModel, EvaluationWithoutTimeKeepsTheHistory) {
  const ContactModel model = ContactModelOf(test::HertzModel());
  ContactBlock b = Block(1e-3);
  model.Evaluate(b);
  const double before = b.history[1][0];
  b.dt = 0;
  model.Evaluate(b);
  EXPECT_EQ(b.history[1][0], before);
}

}  // namespace
}  // namespace calib::dem
