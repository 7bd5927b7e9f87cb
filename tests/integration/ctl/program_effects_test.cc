// A user's code with effects that it can switch on: diagnose finds the one that made the
// measurement among its rivals, extend and improve add it, and the control is adequate.
#include <cmath>

#include "absl/strings/str_cat.h"
#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

// The code: a closed form of a drained test in two parameters and four effects. What chance makes
// of a specimen goes by the seed. An effect that is not named has no part, whatever its parameter.
constexpr char kCode[] = R"(import json, math, sys

def chance(number):
    return 2 * math.fmod(0.5 + 0.6180339887 * number, 1.0) - 1

def at(p, on, pressure, strain, seed):
    rolling = p["rolling.friction"] if "rolling" in on else 0
    bonds = p["bonds.strength"] if "bonds" in on else 0
    wear = p["wear.rate"] if "wear" in on else 0
    lock = p["locking.strength"] if "locking" in on else 0
    peak = 2.2 * p["friction"] + 1.2 * rolling ** 0.8 - 0.1 * pressure / 1e5
    q = peak * (1 - math.exp(-strain * p["modulus"] / (5e6 * (1 + pressure / 1e5)))) \
        * (1 - 0.5 * strain * (2 + 6 * rolling)) + 2 * bonds * math.exp(-100 * strain) \
        - 4 * wear * strain + 60 * lock * strain ** 2
    v = 0.12 * strain * math.exp(-100 * strain) + 0.02 * bonds * strain + 0.2 * wear * strain \
        - (0.35 * p["friction"] + 0.5 * rolling) * max(strain - 0.006, 0.0) - lock * strain ** 2
    q += (1 + q) * 0.2 * (p["step"] - 0.1)
    return (1 + q) * (1 + 0.005 * chance(seed) + 0.004 * chance(7 * seed) * math.sin(40 * strain)), \
        v + 0.006 * strain * chance(3 * seed)

def answer(request):
    for k, strain in enumerate(request["control"]["values"]):
        q, v = at(request["parameters"], request["effects"], request["settings"]["confining_pressure"],
                  strain, request["seed"])
        print(json.dumps({"run": request["run"], "load_step": k, "stress_ratio": q,
                          "volumetric_strain": v}), flush=True)

if __name__ == "__main__":
    for line in sys.stdin:
        request = json.loads(line)
        if "stop" in request:
            continue
        answer(request)
        print(json.dumps({"run": request["run"], "end": "complete"}), flush=True)
)";

class ProgramEffects : public CalibctlFixture {
 protected:
  static constexpr int kReadings = 16;
  static double Strain(int i) { return 0.002 + 0.058 * i / (kReadings - 1); }

