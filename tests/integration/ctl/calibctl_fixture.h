#pragma once
// calibctl as a user meets it: real processes in a folder of their own, exit codes and what is
// printed, and a calibration of 64 grains that takes seconds.

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

namespace calib::ctl {

using Json = nlohmann::json;

struct Answer {
  int code = -1;
  std::string out, err;
  Json json() const { return Json::parse(out, nullptr, false); }
};

inline std::string ReadAll(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class CalibctlFixture : public ::testing::Test {
 protected:
  CalibctlFixture() {
    std::string pattern =
        (std::filesystem::temp_directory_path() / "calibctl-test-XXXXXX").string();
    work_ = mkdtemp(pattern.data());
    Write("data.csv",
          "axial_strain,q_over_p,volumetric_strain\n0.002,0.5,0.0008\n0.005,0.8,0.0012\n"
          "0.01,1.0,0.001\n");
  }
  ~CalibctlFixture() override { std::filesystem::remove_all(work_); }

  /// A campaign on data.csv: one triaxial test, two parameters, 15 lines.
  static std::string SmallCampaign(int samples, int iterations) {
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
    observables: {q_over_p: {noise: {absolute: 0.3}}, volumetric_strain: {noise: {absolute: 0.002}}}
inference: {method: iterative_bayesian_filter, samples: )" +
           std::to_string(samples) + ", max_iterations: " + std::to_string(iterations) +
           "}\nseed: 7\n";
  }

  void Write(const std::string& name, const std::string& text) const {
    std::ofstream(work_ / name) << text;
  }
  std::string Read(const std::string& name) const { return ReadAll(work_ / name); }

  Answer Call(const std::string& arguments) const { return CallWith("", arguments); }

  /// wrapper: a program that starts calibctl and gives back its exit code (timeout
  /// --preserve-status).
  Answer CallWith(const std::string& wrapper, const std::string& arguments) const {
    const std::string command = "cd '" + work_.string() + "' && " + wrapper + " '" + CALIBCTL +
                                "' " + arguments + " >out 2>err </dev/null";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, Read("out"), Read("err")};
  }

  std::filesystem::path work_;
};

}  // namespace calib::ctl
