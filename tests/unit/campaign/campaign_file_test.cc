#include "server/campaign/file/campaign_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "server/campaign/model/identity.h"
#include "server/methods/registry.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using ::testing::DoubleEq;
using ::testing::ElementsAre;
using testing::GoodFiles;
using testing::GoodYaml;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::ProblemsOf;
using testing::ReaderOf;
using ::testing::SizeIs;
using testing::Spoiled;

ReadOutcome Read(const std::string& yaml) {
  ReadOutcome outcome = ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(GoodFiles()));
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  return outcome;
}

TEST(CampaignFile, ReadsEverySection) {
  const ReadOutcome outcome = Read(GoodYaml());
  const Campaign& c = outcome.campaign;
  EXPECT_EQ(c.name, "sand");
  EXPECT_EQ(c.model.contact, "hertz_mindlin");
  EXPECT_THAT(c.model.effects, ElementsAre("rolling_resistance"));
  EXPECT_DOUBLE_EQ(c.model.density, 2650);
  EXPECT_DOUBLE_EQ(c.model.parameters.at("poisson_ratio"), 0.2);
  ASSERT_THAT(c.parameters, SizeIs(4));
  EXPECT_EQ(c.parameters[1].name, "friction_angle");
  EXPECT_EQ(c.parameters[1].unit, "rad");
  EXPECT_DOUBLE_EQ(c.parameters[1].prior.max, std::numbers::pi / 4);
  EXPECT_EQ(c.parameters[0].prior.kind, inference::PriorKind::kLogUniform);
  EXPECT_EQ(c.samples, 20);
  EXPECT_EQ(c.max_iterations, 3);
  EXPECT_EQ(c.seed, 7U);
  EXPECT_EQ(c.filter.seed, 7U);
  EXPECT_DOUBLE_EQ(c.early_stopping->discard_at_most, 1e-3);
  EXPECT_EQ(c.budget.model_evaluations, 400);
  EXPECT_THAT(outcome.files, ElementsAre("packing.txt", "data.txt", "validation.csv"));
}

TEST(CampaignFile, ResourcesAreWhatOneRunNeeds) {
  const Resources none = Read(GoodYaml()).campaign.resources;
  EXPECT_FALSE(none.threads || none.memory || none.wall || none.silence);
  const Resources some =
      Read(Spoiled("seed: 7",
                   "resources: {threads: 2, memory: 1 GB, wall: 2 h, silence: 10 min}\nseed: 7"))
          .campaign.resources;
  EXPECT_EQ(some.threads, 2);
  EXPECT_EQ(some.memory, 1e9);
  EXPECT_EQ(some.wall, 7200);
  EXPECT_EQ(some.silence, 600);
}

TEST(CampaignFile, TheShearForceAtUnloadingIsChosen) {
  EXPECT_EQ(Read(GoodYaml()).campaign.model.shear_unloading, dem::ShearUnloading::kAsPublished);
  const Campaign rescaled =
      Read(Spoiled("  density: 2650 kg/m^3", "  density: 2650 kg/m^3\n  shear_unloading: rescaled"))
          .campaign;
  EXPECT_EQ(rescaled.model.shear_unloading, dem::ShearUnloading::kRescaled);
  const std::vector<double> values(rescaled.parameters.size(), 0.3);
  EXPECT_EQ(MakeScenario(rescaled, rescaled.experiments[0], {values, 0}).model.shear_unloading,
            dem::ShearUnloading::kRescaled);
}

// Collisions with what `settings` says of them, measured in impact.csv along `control`.
std::string Impact(const std::string& settings, const std::string& control) {
  return R"(name: impact
model: {contact: hertz_mindlin, density: 2500, fixed: {poisson_ratio: 0.2}}
parameters:
  young_modulus: {prior: log_uniform, min: 1e8 Pa, max: 1e11 Pa}
  friction_coefficient: {prior: uniform, min: 0, max: 1}
experiments:
  - name: wall
    test: collision
    radius: 10 mm
    data: {file: impact.csv}
    observables: {normal_restitution: {noise: {absolute: 0.01}}}
    )" + settings +
         "\n    control: " + control + "\ninference: {samples: 10}\n";
}

