// A run that goes on from a checkpoint ends with the bits of one that was never interrupted.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dem/dynamics/archive.h"
#include "dem/geometry/triangle_mesh.h"
#include "dem/lab_tests/shared/run_checkpoint.h"
#include "dem/simulate/packing_generator.h"
#include "dem/simulate/simulate.h"
#include "tests/support/dem/scenarios.h"
#include "tests/support/dem/user_effects.h"

namespace calib::dem {
namespace {

using test::With;
using ::testing::HasSubstr;

Scenario ElementTest(const std::string& name, const std::vector<double>& controls) {
  Scenario scenario = test::SmallTriaxial(test::HertzModel());
  scenario.test = name;
  scenario.path.clear();
  for (std::size_t k = 0; k < controls.size(); ++k) {
    scenario.path.push_back({.target = controls[k], .load_step = static_cast<int>(k)});
  }
  return scenario;
}

Scenario Pour(const std::string& name, int grains, const std::vector<double>& controls) {
  Scenario scenario = ElementTest(name, controls);
  scenario.model = {};
  scenario.model.contact = "hertz_mindlin";
  scenario.model.density = 2500;
  scenario.model.effects = {"viscous_damping", "rolling_resistance"};
  scenario.model.parameters = {{"young_modulus", 5e6},
                               {"poisson_ratio", 0.25},
                               {"friction_coefficient", 0.5},
                               {"viscous_damping.ratio", 0.3},
                               {"rolling_resistance.stiffness_ratio", 0.5},
                               {"rolling_resistance.friction", 0.1}};
  scenario.settings = {};
  const auto sizes =
      GenerateSizes({.particles = grains, .mean_radius = 0.002, .radius_spread = 0.15, .seed = 3});
  EXPECT_TRUE(sizes.ok());
  scenario.packing = *sizes;
  scenario.seed = 5;
  return scenario;
}

/// A run and every checkpoint it left.
struct Recorded {
  test::Run run;
  std::vector<std::string> checkpoints;
};

Recorded Record(const Scenario& scenario, const std::string& from = "") {
  Recorded recorded;
  const auto summary =
      Simulate(scenario, [&](const State& state) { recorded.run.states.push_back(state); }, {},
               {.checkpoint =
                    [&](const std::string& bytes) {
                      recorded.checkpoints.push_back(bytes);
                      return absl::OkStatus();
                    },
                .resume_from = from});
  EXPECT_TRUE(summary.ok()) << summary.status();
  recorded.run.summary = summary.ok() ? *summary : Summary{};
  return recorded;
}

void ExpectSameBits(const test::Run& a, const test::Run& b) {
  ASSERT_EQ(a.states.size(), b.states.size());
  for (std::size_t s = 0; s < a.states.size(); ++s) {
    EXPECT_EQ(a.states[s].load_step, b.states[s].load_step);
    EXPECT_EQ(a.states[s].values, b.states[s].values) << "state " << s;
  }
  EXPECT_EQ(a.summary.outcome, b.summary.outcome);
  EXPECT_EQ(a.summary.steps, b.summary.steps);
  EXPECT_EQ(a.summary.contact_updates, b.summary.contact_updates);
  EXPECT_EQ(a.summary.time_step, b.summary.time_step);
}

/// From each checkpoint to the same end, on another number of threads.
void ExpectToGoOn(const Scenario& scenario) {
  const test::Run undisturbed = test::RunAll(scenario);
  ASSERT_EQ(undisturbed.summary.outcome, Outcome::kCompleted) << undisturbed.summary.reason;
  const Recorded recorded = Record(scenario);
  ExpectSameBits(recorded.run, undisturbed);
  ASSERT_EQ(recorded.checkpoints.size(), scenario.path.size());
  Scenario other = scenario;
  other.threads = 2;
  for (const std::string& checkpoint : recorded.checkpoints) {
    const Recorded resumed = Record(other, checkpoint);
    ExpectSameBits(resumed.run, undisturbed);
    EXPECT_LT(resumed.checkpoints.size(), recorded.checkpoints.size());
  }
}

TEST(RunCheckpoint, ElementTestsGoOnBitForBit) {
  for (const Scenario& scenario : {ElementTest("triaxial_drained", {0, 0.004, 0.002, 0.006}),
                                   ElementTest("triaxial_undrained", {0, 0.004}),
                                   ElementTest("oedometric", {0, 0.01, 0.006, 0.01}),
                                   ElementTest("isotropic", {2e5, 3e5, 2.5e5})}) {
    SCOPED_TRACE(scenario.test);
    ExpectToGoOn(scenario);
  }
  Scenario shear = ElementTest("simple_shear", {0, 0.02, 0.01});
  shear.packing = test::SmallPacking(200);
  ExpectToGoOn(shear);
}

TEST(RunCheckpoint, TurningPointsAndRealRatesGoOnBitForBit) {
  Scenario scenario = ElementTest("triaxial_drained", {0, 0.004, 0.002, 0.006});
  scenario.path[2].load_step = -1;
  scenario.path[3].load_step = 2;
  scenario.loading_rate = 0.5;
  ExpectToGoOn(scenario);
}

TEST(RunCheckpoint, AdaptiveStagingGoesOnBitForBit) {
  for (Scenario scenario : {ElementTest("triaxial_drained", {0, 0.004, 0.002, 0.006, 0.03}),
                            ElementTest("oedometric", {0, 0.01, 0.006, 0.01})}) {
    SCOPED_TRACE(scenario.test);
    scenario.staging.adaptive = true;
    ExpectToGoOn(scenario);
  }
}

TEST(RunCheckpoint, EffectsThatChangeGrainsReadingsOrStartGoOnBitForBit) {
  const Scenario plain = ElementTest("oedometric", {0, 0.01, 0.02});
  for (const Scenario& scenario :
       {With(plain, "particle_crushing",
             {{"weakness", 0.15 / 2e5}, {"reference_diameter", 2e-3}, {"size_loss", 0.05}}),
        With(plain, "nonspherical_shape", {{"aspect", 1.1}}),
        With(plain, "apparatus_compliance", {{"compliance", 1e-9}}),
        With(plain, "contact_plasticity", {{"stiffness_ratio", 2}})}) {
    SCOPED_TRACE(scenario.model.effects.front());
    ExpectToGoOn(scenario);
  }
  Scenario formula = plain;
  formula.model = test::Joined(
      plain.model, test::Formula("normal_force", "1 + c * axial_strain", FormulaAction::kScales),
      {2.0});
  ExpectToGoOn(formula);
}

TEST(RunCheckpoint, TestsUnderGravityGoOnBitForBit) {
  Scenario drum = Pour("rotating_drum", 150, {2, 4});
  drum.settings = {{"turns", 0.1}};
  ExpectToGoOn(drum);
  drum.settings["turns"] = 0.02;
  ExpectToGoOn(With(drum, "nonspherical_shape", {{"aspect", 1.4}}));
  Scenario box = Pour("shaken_box", 30, {0.05, 0.1, 0.2});
  ExpectToGoOn(box);
  box.settings = {{"thickness", 0.004}};
  ExpectToGoOn(With(box, "nonspherical_shape", {{"aspect", 1.4}}));
  Scenario silo = Pour("silo_discharge", 100, {0.02, 0.028});
  silo.settings = {{"flat", 1}, {"silo_width", 0.056}, {"duration", 0.2}};
  ExpectToGoOn(silo);
  silo.settings = {{"silo_width", 0.04}, {"duration", 0.2}};
  ExpectToGoOn(With(silo, "nonspherical_shape", {{"aspect", 1.4}}));
}

TEST(RunCheckpoint, DevicesAndChutesGoOnBitForBit) {
  Scenario device = Pour("calibration_device", 80, {1, 2});
  device.settings = {{"duration", 0.4}};
  ExpectToGoOn(device);
  Scenario chute = Pour("transfer_chute", 40, {0.8, 1.2});
  chute.settings = {{"funnel_angle", 0.1}};
  ExpectToGoOn(chute);
  ExpectToGoOn(With(chute, "nonspherical_shape", {{"aspect", 1.4}}));
  TriangleMesh funnel;
  AddFrustum({.height = 0.03, .lower_radius = 0.013, .upper_radius = 0.03, .sides = 12}, funnel);
  chute.settings = {};
  chute.meshes = {{"funnel", funnel}};
  ExpectToGoOn(chute);
  const std::string bytes = Record(chute).checkpoints.front();
  EXPECT_EQ(CheckpointProblem(chute, bytes), "");
  chute.meshes["funnel"].vertex[5].z += 1e-12;
  EXPECT_EQ(CheckpointProblem(chute, bytes),
            "the checkpoint belongs to another run; what differs: meshes");
}

TEST(RunCheckpoint, RepetitionsAreNotMadeAgain) {
  const Scenario heaps = Pour("angle_of_repose", 60, {1, 2});
  const Recorded recorded = Record(heaps);
  ASSERT_EQ(recorded.checkpoints.size(), 2U);
  const Recorded resumed = Record(heaps, recorded.checkpoints[0]);
  ExpectSameBits(resumed.run, recorded.run);
  EXPECT_EQ(resumed.checkpoints.size(), 1U);
}

TEST(RunCheckpoint, AFinishedRunOnlyRepeatsItsStates) {
  const Scenario scenario = test::SmallTriaxial(test::HertzModel());
  const Recorded recorded = Record(scenario);
  const Recorded again = Record(scenario, recorded.checkpoints.back());
  ExpectSameBits(again.run, recorded.run);
  EXPECT_TRUE(again.checkpoints.empty());
}

TEST(RunCheckpoint, OfAnotherRunIsRefusedNamingWhatDiffers) {
  const Scenario scenario = test::SmallTriaxial(test::HertzModel());
  const std::string bytes = Record(scenario).checkpoints.front();
  EXPECT_EQ(CheckpointProblem(scenario, bytes), "");
  Scenario other = scenario;
  other.threads = 7;
  EXPECT_EQ(CheckpointProblem(other, bytes), "");
  other.model.parameters["friction_coefficient"] = 0.551;
  other.path.back().target = 0.02;
  EXPECT_EQ(CheckpointProblem(other, bytes),
            "the checkpoint belongs to another run; what differs: parameters, control path");
  Scenario grains = scenario;
  grains.packing.x[7] += 1e-12;
  EXPECT_THAT(CheckpointProblem(grains, bytes), HasSubstr("what differs: packing"));
  Scenario adaptive = scenario;
  adaptive.staging.adaptive = true;
  EXPECT_THAT(CheckpointProblem(adaptive, bytes), HasSubstr("what differs: staging"));
  Scenario effect = With(scenario, "rolling_resistance", {{"stiffness", 0}, {"friction", 0}});
  EXPECT_THAT(CheckpointProblem(effect, bytes), HasSubstr("what differs: effects"));
  Scenario rescaled = scenario;
  rescaled.model.shear_unloading = ShearUnloading::kRescaled;
  EXPECT_THAT(CheckpointProblem(rescaled, bytes), HasSubstr("what differs: shear at unloading"));
  Scenario mixed = scenario;  // whose checkpoint has a part more
  mixed.model.materials = {"twin"};
  mixed.materials = {.grains = {{"twin", 0.4}}, .seed = 3};
  const std::string of_mixture = Record(mixed).checkpoints.front();
  EXPECT_THAT(CheckpointProblem(scenario, of_mixture), HasSubstr("what differs: materials"));
  EXPECT_THAT(CheckpointProblem(mixed, bytes), HasSubstr("what differs: materials"));
  mixed.materials.seed = 4;
  EXPECT_THAT(CheckpointProblem(mixed, of_mixture), HasSubstr("what differs: materials"));
  int states = 0;
  const auto summary =
      Simulate(grains, [&](const State&) { ++states; }, {}, {.resume_from = bytes});
  EXPECT_EQ(summary.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(states, 0);
}

TEST(RunCheckpoint, OfAnotherEngineIsRefused) {
  const Scenario scenario = test::SmallTriaxial(test::HertzModel());
  std::string head = CheckpointHead(scenario);
  LoadArchive archive(head);
  std::string magic;
  archive(magic);
  head[sizeof(std::uint64_t) + magic.size() + sizeof(std::uint64_t)] = '?';  // of the version
  EXPECT_THAT(CheckpointProblem(scenario, PackCheckpoint(head, {.next = 1})),
              HasSubstr("was written by engine ?"));
}

TEST(RunCheckpoint, DamageOfAnyByteIsFound) {
  Scenario scenario = test::SmallTriaxial(test::HertzModel());
  scenario.path.resize(1);
  const std::string bytes = Record(scenario).checkpoints.front();
  for (std::size_t at = 0; at < bytes.size(); at += 1 + bytes.size() / 200) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    EXPECT_NE(CheckpointProblem(scenario, damaged), "") << "byte " << at;
    EXPECT_NE(CheckpointProblem(scenario, bytes.substr(0, at)), "") << "first " << at;
  }
  EXPECT_EQ(CheckpointProblem(scenario, bytes + "x"), "the checkpoint is damaged or cut off");
  EXPECT_EQ(CheckpointProblem(scenario, bytes.substr(0, bytes.size() / 2)),
            "the checkpoint is damaged or cut off");
  EXPECT_EQ(CheckpointProblem(scenario, ""), "this is no checkpoint of a run");
}

}  // namespace
}  // namespace calib::dem
