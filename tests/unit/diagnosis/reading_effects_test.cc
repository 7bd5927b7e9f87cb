#include "server/diagnosis/reading_effects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

namespace calib::diagnosis {
namespace {

constexpr double kPressure = 1e5;

// A triaxial test read at five strains, the fourth after unloading: the model agrees with it.
campaign::Campaign Triaxial(const std::string& observable, const std::vector<double>& values,
                            double sd) {
  campaign::Experiment experiment;
  experiment.name = "tx";
  experiment.test = "triaxial_drained";
  experiment.settings["confining_pressure"] = kPressure;
  experiment.control_name = "axial_strain";
  experiment.control = {0, 0.01, 0.02, 0.015, 0.02};
  for (int k = 0; k < 5; ++k) {
    experiment.path.push_back(
        {.target = experiment.control[static_cast<std::size_t>(k)], .load_step = k});
  }
  experiment.segment = {"initial_loading", "initial_loading", "initial_loading", "unload_1",
                        "reload_1"};
  experiment.observables.push_back(
      {.name = observable, .values = values, .sd = std::vector<double>(values.size(), sd)});
  campaign::Campaign campaign;
  campaign.experiments.push_back(experiment);
  return campaign;
}

Eigen::RowVectorXd RowOf(const std::vector<double>& values) {
  return Eigen::Map<const Eigen::RowVectorXd>(values.data(),
                                              static_cast<Eigen::Index>(values.size()));
}

// The readings of one run with an effect of this strength, less those without.
Eigen::RowVectorXd Change(const campaign::Campaign& campaign, const std::string& strength,
                          double value, const std::vector<double>& readings) {
  const EffectsOnCurves effects = EffectsOnReadings(campaign);
  const auto found = effects.by_strength.find(strength);
  EXPECT_NE(found, effects.by_strength.end()) << strength;
  if (found == effects.by_strength.end()) return {};
  return found->second(RowOf(readings), Eigen::VectorXd::Constant(1, value)) - RowOf(readings);
}

const std::vector<double> kRatio = {1, 2, 3, 2, 3};

// sigma_a is read as sigma_a + g (q - q0) [dem/effects/load_cell_error.h], here R + g (R - 1).
TEST(EffectsOnReadings, GainOfTheLoadCell) {
  const campaign::Campaign campaign = Triaxial("stress_ratio", kRatio, 0.1);
  const std::vector<double> run = {1, 2.5, 3.5, 2.5, 4};
  const Eigen::RowVectorXd change = Change(campaign, "load_cell_error.gain", -0.2, run);
  for (int k = 0; k < 5; ++k)
    EXPECT_NEAR(change[k], -0.2 * (run[static_cast<std::size_t>(k)] - 1), 1e-12);
  EXPECT_EQ(Change(campaign, "load_cell_error.gain", 0, run).cwiseAbs().maxCoeff(), 0);
  const auto impossible = EffectsOnReadings(campaign).impossible;
  ASSERT_EQ(impossible.size(), 1U);
  EXPECT_EQ(impossible[0].first, "initial_density");
  EXPECT_EQ(impossible[0].second, "no fitted test reads porosity or void ratio");
}

// The same through q/p: R = (1 + 2 m / 3) / (1 - m / 3). Exact at any strength.
TEST(EffectsOnReadings, StressesFromTheirRatio) {
  constexpr double kGain = 0.3;
  std::vector<double> q_over_p;
  for (const double r : kRatio) q_over_p.push_back(3 * (r - 1) / (r + 2));
  const Eigen::RowVectorXd change =
      Change(Triaxial("q_over_p", q_over_p, 0.1), "load_cell_error.gain", kGain, q_over_p);
  for (std::size_t k = 0; k < 5; ++k) {
    const double r = kRatio[k] + kGain * (kRatio[k] - 1);
    EXPECT_NEAR(change[static_cast<Eigen::Index>(k)], 3 * (r - 1) / (r + 2) - q_over_p[k], 1e-12);
  }
}

// As MisreadLoads has it, where that can be.
TEST(EffectsOnReadings, LoadCellsAreReadAsMisreadLoadsHasThem) {
  const campaign::Campaign campaign = Triaxial("stress_ratio", kRatio, 0.1);
  const std::vector<double> run = {1, 2.5, 3.5, 2.5, 4};
  const Eigen::MatrixXd history = (RowOf(run) - RowOf(kRatio)) / 0.1;
  const auto misread = MisreadLoads(campaign, campaign::MakeDataSet(campaign), history,
                                    Eigen::VectorXd::Zero(1), Eigen::VectorXd::Constant(1, 3e3));
  ASSERT_TRUE(misread);
  const Eigen::RowVectorXd change = Change(campaign, "load_cell_error.offset", 3e3, run);
  EXPECT_NEAR(change[0], 0.03, 1e-12);
  EXPECT_LT((change - 0.1 * (*misread - history)).norm(), 1e-12);
}

TEST(MisreadLoads, EachHistoryByItsOwnGainAndOffset) {
  const campaign::Campaign campaign = Triaxial("stress_ratio", kRatio, 0.1);
  const inference::DataSet data = campaign::MakeDataSet(campaign);
  const Eigen::MatrixXd histories = Eigen::MatrixXd::Constant(2, 5, 0.5);  // R is 0.05 larger
  const auto misread =
      MisreadLoads(campaign, data, histories, Eigen::Vector2d(0.1, -0.2), Eigen::Vector2d(0, 2e3));
  ASSERT_TRUE(misread);
  for (Eigen::Index k = 0; k < 5; ++k) {
    const double load = kRatio[static_cast<std::size_t>(k)] - 1;  // over the cell pressure
    EXPECT_NEAR((*misread)(0, k), 0.5 + 0.1 * load / 0.1, 1e-9);
    EXPECT_NEAR((*misread)(1, k), 0.5 + (-0.2 * load + 2e3 / kPressure) / 0.1, 1e-9);
  }
}

// A reading without the load cell stays as it is.
TEST(MisreadLoads, NotWhatIsNoStress) {
  campaign::Campaign campaign = Triaxial("stress_ratio", kRatio, 0.1);
  campaign.experiments[0].observables.push_back(
      {.name = "volumetric_strain", .values = {0, 0, 0, 0, 0}, .sd = {1, 1, 1, 1, 1}});
  const inference::DataSet data = campaign::MakeDataSet(campaign);
  const auto misread = MisreadLoads(campaign, data, Eigen::MatrixXd::Zero(1, 10),
                                    Eigen::VectorXd::Constant(1, 0.1), Eigen::VectorXd::Zero(1));
  ASSERT_TRUE(misread);
  EXPECT_EQ((misread->array() != 0).count(), 4) << "four readings of the stress under load";
}

// Of a test without a load cell no reading, whatever it reads.
TEST(MisreadLoads, NotWhereNoLoadCellIs) {
  campaign::Campaign campaign = Triaxial("q_over_p", kRatio, 0.1);
  campaign.experiments[0].test = "simple_shear";
  const auto misread =
      MisreadLoads(campaign, campaign::MakeDataSet(campaign), Eigen::MatrixXd::Zero(1, 5),
                   Eigen::VectorXd::Constant(1, 0.1), Eigen::VectorXd::Constant(1, 1e3));
  ASSERT_TRUE(misread);
  EXPECT_TRUE(misread->isZero(0));
}

TEST(MisreadLoads, AtTheLateralStressThatIsHeld) {
  campaign::Campaign campaign = Triaxial("stress_ratio", kRatio, 0.1);
  campaign.experiments[0].initial_stress = dem::InitialStress{.axial = 3e5, .lateral = 2e5};
  const auto misread =
      MisreadLoads(campaign, campaign::MakeDataSet(campaign), Eigen::MatrixXd::Zero(1, 5),
                   Eigen::VectorXd::Zero(1), Eigen::VectorXd::Constant(1, 4e3));
  ASSERT_TRUE(misread);
  EXPECT_NEAR((*misread)(0, 2), 4e3 / 2e5 / 0.1, 1e-9);
}

TEST(MisreadLoads, NothingWhereItCannotBeCalculated) {
  const auto of = [](const campaign::Campaign& campaign) {
    return MisreadLoads(campaign, campaign::MakeDataSet(campaign), Eigen::MatrixXd::Zero(1, 5),
                        Eigen::VectorXd::Zero(1), Eigen::VectorXd::Zero(1));
  };
  campaign::Campaign driven = Triaxial("stress_ratio", kRatio, 0.1);
  driven.experiments[0].control_name = "axial_stress";
  EXPECT_FALSE(of(driven)) << "the rig follows the cell";
  campaign::Campaign late = Triaxial("stress_ratio", kRatio, 0.1);
  late.experiments[0].control[0] = 0.005;
  EXPECT_FALSE(of(late)) << "the load at the start is not known";
  campaign::Campaign undrained = Triaxial("deviatoric_stress", kRatio, 0.1);
  undrained.experiments[0].test = "triaxial_undrained";
  EXPECT_FALSE(of(undrained)) << "q alone, at a lateral stress that is not known";
}

// y read at strain e is y(e - x C): minus the slope of its stage times x C, linear in C.
TEST(EffectsOnReadings, ComplianceOfTheFrame) {
  constexpr double kCompliance = 2e-9;
  const Eigen::RowVectorXd change = Change(Triaxial("stress_ratio", kRatio, 0.1),
                                           "apparatus_compliance.compliance", kCompliance, kRatio);
  EXPECT_NEAR(change[0], 0, 1e-12);
  EXPECT_NEAR(change[2], -100 * kCompliance * kPressure * (3 - 1), 1e-12);
  EXPECT_NEAR(change[3], 0, 1e-12) << "no neighbour on its stage";
}

// The stress that closes 63 % of the gaps is a tenth of the largest load.
TEST(EffectsOnReadings, GapsThatCloseUnderLoad) {
  const Eigen::RowVectorXd change =
      Change(Triaxial("stress_ratio", kRatio, 0.1), "strain_offset.offset", 1e-3, kRatio);
  EXPECT_NEAR(change[1], -100 * 1e-3 * (1 - std::exp(-5)), 1e-12) << "at half the load";
}

// n falls by d; e = n / (1 - n), so that de = -d (1 + e)^2 to first order.
TEST(EffectsOnReadings, ADenserStart) {
  const std::vector<double> void_ratio = {0.8, 0.79, 0.78, 0.78, 0.77};
  const Eigen::RowVectorXd change = Change(Triaxial("void_ratio", void_ratio, 0.1),
                                           "initial_density.densification", 0.02, void_ratio);
  EXPECT_NEAR(change[0], -0.02 * 1.8 * 1.8, 1e-12);
  EXPECT_NEAR(change[4], -0.02 * 1.77 * 1.77, 1e-12);
}

TEST(EffectsOnReadings, WhatTheReadingsDoNotTellIsSaid) {
  const auto reasons = [](const campaign::Campaign& campaign) {
    std::map<std::string, std::string> by_effect;
    for (const auto& [effect, why] : EffectsOnReadings(campaign).impossible)
      by_effect[effect] = why;
    return by_effect;
  };
  const std::string no_stress = "the readings do not give axial and lateral stress";
  campaign::Campaign campaign = Triaxial("void_ratio", kRatio, 0.1);
  EXPECT_EQ(reasons(campaign).at("load_cell_error"), no_stress);
  EXPECT_EQ(reasons(campaign).at("strain_offset"), no_stress);
  campaign = Triaxial("stress_ratio", kRatio, 0.1);
  campaign.experiments[0].control_name = "axial_stress";
  EXPECT_EQ(reasons(campaign).at("apparatus_compliance"),
            "axial strain is not the control of any fitted test");
  EXPECT_EQ(reasons(campaign).count("load_cell_error"), 0U);
  // A test without a rig has no load on it, whatever it reads.
  campaign = Triaxial("stress_ratio", kRatio, 0.1);
  campaign.experiments[0].observables[0].name = "axial_stress";
  campaign.experiments[0].observables.push_back(campaign.experiments[0].observables[0]);
  campaign.experiments[0].observables[1].name = "lateral_stress";
  campaign.experiments[0].observables[1].values = {1, 1, 1, 1, 1};
  EXPECT_EQ(reasons(campaign).count("load_cell_error"), 0U);
  campaign.experiments[0].test = "simple_shear";
  EXPECT_EQ(reasons(campaign).at("load_cell_error"), no_stress);
}

// A run in which q is three p has no ratio of stresses; nothing is NaN.
TEST(EffectsOnReadings, ARunWithoutAStressRatioStaysAsItIs) {
  const campaign::Campaign campaign = Triaxial("q_over_p", {0, 0.5, 1, 0.5, 1}, 0.1);
  const Eigen::RowVectorXd change =
      Change(campaign, "load_cell_error.gain", 0.1, {0, 0.5, 3, 0.5, 1});
  EXPECT_GT(change[1], 0);
  EXPECT_EQ(change[2], 0);
}

}  // namespace
}  // namespace calib::diagnosis