TEST(CampaignFile, AnInfinitePartnerIsAWall) {
  for (const char* radius : {"inf", ".inf", "2 cm"}) {
    const std::string yaml =
        Impact(std::string("impact_speed: 1 m/s\n    partner_radius: ") + radius, "impact_angle");
    const ReadOutcome outcome =
        ReadCampaign(methods::All(), yaml, "c.yaml",
                     ReaderOf({{"impact.csv", "impact_angle,normal_restitution\n0.3,1\n"}}));
    for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
    EXPECT_EQ(std::isinf(outcome.campaign.experiments.at(0).settings.at("partner_radius")),
              radius != std::string("2 cm"));
  }
  EXPECT_EQ(ProblemsOf(Spoiled("confining_pressure: 0.2 MPa", "confining_pressure: .inf")),
            "c.yaml:15: experiments[1].confining_pressure: '.inf' is not finite; allowed: "
            "between 0 (excluded) and 1e+10 Pa\n");
}

TEST(CampaignFile, ConvertsEngineeringStrainAndItsNoise) {
  const Campaign c = Read(GoodYaml()).campaign;
  const Experiment& e = c.experiments[0];
  EXPECT_EQ(e.control_name, "axial_strain");
  ASSERT_THAT(e.control, SizeIs(6));
  EXPECT_DOUBLE_EQ(e.control[5], -std::log(1 - 0.12));
  EXPECT_EQ(e.path[5].load_step, 5);
  const MeasuredObservable& volume = e.observables[1];
  EXPECT_EQ(volume.name, "volumetric_strain");
  EXPECT_NEAR(volume.values[5], -std::log(1 + 0.029), 1e-15);
  EXPECT_DOUBLE_EQ(volume.sd[5], 1e-3 / (1 + 0.029));
  EXPECT_DOUBLE_EQ(volume.correlation_length, 0.005);
  EXPECT_DOUBLE_EQ(e.observables[0].sd[1], std::hypot(0.02 * 2.1, 0.01));
  EXPECT_THAT(e.segment, ElementsAre("initial_loading", "initial_loading", "pre_peak", "peak",
                                     "post_peak", "post_peak"));
}

TEST(CampaignFile, RealizationsOfARecipeDifferInTheirSeeds) {
  const Campaign c = Read(GoodYaml()).campaign;
  ASSERT_THAT(c.experiments[1].specimens, SizeIs(3));
  for (std::size_t i = 0; i < 3; ++i) {
    const auto& recipe = std::get<dem::PackingRecipe>(c.experiments[1].specimens[i]);
    EXPECT_EQ(recipe.seed, 5 + i);
    EXPECT_DOUBLE_EQ(recipe.porosity, 0.68 / 1.68);
    EXPECT_DOUBLE_EQ(recipe.mean_radius, 1e-3);
  }
}

TEST(CampaignFile, ValidationDataAreNotFitted) {
  const Campaign c = Read(GoodYaml()).campaign;
  const inference::DataSet data = MakeDataSet(c);
  EXPECT_THAT(data.readings, SizeIs(12));
  for (const inference::Reading& reading : data.readings) EXPECT_EQ(reading.experiment, 0);
  ASSERT_THAT(data.correlations, SizeIs(1));
  EXPECT_EQ(data.correlations[0].observable, 1);
  // Processing order: load step, then observable; the control counts as path length.
  EXPECT_EQ(data.readings[3].load_step, 1);
  EXPECT_EQ(data.readings[3].observable, 1);
  EXPECT_DOUBLE_EQ(data.readings[3].control, -std::log(1 - 0.004));
}

