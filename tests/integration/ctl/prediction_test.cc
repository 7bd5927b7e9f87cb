// predict as a user meets it, on a calibration of 64 grains.
#include <cmath>

#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

class Predicting : public CalibctlFixture {
 protected:
  Predicting() {
    Write("small.yaml", SmallCampaign(12, 1));
    Write("other.yaml", R"(name: tx200
test: triaxial_drained
confining_pressure: 200 kPa
control: {column: axial_strain, to: 1 percent, readings: 4}
staging: {rate: 1 1/s, step: 0.005, damping: [0.3, 0.9], unbalanced: 5e-3}
observables: [q_over_p, volumetric_strain]
)");
  }
};

TEST_F(Predicting, PosteriorAtAnotherPressure) {
  ASSERT_EQ(Call("run small.yaml --state s --workers 2 --json").code, 0) << Read("err");
  const std::string verb =
      "predict c1 --test other.yaml --draws 10 --exceed q_over_p=0.2 --exceed q_over_p=5 "
      "--state s --workers 2";
  const Answer first = Call(verb + " --json");
  ASSERT_EQ(first.code, 0) << first.err;
  const Json json = first.json();
  EXPECT_EQ(json["campaign"], "c1");
  EXPECT_EQ(json["prediction"], "c2");
  EXPECT_EQ(json["runs"], 10);
  ASSERT_EQ(json["predictions"].size(), 2U);
  const Json& q = json["predictions"][0];
  EXPECT_EQ(q["experiment"], "tx200");
  EXPECT_EQ(q["observable"], "q_over_p");
  ASSERT_EQ(q["points"].size(), 4U);
  for (const Json& point : q["points"]) {
    EXPECT_LT(point["q05"], point["q95"]);
    EXPECT_GT(point["mean"], 0);
    EXPECT_TRUE(point["measured"].is_null());
    EXPECT_GE(point["sd_discrepancy"].get<double>(), 0);
    EXPECT_LE(point["sd_discrepancy"], point["sd_model_error"]);
    EXPECT_TRUE(point["discrepancy_mean"].is_number());
    const double parts =
        std::hypot(point["sd_parameters"].get<double>(), point["sd_model_error"].get<double>());
    EXPECT_NEAR(point["sd"].get<double>(), parts, 1e-9 * parts);
  }
  EXPECT_NEAR(q["points"][3]["control"].get<double>(), 0.01, 1e-15);
  ASSERT_EQ(q["exceedance"].size(), 2U);
  // The fitted curve is one that 64 grains cannot follow; without model error it was above 0.9.
  EXPECT_GT(q["exceedance"][0]["probability"][3], 0.5);
  EXPECT_LT(q["exceedance"][1]["probability"][3], 0.01);
  EXPECT_LT(q["exceedance"][1]["anywhere"], 0.05);
  // Again: nothing is run, nothing changes; in words too.
  const auto evaluations = [this] {
    std::int64_t sum = 0;
    for (const Json& c : Call("list --state s --json").json()) {
      sum += c["model_evaluations"].get<std::int64_t>();
    }
    return sum;
  };
  const auto before = evaluations();
  EXPECT_EQ(Call(verb + " --json").out, first.out);
  EXPECT_NE(Call(verb).out.find("Probability to exceed"), std::string::npos);
  EXPECT_EQ(evaluations(), before);
}

