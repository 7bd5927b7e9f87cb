#include "server/diagnosis/reading_effects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

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

const ReadingEffect* Find(const std::vector<ReadingEffect>& effects, const std::string& parameter) {
  for (const ReadingEffect& effect : effects) {
    if (effect.parameter == parameter) return &effect;
  }
  return nullptr;
}

const std::vector<double> kRatio = {1, 2, 3, 2, 3};

// sigma_a is read as sigma_a + g (q - q0) [dem/effects/load_cell_error.h], here R + g (R - 1).
TEST(EffectsOnReadings, GainOfTheLoadCell) {
  std::vector<std::pair<std::string, std::string>> impossible;
  const auto effects = EffectsOnReadings(Triaxial("stress_ratio", kRatio, 0.1),
                                         Eigen::MatrixXd::Zero(1, 5), impossible);
  const ReadingEffect* gain = Find(effects, "load_cell_error.gain");
  ASSERT_NE(gain, nullptr);
  for (int k = 0; k < 5; ++k) {
    EXPECT_NEAR(gain->change(0, k), gain->unit * (kRatio[static_cast<std::size_t>(k)] - 1) / 0.1,
                1e-12);
  }
  ASSERT_EQ(impossible.size(), 1U);
  EXPECT_EQ(impossible[0].first, "initial_density");
}

// The same through q/p: R = (1 + 2 m / 3) / (1 - m / 3).
TEST(EffectsOnReadings, StressesFromTheirRatio) {
  std::vector<double> q_over_p;
  for (const double r : kRatio) q_over_p.push_back(3 * (r - 1) / (r + 2));
  std::vector<std::pair<std::string, std::string>> impossible;
  const auto effects = EffectsOnReadings(Triaxial("q_over_p", q_over_p, 0.1),
                                         Eigen::MatrixXd::Zero(1, 5), impossible);
  const ReadingEffect* gain = Find(effects, "load_cell_error.gain");
  ASSERT_NE(gain, nullptr);
  for (std::size_t k = 0; k < 5; ++k) {
    const double r = kRatio[k] + gain->unit * (kRatio[k] - 1);
    EXPECT_NEAR(gain->change(0, static_cast<Eigen::Index>(k)),
                (3 * (r - 1) / (r + 2) - q_over_p[k]) / 0.1, 1e-12);
  }
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

// y read at strain e is y(e - x C): minus the slope of its stage times x C.
TEST(EffectsOnReadings, ComplianceOfTheFrame) {
  std::vector<std::pair<std::string, std::string>> impossible;
  const auto effects = EffectsOnReadings(Triaxial("stress_ratio", kRatio, 0.1),
                                         Eigen::MatrixXd::Zero(1, 5), impossible);
  const ReadingEffect* compliance = Find(effects, "apparatus_compliance.compliance");
  ASSERT_NE(compliance, nullptr);
  const auto strain = [&](double ratio) { return compliance->unit * kPressure * (ratio - 1); };
  EXPECT_NEAR(compliance->change(0, 0), 0, 1e-12);
  EXPECT_NEAR(compliance->change(0, 2), -100 * strain(3) / 0.1, 1e-9);
  EXPECT_NEAR(compliance->change(0, 3), 0, 1e-12) << "no neighbour on its stage";
}

// A measurement made with a gain is explained by it exactly, and never by a negative strength of a
// one-sided effect.
TEST(Join, FindsTheStrength) {
  const double gain = 0.08;
  std::vector<double> read;
  for (const double r : kRatio) read.push_back(r + gain * (r - 1));
  const auto campaign = Triaxial("stress_ratio", read, 0.1);
  Eigen::MatrixXd histories(1, 5);  // the model: kRatio
  for (Eigen::Index k = 0; k < 5; ++k) {
    histories(0, k) =
        (kRatio[static_cast<std::size_t>(k)] - read[static_cast<std::size_t>(k)]) / 0.1;
  }
  std::vector<std::pair<std::string, std::string>> impossible;
  const auto effects = EffectsOnReadings(campaign, histories, impossible);
  const ReadingEffect* effect = Find(effects, "load_cell_error.gain");
  ASSERT_NE(effect, nullptr);
  const inference::FittedModel model{
      .histories = histories, .covariance = Eigen::MatrixXd::Identity(5, 5), .parameters = 1};
  Eigen::VectorXd strengths;
  const auto joined = Join(model, *effect, -10, 10, strengths);
  EXPECT_NEAR(strengths[0] * effect->unit, gain, 1e-12);
  EXPECT_NEAR(joined.histories.Values().norm(), 0, 1e-12);
  EXPECT_EQ(joined.parameters, 2);
  Join({.histories = -histories, .covariance = model.covariance, .parameters = 1}, *effect, 0, 10,
       strengths);
  EXPECT_EQ(strengths[0], 0);
}

}  // namespace
}  // namespace calib::diagnosis
