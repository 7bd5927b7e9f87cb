// The tests of grains under gravity: scaling laws, order of their answers, threads, bad settings.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>

#include "dem/geometry/triangle_mesh.h"
#include "dem/registry/catalog.h"
#include "dem/registry/scenario_problems.h"
#include "dem/simulate/packing_generator.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

constexpr double kDiameter = 0.004;

Model Beads(double friction, double rolling) {
  Model model;
  model.contact = "hertz_mindlin";
  model.density = 2500;
  model.effects = {"viscous_damping", "rolling_resistance"};
  model.parameters = {{"young_modulus", 5e6},
                      {"poisson_ratio", 0.25},
                      {"friction_coefficient", friction},
                      {"viscous_damping.ratio", 0.3},
                      {"rolling_resistance.stiffness_ratio", 0.5},
                      {"rolling_resistance.friction", rolling}};
  return model;
}

Scenario Pour(const std::string& test, int grains, std::vector<double> controls) {
  Scenario scenario;
  scenario.model = Beads(0.5, 0.1);
  scenario.test = test;
  const auto packing = GenerateSizes(
      {.particles = grains, .mean_radius = 0.5 * kDiameter, .radius_spread = 0.15, .seed = 3});
  EXPECT_TRUE(packing.ok());
  scenario.packing = *packing;
  scenario.seed = 5;
  for (std::size_t k = 0; k < controls.size(); ++k) {
    scenario.path.push_back({.target = controls[k], .load_step = static_cast<int>(k)});
  }
  return scenario;
}

/// Value of an observable at a load step of a run that has to complete.
double Value(const test::Run& run, const std::string& test, const std::string& name,
             std::size_t step) {
  EXPECT_EQ(run.summary.outcome, Outcome::kCompleted) << run.summary.reason;
  const auto& names = FindTest(test)->observables;
  const auto at = std::find(names.begin(), names.end(), name) - names.begin();
  return step < run.states.size() ? run.states[step].values[static_cast<std::size_t>(at)]
                                  : std::nan("");
}

constexpr double kDegree = std::numbers::pi / 180;

TEST(AngleOfRepose, RoughGrainsStandSteeperThanSmoothOnes) {
  Scenario rough = Pour("angle_of_repose", 300, {1});
  rough.model = Beads(0.6, 0.3);
  Scenario smooth = rough;
  smooth.model = Beads(0.1, 0.0);
  const double steep = Value(test::RunAll(rough), "angle_of_repose", "angle_of_repose", 0);
  const double flat = Value(test::RunAll(smooth), "angle_of_repose", "angle_of_repose", 0);
  std::printf("angle of repose %.1f deg rough, %.1f deg smooth\n", steep / kDegree, flat / kDegree);
  EXPECT_GT(steep, 8 * kDegree);  // a heap of four layers is flatter than one of many
  EXPECT_LT(steep, 45 * kDegree);
  EXPECT_LT(flat, 0.6 * steep);
}

TEST(SiloDischarge, WiderOutletsGiveBeverloosExponentInThePlane) {
  // In the plane W grows as (D - k d)^{3/2}; between two openings the exponent is found with k
  // = 1.4.
  Scenario silo = Pour("silo_discharge", 600, {4.5 * kDiameter, 7 * kDiameter});
  silo.model = Beads(0.3, 0.0);
  silo.settings = {{"flat", 1}, {"silo_width", 18 * kDiameter}};
  const test::Run run = test::RunAll(silo);
  const double narrow = Value(run, "silo_discharge", "mass_flow_rate", 0);
  const double wide = Value(run, "silo_discharge", "mass_flow_rate", 1);
  const double exponent = std::log(wide / narrow) / std::log((7 - 1.4) / (4.5 - 1.4));
  std::printf("silo %.4f and %.4f kg/s, exponent %.2f\n", narrow, wide, exponent);
  EXPECT_NEAR(exponent, 1.5, 0.35);
}

