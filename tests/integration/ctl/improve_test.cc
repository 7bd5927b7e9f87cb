// What a user is told on the way to a hidden effect, on 64 grains.
#include <algorithm>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

// What is calibrated on which test, up to the observables.
const std::string kSpecimen = R"(  young_modulus: {prior: log_uniform, min: 1e8, max: 2e9}
  friction_coefficient: {prior: uniform, min: 0.2, max: 0.8}
experiments:
  - name: tx
    test: triaxial_drained
    confining_pressure: 200 kPa
    packing: {generate: {particles: 64, porosity: 0.4, radii: {mean: 1 mm, spread: 0.2}, seed: 5}}
    data: {file: data.csv, strain: logarithmic}
    control: {column: axial_strain, noise: 1e-5}
)";

class Improve : public CalibctlFixture {
 protected:
  static std::string Campaign(const std::string& effects, const std::string& noise) {
    return R"(name: small
model:
  contact: hertz_mindlin
  effects: [)" +
           effects + R"(]
  density: 2650000 kg/m^3
  fixed: {poisson_ratio: 0.3}
parameters:
)" + (effects.empty() ? "" : "  contact_plasticity.stiffness_ratio: default\n") +
           kSpecimen + R"(    observables: {q_over_p: {noise: {absolute: )" + noise +
           R"(}}, volumetric_strain: {noise: {absolute: 0.0002}}}
noise: given
inference: {method: iterative_bayesian_filter, samples: 24, max_iterations: 2}
seed: 3
)";
  }

  // 28 readings of a specimen with contact plasticity, one unloading; sd of q_over_p 0.02.
  void Measure() const {
    std::vector<double> strains;
    for (int k = 1; k <= 10; ++k) strains.push_back(0.001 * k);
    for (const double s : {0.009, 0.008, 0.007, 0.006, 0.007, 0.008, 0.009, 0.01}) {
      strains.push_back(s);
    }
    for (int k = 1; k <= 10; ++k) strains.push_back(0.01 + 0.0015 * k);
    Write("data.csv", UnmeasuredReadings(strains));
    Write("truth.yaml", Campaign("contact_plasticity", "0.02"));
    const Json states =
        Call(
            "simulate truth.yaml --set young_modulus=4e8 --set friction_coefficient=0.45 --set "
            "contact_plasticity.stiffness_ratio=3 --json")
            .json();
    Write("data.csv", MeasuredReadings(states["states"], "tx"));
  }
};

TEST_F(Improve, SaysThatNoiseIsStatedTooSmallAndWhatToTypeNext) {
  Measure();
  // Noise stated a tenth: said before anything runs.
  Write("small.yaml", Campaign("", "0.002"));
  const Json bold = Call("validate small.yaml --json").json();
  ASSERT_EQ(bold["warnings"].size(), 1U) << bold;
  EXPECT_NE(bold["warnings"][0]["message"].get<std::string>().find("stated too small"),
            std::string::npos);
  EXPECT_NE(Call("validate small.yaml").out.find("! tx, q_over_p: the readings scatter"),
            std::string::npos)
      << Read("out");
  Write("small.yaml", Campaign("", "0.02"));
  EXPECT_TRUE(Call("validate small.yaml --json").json()["warnings"].empty()) << Read("out");

  ASSERT_EQ(Call("run small.yaml --state s --workers 2 --json").code, 0) << Read("err");
  const Answer compared = Call("compare c1 --state s");
  EXPECT_NE(compared.out.find("Next: calibctl diagnose c1 --state s"), std::string::npos)
      << compared.out;
  EXPECT_NE(compared.out.find("Error of the fitted data: "), std::string::npos) << compared.out;
}

TEST_F(Improve, AWaitWithoutWorkersSaysSo) {
  Measure();
  Write("small.yaml", Campaign("", "0.02"));
  ASSERT_EQ(Call("submit small.yaml --state s").code, 0) << Read("err");
  const Answer watched = CallWith("timeout 3", "watch c1 --state s");
  EXPECT_NE(watched.err.find("no worker is connected to unix:"), std::string::npos) << watched.err;
  const Answer run = CallWith("timeout -s INT 9", "run small.yaml --state s --workers 0");
  EXPECT_NE(run.err.find("no worker is connected to unix:"), std::string::npos) << run.err;
}