TEST(CampaignFile, CorrelatedErrorsOfReadingsAtOneControlAreNotTheSame) {
  Experiment e;
  e.path = {{.target = 0.01, .load_step = 0},
            {.target = 0.01, .load_step = 1},
            {.target = 0.02, .load_step = 2}};
  EXPECT_THAT(TravelledControl(e, 0), ElementsAre(0.01, 0.01, 0.02));
  EXPECT_THAT(TravelledControl(e, 0.1),
              ElementsAre(DoubleEq(0.01), DoubleEq(0.011), DoubleEq(0.021)));
}

TEST(CampaignFile, ReadingsThatDifferInTheLastDigitsAreAtOneControl) {
  Experiment e;
  e.path = {{.target = 0.01, .load_step = 0},
            {.target = 0.02, .load_step = 1},
            {.target = 0.02 + 1e-8, .load_step = 2},
            {.target = 0.03, .load_step = 3}};
  EXPECT_THAT(TravelledControl(e, 0.1),
              ElementsAre(DoubleEq(0.01), DoubleEq(0.02), DoubleEq(0.021), DoubleEq(0.031 - 1e-8)));
}

TEST(CampaignFile, WhatWasAcceptedOnceIsNotAskedAgainWhetherItsRunsAreOfUse) {
  const std::string yaml = Spoiled("model_evaluations: 400", "model_evaluations: 19");
  const auto files = GoodFiles();
  EXPECT_THAT(ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(files)).problems, SizeIs(1));
  EXPECT_THAT(ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(files), std::nullopt,
                           CampaignIs::kStored)
                  .problems,
              IsEmpty());
}

TEST(CampaignFile, ADenseCurveKeepsTheDistancesOfItsReadings) {
  Experiment e;
  for (int i = 0; i < 4; ++i) e.path.push_back({.target = 1e-5 * (i + 1), .load_step = i});
  EXPECT_THAT(TravelledControl(e, 0.1),
              ElementsAre(DoubleEq(1e-5), DoubleEq(2e-5), DoubleEq(3e-5), DoubleEq(4e-5)));
}

TEST(CampaignFile, MakesTheScenarioOfASample) {
  const Campaign c = Read(GoodYaml()).campaign;
  const dem::Scenario s = MakeScenario(c, c.experiments[0], {{1e9, 0.5, 0.1, 0.2}, 3});
  EXPECT_DOUBLE_EQ(s.model.parameters.at("young_modulus"), 1e9);
  EXPECT_DOUBLE_EQ(s.model.parameters.at("poisson_ratio"), 0.2);
  EXPECT_DOUBLE_EQ(s.settings.at("confining_pressure"), 2e5);
  EXPECT_THAT(s.packing.x, SizeIs(20));
  EXPECT_THAT(s.path, SizeIs(6));
  EXPECT_THAT(MakeScenario(c, c.experiments[1], {{1e9, 0.5, 0.1, 0.2}, 0}).packing.x, IsEmpty());
}

TEST(CampaignFile, ASeedOnTheCommandLineWins) {
  const ReadOutcome outcome =
      ReadCampaign(methods::All(), GoodYaml(), "c.yaml", ReaderOf(GoodFiles()), 99);
  EXPECT_EQ(outcome.campaign.seed, 99U);
  EXPECT_EQ(outcome.campaign.filter.seed, 99U);
}

TEST(CampaignFile, AcceptsEveryNoiseMode) {
  EXPECT_EQ(Read(Spoiled("noise: given", "noise: inferred")).campaign.filter.noise,
            inference::NoiseMode::kInferred);
  const Campaign tempered = Read(R"(name: t
model: {contact: linear, effects: none, fixed: {poisson_ratio: 0.3, young_modulus: 1 GPa}}
parameters: {friction_coefficient: default}
experiments:
  - name: a
    test: triaxial_drained
    confining_pressure: 0.5 MPa
    packing: {file: packing.txt}
    data: {file: validation.csv}
    control: axial_strain
    observables: [q_over_p]
noise: {ess_target: 0.3}
early_stopping: {discard_at_most: 1e-3}
inference: {method: sqmc, samples: 50}
)")
                                .campaign;
  EXPECT_EQ(tempered.filter.noise, inference::NoiseMode::kEssTarget);
  EXPECT_DOUBLE_EQ(tempered.filter.ess_target, 0.3);
  EXPECT_EQ(tempered.max_iterations, 1);
  EXPECT_FALSE(tempered.early_stopping.has_value());  // a tempered likelihood has no bound to keep
}

