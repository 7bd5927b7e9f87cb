// calibctl sensitivity on runs made elsewhere, whose Sobol indices have a closed form.
#include <gmock/gmock.h>

#include <cmath>

#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

using ::testing::HasSubstr;

class Sensitivity : public CalibctlFixture {
 protected:
  /// Three parameters, uniform on [0, 1], and runs on a Kronecker sequence [Roberts 2018] whose
  /// last mean_stress is 2 a + b + 2 (a - 1/2) (c - 1/2): of its variance of 16/36 a has 12, b 3,
  /// and a with c 1 of 16 parts.
  void WriteEnsemble(int runs) const {
    std::string parameters = "sample,a,b,c\n";
    std::string states = "sample,step,p\n";
    const double g = 1.2207440846057596;  // g^4 = g + 1
    for (int i = 0; i < runs; ++i) {
      const auto share = [&](double power) { return std::fmod(0.5 + (i + 1) / power, 1.0); };
      const double a = share(g);
      const double b = share(g * g);
      const double c = share(g * g * g);
      const double y = 2 * a + b + 2 * (a - 0.5) * (c - 0.5);
      parameters += std::to_string(i) + "," + Text(a) + "," + Text(b) + "," + Text(c) + "\n";
      states += std::to_string(i) + ",0," + Text(1 + a) + "\n";
      states += std::to_string(i) + ",1," + Text(3 + y) + "\n";
    }
    Write("parameters.csv", parameters);
    Write("states.csv", states);
    Write("readings.csv", "axial_strain,mean_stress\n0.01,1.5\n0.02,4.5\n");
    Write("ensemble.yaml", R"(name: ensemble
model:
  precomputed: {parameters: parameters.csv, states: states.csv, state_columns: {mean_stress: p}}
parameters:
  a: {prior: uniform, min: 0, max: 1}
  b: {prior: uniform, min: 0, max: 1}
  c: {prior: uniform, min: 0, max: 1}
experiments:
  - name: oedo
    test: oedometric
    confining_pressure: 1 Pa
    data: {file: readings.csv, strain: logarithmic}
    control: axial_strain
    observables: {mean_stress: {noise: {absolute: 1}}}
inference: {method: sqmc}
seed: 3
)");
  }

  static std::string Text(double value) { return Json(value).dump(); }

  static Json Find(const Json& answer, const std::string& quantity) {
    for (const Json& q : answer["quantities"]) {
      if (q["quantity"] == quantity) return q;
    }
    return {};
  }
};

TEST_F(Sensitivity, FindsSobolIndicesInClosedForm) {
  WriteEnsemble(200);
  const Answer run = Call("run ensemble.yaml --state s");
  ASSERT_EQ(run.code, 0) << run.err;
  const Answer answer = Call("sensitivity c1 --state s --json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const Json json = answer.json();
  EXPECT_EQ(json["parameters"], Json({"a", "b", "c"}));
  EXPECT_EQ(json["independent"], true);
  const Json last = Find(json, "final_mean_stress");
  ASSERT_FALSE(last.is_null()) << answer.out;
  EXPECT_EQ(last["runs"], 200);
  EXPECT_EQ(last["unit"], "Pa");
  EXPECT_GT(last["explained"], 0.99);
  EXPECT_NEAR(last["prior"]["mean"], 4.5, 0.05);
  EXPECT_NEAR(last["prior"]["sd"], std::sqrt(16.0 / 36), 0.05);
  const struct {
    const char *kind, *parameter;
    double index;
  } known[] = {{"first_order", "a", 12.0 / 16}, {"first_order", "b", 3.0 / 16},
               {"first_order", "c", 0},         {"total", "a", 13.0 / 16},
               {"total", "b", 3.0 / 16},        {"total", "c", 1.0 / 16}};
  for (const auto& one : known) {
    const Json& found = last[one.kind][one.parameter];
    // Its own standard error, and what an emulator of 200 runs may miss (found: 4e-4).
    EXPECT_NEAR(found["index"], one.index, 5 * found["error"].get<double>() + 2e-3)
        << one.kind << " " << one.parameter;
    EXPECT_LT(found["error"], 5e-3);
  }
  // Of an output that grows with `a` alone the rank correlation is that of a linear function.
  EXPECT_GT(last["prior"]["correlation"]["a"]["rank"], 0.8);
  EXPECT_NEAR(last["prior"]["correlation"]["c"]["rank"], 0, 0.15);

  const Answer text = Call("sensitivity c1 --state s");
  EXPECT_EQ(text.code, 0) << text.err;
  EXPECT_THAT(text.out, HasSubstr("oedo"));
  EXPECT_EQ(Call("sensitivity c1 --state s --json").out, answer.out) << "the same bits again";
}

TEST_F(Sensitivity, SaysWhatIsWrongInASentence) {
  WriteEnsemble(3);
  ASSERT_NE(Call("run ensemble.yaml --state s").code, 2);
  const Answer few = Call("sensitivity c1 --state s");
  EXPECT_EQ(few.code, 1) << few.out;
  EXPECT_THAT(few.err, HasSubstr("runs"));
  const Answer unknown = Call("sensitivity c9 --state s");
  EXPECT_EQ(unknown.code, 1);
  EXPECT_THAT(unknown.err, HasSubstr("c9"));
  EXPECT_EQ(Call("sensitivity --state s").code, 2);
  EXPECT_EQ(Call("sensitivity c1 --state s --iteration 2").code, 2);
  EXPECT_EQ(Call("sensitivity c1 --server 127.0.0.1:1").code, 3);
}

}  // namespace
}  // namespace calib::ctl