// What the file states of a measurement that nobody has made is part of what is predicted of it.
TEST_F(Predicting, TheStatedErrorOfAnUnmeasuredTestCounts) {
  ASSERT_EQ(Call("run small.yaml --state s --workers 2 --json").code, 0) << Read("err");
  Write("noisy.yaml", R"(test: triaxial_drained
confining_pressure: 200 kPa
control: {column: axial_strain, to: 1 percent, readings: 4}
staging: {rate: 1 1/s, step: 0.005, damping: [0.3, 0.9], unbalanced: 5e-3}
observables: {q_over_p: {noise: {absolute: 10}}, volumetric_strain: {}}
)");
  const Answer answer = Call(
      "predict c1 --test noisy.yaml --draws 10 --exceed q_over_p=5 --state s --workers 2 --json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const Json json = answer.json();
  const Json& q = json["predictions"][0];
  EXPECT_EQ(q["experiment"], "predicted");
  for (const Json& point : q["points"]) {
    EXPECT_EQ(point["sd_noise"], 10);
    const double parts =
        std::hypot(point["sd_parameters"].get<double>(), point["sd_model_error"].get<double>());
    EXPECT_NEAR(point["sd"].get<double>(), std::hypot(parts, 10), 1e-9 * parts);
  }
  // Without the error 5 is out of reach; with it the level is less than half an error away.
  EXPECT_GT(q["exceedance"][0]["probability"][3], 0.3);
  EXPECT_LT(q["exceedance"][0]["probability"][3], 0.5);
  EXPECT_TRUE(json["predictions"][1]["points"][0]["sd_noise"].is_null());
}

// Runs that end where others do not are no fair sample of the posterior.
TEST_F(Predicting, NothingIsPredictedFromFewerThanHalfOfTheRuns) {
  Write("brittle.yaml", Rebounds(R"({contact: hertz_mindlin, density: 2500, effects: [brittle],
  fixed: {poisson_ratio: 0.2, brittle.c: 0.001 m/s},
  user_effects: {brittle: {scales: normal_force,
    formula: "closing_velocity > limit ? 1 + c / (closing_velocity - closing_velocity) : 1 + c / limit",
    parameters: {c: {null: 0, unit: m/s, prior: {prior: uniform, min: 0, max: 1}, steps: [0.1, 0.2]},
                 limit: {unit: m/s, default: 2}}}}})",
                                 "0.02", "{samples: 20, max_iterations: 1}"));
  const std::string faster = R"(test: collision
radius: 10 mm
impact_speed: 3 m/s
control: {column: impact_angle, to: 50 deg, readings: 3}
observables: [rebound_angle]
)";
  Write("faster.yaml", faster);
  Write("slower.yaml", std::string(faster).replace(faster.find("3 m/s"), 1, "1.5"));
  ASSERT_EQ(Call("run brittle.yaml --state s --workers 1 --json").code, 0) << Read("err");
  const std::string options = " --draws 10 --state s --workers 1 --json";
  EXPECT_EQ(Call("predict c1 --test slower.yaml" + options).code, 0) << Read("err");
  const Answer refused = Call("predict c1 --test faster.yaml" + options);
  EXPECT_EQ(refused.code, 1);
  EXPECT_TRUE(refused.out.empty()) << refused.out;
  EXPECT_NE(refused.err.find("0 of 10 runs"), std::string::npos) << refused.err;
  EXPECT_NE(refused.err.find("effect brittle"), std::string::npos) << refused.err;
}

TEST_F(Predicting, RefusesInASentence) {
  ASSERT_EQ(Call("run small.yaml --state s --workers 2 --json").code, 0) << Read("err");
  EXPECT_EQ(Call("predict c1 --test none.yaml --state s").code, 2);
  Write("nothing.yaml", "name: nothing\n");
  const Answer nothing = Call("predict c1 --test nothing.yaml --state s");
  EXPECT_EQ(nothing.code, 2);
  EXPECT_NE(nothing.err.find("neither the keys of one experiment"), std::string::npos) << nothing.err;
  Write("wrong.yaml",
        "name: a\ntest: triaxial_drained\ncontrol: {column: axial_strain, to: 1 percent}\n"
        "observables: [q_over_q]\n");
  const Answer wrong = Call("predict c1 --test wrong.yaml --state s");
  EXPECT_EQ(wrong.code, 2);
  EXPECT_NE(wrong.err.find("q_over_q"), std::string::npos) << wrong.err;
  EXPECT_NE(wrong.err.find("confining_pressure"), std::string::npos) << wrong.err;
  const Answer level = Call("predict c1 --test other.yaml --exceed q_over_p=inf --state s");
  EXPECT_EQ(level.code, 2);
  EXPECT_NE(level.err.find("the level is a finite number"), std::string::npos) << level.err;
  Write("unasked.yaml", "name: a\ntest: triaxial_drained\n");
  const Answer unasked = Call("predict c1 --test unasked.yaml --state s");
  EXPECT_EQ(unasked.code, 2);
  EXPECT_NE(unasked.err.find("unasked.yaml:1: observables is missing"), std::string::npos)
      << unasked.err;
  EXPECT_EQ(Call("list --state s --json").json().size(), 1U) << "nothing was submitted";
}

}  // namespace
}  // namespace calib::ctl