TEST(CampaignFile, PriorsOfEveryKind) {
  const Campaign c = Read(Spoiled("young_modulus: {prior: log_uniform, min: 1e8 Pa, max: 1e11 Pa}",
                                  "young_modulus: {prior: log_normal, mean: 1 GPa, sd: 0.5}"))
                         .campaign;
  EXPECT_EQ(c.parameters[0].prior.kind, inference::PriorKind::kLogNormal);
  EXPECT_DOUBLE_EQ(c.parameters[0].prior.mean, std::log(1e9));
  EXPECT_DOUBLE_EQ(c.parameters[0].prior.min, 1e4);  // cut off at what is admissible
}

TEST(CampaignFile, FullCovarianceOfTheErrors) {
  auto files = GoodFiles();
  files["covariance.txt"] =
      "# percent^2\n0.04 0.01 0 0 0 0\n0.01 0.04 0 0 0 0\n0 0 0.04 0 0 0\n"
      "0 0 0 0.04 0 0\n0 0 0 0 0.09 0\n0,0,0,0,0,0.09\n";
  const std::string yaml = Spoiled("{absolute: 0.1 percent, correlation_length: 0.5 percent}",
                                   "{covariance: covariance.txt}");
  const ReadOutcome outcome = ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(files));
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  const MeasuredObservable& volume = outcome.campaign.experiments[0].observables[1];
  ASSERT_THAT(volume.sd, SizeIs(6));
  const double slope0 = 1;                 // of ln at the first reading, 0
  const double slope1 = 1 / (1 - 0.0012);  // and the second, 0.12 percent
  EXPECT_DOUBLE_EQ(volume.covariance(0, 1), 1e-6 * slope0 * slope1);
  EXPECT_DOUBLE_EQ(volume.sd[1], 2e-3 * slope1);
  const inference::DataSet data = MakeDataSet(outcome.campaign);
  ASSERT_THAT(data.covariances, SizeIs(1));
  EXPECT_EQ(data.covariances[0].observable, 1);
  EXPECT_TRUE(inference::ValidateData(data, inference::NoiseMode::kGiven).ok());
  EXPECT_THAT(outcome.files, ::testing::Contains("covariance.txt"));

  files["covariance.txt"] = "1 0\n0 1\n";
  EXPECT_THAT(ProblemsOf(yaml, files),
              ::testing::HasSubstr("covariance.txt:1: has 2 numbers; a row has 6 numbers"));
  files["covariance.txt"] =
      "1 2 0 0 0 0\n2 1 0 0 0 0\n0 0 1 0 0 0\n0 0 0 1 0 0\n0 0 0 0 1 0\n0 0 0 0 0 1\n";
  EXPECT_THAT(ProblemsOf(yaml, files),
              ::testing::HasSubstr("covariance.txt: is not positive definite, as a covariance is: "
                                   "row 2 contradicts the rows before it"));
  // Positive definite by its signs, but the third error is half the sum of the first two to within
  // a part in 10^14: the likelihood would refuse it after the submission.
  files["covariance.txt"] =
      "1 0 0.5 0 0 0\n0 1 0.5 0 0 0\n0.5 0.5 0.50000000000001 0 0 0\n"
      "0 0 0 1 0 0\n0 0 0 0 1 0\n0 0 0 0 0 1\n";
  EXPECT_THAT(
      ProblemsOf(yaml, files),
      ::testing::HasSubstr("covariance.txt: is singular to within rounding: the rows before "
                           "leave a share of "));
  EXPECT_THAT(ProblemsOf(yaml, files),
              ::testing::HasSubstr("of the variance of row 3 open (needed: 1e-13); add the "
                                   "independent part of each reading's error to the diagonal, or "
                                   "leave readings out"));
  files["covariance.txt"] =
      "0 0 0 0 0 0\n0 1 0 0 0 0\n0 0 1 0 0 0\n0 0 0 1 0 0\n0 0 0 0 1 0\n0 0 0 0 0 1\n";
  EXPECT_THAT(ProblemsOf(yaml, files),
              ::testing::HasSubstr("covariance.txt: has the variance 0 in row 1; a variance has to "
                                   "be greater than 0"));
}

