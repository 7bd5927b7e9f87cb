// A user's code whose effects the measurement cannot tell apart: diagnose proposes the test of
// model.next that can, and knows the effect once that has been measured.
#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

// Creep and heat are one and the same at 300 K. The code knows its tests by their settings; what
// chance makes of a specimen goes by the seed.
constexpr char kProposingCode[] = R"(import json, math, sys

def at(p, on, test, kelvin, pull, seed):
    creep = p["creep.strength"] if "creep" in on else 0
    heat = p["heat.strength"] if "heat" in on else 0
    chance = 2 * math.fmod(0.5 + 0.6180339887 * seed, 1.0) - 1
    force = p["stiffness"] * pull + p["friction"] * math.sqrt(pull)
    return (force + (creep + heat * (kelvin / 300) ** 3) * pull ** 3) * (1 + 0.004 * chance)

if __name__ == "__main__":
    for line in sys.stdin:
        request = json.loads(line)
        if "stop" in request:
            continue
        if request["experiment"] not in ("cold", "hot", "warm"):
            sys.exit("no test is called " + request["experiment"])
        for k, pull in enumerate(request["control"]["values"]):
            force = at(request["parameters"], request["effects"], request["experiment"],
                       request["settings"]["temperature"], pull, request["seed"])
            print(json.dumps({"run": request["run"], "load_step": k, "force": force}), flush=True)
        print(json.dumps({"run": request["run"], "end": "complete"}), flush=True)
)";

constexpr char kMeasure[] = R"(import random
from code_as_module import at
random.seed(5)
for name, kelvin in (("cold", 300), ("hot", 600)):
    with open(name + ".csv", "w") as table:
        print("pull,force", file=table)
        for k in range(16):
            pull = 0.1 + 0.9 * k / 15
            p = {"stiffness": 2.0, "friction": 1.0, "heat.strength": 0.4}
            force = at(p, ["heat"], name, kelvin, pull, 1001)
            print(pull, force * (1 + random.gauss(0, 0.01)), sep=",", file=table)
)";

constexpr char kCampaign[] = R"(name: pull
model:
  command: [/usr/bin/python3, code.py]
  files: [code.py]
  persistent: true
  limits: {silence: 60 s}
  effects:
    creep: {parameters: {strength: {null: 0, prior: {prior: uniform, min: 0, max: 3}}}}
    heat: {parameters: {strength: {null: 0, prior: {prior: uniform, min: 0, max: 3}}}}
  next:
    - {name: warm, settings: {temperature: 301, note: as before}, control: pull,
       values: [0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1]}
    - {name: hot, settings: {temperature: 600, note: as before}, control: pull,
       values: [0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1]}
parameters:
  stiffness: {prior: uniform, min: 1, max: 4}
  friction: {prior: uniform, min: 0.3, max: 3}
experiments:
  - name: cold
    settings: {temperature: 300, note: as before}
    realizations: 16
    data: {file: cold.csv}
    control: pull
    observables: {force: {noise: {relative: 0.01}}}
inference: {method: iterative_bayesian_filter, samples: 80, max_iterations: 2}
seed: 3
)";

class ProgramNext : public CalibctlFixture {};

TEST_F(ProgramNext, TheTestThatTellsEffectsApartIsProposedAndDoes) {
  Write("code.py", kProposingCode);
  Write("code_as_module.py", kProposingCode);
  Write("measure.py", kMeasure);
  ASSERT_EQ(std::system(("cd '" + work_.string() + "' && /usr/bin/python3 -B measure.py").c_str()),
            0);
  Write("model.yaml", kCampaign);
  ASSERT_EQ(Call("run model.yaml --state s --workers 2 --json").code, 0) << Read("err");
  const Answer answer = Call("diagnose c1 --state s --workers 2 --json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const Json found = answer.json();
  EXPECT_EQ(found["verdict"], "ambiguous") << answer.out;
  const Json next = found["next_experiment"];
  ASSERT_TRUE(next.is_object()) << answer.out;
  EXPECT_EQ(next["test"], "hot") << answer.out;
  EXPECT_EQ(next["settings"], Json::parse(R"({"temperature": 600, "note": "as before"})"));
  EXPECT_GT(next["expected_power"].get<double>(), 0.7) << answer.out;
  EXPECT_GE(next["separates"].size(), 2U) << answer.out;
  EXPECT_GT(next["model_evaluations"].get<int>(), 40);
  // The others that were weighed: a test that changes nothing, and the same on another specimen.
  ASSERT_EQ(next["considered"].size(), 3U) << answer.out;
  for (const Json& other : next["considered"]) {
    if (other["test"] == "hot") continue;
    EXPECT_LT(other["expected_power"].get<double>(), next["expected_power"].get<double>());
  }
  const Answer then = Call("diagnose c1 --then hot.csv --state s --workers 2 --json");
  ASSERT_EQ(then.code, 0) << then.err;
  EXPECT_EQ(then.json()["probabilities"][0]["effects"], Json({"heat"})) << then.out;
  EXPECT_GT(then.json()["probabilities"][0]["probability"].get<double>(), 0.95) << then.out;
  // A file that does not go the way that was proposed is none of this test.
  Write("short.csv", "pull,force\n0.1,1\n0.2,2\n");
  EXPECT_NE(Call("diagnose c1 --then short.csv --state s --workers 2 --json").code, 0);
}

}  // namespace
}  // namespace calib::ctl