TEST(SiloDischarge, ArchesStopASmallOutletAndAreBroken) {
  Scenario silo = Pour("silo_discharge", 150, {2.5 * kDiameter});
  silo.settings = {{"flat", 1}, {"silo_width", 14 * kDiameter}, {"avalanches", 4}};
  const test::Run run = test::RunAll(silo);
  EXPECT_GE(Value(run, "silo_discharge", "jams", 0), 1);
  const auto value = [&run](const char* name) { return Value(run, "silo_discharge", name, 0); };
  std::printf("arches: %g, avalanches %g, mean %.1f, median %g, 90 %% %g\n", value("jams"),
              value("avalanche_count"), value("avalanche_size"), value("avalanche_median"),
              value("avalanche_p90"));
  EXPECT_GT(value("avalanche_size"), 0);
  EXPECT_LE(value("avalanche_count"), value("jams"));
  EXPECT_LE(value("avalanche_median"), value("avalanche_p90"));
  // Ended by its fourth arch, or with grains that left after the last one: never more than left.
  double mean_mass = 0;
  for (const double r : silo.packing.radius) {
    mean_mass += 2500 * 4.0 / 3.0 * std::numbers::pi * r * r * r / 150;
  }
  EXPECT_LE(value("avalanche_size") * value("avalanche_count"),
            1.1 * value("discharged_mass") / mean_mass);
}

TEST(SiloDischarge, WithoutAnArchNoAvalancheHasEnded) {
  Scenario silo = Pour("silo_discharge", 100, {8 * kDiameter});
  silo.settings = {{"flat", 1}, {"silo_width", 9 * kDiameter}};
  const test::Run run = test::RunAll(silo);
  EXPECT_EQ(Value(run, "silo_discharge", "avalanche_count", 0), 0);
  EXPECT_EQ(Value(run, "silo_discharge", "avalanche_size", 0),
            Value(run, "silo_discharge", "avalanche_p90", 0));
}

TEST(SiloDischarge, DisksWeighWhatTheirThicknessSays) {
  // Nothing but the mass differs: of 150 grains all leave a wide outlet, as disks with pi r^2 t rho
  // each.
  const double t = 0.7 * kDiameter;
  Scenario silo = Pour("silo_discharge", 150, {8 * kDiameter});
  silo.model = Beads(0.1, 0.0);
  silo.settings = {{"flat", 1}, {"silo_width", 8.5 * kDiameter}};
  const test::Run spheres = test::RunAll(silo);
  silo.settings["thickness"] = t;
  const test::Run disks = test::RunAll(silo);
  double volume = 0;
  for (const double r : silo.packing.radius) {
    volume += 4.0 / 3.0 * std::numbers::pi * r * r * r;
  }
  double area = 0;
  for (const double r : silo.packing.radius) {
    area += std::numbers::pi * r * r;
  }
  const auto mass = [](const test::Run& run) {
    return Value(run, "silo_discharge", "discharged_mass", 0);
  };
  EXPECT_NEAR(mass(spheres), silo.model.density * volume, 1e-9 * mass(spheres));
  EXPECT_NEAR(mass(disks), silo.model.density * area * t, 1e-9 * mass(disks));

  silo.settings["flat"] = 0.4;  // the run takes it for a cylinder
  EXPECT_THAT(ScenarioProblems(silo), testing::Contains(testing::HasSubstr("set flat: 1")));
}

TEST(RotatingDrum, SlopeRisesWithFrictionAndLeansAgainstTheTurn) {
  Scenario drum = Pour("rotating_drum", 250, {2});
  drum.settings = {{"turns", 0.15}};
  drum.model = Beads(0.6, 0.2);
  Scenario smooth = drum;
  smooth.model = Beads(0.1, 0.0);
  const double steep = Value(test::RunAll(drum), "rotating_drum", "angle_of_repose", 0);
  const double flat = Value(test::RunAll(smooth), "rotating_drum", "angle_of_repose", 0);
  std::printf("drum %.1f deg rough, %.1f deg smooth\n", steep / kDegree, flat / kDegree);
  EXPECT_GT(steep, 15 * kDegree);
  EXPECT_LT(steep, 60 * kDegree);
  EXPECT_LT(flat, steep);
  EXPECT_GT(flat, 0);
}

TEST(RotatingDrum, ADrumThatIsNotGivenHoldsItsGrainsWhateverTheirSizes) {
  for (const double spread : {0.2, 0.3, 0.5}) {
    Scenario drum = Pour("rotating_drum", 200, {2});
    drum.settings = {{"turns", 0.05}};
    drum.packing =
        *GenerateSizes({.particles = 200, .mean_radius = 3e-3, .radius_spread = spread, .seed = 1});
    EXPECT_EQ(test::RunAll(drum).summary.reason, "") << spread;
  }
}

