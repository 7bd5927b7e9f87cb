#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "server/report/documents/csv_export.h"
#include "server/report/documents/json_documents.h"
#include "tests/unit/report/example_view.h"

namespace calib::report {
namespace {

using Json = nlohmann::json;

TEST(Json, PosteriorHasTheFieldsOfTheInterface) {
  const CampaignView view = testing::ExampleView("x");
  const Json json = Json::parse(PosteriorJson(view.posterior));
  for (const char* field : {"campaign", "iterations", "converged", "log_evidence", "parameters",
                            "ess", "model_evaluations", "stopped_early"}) {
    EXPECT_TRUE(json.contains(field)) << field;
  }
  const Json& p = json["parameters"]["young_modulus"];
  for (const char* field : {"mean", "sd", "cov", "q05", "q50", "q95", "unit", "at_bound"}) {
    EXPECT_TRUE(p.contains(field)) << field;
  }
  EXPECT_EQ(p["mean"].get<double>(), view.posterior.parameters(0).mean());  // bit for bit
}

TEST(Json, NuisanceParametersStandApartAndLast) {
  v1::Posterior posterior;
  for (const char* name : {"a", "pressure", "b"}) {
    v1::Posterior::Parameter& parameter = *posterior.add_parameters();
    parameter.set_name(name);
    parameter.set_nuisance(std::string(name) == "pressure");
  }
  for (const double r : {1.0, 0.1, 0.2, 0.1, 1.0, 0.3, 0.2, 0.3, 1.0}) posterior.add_correlation(r);
  v1::Posterior::PathPoint& point = *posterior.add_path();
  for (const double mean : {1, 2, 3}) point.add_mean(mean);
  const Json json = Json::parse(PosteriorJson(posterior));
  EXPECT_EQ(json["parameters"].size(), 2U);
  EXPECT_FALSE(json["parameters"].contains("pressure"));
  EXPECT_EQ(json["nuisance_parameters"].size(), 1U);
  EXPECT_TRUE(json["nuisance_parameters"]["pressure"].contains("q95"));
  EXPECT_EQ(json["correlation"], Json({{1.0, 0.2, 0.1}, {0.2, 1.0, 0.3}, {0.1, 0.3, 1.0}}));
  EXPECT_EQ(json["path"][0]["mean"], Json({1.0, 3.0, 2.0}));
}

TEST(Json, ValuesOfLabelsStandBehindTheParameters) {
  v1::Posterior posterior;
  for (const char* name : {"k", "k.spread", "k@A.score"}) {
    v1::Posterior::Parameter& parameter = *posterior.add_parameters();
    parameter.set_name(name);
    parameter.set_nuisance(std::string(name) == "k@A.score");
  }
  v1::Posterior::Parameter& member = *posterior.add_members();
  member.set_name("k@A");
  member.set_unit("N/m");
  member.set_mean(1.0 / 3.0);
  member.set_sd(0.25);
  const std::string text = PosteriorJson(posterior);
  const Json json = Json::parse(text);
  const Json& p = json["parameters"];
  EXPECT_EQ(p.size(), 3U);
  EXPECT_LT(text.find("\"k.spread\""), text.find("\"k@A\""));
  for (const char* field : {"mean", "sd", "cov", "q05", "q50", "q95", "unit", "at_bound"}) {
    EXPECT_TRUE(p["k@A"].contains(field)) << field;
  }
  EXPECT_EQ(p["k@A"]["mean"].get<double>(), 1.0 / 3.0);
  EXPECT_EQ(p["k@A"]["unit"], "N/m");
  EXPECT_EQ(p["k@A"]["at_bound"], false);
  EXPECT_EQ(p["k@A"]["member"], true);
  EXPECT_FALSE(p["k"].contains("member"));
  EXPECT_TRUE(p["k@A"]["prior_min"].is_null());
  EXPECT_TRUE(json["nuisance_parameters"].contains("k@A.score"));
  EXPECT_NE(PosteriorCsv(posterior).find("k@A,N/m,0.333333"), std::string::npos);
}

TEST(Json, ABoundThatThePriorDoesNotHaveIsNull) {
  CampaignView view = testing::ExampleView("x");
  view.campaign.parameters[0].prior.max = HUGE_VAL;
  const Json p = Json::parse(
      PosteriorJson(view.posterior, view.campaign.parameters))["parameters"]["young_modulus"];
  EXPECT_TRUE(p["prior_max"].is_null());
  EXPECT_EQ(p["prior_min"].get<double>(), view.posterior.parameters(0).prior_min());
}

// Rows were run and nothing was inferred: no zero stands for what there is not.
TEST(Json, ATableHasItsCostAndNoPosterior) {
  v1::CampaignStatus status;
  status.set_campaign("c7");
  status.set_model_evaluations(728);
  const Json json = Json::parse(TablePosteriorJson(status));
  EXPECT_EQ(json["campaign"], "c7");
  EXPECT_EQ(json["model_evaluations"], 728);
  for (const char* field : {"iterations", "converged", "log_evidence", "log_evidence_se", "ess",
                            "stopped_early", "posterior_from"}) {
    ASSERT_TRUE(json.contains(field)) << field;
    EXPECT_TRUE(json[field].is_null()) << field;
  }
  EXPECT_EQ(json["parameters"], Json::object());
}

TEST(Json, WhatIsNotKnownIsNull) {
  v1::Posterior posterior;
  posterior.set_log_evidence(std::nan(""));
  posterior.set_ess(HUGE_VAL);
  const Json json = Json::parse(PosteriorJson(posterior));
  EXPECT_TRUE(json["log_evidence"].is_null());
  EXPECT_TRUE(json["ess"].is_null());
}

TEST(Json, ComparisonHasTheFieldsOfTheInterface) {
  const CampaignView view = testing::ExampleView("x");
  const Json json = Json::parse(ComparisonJson("c1", Compare(view, PredictReadings(view))));
  for (const char* field : {"campaign", "rms_error", "reduced_chi2", "p_value", "heldout_rms_error",
                            "by_observable", "by_segment", "parameter_drift"}) {
    EXPECT_TRUE(json.contains(field)) << field;
  }
  for (const char* field : {"experiment", "observable", "rms_error", "z", "p_value"}) {
    EXPECT_TRUE(json["by_observable"][0].contains(field));
  }
  for (const char* field : {"experiment", "observable", "segment", "from", "to", "bias", "z"}) {
    EXPECT_TRUE(json["by_segment"][0].contains(field));
  }
}

// Numbers in people's units, null where there is none.
TEST(Json, ValidationSaysWhatWasReadOfEachExperiment) {
  campaign::ExperimentSummary summary{.name = "tx",
                                      .control = "axial_strain",
                                      .from = 0,
                                      .to = 0.08,
                                      .turning_points = 2,
                                      .observables = {},
                                      .grains = 1000,
                                      .d50 = 2e-3,
                                      .porosity = 0.4};
  summary.observables.push_back({.name = "axial_stress",
                                 .unit = "Pa",
                                 .readings = 24,
                                 .missing = 1,
                                 .first = 200e3,
                                 .last = 450e3,
                                 .min = 200e3,
                                 .max = 450e3,
                                 .sd_min = 6e3,
                                 .sd_max = 13.5e3});
  const campaign::ExperimentSummary counted{
      .name = "heap", .control = "", .observables = {{.name = "mass"}}};
  const Json json = Json::parse(ProblemsJson(
      {}, {{campaign::WarningKind::kFewGrains, "tx", "axial_stress", "is read from 64 grains"}},
      {"a note"}, {summary, counted}));
  EXPECT_EQ(json["valid"], true);
  EXPECT_EQ(json["notes"], Json({"a note"}));
  EXPECT_EQ(json["warnings"], Json::array({{{"kind", "few_grains"},
                                            {"experiment", "tx"},
                                            {"name", "axial_stress"},
                                            {"message", "is read from 64 grains"}}}));
  const Json& tx = json["experiments"][0];
  EXPECT_EQ(tx["name"], "tx");
  EXPECT_EQ(tx["path"]["from"], 0);
  EXPECT_NEAR(tx["path"]["to"].get<double>(), 8, 1e-12);
  EXPECT_EQ(tx["path"]["unit"], "%");
  EXPECT_EQ(tx["path"]["turning_points"], 2);
  EXPECT_EQ(tx["grains"], 1000);
  EXPECT_NEAR(tx["d50"].get<double>(), 2, 1e-12);
  EXPECT_EQ(tx["d50_unit"], "mm");
  EXPECT_EQ(tx["porosity"], 0.4);
  const Json& stress = tx["observables"][0];
  EXPECT_EQ(stress["name"], "axial_stress");
  EXPECT_EQ(stress["readings"], 24);
  EXPECT_EQ(stress["missing"], 1);
  EXPECT_NEAR(stress["first"].get<double>(), 200, 1e-9);
  EXPECT_NEAR(stress["last"].get<double>(), 450, 1e-9);
  EXPECT_EQ(stress["unit"], "kPa");
  EXPECT_NEAR(stress["sd_min"].get<double>(), 6, 1e-9);
  EXPECT_NEAR(stress["sd_max"].get<double>(), 13.5, 1e-9);
  const Json& heap = json["experiments"][1];
  EXPECT_TRUE(heap["grains"].is_null() && heap["d50"].is_null() && heap["porosity"].is_null());
  EXPECT_TRUE(heap["path"]["from"].is_null() && heap["path"]["control"].is_null());
  EXPECT_TRUE(heap["observables"][0]["first"].is_null());
}

TEST(Json, AProblemHasItsKind) {
  const Json json = Json::parse(ProblemsJson(
      {{"c.yaml", 14, "observables.x", "is held", "held"}, {"c.yaml", 1, "name", "is missing"}}));
  EXPECT_EQ(json["valid"], false);
  EXPECT_EQ(json["problems"][0]["kind"], "held");
  EXPECT_TRUE(json["problems"][1]["kind"].is_null());
  EXPECT_TRUE(json["experiments"].empty());
}

TEST(Json, CataloguesHaveNamesAndParameters) {
  for (const std::string& text : {EffectsJson(), ContactsJson(), TestsJson()}) {
    const Json list = Json::parse(text);
    ASSERT_TRUE(list.is_array());
    for (const Json& entry : list) {
      EXPECT_TRUE(entry.contains("name"));
      EXPECT_TRUE(entry["parameters"].is_array());
    }
  }
}

TEST(Json, CataloguesSayWhereEffectsActAndWhatObservablesAre) {
  const Json effects = Json::parse(EffectsJson());
  const auto effect = [&effects](const std::string& name) {
    return *std::find_if(effects.begin(), effects.end(),
                         [&name](const Json& entry) { return entry["name"] == name; });
  };
  const Json membrane = effect("membrane_stiffness");
  EXPECT_EQ(membrane["excited_by"], Json({"triaxial_drained", "triaxial_undrained"}));
  EXPECT_EQ(membrane["parameters"][0]["reference_scale"],
            Json({{"factor", 1}, {"pressure", 1}, {"diameter", 0}, {"modulus", 0}}));
  EXPECT_EQ(membrane["parameters"][0]["scaled_default_prior"],
            Json({{"prior", "log_uniform"}, {"min", 0.01}, {"max", 10}}));
  EXPECT_TRUE(effect("viscous_damping")["needs_motion"]);
  const Json rolling = effect("rolling_resistance")["parameters"][0];
  EXPECT_EQ(rolling["reference_scale_by_contact"]["hertz_mindlin"]["diameter"], 3);
  EXPECT_TRUE(effect("wall_friction")["parameters"][0]["scaled_default_prior"].is_null());
  for (const Json& test : Json::parse(TestsJson())) {
    ASSERT_EQ(test["observable_details"].size(), test["observables"].size());
    for (std::size_t k = 0; k < test["observables"].size(); ++k) {
      EXPECT_EQ(test["observable_details"][k]["name"], test["observables"][k]);
      EXPECT_FALSE(test["observable_details"][k]["unit"].get<std::string>().empty());
      EXPECT_FALSE(test["observable_details"][k]["description"].get<std::string>().empty());
    }
  }
}

TEST(Json, MalformedTextFromUsersIsReplaced) {
  v1::CampaignStatus status;
  status.set_state("a\xff");
  EXPECT_TRUE(Json::accept(StatusJson(status)));
}

TEST(Json, StatesOfSeveralExperiments) {
  const Json json = Json::parse(StateTableJson("experiment,load_step,x,y\na,0,1.5,\nb,0,,2\n"));
  EXPECT_EQ(json["states"][0]["x"], 1.5);
  EXPECT_TRUE(json["states"][0]["y"].is_null());
  EXPECT_EQ(json["states"][1]["experiment"], "b");
}

TEST(Csv, OneRowPerSampleStateAndReading) {
  const CampaignView view = testing::ExampleView("x");
  const auto lines = [](const std::string& text) {
    return std::count(text.begin(), text.end(), '\n');
  };
  EXPECT_EQ(lines(SamplesCsv(view)), 1 + 120);
  EXPECT_EQ(lines(StatesCsv(view)), 1 + 2 * 120 * 40);
  EXPECT_EQ(lines(FitCsv(view, PredictReadings(view))), 1 + 2 * 2 * 40);
  EXPECT_EQ(lines(PosteriorCsv(view.posterior)), 1 + 3);
}

}  // namespace
}  // namespace calib::report
