// How a model with more effects is calibrated where a diagnosis has seen it fit.
#include "server/diagnosis/extended_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "server/methods/registry.h"

namespace calib::diagnosis {
namespace {

using ::testing::HasSubstr;

void Calibrate(const char* name, inference::PriorKind kind, double min, double max,
               report::CampaignView& view) {
  campaign::CalibratedParameter& parameter = view.campaign.parameters.emplace_back();
  parameter.name = name;
  parameter.prior = {.kind = kind, .min = min, .max = max};
}

// Two fitted tests, one held out, two parameters.
report::CampaignView Parent(std::string_view method) {
  report::CampaignView view;
  view.campaign.model.contact = "hertz_mindlin";
  view.campaign.model.density = 2500;
  view.campaign.method = methods::All().Find(method);
  view.campaign.samples = 96;
  view.campaign.max_iterations = 4;
  Calibrate("young_modulus", inference::PriorKind::kLogUniform, 1e8, 1e10, view);
  Calibrate("friction_coefficient", inference::PriorKind::kUniform, 0.1, 1, view);
  view.campaign.experiments.resize(3);
  view.campaign.experiments.back().role = campaign::Role::kValidate;
  view.posterior.set_posterior_from("none");
  return view;
}

const NamedModel& Plastic() {
  static const NamedModel model{
      .effects = {"contact_plasticity"},
      .posterior = {{"contact_plasticity.stiffness_ratio", {.center = 3, .sd = 0.2}}}};
  return model;
}

TEST(ExtendedCalibration, AFilterTakesFiveSamplesForEachParameterAtATime) {
  for (const auto method : {"sqmc", "iterative_bayesian_filter"}) {
    const auto plan = PlanExtended(Parent(method), Plastic());
    ASSERT_TRUE(plan.ok()) << plan.status();
    EXPECT_EQ(plan->method, "iterative_bayesian_filter");
    EXPECT_EQ(plan->samples, 15);
    EXPECT_GE(plan->iterations, 2) << "of one nobody knows whether it stands still";
    EXPECT_EQ(plan->model_evaluations, std::nullopt);
    EXPECT_EQ(plan->near.at("contact_plasticity.stiffness_ratio").center, 3);
  }
}

TEST(ExtendedCalibration, MoreRunsAreMoreIterationsOfTheSame) {
  const auto once = PlanExtended(Parent("sqmc"), Plastic());
  const auto twice = PlanExtended(Parent("sqmc"), Plastic(), {.times = 2});
  ASSERT_TRUE(once.ok() && twice.ok());
  EXPECT_EQ(*twice->iterations, 2 * *once->iterations);
  EXPECT_EQ(twice->samples, once->samples) << "or the first would not be found again";
}

TEST(ExtendedCalibration, OtherMethodsAreThoseOfTheParent) {
  const auto plan = PlanExtended(Parent("tmcmc"), Plastic());
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->method, std::nullopt);
  EXPECT_EQ(plan->samples, std::nullopt);
  EXPECT_EQ(plan->iterations, std::nullopt);
}

TEST(ExtendedCalibration, ABudgetThatAllowsNoIterationIsSaid) {
  const report::CampaignView parent = Parent("sqmc");
  EXPECT_EQ(PlanExtended(parent, Plastic(), {.budget = 30})->model_evaluations, 30);
  const auto less = PlanExtended(parent, Plastic(), {.budget = 29}).status();
  EXPECT_EQ(less.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(less.message()), HasSubstr("takes 30 model evaluations, and 29"));
  EXPECT_EQ(PlanExtended(parent, Plastic(), {.budget = 100000})->model_evaluations, std::nullopt)
      << "what forbids nothing is not in the text, by which the campaign is found again";
}

// Parameters of the parent, two effects of a race and one of the numerics.
report::CampaignView Design() {
  report::CampaignView view = Parent("design");
  view.campaign.race = {"contact_plasticity", "pressure_dependent_friction"};
  Calibrate("contact_plasticity.stiffness_ratio", inference::PriorKind::kLogUniform, 1, 11, view);
  Calibrate("pressure_dependent_friction.exponent", inference::PriorKind::kUniform, -0.6, 0.6,
            view);
  Calibrate("numerics.rate", inference::PriorKind::kLogUniform, 0.5, 2, view);
  return view;
}

void AddRun(const std::vector<double>& values, const char* status, report::CampaignView& design) {
  v1::Sample& sample = design.samples.emplace_back();
  for (const double value : values) sample.add_parameters(value);
  sample.set_index(static_cast<int>(design.samples.size()) - 1);
  sample.set_stream(100 + sample.index());
  sample.set_status(status);
  sample.set_purpose("main");
}

TEST(ExtendedCalibration, RunsOfTheModelAreTakenFromTheDesign) {
  const report::CampaignView parent = Parent("sqmc");
  report::CampaignView design = Design();
  AddRun({1e9, 0.4, 2.5, 0, 1}, "finished", design);    // the model
  AddRun({1e9, 0.4, 1, 0, 1}, "finished", design);      // the base
  AddRun({1e9, 0.4, 2.5, 0.1, 1}, "finished", design);  // another effect beside
  AddRun({1e9, 0.4, 2.5, 0, 2}, "finished", design);    // other numerics
  AddRun({1e9, 0.4, 2.5, 0, 1}, "diverged", design);
  AddRun({1e9, 1.1, 2.5, 0, 1}, "finished", design);  // outside a prior
  AddRun({1e9, 0.4, 12, 0, 1}, "finished", design);   // likewise, of the effect
  AddRun({2e9, 0.5, 3.5, 0, 1}, "finished", design);  // the model
  const auto rows = RunsOfModel(parent, design, {"contact_plasticity"});
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0].like, 100);
  EXPECT_EQ(rows[1].like, 107);
  EXPECT_EQ(rows[1].values,
            (std::map<std::string, double>{{"young_modulus", 2e9},
                                           {"friction_coefficient", 0.5},
                                           {"contact_plasticity.stiffness_ratio", 3.5}}));
  EXPECT_EQ(
      RunsOfModel(parent, design, {"contact_plasticity", "pressure_dependent_friction"}).size(),
      1U);
  EXPECT_EQ(PlanExtended(parent, Plastic(), {.design = &design})->given.size(), 2U);
}

