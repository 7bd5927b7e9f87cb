// An effect written as a formula, from the campaign file to the verdict, as a user meets it.
#include <algorithm>
#include <map>
#include <vector>

#include "server/campaign/model/sha256.h"
#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

class UserEffects : public CalibctlFixture {
 protected:
  // The small campaign with `hardening` declared, named in model.effects or not.
  static std::string Campaign(bool used, const std::string& formula = "1 + c * axial_strain") {
    std::string text = SmallCampaign(28, 1);
    const std::string fixed = "fixed: {poisson_ratio: 0.3}}";
    text.replace(
        text.find(fixed), fixed.size(),
        std::string(used ? "effects: [hardening], " : "") +
            "fixed: {poisson_ratio: 0.3},\n  user_effects: {hardening: {scales: "
            "friction_coefficient, formula: \"" +
            formula +
            "\",\n    parameters: {c: {null: 0, prior: {prior: uniform, min: -50, max: 100}, "
            "steps: [20, 60]}}}}}");
    if (used) {
      text.replace(text.find("parameters:\n  young"), 12, "parameters:\n  hardening.c: default\n");
    }
    return text;
  }

  Json Simulated(const std::string& file, const std::string& more = "") const {
    const Answer answer =
        Call("simulate " + file + " --set young_modulus=4e8 --set friction_coefficient=0.5" + more +
             " --json");
    EXPECT_EQ(answer.code, 0) << answer.err;
    return answer.json();
  }
};

TEST_F(UserEffects, AreValidatedListedAndSimulated) {
  Write("used.yaml", Campaign(true));
  Write("declared.yaml", Campaign(false));
  Write("base.yaml", SmallCampaign(12, 1));
  Write("bad.yaml", Campaign(false, "1 + c * axial_strian"));
  EXPECT_EQ(Call("validate used.yaml").code, 0) << Read("err");
  const Answer bad = Call("validate bad.yaml");
  EXPECT_EQ(bad.code, 2);
  EXPECT_NE(bad.err.find("bad.yaml:3: model.user_effects.hardening.formula: character 9: "
                         "'axial_strian' is neither a quantity nor a parameter; did you mean "
                         "'axial_strain'?"),
            std::string::npos)
      << bad.err;
  const Json effects = Call("effects --campaign declared.yaml --json").json();
  ASSERT_FALSE(effects.empty());
  EXPECT_EQ(effects.back()["name"], "hardening");
  EXPECT_EQ(effects.back()["kind"], "contact");
  EXPECT_EQ(effects.back()["parameters"][0]["null_value"], 0);

  const Json base = Simulated("base.yaml");
  EXPECT_EQ(Simulated("declared.yaml"), base) << "declared is not used";
  EXPECT_EQ(Simulated("used.yaml", " --set hardening.c=0"), base) << "the null changes no bit";
  EXPECT_NE(Simulated("used.yaml", " --set hardening.c=60"), base);
  Write("infinite.yaml", Campaign(true,
                                  "axial_strain > 0.004 && axial_strain < 0.009 ? 1 + c / "
                                  "(axial_strain - axial_strain) : 1 + c * axial_strain"));
  const Answer stopped = Call(
      "simulate infinite.yaml --set young_modulus=4e8 --set friction_coefficient=0.5 --set "
      "hardening.c=60");
  EXPECT_EQ(stopped.code, 1);
  EXPECT_NE(stopped.err.find("effect hardening"), std::string::npos) << stopped.err;
  EXPECT_NE(stopped.err.find("grains "), std::string::npos) << stopped.err;
}

// As viscous_damping: readings of staged tests are taken when all has come to rest.
TEST_F(UserEffects, ThatNeedMotionAreNotTriedOnReadingsAtRest) {
  Write("viscous.yaml", Campaign(false, "sliding_velocity > 0 ? 1 + 0.001 * c : 1"));
  ASSERT_EQ(Call("run viscous.yaml --state s --workers 2 --json").code, 0) << Read("err");
  const Answer extended = Call("extend c1 --effect hardening --state s");
  EXPECT_EQ(extended.code, 2);
  EXPECT_NE(extended.err.find("all readings are taken at rest"), std::string::npos) << extended.err;
}

