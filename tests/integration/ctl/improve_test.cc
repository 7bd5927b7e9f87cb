// What a user is told on the way to a hidden effect, on 64 grains.
#include <algorithm>
#include <random>
#include <sstream>
#include <vector>

#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

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
           R"(  young_modulus: {prior: log_uniform, min: 1e8, max: 2e9}
  friction_coefficient: {prior: uniform, min: 0.2, max: 0.8}
experiments:
  - name: tx
    test: triaxial_drained
    confining_pressure: 200 kPa
    packing: {generate: {particles: 64, porosity: 0.4, radii: {mean: 1 mm, spread: 0.2}, seed: 5}}
    data: {file: data.csv, strain: logarithmic}
    control: {column: axial_strain, noise: 1e-5}
    observables: {q_over_p: {noise: {absolute: )" +
           noise + R"(}}, volumetric_strain: {noise: {absolute: 0.0002}}}
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
    std::ostringstream path;
    path << "axial_strain,q_over_p,volumetric_strain\n";
    for (const double s : strains) path << s << ",0.5,0.001\n";
    Write("data.csv", path.str());
    Write("truth.yaml", Campaign("contact_plasticity", "0.02"));
    const Json states =
        Call(
            "simulate truth.yaml --set young_modulus=4e8 --set friction_coefficient=0.45 --set "
            "contact_plasticity.stiffness_ratio=3 --json")
            .json();
    std::mt19937 random(4);
    std::normal_distribution<double> normal;
    std::ostringstream file;
    file << "axial_strain,q_over_p,volumetric_strain\n";
    for (const Json& state : states["states"]) {
      file << state["axial_strain"].get<double>() << ','
           << state["q_over_p"].get<double>() + 0.02 * normal(random) << ','
           << state["volumetric_strain"].get<double>() + 0.0002 * normal(random) << '\n';
    }
    Write("data.csv", file.str());
  }
};

TEST_F(Improve, SaysThatNoiseIsStatedTooSmallAndWhatToTypeNext) {
  Measure();
  // Noise stated a tenth: said before anything runs.
  Write("small.yaml", Campaign("", "0.002"));
  const Json bold = Call("validate small.yaml --json").json();
  ASSERT_EQ(bold["warnings"].size(), 1U) << bold;
  EXPECT_NE(bold["warnings"][0].get<std::string>().find("stated too small"), std::string::npos);
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
  EXPECT_NE(watched.err.find("no worker is connected to 127.0.0.1:"), std::string::npos)
      << watched.err;
  const Answer run = CallWith("timeout -s INT 9", "run small.yaml --state s --workers 0");
  EXPECT_NE(run.err.find("no worker is connected to 127.0.0.1:"), std::string::npos) << run.err;
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
  EXPECT_GT(diagnosis["adequacy"]["p_value"], 0.999) << diagnosis;
  const auto said = [&diagnosis](const std::string& what) {
    return std::any_of(diagnosis["warnings"].begin(), diagnosis["warnings"].end(),
                       [&what](const Json& warning) {
                         return warning.get<std::string>().find(what) != std::string::npos;
                       });
  };
  EXPECT_TRUE(said("closer to the readings than the stated errors")) << diagnosis["warnings"];
  EXPECT_TRUE(said("stated too large")) << "by the curve alone: " << diagnosis["warnings"];
}

}  // namespace
}  // namespace calib::ctl
