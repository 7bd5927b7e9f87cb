// Runs that another code made, some of them with an effect: diagnose, extend and improve learn from
// their tables alone.
#include <cmath>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

// Another code: a closed form of two parameters and two effects, rolling and bonds, in two tests.
// What chance makes of a run is a number between -1 and 1 that goes by its own.
class RunTables : public CalibctlFixture {
 protected:
  struct Run {
    double modulus, friction, rolling, bonds;
  };
  static double Chance(int number) { return 2 * std::fmod(0.5 + 0.6180339887 * number, 1.0) - 1; }

  // stress ratio and volumetric strain at a strain.
  static std::pair<double, double> At(const Run& run, int test, double strain, int number) {
    const double peak = 2.2 * run.friction + 1.2 * std::pow(run.rolling, 0.8) - 0.1 * test;
    const double q = peak * (1 - std::exp(-strain * run.modulus / (5e6 * (1 + test)))) *
                         (1 - 0.5 * strain * (2 + 6 * run.rolling)) +
                     2 * run.bonds * std::exp(-100 * strain);
    const double v = 0.12 * strain * std::exp(-100 * strain) + 0.02 * run.bonds * strain -
                     (0.35 * run.friction + 0.5 * run.rolling) * std::max(strain - 0.006, 0.0);
    return {
        (1 + q) * (1 + 0.005 * Chance(number) + 0.004 * Chance(7 * number) * std::sin(40 * strain)),
        v + 0.006 * strain * Chance(3 * number)};
  }
  static constexpr int kReadings = 16;
  static double Strain(int i) { return 0.002 + 0.058 * i / (kReadings - 1); }

  void WriteTables() {
    std::string rows = "sample,E,mu,roll,bond\n", states = "sample,test,step,axial_strain,q,v\n";
    for (int n = 0; n < 120; ++n) {
      const auto at = [n](double a) { return std::fmod(0.5 + a * n, 1.0); };
      const bool effects = n >= 60;
      const Run run{.modulus = std::pow(10, 8.5 + at(0.7548776662)),
                    .friction = 0.2 + 0.6 * at(0.5698402910),
                    .rolling = effects && n % 3 != 0 ? 0.01 + 0.4 * at(0.3819660113) : 0,
                    .bonds = effects && n % 3 != 1 ? 0.02 + 0.5 * at(0.2451223338) : 0};
      absl::StrAppend(&rows, n, ",", run.modulus, ",", run.friction, ",", run.rolling, ",",
                      run.bonds, "\n");
      for (const int test : {0, 1}) {
        for (int i = 0; i < kReadings; ++i) {
          const auto [q, v] = At(run, test, Strain(i), n + 1);
          absl::StrAppend(&states, n, ",", test == 0 ? "low" : "high", ",", i, ",", Strain(i), ",",
                          q, ",", v, "\n");
        }
      }
    }
    Write("parameters.csv", rows);
    Write("states.csv", states);
  }

  void Measure(const Run& truth) {
    for (const int test : {0, 1}) {
      std::string table = "axial_strain,stress_ratio,volumetric_strain\n";
      for (int i = 0; i < kReadings; ++i) {
        const auto [q, v] = At(truth, test, Strain(i), 1001);
        absl::StrAppend(&table, Strain(i), ",", q * (1 + 0.012 * Chance(50 * test + i)), ",",
                        v + 3e-4 * Chance(90 * test + i), "\n");
      }
      Write(test == 0 ? "low.csv" : "high.csv", table);
    }
  }

  static std::string Campaign() {
    std::string text = R"(name: another code
model:
  precomputed:
    parameters: parameters.csv
    states: states.csv
    experiment: test
    parameter_columns: {young_modulus: E, friction: mu, rolling.friction: roll, bonds.strength: bond}
    state_columns: {stress_ratio: q, volumetric_strain: v}
    effects:
      rolling: {parameters: {rolling.friction: {null: 0, prior: {prior: uniform, min: 0, max: 0.5}}}}
      bonds: {parameters: {strength: {null: 0, prior: {prior: uniform, min: 0, max: 0.6}}}}
parameters:
  young_modulus: {prior: log_uniform, min: 0.3 GPa, max: 3.2 GPa}
  friction: {prior: uniform, min: 0.2, max: 0.8}
experiments:
)";
    for (const char* test : {"low", "high"}) {
      absl::StrAppend(&text, "  - name: ", test,
                      "\n    test: triaxial_drained\n    data: {file: ", test,
                      R"(.csv, strain: logarithmic}
    control: axial_strain
    observables:
      stress_ratio: {noise: {relative: 0.01}}
      volumetric_strain: {noise: {absolute: 2e-4}}
    role: )",
                      test == std::string("low") ? "calibrate" : "validate", "\n");
    }
    return text + "noise: given\ninference: {method: iterative_bayesian_filter}\nseed: 3\n";
  }

  Json DiagnosisOf(const Run& truth) {
    WriteTables();
    Measure(truth);
    Write("model.yaml", Campaign());
    EXPECT_EQ(Call("run model.yaml --state s --json").code, 0) << Read("err");
    return Call("diagnose c1 --state s --json").json();
  }
};