// The model itself, noise stated as large as the curve.
TEST_F(Improve, AFitThatIsTooGoodIsSaid) {
  Measure();
  Write("truth.yaml", Campaign("", "0.02"));
  const Json states =
      Call("simulate truth.yaml --set young_modulus=4e8 --set friction_coefficient=0.45 --json")
          .json();
  std::ostringstream file;
  file << "axial_strain,q_over_p,volumetric_strain\n";
  for (const Json& state : states["states"]) {
    file << state["axial_strain"].get<double>() << ',' << state["q_over_p"].get<double>() << ','
         << state["volumetric_strain"].get<double>() << '\n';
  }
  Write("data.csv", file.str());
  std::string campaign = Campaign("", "0.3");
  campaign.replace(campaign.find("0.0002"), 6, "0.0100");
  Write("small.yaml", campaign);
  ASSERT_EQ(Call("run small.yaml --state s --workers 2 --json").code, 0) << Read("err");
  const Json diagnosis = Call("diagnose c1 --state s --workers 2 --json").json();
  EXPECT_EQ(diagnosis["verdict"], "adequate") << diagnosis;
  EXPECT_GT(diagnosis["adequacy"]["p_chi2"], 0.999) << diagnosis;
  const auto said = [&diagnosis](const std::string& what) {
    return std::any_of(diagnosis["warnings"].begin(), diagnosis["warnings"].end(),
                       [&what](const Json& warning) {
                         return warning.get<std::string>().find(what) != std::string::npos;
                       });
  };
  EXPECT_TRUE(said("closer to the readings than the stated errors")) << diagnosis["warnings"];
  EXPECT_TRUE(said("stated too large")) << "by the curve alone: " << diagnosis["warnings"];
}

// Formulas alone take part: nothing of the build.
class Formulas : public CalibctlFixture {
 protected:
  // data.csv: 20 readings of the model `truth` with the hidden values `set`.
  void Measure(const std::string& truth, const std::string& set) const {
    std::vector<double> strains;
    for (int k = 1; k <= 20; ++k) strains.push_back(0.002 * k);
    Write("data.csv", UnmeasuredReadings(strains));
    Write("truth.yaml", truth);
    const std::string simulate =
        "simulate truth.yaml --set young_modulus=4e8 --set friction_coefficient=0.5 " + set;
    const Json states = Call(simulate + " --json").json()["states"];
    Write("data.csv", MeasuredReadings(states, "tx"));
  }

  std::string WithoutTheBuild() const {
    std::string without;
    for (const Json& effect : Call("effects --json").json()) {
      without += " --without " + effect["name"].get<std::string>();
    }
    return without;
  }
};

// Two things hidden in the volume of 64 grains, `first` and `second`, and a third that is much like
// both together.
class TwoOfThreeSlow : public Formulas {
 protected:
  static std::string Campaign(const std::string& effects, const std::string& parameters) {
    std::string formulas;
    for (const auto& [name, formula] :
         {std::pair("first", "sin(2 * pi * axial_strain / 0.04)"),
          std::pair("second", "sin(3 * pi * axial_strain / 0.04)"),
          std::pair("both",
                    "(sin(2 * pi * axial_strain / 0.04) / 2 + sin(3 * pi * axial_strain / 0.04) + "
                    "sin(4 * pi * axial_strain / 0.04) / 2)")}) {
      formulas += std::string("    ") + name + ": {adds: volumetric_strain, formula: \"a * " +
                  formula +
                  "\", parameters: {a: {null: 0, prior: {prior: uniform, min: -0.01, max: "
                  "0.01}}}}\n";
    }
    return "name: two of three\nmodel:\n  contact: hertz_mindlin\n  effects: [" + effects +
           "]\n  density: 2650000 kg/m^3\n  fixed: {poisson_ratio: 0.3}\n  user_effects:\n" +
           formulas + "parameters:\n" + parameters + kSpecimen +
           R"(    observables: {q_over_p: {noise: {absolute: 0.02}}, volumetric_strain: {noise: {absolute: 0.0002}}}
noise: given
inference: {method: iterative_bayesian_filter, samples: 24, max_iterations: 3}
seed: 3
)";
  }
};