TEST(RotatingDrum, TooSmallOrTooFastIsSaid) {
  Scenario drum = Pour("rotating_drum", 250, {2});
  drum.settings = {{"drum_diameter", 0.02}};
  EXPECT_THAT(test::RunAll(drum).summary.reason,
              ::testing::HasSubstr("make drum_diameter or drum_length larger"));
  drum.settings = {};  // chosen: known to the run alone
  drum.path[0].target = 200;
  EXPECT_THAT(test::RunAll(drum).summary.reason,
              ::testing::HasSubstr("rotation_speed 200 rad/s has a Froude number"));
}

TEST(CalibrationDevice, SlipperySlideIsLeftSooner) {
  Scenario device = Pour("calibration_device", 300, {1});
  device.model.effects.emplace_back("wall_friction");
  device.model.parameters["wall_friction.coefficient"] = 0.1;
  Scenario rough = device;
  rough.model.parameters["wall_friction.coefficient"] = 0.8;
  const test::Run fast = test::RunAll(device);
  const test::Run slow = test::RunAll(rough);
  const auto value = [](const test::Run& run, const char* name) {
    return Value(run, "calibration_device", name, 0);
  };
  std::printf("device: rate %.4f %.4f kg/s, slide %.3f %.3f s, pile %.1f %.1f deg\n",
              value(fast, "mass_flow_rate"), value(slow, "mass_flow_rate"),
              value(fast, "slide_time"), value(slow, "slide_time"),
              value(fast, "angle_of_repose") / kDegree, value(slow, "angle_of_repose") / kDegree);
  EXPECT_GT(value(fast, "mass_flow_rate"), 0);
  EXPECT_LT(value(fast, "slide_time"), value(slow, "slide_time"));
  EXPECT_GT(value(fast, "angle_of_repose"), 0);
}

// 520 grains in a slice of three diameters make a pile higher than ten diameters, where the slide
// of a few grains ends; a slide that ends at five is buried by 300.
TEST(CalibrationDevice, ALargeFillingDoesNotBuryTheSlide) {
  Scenario device = Pour("calibration_device", 520, {1});
  device.settings = {{"duration", 2}, {"depth", 3 * kDiameter}};
  const test::Run run = test::RunAll(device);
  const auto value = [&](const char* name) { return Value(run, "calibration_device", name, 0); };
  std::printf("device of 520: rate %.4f kg/s, slide %.4f s, pile %.1f deg\n",
              value("mass_flow_rate"), value("slide_time"), value("angle_of_repose") / kDegree);
  EXPECT_LT(value("slide_time"), 2);  // it has run empty

  device = Pour("calibration_device", 300, {1});
  device.settings = {{"duration", 2}, {"depth", 3 * kDiameter}, {"slide_height", 5 * kDiameter}};
  const test::Run buried = test::RunAll(device);
  EXPECT_EQ(buried.summary.outcome, Outcome::kDiverged);
  EXPECT_THAT(buried.summary.reason,
              testing::AllOf(testing::HasSubstr("repetition 1, pile: it has grown over the slide's "
                                                "lower end, up to 0.0"),
                             testing::HasSubstr(" m where that stands at 0.02 m"),
                             testing::HasSubstr("raise slide_height")));
}

// Slides a little longer each keep their grains a little longer: no steps of the time between
// looks.
TEST(CalibrationDevice, SlideTimeIsFinelyResolved) {
  const double fall = std::sqrt(kDiameter / 9.81);
  std::set<long> remainders;
  for (const double length : {16.0, 16.5, 17.0, 17.5}) {
    Scenario device = Pour("calibration_device", 60, {1});
    device.settings = {{"slide_length", length * kDiameter}, {"depth", 3 * kDiameter}};
    const double time = Value(test::RunAll(device), "calibration_device", "slide_time", 0);
    remainders.insert(std::lround(20 * std::remainder(time / fall, 1)));
  }
  EXPECT_GT(remainders.size(), 2U);
}

