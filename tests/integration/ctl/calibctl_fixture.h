#pragma once
// calibctl as a user meets it: real processes in a folder of their own, exit codes and what is
// printed, and a calibration of 64 grains that takes seconds.

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/sixty_four_grains.h"

namespace calib::ctl {

using Json = nlohmann::json;

struct Answer {
  int code = -1;
  std::string out, err;
  Json json() const { return Json::parse(out, nullptr, false); }
};

using calib::testing::ReadAll;

class CalibctlFixture : public ::testing::Test {
 protected:
  static constexpr char kReadings[] = "axial_strain,q_over_p,volumetric_strain\n";

  CalibctlFixture() {
    std::string pattern =
        (std::filesystem::temp_directory_path() / "calibctl-test-XXXXXX").string();
    work_ = mkdtemp(pattern.data());
    Write("data.csv",
          "axial_strain,q_over_p,volumetric_strain\n0.002,0.5,0.0008\n0.005,0.8,0.0012\n"
          "0.01,1.0,0.001\n");
  }
  ~CalibctlFixture() override {
    if (!HasFailure()) std::filesystem::remove_all(work_);
  }

  /// A campaign on data.csv: one triaxial test, two parameters, 15 lines.
  static std::string SmallCampaign(int samples, int iterations) {
    return calib::testing::SixtyFourGrains(
        "{q_over_p: {noise: {absolute: 0.3}}, volumetric_strain: {noise: {absolute: 0.002}}}",
        samples, iterations);
  }

  /// Rebounds of a sphere of 1 cm from a wall at 1 m/s, measured in impact.csv, which this writes.
  /// model: a flow mapping; noise: absolute, of the rebound angle [rad]; inference: a flow mapping.
  std::string Rebounds(const std::string& model, const std::string& noise,
                       const std::string& inference) const {
    Write("impact.csv", "impact_angle,rebound_angle\n0.3,0.21\n0.6,0.42\n0.9,0.75\n");
    return "name: rebounds\nmodel: " + model + R"(
parameters:
  young_modulus: {prior: log_uniform, min: 1e8 Pa, max: 1e11 Pa}
  friction_coefficient: {prior: uniform, min: 0.01, max: 1}
experiments:
  - name: wall
    test: collision
    radius: 10 mm
    impact_speed: 1 m/s
    data: {file: impact.csv}
    control: impact_angle
    observables: {rebound_angle: {noise: {absolute: )" +
           noise + "}}}\ninference: " + inference + "\nseed: 3\n";
  }

  /// Readings of q_over_p and volumetric_strain at these axial strains, before they are measured.
  static std::string UnmeasuredReadings(const std::vector<double>& strains) {
    std::ostringstream file;
    file << kReadings;
    for (const double s : strains) file << s << ",0.5,0.001\n";
    return file.str();
  }

  /// What simulate --json says of an experiment, measured with noise of 0.02 and 0.0002.
  static std::string MeasuredReadings(const Json& states, const std::string& experiment) {
    std::mt19937 random(4);
    std::normal_distribution<double> normal;
    std::ostringstream file;
    file << kReadings;
    for (const Json& state : states) {
      if (state["experiment"] != experiment) continue;
      file << state["axial_strain"].get<double>() << ','
           << state["q_over_p"].get<double>() + 0.02 * normal(random) << ','
           << state["volumetric_strain"].get<double>() + 0.0002 * normal(random) << '\n';
    }
    return file.str();
  }

  void Write(const std::string& name, const std::string& text) const {
    std::ofstream(work_ / name) << text;
  }
  std::string Read(const std::string& name) const { return ReadAll(work_ / name); }

  Answer Call(const std::string& arguments) const { return CallWith("", arguments); }

  /// Evaluations made for all campaigns of the folder `s` together.
  std::int64_t Evaluations() const {
    std::int64_t sum = 0;
    for (const Json& c : Call("list --state s --json").json()) {
      sum += c["model_evaluations"].get<std::int64_t>();
    }
    return sum;
  }

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