// Mistakes of units and signs, by what the observable can be at all.
TEST(CampaignFile, ReadingsOutsideWhatTheirObservableCanBe) {
  const auto problems = [](const std::string& observable,
                           const std::vector<std::string>& readings) {
    auto files = GoodFiles();
    std::string& text = files["validation.csv"] = "axial_strain," + observable + "\n";
    for (int row = 1; const std::string& reading : readings) {
      text += "0.0" + std::to_string(row++) + "," + reading + "\n";
    }
    return ProblemsOf(Spoiled("{q_over_p: {noise: {relative: 0.05}}}",
                              "{" + observable + ": {noise: {absolute: 0.05}}}"),
                      files);
  };
  EXPECT_EQ(problems("porosity", {"0.39", "0.4", "0.41"}), "");
  EXPECT_EQ(problems("porosity", {"39", "40", "41"}),
            "validation.csv:2: porosity: is 39 here (and impossible in 2 later rows); it "
            "has to be between 0 and 1; if the column is in percent, say so: units: {porosity: "
            "percent}\n");
  EXPECT_EQ(problems("void_ratio", {"0.7", "0.71", "72"}),
            "validation.csv:4: void_ratio: is 72 here; it has to be between 0 and 20; "
            "if the column is in percent, say so: units: {void_ratio: percent}\n");
  EXPECT_EQ(
      problems("mean_stress", {"1e5", "-1e5", "-2e5"}),
      "validation.csv:3: mean_stress: is -100000 here (and impossible in 1 later row); it has "
      "to be at least 0; compression is positive here: see to its sign\n");
  EXPECT_EQ(problems("mean_stress", {"1e5", "-1e5", "2e5"}), "") << "grains may stick together";
  EXPECT_EQ(problems("q_over_p", {"-1.5", "3", "0"}), "");
  EXPECT_EQ(problems("mean_stress", {"1e3", "-2", "-300"}), "") << "liquefied, zeros drift";
  EXPECT_EQ(problems("porosity", {"0.4", "1.1"}), "") << "two of its errors";
  for (const std::string wrong : {"-1.8", "200000"}) {
    EXPECT_EQ(problems("stress_ratio", {"1.1", "1.8", wrong}),
              "validation.csv:4: stress_ratio: is " + wrong +
                  " here; it has to be between 0 and 1000; it is axial over lateral stress, "
                  "compression positive: see to column and sign\n");
  }
  EXPECT_EQ(problems("q_over_p", {"0.8", "-4", "-5"}),
            "validation.csv:3: q_over_p: is -4 here (and impossible in 1 later row); it has to be "
            "between -1.5 (no axial stress) and 3 (no lateral one); compression is positive here: "
            "see to its sign\n");
  EXPECT_EQ(problems("deviatoric_stress", {"-1e9", "0", "1e9"}), "") << "nothing is certain of it";
}

TEST(CampaignFile, GrainsOfTheSpecimenShareTheScatter) {
  const Campaign plain = Read(GoodYaml()).campaign;
  EXPECT_DOUBLE_EQ(ScatterShare(plain.experiments[1]), 1);
  const Campaign c =
      Read(Spoiled("    realizations: 3\n", "    realizations: 3\n    specimen_grains: 2e6\n"))
          .campaign;
  EXPECT_DOUBLE_EQ(ScatterShare(c.experiments[1]), 100 / 2e6);
}