TEST(TransferChute, AFunnelShiftedToTheRightFeedsTheRight) {
  Scenario chute = Pour("transfer_chute", 250, {1.0});
  chute.settings = {{"funnel_shift_y", 2 * kDiameter}};
  const test::Run run = test::RunAll(chute);
  const double left = Value(run, "transfer_chute", "mass_flow_left", 0);
  const double right = Value(run, "transfer_chute", "mass_flow_right", 0);
  std::printf("chute: left %.4f, right %.4f kg/s\n", left, right);
  EXPECT_GT(right, 2 * left);
  EXPECT_DOUBLE_EQ(Value(run, "transfer_chute", "mass_flow_difference", 0), std::abs(left - right));
}

TEST(TransferChute, CarriesItsFeedRateAndNoMore) {
  Scenario chute = Pour("transfer_chute", 250, {1.0});
  double d = 0;
  double mass = 0;
  for (const double r : chute.packing.radius) {
    d = std::max(d, 2 * r);
    mass += 2500 * 4.0 / 3.0 * std::numbers::pi * r * r * r;
  }
  const double largest = 8 * mass / 250 * 1.0 / (1.2 * d);  // rows of eight, one behind another
  const auto through = [&chute](double rate) {
    chute.settings = {{"feed_rate", rate}};
    const test::Run run = test::RunAll(chute);
    return Value(run, "transfer_chute", "mass_flow_left", 0) +
           Value(run, "transfer_chute", "mass_flow_right", 0);
  };
  const double slow = through(0.3 * largest);
  const double half = through(0.5 * largest);
  std::printf("chute: fed 0.3 and 0.5 of %.4f kg/s, through %.4f and %.4f\n", largest, slow, half);
  EXPECT_NEAR(slow, 0.3 * largest, 0.1 * slow);
  EXPECT_GT(half, 1.3 * slow);
  chute.settings = {{"feed_rate", 1.01 * largest}};
  const test::Run run = test::RunAll(chute);
  EXPECT_EQ(run.summary.outcome, Outcome::kDiverged);
  EXPECT_THAT(run.summary.reason, ::testing::HasSubstr(" kg/s, the belt carries at most "));
}

TEST(TransferChute, AFunnelThatNoGrainMeetsIsNoChute) {
  Scenario chute = Pour("transfer_chute", 250, {1.0});
  chute.settings = {{"funnel_shift_y", 1.0}};
  EXPECT_THAT(test::RunAll(chute).summary.reason, ::testing::HasSubstr("no grain met the funnel"));
}

TEST(TransferChute, AMeshLikeItsFunnelActsLikeIt) {
  Scenario chute = Pour("transfer_chute", 250, {1.0});
  chute.settings = {{"funnel_shift_y", 2 * kDiameter}};
  const test::Run built_in = test::RunAll(chute);
  double d = 0;
  for (const double r : chute.packing.radius) {
    d = std::max(d, 2 * r);
  }
  TriangleMesh funnel;
  AddFrustum({.height = 7 * d, .lower_radius = 3 * d, .upper_radius = 7 * d, .sides = 16}, funnel);
  chute.meshes = {{"funnel", funnel}};
  const test::Run same = test::RunAll(chute);
  chute.meshes = {{"funnel", Shifted(funnel, {0, -4 * kDiameter, 0})}};
  const test::Run other = test::RunAll(chute);
  const auto value = [](const test::Run& run, const char* name) {
    return Value(run, "transfer_chute", name, 0);
  };
  std::printf(
      "chute: left, right %.4f %.4f, as a mesh %.4f %.4f, mesh to the left %.4f %.4f kg/s\n",
      value(built_in, "mass_flow_left"), value(built_in, "mass_flow_right"),
      value(same, "mass_flow_left"), value(same, "mass_flow_right"), value(other, "mass_flow_left"),
      value(other, "mass_flow_right"));
  EXPECT_NEAR(value(same, "mass_flow_right"), value(built_in, "mass_flow_right"),
              0.2 * value(built_in, "mass_flow_right"));  // places differ by rounding
  EXPECT_GT(value(other, "mass_flow_left"), 2 * value(other, "mass_flow_right"));
}