TEST_F(UserEffects, AreCandidatesAndJoinTheModel) {
  Write("small.yaml", Campaign(false));
  ASSERT_EQ(Call("run small.yaml --state s --workers 2 --json").code, 0) << Read("err");
  std::string without;
  for (const Json& effect : Call("effects --json").json()) {
    without += " --without " + effect["name"].get<std::string>();
  }
  const Answer diagnosed = Call("diagnose c1 --state s --workers 2 --json" + without);
  ASSERT_EQ(diagnosed.code, 0) << diagnosed.err;
  const Json candidates = diagnosed.json()["candidates"];
  ASSERT_EQ(candidates.size(), 1U) << diagnosed.out;
  EXPECT_EQ(candidates[0]["effect"], "hardening");
  EXPECT_TRUE(candidates[0]["amplitude"].contains("hardening.c")) << diagnosed.out;

  const Answer extended = Call("extend c1 --effect hardening --state s --workers 2 --json");
  ASSERT_EQ(extended.code, 0) << extended.err;
  const Json parameters = extended.json()["parameters"];
  EXPECT_EQ(parameters.size(), 3U);
  EXPECT_TRUE(parameters.contains("hardening.c")) << extended.out;
  const Answer twice = Call("extend " + extended.json()["campaign"].get<std::string>() +
                            " --effect hardening --state s");
  EXPECT_NE(twice.code, 0);
  EXPECT_NE(twice.err.find("part of the model already"), std::string::npos) << twice.err;
  EXPECT_EQ(Call("compare c1 --state s --json").code, 0);
}

// A friction that falls with the strain, hidden in a measurement at two pressures; a third is held
// out.
class HiddenFormulaSlow : public CalibctlFixture {
 protected:
  HiddenFormulaSlow() {
    std::vector<double> strains;
    for (int k = 1; k <= 20; ++k) strains.push_back(0.002 * k);
    for (const char* name : {"low", "high", "held"})
      Write(Readings(name), UnmeasuredReadings(strains));
    Write("truth.yaml", Campaign("effects: [hardening], ", "  hardening.c: default\n"));
    Write("base.yaml", Campaign("", ""));
    const Json states =
        Call(
            "simulate truth.yaml --set young_modulus=4e8 --set friction_coefficient=0.6 --set "
            "hardening.c=-20 --json")
            .json()["states"];
    for (const char* name : {"low", "high", "held"})
      Write(Readings(name), MeasuredReadings(states, name));
  }

  static std::string Readings(const std::string& name) { return name + ".csv"; }

  static std::string Campaign(const std::string& effects, const std::string& parameters) {
    std::string text = "name: hidden formula\nmodel: {contact: hertz_mindlin, " + effects +
                       R"(density: 2650000 kg/m^3,
  fixed: {poisson_ratio: 0.3},
  user_effects: {hardening: {scales: friction_coefficient, formula: "1 + c * axial_strain",
    parameters: {c: {null: 0, prior: {prior: uniform, min: -24, max: 100}, steps: [-8, -16]}}}}}
parameters:
)" + parameters + R"(  young_modulus: {prior: log_uniform, min: 1e8, max: 2e9}
  friction_coefficient: {prior: uniform, min: 0.1, max: 0.8}
experiments:
)";
    const std::map<std::string, std::string> pressures = {
        {"low", "100 kPa"}, {"high", "400 kPa"}, {"held", "200 kPa"}};
    for (const auto& [name, pressure] : pressures) {
      text += "  - name: " + name +
              "\n    test: triaxial_drained\n    confining_pressure: " + pressure + R"(
    packing: {generate: {particles: 64, porosity: 0.4, radii: {mean: 1 mm, spread: 0.2}, seed: 5}}
    data: {file: )" +
              name +
              R"(.csv, strain: logarithmic}
    control: {column: axial_strain, noise: 1e-5}
    observables: {q_over_p: {noise: {absolute: 0.02}}, volumetric_strain: {noise: {absolute: 0.0002}}}
)" + (name == "held" ? "    role: validate\n" : "");
    }
    return text + R"(noise: given
