// diagnose on collisions, which neither scatter nor have a packing, and the measurement that it
// proposes, made and told.
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

// Collisions do not scatter: a refit has to come within the noise by itself. A dashpot of 0.1,
// which the model does not know, measured to 1 %. A sphere that hits a wall: no packing, no
// scatter, milliseconds a run.
class Impacts : public CalibctlFixture {
 protected:
  // What is found from a measurement that an effect takes part in, of a model without it.
  Json Found(const std::string& effect, const std::string& strength, const std::string& readings,
             const std::string& control, const std::string& setting, int samples) {
    Measure(effect, strength, readings, control, setting, samples, "wall.csv");
    Write("model.yaml", Campaign("", "", control, setting, samples, "wall.csv"));
    EXPECT_EQ(Call("run model.yaml --state s --workers 2 --json").code, 0) << Read("err");
    const Answer answer = Call("diagnose c1 --state s --workers 2 --json");
    EXPECT_EQ(answer.code, 0) << answer.err;
    return answer.json();
  }

  std::string noise_ = "0.01";

  std::string Campaign(const std::string& effects, const std::string& fixed,
                       const std::string& control, const std::string& setting, int samples,
                       const std::string& file) const {
    return "name: impacts\nmodel: {contact: hertz_mindlin, effects: [" + effects +
           "], density: 2500 kg/m^3, fixed: {poisson_ratio: 0.25" + fixed + R"(}}
parameters:
  young_modulus: {prior: log_uniform, min: 0.02 GPa, max: 1 GPa}
  friction_coefficient: {prior: uniform, min: 0.05, max: 1}
experiments:
  - name: wall
    test: collision
    radius: 5 mm
    )" + setting +
           R"(
    data: {file: )" +
           file + R"(}
    control: )" +
           control + R"(
    observables:
      normal_restitution: {noise: {absolute: )" +
           noise_ + R"(}}
      tangential_restitution: {noise: {absolute: )" +
           noise_ + R"(}}
      contact_duration: {noise: {relative: )" +
           noise_ + R"(}}
inference: {method: iterative_bayesian_filter, max_iterations: 3, samples: )" +
           std::to_string(samples) + "}\nseed: 5\n";
  }

  // A file as an effect of this strength makes it.
  void Measure(const std::string& effect, const std::string& strength, const std::string& readings,
               const std::string& control, const std::string& setting, int samples,
               const std::string& file) {
    std::string table = control + ",normal_restitution,tangential_restitution,contact_duration\n";
    for (const std::string& at : std::vector<std::string>(absl::StrSplit(readings, ' '))) {
      table += at + ",1,1,1\n";
    }
    Write(file, table);
    Write("truth.yaml",
          Campaign(effect, ", " + effect + "." + strength, control, setting, samples, file));
    EXPECT_EQ(Call("simulate truth.yaml --set young_modulus='0.2 GPa' --set "
                   "friction_coefficient=0.3 -o " +
                   file)
                  .code,
              0)
        << Read("err");
  }

  // What a proposal measures where a dashpot acts.
  void MeasureProposal(const std::string& ratio, const Json& planned, const std::string& file) {
    std::string settings, readings;
    for (const auto& [name, value] : planned["settings"].items()) {
      if (name != "radius")
        settings += (settings.empty() ? "" : "\n    ") + name + ": " + value.dump();
    }
    for (const Json& at : planned["path"]) readings += (readings.empty() ? "" : " ") + at.dump();
    Measure("viscous_damping", "ratio: " + ratio, readings, planned["control"], settings, 24, file);
  }
};

// Alone or together with plasticity, whose refit then has not come to an end: with 24 runs a refit
// that hangs on last bits of the runs.
TEST_F(Impacts, ADashpotIsFound) {
  const Json json = Found("viscous_damping", "ratio: 0.1", "0 0.2 0.4 0.6 0.8 1 1.2",
                          "impact_angle", "impact_speed: 1 m/s", 24);
  EXPECT_TRUE(json["verdict"] == "missing_effect" || json["verdict"] == "ambiguous")
      << json["sentence"];
  ASSERT_FALSE(json["candidates"].empty());
  const Json& first = json["candidates"][0];
  ASSERT_EQ(first["effect"], "viscous_damping") << json["sentence"];
  EXPECT_NEAR(first["amplitude"]["viscous_damping.ratio"].get<double>(), 0.1, 0.01);
}

// A dashpot so weak, read so coarsely, that plastic contacts may stand for it.
TEST_F(Impacts, TheMeasurementThatIsProposedIsMadeAndTold) {
  noise_ = "0.03";
  const Json json = Found("viscous_damping", "ratio: 0.035", "0 0.2 0.4 0.6 0.8 1 1.2",
                          "impact_angle", "impact_speed: 1 m/s", 24);
  ASSERT_TRUE(json["next_experiment"].is_object()) << json["sentence"] << json["warnings"];

  // It goes into the campaign file as it is printed.
  const std::string snippet = json["next_experiment"]["snippet"];
  Write("pasted.yaml",
        absl::StrReplaceAll(Read("model.yaml"), {{"\ninference:", "\n" + snippet + "inference:"}}));
  const Answer unmeasured = Call("validate pasted.yaml");
  EXPECT_EQ(unmeasured.code, 2);
  EXPECT_NE(unmeasured.err.find("measurement_to_be_made.csv"), std::string::npos) << unmeasured.err;
  MeasureProposal("0.035", json["next_experiment"], "measurement_to_be_made.csv");
  const Answer pasted = Call("validate pasted.yaml");
  EXPECT_EQ(pasted.code, 0) << pasted.err << Read("pasted.yaml");
  Write("next.csv", Read("measurement_to_be_made.csv"));

  const std::string then = "diagnose c1 --state s --workers 2 --json --then ";
  const Answer told = Call(then + "next.csv");
  ASSERT_EQ(told.code, 0) << told.err;
  const Json both = told.json();
  EXPECT_EQ(both["then"]["file"], "next.csv");
  EXPECT_EQ(both["next_experiment"], nullptr);
  EXPECT_EQ(both["candidates"][0]["effect"], "viscous_damping") << both["sentence"];
  EXPECT_GT(both["candidates"][0]["probability"], 0.95) << both["sentence"];
  EXPECT_LE(both["credible_set"].size(), json["credible_set"].size()) << both["sentence"];
  const auto evaluations = Evaluations();
  EXPECT_EQ(Call(then + "next.csv").out, told.out) << "asked again";
  EXPECT_EQ(Evaluations(), evaluations);

  // Another measurement is none of the proposed test, and changes nothing.
  Write("short.csv", Read("wall.csv").substr(0, Read("wall.csv").find('\n', 120) + 1));
  const Answer other = Call(then + "short.csv");
  EXPECT_EQ(other.code, 2) << other.out;
  EXPECT_NE(other.err.find("short.csv is not the proposed test"), std::string::npos) << other.err;
  const Answer none = Call(then + "nowhere.csv");
  EXPECT_EQ(none.code, 2);
  EXPECT_NE(none.err.find("nowhere.csv: no such file"), std::string::npos) << none.err;
  const Answer many = Call(then + "next.csv --plan 99");
  EXPECT_EQ(many.code, 2);
  EXPECT_NE(many.err.find("--plan 99"), std::string::npos) << many.err;
  EXPECT_EQ(Evaluations(), evaluations);
}

using ImpactsSlow = Impacts;

// The catalogue's strengths are those at which grains of a specimen hold together; the slowest
// spheres would stick, and near that the runs are no polynomial: what is seen is that the model
// lacks something, not what.
TEST_F(ImpactsSlow, ThatSomethingLikeAdhesionIsMissingIsSeen) {
  const Json json =
      Found("adhesion_dmt", "work_of_adhesion: 3", "0.1 0.14 0.2 0.28 0.4 0.57 0.8 1.1 1.6",
            "impact_speed", "impact_angle: 30 deg", 40);
  for (const Json& effect : json["not_excitable"]) {
    EXPECT_NE(effect["effect"], "adhesion_dmt") << effect["reason"];
    EXPECT_NE(effect["effect"], "adhesion_jkr") << effect["reason"];
  }
  EXPECT_LT(json["adequacy"]["p_value"], 1e-4) << json["sentence"];
  EXPECT_NE(json["verdict"], "adequate") << json["sentence"];
  for (const Json& candidate : json["candidates"]) {
    EXPECT_TRUE(candidate["effect"] == "adhesion_dmt" || !candidate["alone"]) << candidate;
  }
}

}  // namespace
}  // namespace calib::ctl
