// The reduced size of deploy/bench/hidden-effects: a hidden effect is named, added and the error
// falls on data that took no part; where nothing is hidden nothing is found.
#include <cmath>
#include <map>
#include <random>
#include <sstream>
#include <vector>

#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

class HiddenEffectSlow : public CalibctlFixture {
 protected:
  HiddenEffectSlow() {
    for (const char* file : {"campaign.yaml", "tx100.csv", "tx200.csv", "tx400.csv"}) {
      std::filesystem::copy_file(std::filesystem::path(CALIB_HIDDEN_EFFECT) / file, work_ / file);
    }
  }
  static std::string With(std::string text, const std::string& old, const std::string& now) {
    std::size_t changed = 0;
    for (std::size_t at = text.find(old); at != std::string::npos;
         at = text.find(old, at + now.size())) {
      text.replace(at, old.size(), now);
      ++changed;
    }
    EXPECT_GT(changed, 0U) << old;
    return text;
  }
};

std::vector<std::string> Split(const std::string& line) {
  std::vector<std::string> parts;
  std::istringstream stream(line);
  for (std::string part; std::getline(stream, part, ',');) parts.push_back(part);
  return parts;
}

// The shipped example. What was hidden: make_measurements beside it.
TEST_F(HiddenEffectSlow, IsNamedAddedAndTheErrorFallsOnHeldOutData) {
  const Answer run = Call("run campaign.yaml --state s --workers 2 --json");
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_EQ(run.json()["posterior_from"], "none") << "no run is where an emulator would put it";
  const Answer diagnosis = Call("diagnose c1 --state s --workers 2 --json");
  ASSERT_EQ(diagnosis.code, 0) << diagnosis.err;
  EXPECT_EQ(diagnosis.json()["verdict"], "missing_effect") << diagnosis.out;
  EXPECT_EQ(diagnosis.json()["effect"], "contact_plasticity");
  EXPECT_LE(diagnosis.json()["model_evaluations"], 160 * 2) << "160 runs of two fitted tests";

  EXPECT_EQ(diagnosis.json()["next_experiment"], nullptr) << "nothing is left to tell apart";

  const Answer improved = Call("improve c1 --state s --workers 2 --json");
  ASSERT_EQ(improved.code, 0) << improved.err;
  const Json steps = improved.json()["steps"];
  ASSERT_EQ(steps.size(), 2U) << improved.out;
  EXPECT_EQ(steps[1]["verdict"], "adequate");
  EXPECT_LT(steps[1]["rms_error"].get<double>(), 0.5 * steps[0]["rms_error"].get<double>());
  EXPECT_GT(steps[0]["heldout_rms_error"].get<double>(), 3);
  // By how much runs of one packing wander is not in the errors: a little above 1.3 is chance.
  EXPECT_LE(steps[1]["heldout_rms_error"].get<double>(), 1.6);
  const std::string final_campaign = improved.json()["final_campaign"];
  EXPECT_LE(improved.json()["model_evaluations"], 220 * 2) << "220 runs of two fitted tests";
  // The base has no posterior: its diagnosis has evidences of both models.
  const Answer models = Call("models c1 " + final_campaign + " --state s --json");
  ASSERT_EQ(models.code, 0) << models.err;
  EXPECT_EQ(models.json()["evidence_from"], "diagnosis");
  EXPECT_EQ(models.json()["models"][0]["campaign"], final_campaign);
  // improve has asked of its last model whether it is adequate: nothing is run again.
  const std::size_t campaigns = Call("list --state s --json").json().size();
  const Answer again = Call("diagnose " + final_campaign + " --gate --state s --json");
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_EQ(again.json()["verdict"], "adequate");
  EXPECT_EQ(Call("list --state s --json").json().size(), campaigns);
  const Json posterior = Call("posterior " + final_campaign + " --state s --json").json();
  const std::map<std::string, double> truth = {{"young_modulus", 0.9e9},
                                               {"friction_coefficient", 0.35},
                                               {"contact_plasticity.stiffness_ratio", 3}};
  for (const auto& [name, value] : truth) {
    const Json& parameter = posterior["parameters"][name];
    // Of one case; how often intervals hold the truth is what deploy/bench/coverage is for.
    EXPECT_NEAR(parameter["mean"].get<double>(), value, 3 * parameter["sd"].get<double>()) << name;
    EXPECT_LT(parameter["sd"].get<double>(), 0.1 * value) << name;
  }
}

// A measurement of the model itself on another packing of another number of grains. Eight packings:
// four know their scatter to 40 % only, and controls fail with them
// (deploy/bench/hidden-effects.d).
TEST_F(HiddenEffectSlow, IsNotFoundWhereNothingIsHidden) {
  const std::string campaign = Read("campaign.yaml");
  Write("other.yaml",
        With(With(campaign, "particles: 200", "particles: 230"), "seed: 1}", "seed: 91}"));
  const Answer simulated = Call(
      "simulate other.yaml --set young_modulus=8e8 --set friction_coefficient=0.4 -o states.csv");
  ASSERT_EQ(simulated.code, 0) << simulated.err;
  std::istringstream states(Read("states.csv"));
  std::string line;
  std::getline(states, line);
  std::map<std::string, std::size_t> column;
  for (const std::string& name : Split(line)) column.emplace(name, column.size());
  std::map<std::string, std::ostringstream> files;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  while (std::getline(states, line)) {
    const std::vector<std::string> cells = Split(line);
    const auto number = [&](const char* name) { return std::stod(cells.at(column.at(name))); };
    std::ostringstream& file = files[cells.at(column.at("experiment"))];
    if (file.tellp() == 0) file << "axial_strain,volumetric_strain,stress_ratio\n";
    const double ratio = number("stress_ratio");
    file << 100 * number("axial_strain") << ','
         << 100 * number("volumetric_strain") + 0.06 * normal(random) << ','
         << ratio + std::hypot(0.015 * ratio, 0.015) * normal(random) << '\n';
  }
  ASSERT_EQ(files.size(), 3U);
  for (const auto& [name, file] : files) Write(name + ".csv", file.str());
  Write("campaign.yaml", With(campaign, "    staging:", "    realizations: 8\n    staging:"));
  const Answer run = Call("run campaign.yaml --state s --workers 2 --json");
  ASSERT_EQ(run.code, 0) << run.err;
  const Answer diagnosis = Call("diagnose c1 --state s --gate --json");
  ASSERT_EQ(diagnosis.code, 0) << diagnosis.err;
  EXPECT_EQ(diagnosis.json()["verdict"], "adequate") << diagnosis.out;
  EXPECT_EQ(diagnosis.json()["adequacy"]["packings"], 8);
}

}  // namespace
}  // namespace calib::ctl