inference: {method: iterative_bayesian_filter, samples: 30, max_iterations: 3}
seed: 3
)";
  }

  std::int64_t Evaluations(const std::string& state) const {
    std::int64_t sum = 0;
    for (const Json& c : Call("list --state " + state + " --json").json()) {
      sum += c["model_evaluations"].get<std::int64_t>();
    }
    return sum;
  }
};

TEST_F(HiddenFormulaSlow, IsNamedAddedAndHeldOutDataAreOpenedAfterTheVerdict) {
  ASSERT_EQ(Call("run base.yaml --state s --workers 2 --json").code, 0) << Read("err");

  // A budget that no screen can be paid from: the base model alone, and why.
  const Answer poor = Call("improve c1 --state s --workers 2 --max-evaluations 5 --json");
  ASSERT_EQ(poor.code, 0) << poor.err;
  ASSERT_EQ(poor.json()["steps"].size(), 1U) << poor.out;
  EXPECT_NE(poor.json()["steps"][0]["reason"].get<std::string>().find("--max-evaluations"),
            std::string::npos)
      << poor.out;
  EXPECT_LE(poor.json()["model_evaluations"], 5) << poor.out;

  // Killed on the way, it goes on; asked again, it makes no run and says the same.
  CallWith("timeout -s KILL 4", "improve c1 --state s --workers 2 --json");
  const Answer improved = Call("improve c1 --state s --workers 2 --json");
  ASSERT_EQ(improved.code, 0) << improved.err;
  const std::int64_t evaluations = Evaluations("s");
  EXPECT_EQ(Call("improve c1 --state s --workers 2 --json").out, improved.out);
  EXPECT_EQ(Evaluations("s"), evaluations);

  Json verdict = improved.json();
  const Json steps = verdict["steps"];
  ASSERT_GE(steps.size(), 2U) << improved.out;
  EXPECT_EQ(steps[0]["next_effect"], "hardening") << improved.out;
  EXPECT_LT(steps.back()["rms_error"].get<double>(), 0.7 * steps[0]["rms_error"].get<double>());
  EXPECT_LT(steps.back()["heldout_rms_error"].get<double>(),
            steps[0]["heldout_rms_error"].get<double>());
  const Answer diagnosed = Call("diagnose c1 --state s --workers 2 --json");
  const Json first = diagnosed.json()["candidates"][0];
  Json named = first["confusable_with"];
  named.push_back(first["effect"]);
  EXPECT_NE(std::find(named.begin(), named.end(), "hardening"), named.end()) << diagnosed.out;

  // What was stored before held-out data were opened is the answer without them.
  for (Json& step : verdict["steps"]) {
    const bool end = step == steps.front() || step == steps.back();
    EXPECT_EQ(step["heldout_rms_error"].is_null(), !end) << step;
    step["heldout_rms_error"] = nullptr;
  }
  const std::string digest = verdict["verdict_digest"];
  verdict["verdict_digest"] = "";
  // The budget's verdict was another, and its answer showed them.
  EXPECT_EQ(verdict["opened_before"], Json({poor.json()["verdict_digest"]})) << improved.out;
  verdict.erase("opened_before");
  EXPECT_NE(Call("improve c1 --state s --workers 2")
                .out.find("! The held-out data were opened before, for another verdict"),
            std::string::npos)
      << Read("out");
  EXPECT_EQ(campaign::Sha256Hex(verdict.dump(2) + "\n"), digest);
}

}  // namespace
}  // namespace calib::ctl
