#include "tests/unit/campaign/good_campaign.h"

#include <cstdio>
#include <cstdlib>

#include "server/methods/registry.h"

namespace calib::campaign::testing {

namespace {

std::string TwentyGrains() {
  std::string text = "##PERIODIC:: 0.01 0.01 0.02\n";
  for (int i = 0; i < 20; ++i) {
    text += "0.00" + std::to_string(i % 5 + 1) + " 0.00" + std::to_string(i / 5 + 1) +
            " 0.001 0.0005 -1\n";
  }
  return text;
}

}  // namespace

std::map<std::string, std::string> GoodFiles() {
  return {{"data.txt",
           "# a drained triaxial test\n"
           "#\t\te_v\t\te_z\t\tratio\t\tsd\n"
           "0.0\t0.0\t1.0\t0.01\t\t\n"
           "0.12\t0.4\t2.1\t0.02\n"
           "0.20\t0.8\t3.0\t0.03\t\n"
           "-0.4\t3.0\t4.1\t0.04\n"
           "-1.9\t6.0\t3.7\t0.05\n"
           "-2.9\t12.0\t3.4\t0.06\n"
           "\n"},
          {"validation.csv", "axial_strain,q_over_p\n0.01,0.8\n0.02,1.0\n0.05,1.1\n"},
          {"packing.txt", TwentyGrains()}};
}

std::string GoodYaml() {
  return R"(name: sand
model:
  contact: hertz_mindlin
  effects: [rolling_resistance]
  density: 2650 kg/m^3
  fixed: {poisson_ratio: 0.2}
parameters:
  young_modulus: {prior: log_uniform, min: 1e8 Pa, max: 1e11 Pa}
  friction_angle: {prior: uniform, min: 10 deg, max: 45 deg}
  rolling_resistance.stiffness: {prior: uniform, min: 0, max: 1}
  rolling_resistance.friction: {prior: uniform, min: 0, max: 1}
experiments:
  - name: tx02
    test: triaxial_drained
    confining_pressure: 0.2 MPa
    packing: {file: packing.txt}
    data:
      file: data.txt
      columns: {axial_strain: e_z, volumetric_strain: e_v, stress_ratio: ratio}
      units: {axial_strain: percent, volumetric_strain: percent}
    control: axial_strain
    observables:
      stress_ratio: {noise: {relative: 0.02, floor: 0.01}}
      volumetric_strain: {noise: {absolute: 0.1 percent, correlation_length: 0.5 percent}}
    role: calibrate
  - name: tx05
    test: triaxial_drained
    confining_pressure: 0.5 MPa
    packing: {generate: {particles: 100, void_ratio: 0.68, radii: {mean: 1 mm, spread: 0.2}, seed: 5}}
    realizations: 3
    data: {file: validation.csv, strain: logarithmic}
    control: {column: axial_strain, noise: 1e-4}
    observables: {q_over_p: {noise: {relative: 0.05}}}
    role: validate
noise: given
inference: {method: iterative_bayesian_filter, samples: 20, max_iterations: 3}
early_stopping: {discard_at_most: 1e-3}
failure: {attempts: 5, pause_above: 0.25}
budget: {model_evaluations: 400, core_hours: 12}
seed: 7
)";
}

FileReader ReaderOf(std::map<std::string, std::string> files) {
  return [files = std::move(files)](const std::string& path) -> absl::StatusOr<std::string> {
    const auto found = files.find(path);
    if (found == files.end()) return absl::NotFoundError("no such file");
    return found->second;
  };
}

std::string Spoiled(const std::string& from, const std::string& to) {
  std::string yaml = GoodYaml();
  const std::size_t at = yaml.find(from);
  if (at == std::string::npos || yaml.find(from, at + 1) != std::string::npos) {
    std::fprintf(stderr, "'%s' does not stand exactly once in the good campaign\n", from.c_str());
    std::abort();
  }
  return yaml.replace(at, from.size(), to);
}

std::string ProblemsOf(const std::string& yaml, const std::map<std::string, std::string>& files) {
  std::string text;
  for (const Problem& problem :
       ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(files)).problems) {
    text += ToString(problem) + "\n";
  }
  return text;
}

std::string ProblemsOf(const std::string& yaml) { return ProblemsOf(yaml, GoodFiles()); }

}  // namespace calib::campaign::testing
