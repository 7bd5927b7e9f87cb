#include "server/ctl/answer_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "server/ctl/prediction.h"

namespace calib::ctl {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

v1::Posterior Emulated(double split_half) {
  v1::Posterior posterior;
  posterior.set_posterior_from("emulator");
  v1::Posterior::Parameter& p = *posterior.add_parameters();
  p.set_name("friction_coefficient");
  p.set_split_half(split_half);
  return posterior;
}

TEST(PosteriorText, SaysWhetherTheErrorOfTheEvidenceHoldsThatOfTheEmulator) {
  EXPECT_THAT(PosteriorText(Emulated(0.2), {}), HasSubstr("halves of the emulator's runs"));
  EXPECT_THAT(PosteriorText(Emulated(std::nan("")), {}),
              HasSubstr("of its sampling; the emulator's own error is not known"));
}

TEST(PosteriorText, HasTheValuesOfLabelsAndNotTheirScores) {
  v1::Posterior posterior;
  for (const char* name : {"k", "k.spread", "k@A.score"}) {
    v1::Posterior::Parameter& p = *posterior.add_parameters();
    p.set_name(name);
    p.set_nuisance(std::string(name) == "k@A.score");
  }
  v1::Posterior::Parameter& member = *posterior.add_members();
  member.set_name("k@A");
  member.set_mean(4.75);
  const std::string text = PosteriorText(posterior, {});
  EXPECT_THAT(text, HasSubstr("k.spread"));
  EXPECT_THAT(text, HasSubstr("k@A"));
  EXPECT_THAT(text, HasSubstr("4.75"));
  EXPECT_THAT(text, Not(HasSubstr("score")));
}

TEST(TableText, SaysWhatRanAndThatNothingWasInferred) {
  v1::CampaignStatus status;
  status.set_campaign("c3");
  status.set_samples_done(728);
  status.set_samples_diverged(2);
  status.set_model_evaluations(728);
  const std::string text = TableText(status);
  EXPECT_THAT(text,
              HasSubstr("728 rows run (2 diverged), 728 model evaluations, nothing inferred"));
  EXPECT_THAT(text, HasSubstr("calibctl export c3"));
}

report::Sensitivity Told(double explained) {
  report::Quantity q;
  q.experiment = "tx";
  q.name = "final_stress_ratio";
  q.unit = "1";
  q.runs = 60;
  q.prior.explained = explained;
  q.prior.mean = 2;
  report::Sensitivity sensitivity;
  sensitivity.parameters = {"a", "b"};
  if (q.prior.Explains()) {
    q.prior.indices.first = q.prior.indices.total = Eigen::Vector2d(0.5, std::nan(""));
    q.prior.indices.first_error = q.prior.indices.total_error =
        Eigen::Vector2d(std::nan(""), std::nan(""));
    q.prior.correlation = q.prior.correlation_error = Eigen::Vector2d(0.25, 0.1);
  }
  sensitivity.quantities.push_back(q);
  return sensitivity;
}

TEST(SensitivityText, WhatIsNotKnownIsADashAndWhatIsNotExplainedIsSaid) {
  const std::string known = SensitivityText(Told(0.9));
  EXPECT_THAT(known, Not(HasSubstr("nan")));
  EXPECT_THAT(known, HasSubstr("0.50 ± –"));
  EXPECT_THAT(known, HasSubstr("0.25 ± 0.25"));
  const std::string unknown = SensitivityText(Told(-0.0348));
  EXPECT_THAT(unknown, HasSubstr("an emulator explains none: what moves it cannot be told"));
  EXPECT_THAT(unknown, Not(HasSubstr("3.48")));
  EXPECT_THAT(unknown, Not(HasSubstr("first order")));
  EXPECT_THAT(SensitivityText(Told(std::nan(""))), HasSubstr("60 runs, which all give 2."));
}

// The band follows from what is printed: the noise of the measurement has its column.
TEST(PredictionText, NamesTheNoiseThatIsInTheBand) {
  PredictedObservable o;
  o.experiment = "tx";
  o.observable = "stress_ratio";
  o.control_name = "axial_strain";
  o.control = {0.01};
  for (Eigen::VectorXd* v : {&o.quantity.mean, &o.quantity.sd, &o.quantity.q05, &o.quantity.q50,
                             &o.quantity.q95, &o.quantity.sd_parameters, &o.quantity.sd_model}) {
    *v = Eigen::VectorXd::Constant(1, 2);
  }
  o.quantity.conditional_mean = Eigen::MatrixXd::Constant(3, 1, 2);
  o.quantity.conditional_sd = Eigen::VectorXd::Constant(1, 0.5);
  Prediction prediction;
  prediction.observables.push_back(o);
  EXPECT_THAT(PredictionText(prediction), Not(HasSubstr("measurement with its noise")));
  const auto noise = [&prediction] {
    return nlohmann::json::parse(
        PredictionJson(prediction))["predictions"][0]["points"][0]["sd_noise"];
  };
  EXPECT_TRUE(noise().is_null());
  prediction.observables[0].sd_noise = Eigen::VectorXd::Constant(1, 0.125);
  EXPECT_EQ(noise(), 0.125);
  EXPECT_THAT(PredictionText(prediction), HasSubstr("± noise"));
  EXPECT_THAT(PredictionText(prediction), HasSubstr("0.125"));
  EXPECT_THAT(PredictionText(prediction), HasSubstr("those of a measurement with its noise"));
}

}  // namespace
}  // namespace calib::ctl