TEST_F(TwoOfThreeSlow, AreFoundTogether) {
  Measure(Campaign("first, second", "  first.a: default\n  second.a: default\n"),
          "--set first.a=0.0015 --set second.a=0.0015");
  Write("base.yaml", Campaign("", ""));
  ASSERT_EQ(Call("run base.yaml --state s --workers 2 --json").code, 0) << Read("err");
  const std::string without = WithoutTheBuild();
  const Answer wrong = Call("improve c1 --state s --workers 2 --without frction");
  EXPECT_EQ(wrong.code, 2) << wrong.err;
  EXPECT_NE(wrong.err.find("there is no effect frction to leave out"), std::string::npos)
      << wrong.err;

  const Answer improved = Call("improve c1 --state s --workers 2 --max-effects 2 --json" + without);
  ASSERT_EQ(improved.code, 0) << improved.err;
  const Json steps = improved.json()["steps"];
  std::vector<std::string> effects = steps.back()["effects"];
  std::sort(effects.begin(), effects.end());
  EXPECT_EQ(effects, (std::vector<std::string>{"first", "second"})) << improved.out;
  EXPECT_EQ(steps.back()["verdict"], "adequate") << improved.out;
  EXPECT_LT(steps.back()["rms_error"].get<double>(), 1.3) << improved.out;
}

// A wave in the volume of 64 grains of unknown number, and another of a fixed one nearby.
class AWaveSlow : public Formulas {
 protected:
  static std::string Campaign(const std::string& effects, const std::string& parameters) {
    return "name: a wave\nmodel:\n  contact: hertz_mindlin\n  effects: [" + effects +
           R"yaml(]
  density: 2650000 kg/m^3
  fixed: {poisson_ratio: 0.3}
  user_effects:
    near:
      adds: volumetric_strain
      formula: "a * sin(2.9 * pi * axial_strain / 0.04)"
      parameters: {a: {null: 0, prior: {prior: uniform, min: -0.01, max: 0.01}}}
    wave:
      adds: volumetric_strain
      formula: "a * sin(2 * pi * k * axial_strain / 0.04)"
      parameters:
        a: {null: 0, prior: {prior: uniform, min: -0.01, max: 0.01}}
        k: {prior: {prior: uniform, min: 0.5, max: 14}}
parameters:
)yaml" + parameters +
           kSpecimen +
           R"yaml(    observables:
      q_over_p: {noise: {absolute: 0.02}}
      volumetric_strain: {noise: {absolute: 0.0002}}
noise: given
inference: {method: iterative_bayesian_filter, samples: 24, max_iterations: 3}
seed: 3
)yaml";
  }
};

TEST_F(AWaveSlow, IsFoundWithItsNumber) {
  Measure(Campaign("wave", "  wave.a: default\n  wave.k: default\n"),
          "--set wave.a=0.0015 --set wave.k=1.6");
  Write("base.yaml", Campaign("", ""));
  ASSERT_EQ(Call("run base.yaml --state s --workers 2 --json").code, 0) << Read("err");
  const Answer improved =
      Call("improve c1 --state s --workers 2 --max-effects 1 --json" + WithoutTheBuild());
  ASSERT_EQ(improved.code, 0) << improved.err;
  const Json steps = improved.json()["steps"];
  EXPECT_EQ(steps.back()["effects"], Json({"wave"})) << improved.out;
  EXPECT_EQ(steps.back()["verdict"], "adequate") << improved.out;
  EXPECT_LT(steps.back()["rms_error"].get<double>(), 1.3) << improved.out;
}

}  // namespace
}  // namespace calib::ctl
