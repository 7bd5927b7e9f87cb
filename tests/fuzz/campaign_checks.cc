#include "tests/fuzz/campaign_checks.h"

#include <cmath>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "server/campaign/file/derive.h"
#include "server/campaign/model/race.h"
#include "server/methods/registry.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/support/stl_text.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::fuzz {
namespace {

/// As the server has it (service/limits.h), a covariance aside: smaller ones find the same.
constexpr campaign::ReadLimits kLimits{.covariance = 100};
/// Grains of recipes and realizations are made one by one below this number only.
constexpr std::size_t kMostSpecimens = 4;
constexpr Eigen::Index kMostRows = 4;

void CheckNumbers(const campaign::Campaign& campaign) {
  for (const campaign::Experiment& experiment : campaign.experiments) {
    for (const auto& [name, value] : experiment.settings) {
      Expect(!std::isnan(value), "setting " + name + " is a number");
    }
    for (const dem::ControlPoint& point : experiment.path) {
      Expect(std::isfinite(point.target), "the path of " + experiment.name + " is finite");
    }
    for (const double control : experiment.control) {
      Expect(std::isfinite(control), "the control of " + experiment.name + " is finite");
    }
    for (const campaign::MeasuredObservable& observable : experiment.observables) {
      for (const Eigen::Index row : campaign::RowsRead(observable)) {
        const auto k = static_cast<std::size_t>(row);
        Expect(std::isfinite(observable.values.at(k)), "readings are finite");
        Expect(observable.sd.empty() ||
                   (std::isfinite(observable.sd.at(k)) && observable.sd.at(k) > 0),
               "errors are finite and above 0");
      }
    }
  }
}

void CheckRun(const campaign::Campaign& campaign, const std::vector<double>& values) {
  for (const campaign::Experiment& experiment : campaign.experiments) {
    for (std::size_t k = 0; k < std::min(experiment.specimens.size(), kMostSpecimens); ++k) {
      const dem::Scenario scenario =
          campaign::MakeScenario(campaign, experiment, {values, static_cast<int>(k)});
      for (const auto& [name, value] : scenario.model.parameters) {
        Expect(std::isfinite(value), "parameter " + name + " of a run is finite");
      }
    }
  }
}

void CheckRuns(const campaign::Campaign& campaign) {
  for (const campaign::CalibratedParameter& parameter : campaign.parameters) {
    Expect(parameter.prior.Validate().ok() && std::isfinite(parameter.prior.Quantile(0.5)),
           "the prior of " + parameter.name + " has a median");
  }
  if (campaign.precomputed.has_value()) {
    return;
  }
  std::vector<std::vector<double>> runs = {campaign::MiddleValues(campaign),
                                           campaign::MiddleValues(campaign, campaign.race)};
  const Eigen::Index rows = campaign.table ? campaign.table->parameters.rows() : 0;
  for (Eigen::Index row = 0; row < std::min(rows, kMostRows); ++row) {
    const Eigen::VectorXd values = campaign.table->parameters.row(row);
    runs.emplace_back(values.begin(), values.end());
  }
  for (const std::vector<double>& values : runs) CheckRun(campaign, values);
}

constexpr const char* kModel = R"(name: fuzz
model:
    contact: hertz_mindlin
    density: 2650 kg/m^3
    fixed: {poisson_ratio: 0.2}
)";
constexpr const char* kTest = R"(parameters:
  young_modulus: {prior: log_uniform, min: 1e8 Pa, max: 1e11 Pa}
  friction_angle: {prior: uniform, min: 10 deg, max: 45 deg}
inference: {method: iterative_bayesian_filter, samples: 20, max_iterations: 3}
experiments:
    - name: tx
      test: triaxial_drained
      confining_pressure: 0.2 MPa
)";

}  // namespace

std::string TriaxialCampaign(const std::string& model, const std::string& experiment) {
  return absl::StrCat(kModel, model, kTest, experiment);
}

std::string Indented(const std::string& text, int blanks) {
  std::string lines;
  for (const auto line : absl::StrSplit(text, '\n')) {
    absl::StrAppend(&lines, std::string(static_cast<std::size_t>(blanks), ' '), line, "\n");
  }
  return lines;
}

const std::map<std::string, std::string>& SmallFiles() {
  static const std::map<std::string, std::string> files = [] {
    auto made = campaign::testing::GoodFiles();
    made["silo.stl"] =
        testing::TextStl(testing::FourSides({.lower = 20, .upper = 40, .height = 300}));
    made["silo.csv"] = "opening,mass_flow_rate\n40,1.5\n20,0.4\n30.5,0.9\n20,0.41\n";
    made["exp.dat"] =
        "#\t\te_a\t\tp\t\tn\n0.0\t1.0\t0.40\t\n0.1\t2.0\t0.39\t\n0.05\t1.5\t0.392\t\n";
    made["par.csv"] = "sample,E_GPa,km_nNm\n0,100,8000\n1,120,-5000\n";
    made["sta.csv"] =
        "sample,step,p_MPa,porosity\n0,0,1.1,0.4\n0,1,2.1,0.39\n0,2,1.4,0.393\n"
        "1,0,0.9,0.4\n1,1,1.9,0.38\n";
    return made;
  }();
  return files;
}

campaign::ReadOutcome ReadAndCheck(const std::string& yaml,
                                   const std::map<std::string, std::string>& replaced) {
  auto files = SmallFiles();
  for (const auto& [path, content] : replaced) files[path] = content;
  const campaign::FileReader reader = campaign::testing::ReaderOf(files);
  auto outcome = campaign::ReadCampaign(methods::All(), yaml, "c.yaml", reader, std::nullopt,
                                        campaign::CampaignIs::kNew, kLimits);
  for (const campaign::Problem& problem : outcome.problems) {
    Expect(!problem.message.empty() && problem.line >= 0, "a problem says what and where");
    Expect(campaign::ToString(problem).find('\n') == std::string::npos, "a problem is one line");
  }
  if (!outcome.problems.empty()) {
    return outcome;
  }
  CheckNumbers(outcome.campaign);
  for (const inference::Reading& reading : campaign::MakeDataSet(outcome.campaign).readings) {
    Expect(std::isfinite(reading.value), "data are finite");
  }
  CheckRuns(outcome.campaign);
  if (!campaign::Priors(outcome.campaign).is_constrained()) {  // else half a million points anew
    const auto again = campaign::ReadCampaign(methods::All(), yaml, "c.yaml", reader, std::nullopt,
                                              campaign::CampaignIs::kStored, kLimits);
    Expect(again.problems.empty(),
           "what was accepted once is: " +
               (again.problems.empty() ? "" : campaign::ToString(again.problems.front())));
  }
  Expect(campaign::Derive(methods::All(), yaml,
                          {.name = "derived", .lineage = {.parent = "c1", .purpose = "extension"}})
             .ok(),
         "a campaign can be derived from one that was accepted");
  return outcome;
}

}  // namespace calib::fuzz