  // What the code itself says of a specimen that is none of the model's, with errors.
  void Measure(const std::string& effects, const std::string& values) {
    Write("code.py", kCode);
    Write("measure.py", absl::StrCat(R"(import random
from code_as_module import at
random.seed(11)
for name, pressure in (("low", 1e5), ("high", 3e5)):
    with open(name + ".csv", "w") as table:
        print("axial_strain,stress_ratio,volumetric_strain", file=table)
        for k in range()",
                                     kReadings, R"():
            strain = 0.002 + 0.058 * k / )",
                                     kReadings - 1, R"(
            q, v = at({"modulus": 1e9, "friction": 0.5, "step": 0.1, )",
                                     values, R"(}, )", effects,
                                     R"(, pressure, strain, 1001)
            print(strain, q * (1 + random.gauss(0, 0.01)), v + random.gauss(0, 2e-4), sep=",", file=table)
)"));
    std::filesystem::copy_file(work_ / "code.py", work_ / "code_as_module.py",
                               std::filesystem::copy_options::overwrite_existing);
    ASSERT_EQ(
        std::system(("cd '" + work_.string() + "' && /usr/bin/python3 -B measure.py").c_str()), 0);
  }

  static std::string Campaign() {
    std::string text = R"(name: my code
model:
  command: [/usr/bin/python3, code.py]
  files: [code.py]
  persistent: true
  numerics: {step: {null: 0.1, sd: 0.05}}
  limits: {silence: 60 s}
  effects:
    rolling: {parameters: {friction: {null: 0, prior: {prior: uniform, min: 0, max: 0.5}}}}
    bonds: {parameters: {strength: {null: 0, prior: {prior: uniform, min: 0, max: 0.6}}}}
    wear: {parameters: {rate: {null: 0, prior: {prior: uniform, min: 0, max: 1}}}}
    locking: {parameters: {strength: {null: 0, prior: {prior: uniform, min: 0, max: 1}}}}
parameters:
  modulus: {prior: log_uniform, min: 0.3 GPa, max: 3.2 GPa}
  friction: {prior: uniform, min: 0.2, max: 0.8}
experiments:
)";
    for (const char* test : {"low", "high"}) {
      const bool is_low = test == std::string("low");
      absl::StrAppend(&text, "  - name: ", test, "\n    test: triaxial_drained\n    settings: ",
                      "{confining_pressure: ", is_low ? "0.1 MPa" : "0.3 MPa",
                      "}\n    realizations: 8\n    data: {file: ", test,
                      R"(.csv, strain: logarithmic}
    control: axial_strain
    observables:
      stress_ratio: {noise: {relative: 0.01}}
      volumetric_strain: {noise: {absolute: 2e-4}}
    role: )",
                      is_low ? "calibrate" : "validate", "\n");
    }
    return text +
           "inference: {method: iterative_bayesian_filter, samples: 80, max_iterations: 2}\n"
           "seed: 3\n";
  }
};

TEST_F(ProgramEffects, TheOneThatMadeTheMeasurementIsFoundAndAdded) {
  Measure("[\"rolling\"]", "\"rolling.friction\": 0.25");
  Write("model.yaml", Campaign());
  ASSERT_EQ(Call("run model.yaml --state s --workers 2 --json").code, 0) << Read("err");
  const Answer answer = Call("diagnose c1 --state s --workers 2 --json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const Json found = answer.json();
  ASSERT_FALSE(found["candidates"].empty()) << answer.out;
  EXPECT_EQ(found["candidates"][0]["effect"], "rolling") << answer.out;
  EXPECT_GT(found["candidates"][0]["probability"].get<double>(), 0.5);
  // What instruments do is calculated on the curves: the program knows nothing of it.
  bool instruments = false;
  for (const Json& one : found["candidates"]) {
    instruments = instruments || one["effect"] == "load_cell_error";
  }
  EXPECT_TRUE(instruments) << answer.out;
  // A step of one sd moves one of two observables by a hundredth, its noise.
  ASSERT_EQ(found["numerics"].size(), 1U) << answer.out;
  EXPECT_EQ(found["numerics"][0]["name"], "numerics.step");
  EXPECT_NEAR(found["numerics"][0]["tried"].get<double>(), 0.15, 1e-12);
  EXPECT_GT(found["numerics"][0]["rms"].get<double>(), 0.2);
  EXPECT_LT(found["numerics"][0]["rms"].get<double>(), 0.8);
  const Answer improved = Call("improve c1 --state s --workers 2 --json");
  ASSERT_EQ(improved.code, 0) << improved.err;
  const Json steps = improved.json()["steps"];
  ASSERT_GE(steps.size(), 2U) << improved.out;
  EXPECT_EQ(steps[1]["effects"], Json::array({"rolling"})) << improved.out;
  EXPECT_LT(steps[1]["heldout_rms_error"].get<double>(),
            0.5 * steps[0]["heldout_rms_error"].get<double>());
}

TEST_F(ProgramEffects, WhereNothingIsHiddenTheModelIsAdequate) {
  Measure("[]", "\"rolling.friction\": 0");
  Write("model.yaml", Campaign());
  ASSERT_EQ(Call("run model.yaml --state s --workers 2 --json").code, 0) << Read("err");
  const Answer answer = Call("diagnose c1 --state s --workers 2 --json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  EXPECT_EQ(answer.json()["verdict"], "adequate") << answer.out;
}

}  // namespace
}  // namespace calib::ctl