TEST(SiloDischarge, AMeshLikeItsCylinderFlowsLikeIt) {
  Scenario silo = Pour("silo_discharge", 400, {6 * kDiameter});
  const double built_in = Value(test::RunAll(silo), "silo_discharge", "mass_flow_rate", 0);
  double mean = 0;
  for (const double r : silo.packing.radius) {
    mean += 2 * r / static_cast<double>(silo.packing.radius.size());
  }
  TriangleMesh cylinder;
  AddFrustum({.height = 0.2, .lower_radius = 6 * mean, .upper_radius = 6 * mean, .sides = 32},
             cylinder);
  silo.meshes = {{"silo", cylinder}};
  const test::Run run = test::RunAll(silo);
  const double as_mesh = Value(run, "silo_discharge", "mass_flow_rate", 0);
  std::printf("silo: %.4f kg/s, as a mesh %.4f kg/s\n", built_in, as_mesh);
  EXPECT_NEAR(as_mesh, built_in, 0.1 * built_in);

  TriangleMesh hopper;  // half as steep below as a cylinder's wall, its own outlet
  AddFrustum({.height = 0.04, .lower_radius = 0.0115, .upper_radius = 0.024, .sides = 24}, hopper);
  AddFrustum({.centre = {0, 0, 0.04},
              .height = 0.12,
              .lower_radius = 0.024,
              .upper_radius = 0.024,
              .sides = 24},
             hopper);
  silo.meshes = {{"silo", hopper}};
  const test::Run flowed = test::RunAll(silo);
  const double mass = Value(flowed, "silo_discharge", "discharged_mass", 0);
  double all = 0;
  for (const double r : silo.packing.radius) {
    all += 2500 * 4.0 / 3.0 * std::numbers::pi * r * r * r;
  }
  std::printf("mesh hopper: %.4f kg/s, %.1f %% of the grains left\n",
              Value(flowed, "silo_discharge", "mass_flow_rate", 0), 100 * mass / all);
  EXPECT_GT(mass, 0.98 * all);  // no corner keeps any, as a level floor does
}

TEST(CalibrationDevice, ASlideOfAMeshIsTheSlide) {
  Scenario device = Pour("calibration_device", 200, {1});
  device.settings = {{"slide_length", 16 * kDiameter}, {"slide_angle", 0.8}};
  const double length = 16 * kDiameter;
  const Vec3 top{length * std::cos(0.8), 0, length * std::sin(0.8)};
  const double half = 0.02;
  TriangleMesh plate;
  AddQuad({0, -half, 0}, {top.x, -half, top.z}, {top.x, half, top.z}, {0, half, 0}, plate);
  const test::Run built_in = test::RunAll(device);
  device.meshes = {{"slide", plate}};
  const test::Run run = test::RunAll(device);
  const auto value = [](const test::Run& of, const char* name) {
    return Value(of, "calibration_device", name, 0);
  };
  std::printf("device: rate %.4f, as a mesh %.4f kg/s, slide %.3f, %.3f s\n",
              value(built_in, "mass_flow_rate"), value(run, "mass_flow_rate"),
              value(built_in, "slide_time"), value(run, "slide_time"));
  EXPECT_NEAR(value(run, "slide_time"), value(built_in, "slide_time"),
              0.25 * value(built_in, "slide_time"));
  device.meshes["slide"].vertex[2].y = 0.01;
  device.meshes["slide"].vertex[3].y = 0.01;
  EXPECT_THAT(test::RunAll(device).summary.reason,
              ::testing::HasSubstr("mesh slide reaches to 0.01 m from its middle along y"));
}

TEST(GravityTests, MeshesThatDoNotFitAreRefused) {
  Scenario silo = Pour("silo_discharge", 400, {6 * kDiameter});
  TriangleMesh cylinder;
  AddFrustum({.height = 0.02, .lower_radius = 0.024, .upper_radius = 0.024}, cylinder);
  silo.meshes = {{"silo", cylinder}};
  EXPECT_THAT(test::RunAll(silo).summary.reason,
              ::testing::HasSubstr("mesh silo is too small: of 400 grains "));
  TriangleMesh straw;
  AddFrustum({.height = 1e-3, .lower_radius = 2e-4, .upper_radius = 2e-4}, straw);
  silo.meshes = {{"silo", straw}};
  EXPECT_THAT(test::RunAll(silo).summary.reason, ::testing::HasSubstr("is the mesh's unit right?"));
  silo.meshes = {{"funnel", cylinder}};
  EXPECT_THAT(
      ScenarioProblems(silo),
      ::testing::ElementsAre("no piece \"funnel\" in test silo_discharge, which lets a mesh "
                             "replace: silo"));
  silo.meshes = {{"silo", Shifted(cylinder, {0, 0, -0.001})}};
  silo.settings = {{"silo_width", 0.05}};
  EXPECT_THAT(ScenarioProblems(silo),
              ::testing::ElementsAre(::testing::HasSubstr("mesh silo reaches down to z = -0.001 m"),
                                     ::testing::HasSubstr("silo_width has no meaning with it")));
}