TEST(ExtendedCalibration, AnAdaptiveCalibrationStartsFromTheRunsOfTheDesign) {
  const report::CampaignView parent = Parent("adaptive_emulator");
  report::CampaignView design = Design();
  AddRun({1e9, 0.4, 2.5, 0, 1}, "finished", design);
  const auto plan = PlanExtended(parent, Plastic(), {.design = &design});
  ASSERT_TRUE(plan.ok()) << plan.status();
  ASSERT_EQ(plan->given.size(), 1U);
  EXPECT_EQ(plan->given[0].like, 100);
  EXPECT_EQ(plan->method, "adaptive_emulator");
  EXPECT_EQ(plan->samples, std::nullopt) << "max_runs says how many";
  const auto less = PlanExtended(parent, Plastic(), {.design = &design, .budget = 61}).status();
  EXPECT_THAT(std::string(less.message()), HasSubstr("takes 62 model evaluations, and 61"));
}

// They keep what parameters do together, which a proposal about the mean does not.
TEST(ExtendedCalibration, TheFirstRunsAreAtDrawsOfThePosteriorTwiceAsFarFromItsMean) {
  const report::CampaignView parent = Parent("sqmc");
  NamedModel model = Plastic();
  model.posterior["young_modulus"] = {.center = 1e9, .sd = 1e8};
  model.posterior["friction_coefficient"] = {.center = 0.5, .sd = 0.1};
  for (int i = 0; i < kDrawsOfModel; ++i) {
    const double x = 0.7 * ((i + 0.5) / kDrawsOfModel - 0.5);
    model.draws.push_back({{"young_modulus", 1e9 * (1 + x / 4)},
                           {"friction_coefficient", 0.5 + x},
                           {"contact_plasticity.stiffness_ratio", 3 - x}});
  }
  const auto plan = PlanExtended(parent, model);
  ASSERT_TRUE(plan.ok()) << plan.status();
  ASSERT_EQ(plan->given.size(), 15U);
  int moved = 0;
  for (std::size_t i = 0; i < plan->given.size(); ++i) {
    EXPECT_EQ(plan->given[i].like, static_cast<int>(i));
    const auto& values = plan->given[i].values;
    const double x = 3 - values.at("contact_plasticity.stiffness_ratio");
    EXPECT_NEAR(values.at("young_modulus"), 1e9 * (1 + x / 4), 1);
    EXPECT_NEAR(values.at("friction_coefficient"), 0.5 + x, 1e-12);
    moved += std::abs(x) > 0.36 ? 1 : 0;  // farther than any draw
  }
  EXPECT_GE(moved, 1) << "those that stay inside the priors";
  EXPECT_EQ(PlanExtended(parent, model, {.budget = 59}).status().code(),
            absl::StatusCode::kResourceExhausted)
      << "draws and samples of two tests are 60";
}

}  // namespace
}  // namespace calib::diagnosis
