#pragma once
// The campaign that tests of calibctl start from: a drained triaxial test on 64 grains, a fraction
// of a second a run, read from data.csv beside it; and a file as text.

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace calib::testing {

/// observables: as in the campaign file, "{q_over_p: {noise: {absolute: 0.3}}}".
inline std::string SixtyFourGrains(const std::string& observables, int samples, int iterations) {
  return R"(name: small
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
    observables: )" +
         observables +
         "\ninference: {method: iterative_bayesian_filter, samples: " + std::to_string(samples) +
         ", max_iterations: " + std::to_string(iterations) + "}\nseed: 7\n";
}

inline std::string ReadAll(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace calib::testing