TEST(GravityTests, MeshesWithHolesAreRefused) {
  Scenario chute = Pour("transfer_chute", 60, {1.0});
  TriangleMesh funnel;
  AddFrustum({.height = 0.03, .lower_radius = 0.013, .upper_radius = 0.03, .sides = 16}, funnel);
  chute.meshes = {{"funnel", funnel}};
  EXPECT_THAT(ScenarioProblems(chute), testing::IsEmpty());
  chute.meshes["funnel"].triangle.pop_back();
  EXPECT_THAT(ScenarioProblems(chute),
              testing::ElementsAre(testing::HasSubstr("mesh funnel has a hole or a notch")));

  Scenario device = Pour("calibration_device", 60, {1});
  TriangleMesh slide;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      const auto at = [](int k, int l) { return Vec3{0.01 * k, 0.01 * (l - 3), 0.008 * k}; };
      AddQuad(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1), slide);
    }
  }
  device.settings = {{"slide_length", 0.0768}, {"slide_angle", 0.6747}, {"depth", 0.04}};
  device.meshes = {{"slide", slide}};
  EXPECT_THAT(ScenarioProblems(device), testing::IsEmpty());
  device.meshes["slide"].triangle.erase(device.meshes["slide"].triangle.begin() + 30);
  EXPECT_THAT(ScenarioProblems(device),
              testing::ElementsAre(testing::HasSubstr("mesh slide has a hole: it has 2 loops")));
  device.meshes["slide"] = slide;  // a triangle of the lower end: the run knows how far it matters
  device.meshes["slide"].triangle.erase(device.meshes["slide"].triangle.begin() + 5);
  EXPECT_THAT(ScenarioProblems(device), testing::IsEmpty());
  EXPECT_THAT(test::RunAll(device).summary.reason, testing::HasSubstr("mesh slide has a notch"));
}

TEST(ShakenBox, TheIntruderRises) {
  Scenario box = Pour("shaken_box", 72, {0.0, 1.0, 2.0});
  box.settings = {{"height", 2.5 * kDiameter}};
  const test::Run run = test::RunAll(box);
  const auto height = [&](std::size_t k) { return Value(run, "shaken_box", "intruder_height", k); };
  std::printf("intruder at %.4f, %.4f, %.4f m; above for %.2f of the time, first at %.2f s\n",
              height(0), height(1), height(2), Value(run, "shaken_box", "fraction_above", 2),
              Value(run, "shaken_box", "exit_time", 2));
  EXPECT_NEAR(height(0), kDiameter, 0.2 * kDiameter);
  EXPECT_GT(std::max(height(1), height(2)), 2 * kDiameter);
  EXPECT_LT(Value(run, "shaken_box", "exit_time", 2), 2.0);
}

/// The test with grains of that length over width.
Scenario Elongated(const Scenario& spheres, double aspect) {
  return test::With(spheres, "nonspherical_shape", {{"aspect", aspect}});
}

double MassOf(const Scenario& scenario) {
  double mass = 0;
  for (const double r : scenario.packing.radius) {
    mass += scenario.model.density * 4.0 / 3.0 * std::numbers::pi * r * r * r;
  }
  return mass;
}

TEST(PouredShapes, AspectOneIsSpheresBitForBit) {
  for (const char* name :
       {"angle_of_repose", "calibration_device", "rotating_drum", "shaken_box", "transfer_chute"}) {
    Scenario spheres = Pour(name, name == std::string("shaken_box") ? 40 : 100, {1});
    spheres.settings = name == std::string("rotating_drum")
                           ? std::map<std::string, double>{{"turns", 0.1}}
                           : std::map<std::string, double>{};
    const test::Run one = test::RunAll(Elongated(spheres, 1));
    const test::Run without = test::RunAll(spheres);
    ASSERT_EQ(without.states.size(), 1U) << name << ": " << without.summary.reason;
    EXPECT_EQ(one.states[0].values, without.states[0].values) << name;
  }
}