TEST(CampaignFile, AnObservableThatIsOnlyPredictedNeedNoColumn) {
  const std::string table =
      "inference: {method: table, rows: [{young_modulus: 1 GPa, friction_angle: 30 deg, "
      "rolling_resistance.stiffness: 0.1, rolling_resistance.friction: 0.1}]}";
  std::string yaml = Spoiled(
      "inference: {method: iterative_bayesian_filter, samples: 20, max_iterations: 3}", table);
  const std::string noise = "    observables: {q_over_p: {noise: {relative: 0.05}}}\n";
  yaml.replace(yaml.find(noise), noise.size(), "    observables: [q_over_p, volumetric_strain]\n");
  const Campaign c = Read(yaml).campaign;
  ASSERT_THAT(c.experiments[1].observables, SizeIs(2));
  EXPECT_THAT(c.experiments[1].observables[0].values, SizeIs(3));
  EXPECT_THAT(c.experiments[1].observables[0].sd, IsEmpty());
  EXPECT_THAT(c.experiments[1].observables[1].values, IsEmpty());
}

// Runs that an iterative filter learns from beside its samples.
TEST(CampaignFile, AFilterTakesRunsBesideItsSamples) {
  const std::string filter =
      "inference: {method: iterative_bayesian_filter, samples: 20, max_iterations: 3}";
  const auto with = [&filter](const std::string& angle) {
    return Spoiled(filter, filter.substr(0, filter.size() - 1) +
                               ", rows: [{young_modulus: 1 GPa, friction_angle: " + angle +
                               ", rolling_resistance.stiffness: 0.1, "
                               "rolling_resistance.friction: 0.1, like: 41}]}");
  };
  const Campaign c = Read(with("30 deg")).campaign;
  EXPECT_EQ(c.samples, 20);
  ASSERT_TRUE(c.table.has_value());
  EXPECT_EQ(c.table->parameters.rows(), 1);
  EXPECT_EQ(StreamOf(c, 0), 41);
  EXPECT_EQ(StreamOf(c, 1), 1) << "a sample of its own";
  EXPECT_THAT(testing::ProblemsOf(with("89 deg")), HasSubstr("lies outside the prior"));
}

// What will be measured has the error that the file states of it.
TEST(CampaignFile, NoiseStatedOfWhatIsNotMeasuredIsKept) {
  const std::string table =
      "inference: {method: table, rows: [{young_modulus: 1 GPa, friction_angle: 30 deg, "
      "rolling_resistance.stiffness: 0.1, rolling_resistance.friction: 0.1}]}";
  std::string yaml = Spoiled(
      "inference: {method: iterative_bayesian_filter, samples: 20, max_iterations: 3}", table);
  const std::string noise = "    observables: {q_over_p: {noise: {relative: 0.05}}}\n";
  yaml.replace(yaml.find(noise), noise.size(),
               "    observables: {q_over_p: {noise: {relative: 0.05, floor: 0.12}}, "
               "volumetric_strain: {noise: {absolute: 0.2 percent}}}\n");
  const Campaign c = Read(yaml).campaign;
  ASSERT_THAT(c.experiments[1].observables, SizeIs(2));
  const MeasuredObservable& unmeasured = c.experiments[1].observables[1];
  EXPECT_THAT(unmeasured.values, IsEmpty());
  EXPECT_THAT(unmeasured.sd, IsEmpty());
  ASSERT_TRUE(unmeasured.noise.has_value());
  EXPECT_DOUBLE_EQ(ErrorOf(*unmeasured.noise, 7), 0.002);
  ASSERT_TRUE(c.experiments[1].observables[0].noise.has_value());
  EXPECT_DOUBLE_EQ(ErrorOf(*c.experiments[1].observables[0].noise, -1), 0.13);
}

