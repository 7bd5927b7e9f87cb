// diagnose, extend and improve as a user meets them, on a calibration of 64 grains.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

namespace calib::ctl {
namespace {

using Json = nlohmann::json;

struct Answer {
  int code = -1;
  std::string out, err;
  Json json() const { return Json::parse(out, nullptr, false); }
};

class Diagnosis : public ::testing::Test {
 protected:
  Diagnosis() {
    std::string pattern =
        (std::filesystem::temp_directory_path() / "calib-diagnosis-XXXXXX").string();
    work_ = mkdtemp(pattern.data());
    std::ofstream(work_ / "data.csv") << "axial_strain,q_over_p,volumetric_strain\n0.002,0.5,0."
                                         "0008\n0.005,0.8,0.0012\n0.01,1.0,0.001\n";
    std::ofstream(work_ / "small.yaml") << R"(name: small
model: {contact: linear, density: 2650000 kg/m^3, fixed: {poisson_ratio: 0.3}}
parameters:
  young_modulus: {prior: log_uniform, min: 1e8 Pa, max: 1e9 Pa}
  friction_coefficient: {prior: uniform, min: 0.2, max: 0.8}
experiments:
  - name: tx
    test: triaxial_drained
    confining_pressure: 100 kPa
    packing: {generate: {particles: 64, porosity: 0.42, radii: {mean: 1 mm, spread: 0.2}, seed: 3}}
    data: {file: data.csv, strain: logarithmic}
    control: axial_strain
    staging: {rate: 1 1/s, step: 0.005, damping: [0.3, 0.9], unbalanced: 5e-3}
    observables: {q_over_p: {noise: {absolute: 0.3}}, volumetric_strain: {noise: {absolute: 0.002}}}
inference: {method: iterative_bayesian_filter, samples: 12, max_iterations: 1}
seed: 7
)";
  }
  ~Diagnosis() override { std::filesystem::remove_all(work_); }

  Answer Call(const std::string& arguments, const std::string& wrapper = "") const {
    const std::string command = "cd '" + work_.string() + "' && " + wrapper + " '" + CALIBCTL +
                                "' " + arguments + " >out 2>err </dev/null";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, Read("out"), Read("err")};
  }
  std::string Read(const char* name) const {
    std::ifstream file(work_ / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  // Evaluations made for all campaigns together.
  std::int64_t Evaluations() const {
    std::int64_t sum = 0;
    for (const Json& c : Call("list --state s --json").json()) {
      sum += c["model_evaluations"].get<std::int64_t>();
    }
    return sum;
  }

  std::filesystem::path work_;
};

TEST_F(Diagnosis, AnswersOnceKilledAndRepeatsNoRun) {
  ASSERT_EQ(Call("run small.yaml --state s --workers 2 --json").code, 0) << Read("err");
  Call("diagnose c1 --state s --workers 2 --json", "timeout -s KILL 0.7");
  const Answer first = Call("diagnose c1 --state s --workers 2 --json");
  ASSERT_EQ(first.code, 0) << first.err;
  const Json json = first.json();
  for (const char* field :
       {"campaign", "verdict", "effect", "candidates", "next_experiment", "model_evaluations"}) {
    EXPECT_TRUE(json.contains(field)) << field;
  }
  EXPECT_EQ(json["verdict"], "adequate") << first.out;
  EXPECT_TRUE(json["detectable"].is_object());
  ASSERT_FALSE(json["candidates"].empty());
  for (const char* field : {"effect", "p_value", "explained_fraction", "amplitude",
                            "predicted_rms_error", "confusable_with"}) {
    EXPECT_TRUE(json["candidates"][0].contains(field)) << field;
  }
  const auto evaluations = Evaluations();
  EXPECT_EQ(Call("diagnose c1 --state s --workers 2 --json").out, first.out);
  EXPECT_EQ(Evaluations(), evaluations);

  const Json improved = Call("improve c1 --state s --workers 2 --json").json();
  ASSERT_EQ(improved["steps"].size(), 1U) << improved;
  EXPECT_EQ(improved["steps"][0]["campaign"], "c1");
  EXPECT_EQ(improved["verdict"], "adequate");
  EXPECT_EQ(improved["final_campaign"], "c1");
  EXPECT_EQ(Evaluations(), evaluations);
}

TEST_F(Diagnosis, ExtendsAndRefusesInASentence) {
  ASSERT_EQ(Call("run small.yaml --state s --workers 2 --json").code, 0) << Read("err");
  const Answer unknown = Call("extend c1 --effect magic --state s");
  EXPECT_EQ(unknown.code, 2);
  EXPECT_NE(unknown.err.find("there is no effect magic"), std::string::npos) << unknown.err;
  EXPECT_NE(Call("diagnose c9 --state s").code, 0);
  const Answer extended =
      Call("extend c1 --effect rolling_resistance --state s --workers 2 --json");
  ASSERT_EQ(extended.code, 0) << extended.err;
  EXPECT_EQ(extended.json()["campaign"], "c2");
  EXPECT_EQ(extended.json()["parameters"].size(), 4U);
  const Answer again = Call("extend c1 --effect rolling_resistance --state s --json");
  EXPECT_EQ(again.out, extended.out);
  const Answer twice = Call("extend c2 --effect rolling_resistance --state s");
  EXPECT_NE(twice.code, 0);
}

}  // namespace
}  // namespace calib::ctl
