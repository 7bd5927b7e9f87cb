#include "server/report/documents/record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/unit/report/example_view.h"

namespace calib::report {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

TEST(Methods, SayWhatWasFittedToWhatAndHow) {
  CampaignView view = testing::ExampleView("sand");
  view.campaign.parameters[0].prior = {
      .kind = inference::PriorKind::kLogUniform, .min = 0.4e9, .max = 8e9};
  view.posterior.set_model_evaluations(240);
  const Methods methods = MethodsOf(view);
  for (const char* said :
       {"discrete element method [1]", "young modulus (log-uniform from 400 MPa to 8 GPa)",
        "tx02 (triaxial drained)",
        "held out of every fit and choice: ", "240 model evaluations, seed"}) {
    EXPECT_THAT(methods.sentences, Contains(HasSubstr(said)));
  }
  ASSERT_FALSE(methods.references.empty());
  EXPECT_THAT(methods.references.front(), HasSubstr("Cundall"));
  EXPECT_THAT(methods.references, Contains(HasSubstr("iterative Bayesian filtering")));
  for (std::size_t k = 1; k <= methods.references.size(); ++k) {
    EXPECT_THAT(methods.sentences, Contains(HasSubstr("[" + std::to_string(k) + "]")));
  }
}

TEST(LatexTable, SetsAnyNameAsText) {
  CampaignView view = testing::ExampleView("a_b & 50 % \\input{x}");
  view.posterior.mutable_parameters(0)->set_sd(NAN);
  const std::string tex = LatexTable(view);
  EXPECT_THAT(tex, HasSubstr("a\\_b \\& 50 \\% \\textbackslash{}input\\{x\\}"));
  EXPECT_THAT(tex, HasSubstr(" & -- & "));
  EXPECT_THAT(tex, Not(HasSubstr("nan")));
  view.posterior.clear_parameters();
  EXPECT_EQ(LatexTable(view), "");
}

TEST(Record, HoldsFilesIterationsAndTheCampaignFileAsSubmitted) {
  CampaignView view = testing::ExampleView("sand");
  view.source.set_campaign_file("name: \xff\n");
  (*view.source.mutable_files())["low.csv"] = "5f1e";
  const Json json = Json::parse(RecordJson(view));
  EXPECT_EQ(json["files"][0]["path"], "low.csv");
  EXPECT_EQ(json["files"][0]["sha256"], "5f1e");
  ASSERT_EQ(json["iterations"].size(), view.iterations.size());
  EXPECT_EQ(json["iterations"].back()["parameters"]["young_modulus"]["mean"].get<double>(),
            view.posterior.parameters(0).mean());
  EXPECT_FALSE(json["methods"]["sentences"].empty());
  EXPECT_THAT(json["latex"].get<std::string>(), HasSubstr("\\toprule"));
}

}  // namespace
}  // namespace calib::report