TEST_F(RunTables, AnEffectThatTheirRowsHoldIsNamedAddedAndJudgedWithoutARun) {
  const Json diagnosis =
      DiagnosisOf({.modulus = 1.1e9, .friction = 0.45, .rolling = 0.25, .bonds = 0});
  EXPECT_EQ(diagnosis["verdict"], "missing_effect") << diagnosis["sentence"];
  EXPECT_EQ(diagnosis["effects"], Json({"rolling"})) << diagnosis["sentence"];
  EXPECT_EQ(diagnosis["model_evaluations"], 0);
  EXPECT_EQ(diagnosis["design"]["held_runs"], 60);

  const Answer improved = Call("improve c1 --state s --json");
  ASSERT_EQ(improved.code, 0) << improved.err;
  const Json steps = improved.json()["steps"];
  ASSERT_EQ(steps.size(), 2U) << improved.out;
  EXPECT_EQ(steps[1]["effects"], Json({"rolling"}));
  EXPECT_EQ(steps[1]["verdict"], "adequate");
  EXPECT_LT(steps[1]["rms_error"], 1);
  EXPECT_EQ(steps[1]["heldout_rms_error"], nullptr) << "no run is where an emulator's draws are";
  EXPECT_EQ(improved.json()["model_evaluations"], 0);
  const std::string last = improved.json()["final_campaign"];
  const Json posterior = Call("posterior " + last + " --state s --json").json();
  EXPECT_EQ(posterior["posterior_from"], "emulator") << "with and without: no draws of a prior";
  const std::map<std::string, double> truth = {
      {"young_modulus", 1.1e9}, {"friction", 0.45}, {"rolling.friction", 0.25}};
  for (const auto& [name, value] : truth) {
    const Json& parameter = posterior["parameters"][name];
    EXPECT_NEAR(parameter["mean"].get<double>(), value, 3 * parameter["sd"].get<double>()) << name;
  }

  const Answer again = Call("extend " + last + " --effect rolling --state s");
  EXPECT_EQ(again.code, 2);
  EXPECT_NE(again.err.find("rolling is part of the model already"), std::string::npos) << again.err;
  const Answer other = Call("extend c1 --effect rolling_resistance --state s");
  EXPECT_EQ(other.code, 2);
  EXPECT_NE(other.err.find("declared under model.precomputed.effects"), std::string::npos)
      << other.err;
}

TEST_F(RunTables, AnAdaptiveCalibrationTakesThemAsAllThereIs) {
  WriteTables();
  Measure({.modulus = 0.8e9, .friction = 0.5, .rolling = 0, .bonds = 0});
  std::string text = Campaign();
  text.replace(text.find("iterative_bayesian_filter"), 25, "adaptive_emulator");
  Write("adaptive.yaml", text);
  std::string chooses = text;
  chooses.replace(chooses.find("adaptive_emulator}"), 18, "adaptive_emulator, max_runs: 90}");
  Write("chooses.yaml", chooses);
  const Answer refused = Call("validate chooses.yaml");
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.err.find("max_runs: has no meaning with runs that exist already"),
            std::string::npos)
      << refused.err;
  const Answer run = Call("run adaptive.yaml --state s --json");
  ASSERT_EQ(run.code, 0) << run.err;
  const Json posterior = run.json();
  EXPECT_EQ(posterior["posterior_from"], "emulator");
  EXPECT_TRUE(posterior["converged"]) << posterior["warnings"];
  EXPECT_EQ(posterior["model_evaluations"], 0);
  ASSERT_EQ(posterior["batches"].size(), 1U);
  const std::map<std::string, double> truth = {{"young_modulus", 0.8e9}, {"friction", 0.5}};
  for (const auto& [name, value] : truth) {
    const Json& parameter = posterior["parameters"][name];
    EXPECT_NEAR(parameter["mean"].get<double>(), value, 3 * parameter["sd"].get<double>()) << name;
  }
}

TEST_F(RunTables, OfARightModelNoneIsNamed) {
  const Json diagnosis = DiagnosisOf({.modulus = 0.8e9, .friction = 0.5, .rolling = 0, .bonds = 0});
  EXPECT_EQ(diagnosis["verdict"], "adequate") << diagnosis["sentence"];
  EXPECT_EQ(diagnosis["probabilities"][0]["effects"], Json::array()) << diagnosis["sentence"];
}

}  // namespace
}  // namespace calib::ctl