// A setting that drives the test has the range it has when it is given.
TEST(CampaignFile, AControlThatIsASettingHasItsRange) {
  const std::string yaml = Impact("impact_angle: 0.3", "impact_speed");
  for (const std::string speed : {"-2", "0"}) {  // at a speed of 0 nothing collides
    SCOPED_TRACE(speed);
    const ReadOutcome outcome = ReadCampaign(
        methods::All(), yaml, "c.yaml",
        ReaderOf({{"impact.csv", "impact_speed,normal_restitution\n1,0.9\n" + speed + ",0.9\n"}}));
    ASSERT_THAT(outcome.problems, SizeIs(1));
    EXPECT_EQ(ToString(outcome.problems[0]), "impact.csv:3: impact_speed: is " + speed +
                                                 " m/s; collision allows between 0 (excluded) and "
                                                 "10000 m/s");
  }
}

TEST(CampaignFile, ReadsWhatTiesThePriors) {
  const Campaign c =
      Read(Spoiled("noise: given",
                   "prior_correlation: [[young_modulus, friction_angle, -0.4]]\n"
                   "constraints:\n"
                   "  - rolling_resistance.friction <= 2 1/rad * friction_angle - 0.1\n"
                   "  - 5 deg/GPa * young_modulus >= friction_angle - 30 deg\n"
                   "noise: given"))
          .campaign;
  ASSERT_TRUE(c.tied_prior.has_value());
  EXPECT_DOUBLE_EQ(c.tied_prior->correlation()(0, 1), -0.4);
  EXPECT_LT(c.tied_prior->log_mass(), 0);
  const double degree = std::numbers::pi / 180;
  const auto meets = [&c](double e, double angle, double friction) {
    return c.tied_prior->MeetsConstraints(Eigen::Vector4d(e, angle, 0.5, friction));
  };
  EXPECT_TRUE(meets(1e9, 0.5, 0.89));
  EXPECT_FALSE(meets(1e9, 0.5, 0.91)) << "2 * 0.5 - 0.1";
  EXPECT_TRUE(meets(1e9, 34.9 * degree, 0.5));
  EXPECT_FALSE(meets(1e9, 35.1 * degree, 0.5)) << "30 deg + 5 deg/GPa * 1 GPa";
}

TEST(CampaignFile, ReadsGroupsOfNoise) {
  const Campaign c = Read(Spoiled("noise: given",
                                  "noise:\n  inferred:\n"
                                  "    - {observables: [stress_ratio, tx02.volumetric_strain], "
                                  "shape: 3, rate: 2}"))
                         .campaign;
  EXPECT_EQ(c.filter.noise, inference::NoiseMode::kInferred);
  const inference::DataSet data = MakeDataSet(c);
  ASSERT_THAT(data.noise_groups, SizeIs(1));
  EXPECT_THAT(data.noise_groups[0].members, ElementsAre(std::pair(0, 0), std::pair(0, 1)));
  EXPECT_EQ(data.noise_groups[0].prior.shape, 3);
}

TEST(CampaignFile, ReadsModelErrors) {
  const Campaign c =
      Read(Spoiled("noise: given",
                   "noise:\n  model_error:\n"
                   "    - {observables: [stress_ratio], relative: {prior: uniform, min: 0, max: 20 "
                   "percent}}\n"
                   "    - observables: volumetric_strain\n"
                   "      relative: {on: variance, prior: uniform, min: 0, max: 0.01}\n"
                   "      absolute: {prior: normal, mean: 0, sd: 0.1 percent, min: 0}"))
          .campaign;
  EXPECT_EQ(c.filter.noise, inference::NoiseMode::kModelError);
  const inference::DataSet data = MakeDataSet(c);
  ASSERT_THAT(data.model_errors, SizeIs(2));
  EXPECT_THAT(data.model_errors[0].members, ElementsAre(std::pair(0, 0)));
  EXPECT_EQ(data.model_errors[0].relative->prior.max, 0.2);
  EXPECT_FALSE(data.model_errors[0].relative->on_variance);
  EXPECT_FALSE(data.model_errors[0].absolute.has_value());
  EXPECT_TRUE(data.model_errors[1].relative->on_variance);
  EXPECT_EQ(data.model_errors[1].absolute->prior.sd, 0.001);
  EXPECT_THAT(MakeDataSet(c, Role::kValidate).model_errors, IsEmpty());
}

