// An effect written as a formula, from the campaign file to the verdict, as a user meets it.
#include <algorithm>

#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

class UserEffects : public CalibctlFixture {
 protected:
  // The small campaign with `hardening` declared, named in model.effects or not.
  static std::string Campaign(bool used, const std::string& formula = "1 + c * axial_strain") {
    std::string text = SmallCampaign(12, 1);
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

}  // namespace
}  // namespace calib::ctl