// Grains that are not round roll less and lock: their heap is steeper.
TEST(PouredShapes, ElongatedGrainsStandSteeperThanSpheres) {
  Scenario spheres = Pour("angle_of_repose", 300, {1});
  spheres.model = Beads(0.5, 0.1);
  const double flat = Value(test::RunAll(spheres), "angle_of_repose", "angle_of_repose", 0);
  const double steep =
      Value(test::RunAll(Elongated(spheres, 1.5)), "angle_of_repose", "angle_of_repose", 0);
  std::printf("angle of repose %.1f deg of spheres, %.1f deg at aspect 1.5\n", flat / kDegree,
              steep / kDegree);
  EXPECT_GT(steep, 1.2 * flat);
  EXPECT_LT(steep, 45 * kDegree);
}

// Of nearly the same shape and of the same mass: the same flow, if each grain is weighed once.
TEST(PouredShapes, GrainsOfTwoSpheresAreWeighedOnce) {
  const Scenario spheres = Pour("calibration_device", 200, {1, 2});
  double rate[2] = {0, 0};
  for (int shape = 0; shape < 2; ++shape) {
    const test::Run run = test::RunAll(shape == 0 ? spheres : Elongated(spheres, 1.02));
    for (std::size_t k = 0; k < 2; ++k) {
      rate[shape] += Value(run, "calibration_device", "mass_flow_rate", k) / 2;
    }
  }
  std::printf("device: rate %.4f kg/s of spheres, %.4f at aspect 1.02\n", rate[0], rate[1]);
  EXPECT_NEAR(rate[1] / rate[0], 1, 0.15);
}

TEST(PouredShapes, ADrumTurnsElongatedGrainsAndSaysWhenItIsTooSmall) {
  Scenario drum = Elongated(Pour("rotating_drum", 100, {2}), 1.8);
  drum.settings = {{"turns", 0.1}};
  const double slope = Value(test::RunAll(drum), "rotating_drum", "angle_of_repose", 0);
  std::printf("drum: %.1f deg at aspect 1.8\n", slope / kDegree);
  EXPECT_GT(slope, 10 * kDegree);
  EXPECT_LT(slope, 60 * kDegree);
  drum.settings["drum_diameter"] = 6 * kDiameter;
  const test::Run run = test::RunAll(drum);
  EXPECT_EQ(run.summary.outcome, Outcome::kDiverged);
  EXPECT_THAT(run.summary.reason, testing::HasSubstr("set loosely into it"));
}

TEST(PouredShapes, AChuteIsFedWithElongatedGrains) {
  const Scenario spheres = Pour("transfer_chute", 150, {1});
  double flow[3] = {0, 0, 0};
  const double aspects[3] = {1, 1.02, 1.9};
  for (std::size_t shape = 0; shape < 3; ++shape) {
    Scenario chute = Elongated(spheres, aspects[shape]);
    const test::Run run = test::RunAll(chute);
    flow[shape] = Value(run, "transfer_chute", "mass_flow_left", 0) +
                  Value(run, "transfer_chute", "mass_flow_right", 0);
    if (shape == 2) {
      chute.threads = 2;
      EXPECT_EQ(test::RunAll(chute).states[0].values, run.states[0].values);
    }
  }
  std::printf("chute: %.4f kg/s of spheres, %.4f at aspect 1.02, %.4f at 1.9\n", flow[0], flow[1],
              flow[2]);
  EXPECT_NEAR(flow[1] / flow[0], 1, 0.15);
  EXPECT_GT(flow[2], 0);
}

// Of pairs of disks all leave a wide outlet with the mass of the disks that they replace.
TEST(PouredShapes, PairsOfDisksWeighWhatTheirDisksDo) {
  const double t = 0.7 * kDiameter;
  Scenario silo = Elongated(Pour("silo_discharge", 150, {8 * kDiameter}), 1.4);
  silo.model.parameters["friction_coefficient"] = 0.1;
  silo.settings = {{"flat", 1}, {"silo_width", 8.5 * kDiameter}, {"thickness", t}};
  double area = 0;
  for (const double r : silo.packing.radius) {
    area += std::numbers::pi * r * r;
  }
  const double left = Value(test::RunAll(silo), "silo_discharge", "discharged_mass", 0);
  EXPECT_NEAR(left, silo.model.density * area * t, 1e-9 * left);
  silo.settings.erase("thickness");
  const double spheres = Value(test::RunAll(silo), "silo_discharge", "discharged_mass", 0);
  EXPECT_NEAR(spheres, MassOf(silo), 1e-9 * spheres);
}