TEST(CampaignFile, BadModelErrorsAreTold) {
  const auto problem = [](const std::string& entries) {
    return ProblemsOf(Spoiled("noise: given", "noise: {model_error: " + entries + "}"));
  };
  EXPECT_THAT(problem("[{observables: [stress_ratio]}]"), HasSubstr("needs relative, absolute or"));
  EXPECT_THAT(problem("[{observables: [porosity], relative: {prior: uniform, min: 0, max: 1}}]"),
              HasSubstr("'porosity' is not fitted in any experiment"));
  EXPECT_THAT(
      problem("[{observables: [stress_ratio], relative: {prior: uniform, min: -1, max: 1}}]"),
      HasSubstr("has to be 0 or more: this is the size of an error"));
  EXPECT_THAT(problem("[{observables: [stress_ratio], relative: {prior: normal, mean: 0, sd: 1}}]"),
              HasSubstr("has to be 0 or more"));
  EXPECT_THAT(problem("[{observables: [stress_ratio], relative: {prior: uniform, min: 0, max: 1}}, "
                      "{observables: stress_ratio, relative: {prior: uniform, min: 0, max: 1}}]"),
              HasSubstr("stands in two groups; its errors have one model error"));
  EXPECT_THAT(
      problem("[{observables: [stress_ratio], relative: {on: range, prior: uniform, min: 0, "
              "max: 1}}]"),
      HasSubstr("sd, variance"));
  EXPECT_THAT(problem("[]"), HasSubstr("has to be a list of groups"));
}

TEST(CampaignFile, ReadsWhatIsHeldWhen) {
  const Campaign c = Read(Spoiled("max_iterations: 3}",
                                  "max_iterations: 3, freeze: {1: [young_modulus], 2: converged}, "
                                  "reversed_path: true, replicates: 5, "
                                  "mixture: parameters_and_states}"))
                         .campaign;
  EXPECT_TRUE(c.method->holds_parameters());
  EXPECT_TRUE(c.filter.reversed_path);
  EXPECT_EQ(c.replicates, 5);
  EXPECT_EQ(c.filter.mixture, inference::MixtureOver::kParametersAndStates);
  EXPECT_EQ(Read(GoodYaml()).campaign.filter.mixture, inference::MixtureOver::kParameters);
}

TEST(CampaignFile, ReadsAdaptiveStaging) {
  EXPECT_FALSE(Read(GoodYaml()).campaign.experiments[0].staging.adaptive);
  const Campaign c = Read(Spoiled("    control: axial_strain\n",
                                  "    control: axial_strain\n"
                                  "    staging: {adaptive: true, unbalanced: 1e-3}\n"))
                         .campaign;
  EXPECT_TRUE(c.experiments[0].staging.adaptive);
  EXPECT_EQ(c.experiments[0].staging.unbalanced, 1e-3);
}

TEST(Identity, ChangesWithEverythingSubmitted) {
  Submission a{
      .campaign_file = "x", .file_name = "c.yaml", .files = {{"p", "d"}}, .seed = std::nullopt};
  const std::string digest = IdentityDigest(a);
  EXPECT_THAT(digest, SizeIs(64));
  EXPECT_EQ(IdentityDigest(a), digest);
  for (const auto& change : std::vector<std::function<void(Submission&)>>{
           [](Submission& s) { s.campaign_file = "y"; },
           [](Submission& s) { s.file_name = "d.yaml"; }, [](Submission& s) { s.files["p"] = "e"; },
           [](Submission& s) { s.files["q"] = "d"; }, [](Submission& s) { s.seed = 7; }}) {
    Submission b = a;
    change(b);
    EXPECT_NE(IdentityDigest(b), digest);
  }
}

}  // namespace
}  // namespace calib::campaign