TEST(PouredShapes, TheIntruderRisesAmongElongatedGrains) {
  Scenario box = Elongated(Pour("shaken_box", 72, {0.0, 1.0, 2.0}), 1.5);
  box.settings = {{"height", 2.5 * kDiameter}, {"thickness", kDiameter}};
  const test::Run run = test::RunAll(box);
  const auto height = [&](std::size_t k) { return Value(run, "shaken_box", "intruder_height", k); };
  std::printf("intruder at %.4f, %.4f, %.4f m among grains of aspect 1.5\n", height(0), height(1),
              height(2));
  EXPECT_NEAR(height(0), kDiameter, 0.2 * kDiameter);
  EXPECT_GT(std::max(height(1), height(2)), 2 * kDiameter);
}

TEST(PouredShapes, ASiloOfElongatedGrainsRunsEmpty) {
  Scenario silo = Pour("silo_discharge", 120, {6.5 * kDiameter});
  silo.model = Beads(0.3, 0.0);
  silo.settings = {{"silo_width", 9 * kDiameter}, {"duration", 2}};
  double rate[2] = {0, 0};
  for (int shape = 0; shape < 2; ++shape) {
    const Scenario scenario = shape == 0 ? silo : Elongated(silo, 1.02);
    const test::Run run = test::RunAll(scenario);
    rate[shape] = Value(run, "silo_discharge", "mass_flow_rate", 0);
    const double left = Value(run, "silo_discharge", "discharged_mass", 0) / MassOf(silo);
    EXPECT_GT(left, 0.8) << shape;  // some stay on the floor
    EXPECT_LT(left, 1 + 1e-9) << shape;
  }
  std::printf("silo: %.4f kg/s of spheres, %.4f at aspect 1.02\n", rate[0], rate[1]);
  EXPECT_NEAR(rate[1] / rate[0], 1, 0.25);
}

TEST(PouredShapesSlow, ArchesOfElongatedGrainsAreBroken) {
  Scenario silo = Elongated(Pour("silo_discharge", 120, {2.6 * kDiameter}), 1.6);
  silo.settings = {{"silo_width", 9 * kDiameter}, {"avalanches", 3}, {"duration", 3}};
  const test::Run one = test::RunAll(silo);
  const double jams = Value(one, "silo_discharge", "jams", 0);
  std::printf("arches of grains of aspect 1.6: %g, discharged %.4f of %.4f kg\n", jams,
              Value(one, "silo_discharge", "discharged_mass", 0), MassOf(silo));
  EXPECT_GE(jams, 2);
  silo.threads = 2;
  EXPECT_EQ(test::RunAll(silo).states[0].values, one.states[0].values);
}

TEST(GravityTests, ThreadsChangeNoBit) {
  Scenario silo = Pour("silo_discharge", 400, {6 * kDiameter});
  silo.settings = {{"duration", 0.1}};
  const test::Run one = test::RunAll(silo);
  silo.threads = 2;
  const test::Run two = test::RunAll(silo);
  ASSERT_EQ(one.states.size(), 1U);
  EXPECT_EQ(one.states[0].values, two.states[0].values);
  EXPECT_EQ(one.summary.steps, two.summary.steps);
}

TEST(GravityTests, BadSettingsAndFailuresAreSentences) {
  Scenario drum = Pour("rotating_drum", 100, {-1});
  drum.settings = {{"turns", 0}, {"width", 1}};
  const auto problems = ScenarioProblems(drum);
  EXPECT_THAT(problems,
              testing::Contains("path point 0: rotation_speed is -1, allowed is [0, 1000]"));
  EXPECT_THAT(problems, testing::Contains("test rotating_drum has no setting \"width\""));
  EXPECT_THAT(problems, testing::Contains(testing::HasSubstr("turns is 0")));
  Scenario small = Pour("rotating_drum", 100, {1});
  small.settings = {{"drum_diameter", 0.02}};
  const test::Run run = test::RunAll(small);
  EXPECT_EQ(run.summary.outcome, Outcome::kDiverged);
  EXPECT_THAT(run.summary.reason, testing::HasSubstr("holds only"));
}

}  // namespace
}  // namespace calib::dem
