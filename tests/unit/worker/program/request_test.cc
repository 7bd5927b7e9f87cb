#include "worker/program/request.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

namespace calib::worker {
namespace {

v1::ProgramRun Example() {
  v1::ProgramRun run;
  run.set_experiment("a");
  run.set_realization(2);
  (*run.mutable_parameters())["stiffness"] = 1e5;
  (*run.mutable_parameters())["rolling.friction"] = 0.1;
  (*run.mutable_units())["stiffness"] = "N/m";
  run.add_effects("rolling");
  run.set_settings(
      "{\"confining_pressure\": 2e5,\n \"packing\": \"a.txt\", \"flat\": true, \"seed\": 9, "
      "\"in\": [1]}");
  run.set_control("axial_strain");
  run.add_control_values(0);
  run.add_control_values(0.015);
  run.add_observables("stress_ratio");
  run.set_seed(12);
  run.set_threads(4);
  return run;
}

TEST(ProgramRequest, HoldsWhatTheProtocolSays) {
  const auto text = RequestText(Example(), "17");
  ASSERT_TRUE(text.ok()) << text.status();
  EXPECT_EQ(text->find('\n'), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(*text), nlohmann::json::parse(R"({
    "run": "17", "experiment": "a", "realization": 2,
    "parameters": {"stiffness": 100000, "rolling.friction": 0.1}, "units": {"stiffness": "N/m"},
    "effects": ["rolling"],
    "settings": {"confining_pressure": 2e5, "packing": "a.txt", "flat": true, "seed": 9, "in": [1]},
    "control": {"name": "axial_strain", "values": [0, 0.015]}, "observables": ["stress_ratio"],
    "seed": 12, "threads": 4})"));
  EXPECT_EQ(RequestText(Example(), "17"), text);
}

TEST(ProgramRequest, TheTestOfTheExperimentIsNamedWhereItHasOne) {
  EXPECT_FALSE(nlohmann::json::parse(*RequestText(Example(), "1")).contains("test"));
  v1::ProgramRun run = Example();
  run.set_test("triaxial_drained");
  EXPECT_EQ(nlohmann::json::parse(*RequestText(run, "1")).at("test"), "triaxial_drained");
}

TEST(ProgramRequest, WithoutSettings) {
  v1::ProgramRun run = Example();
  run.set_settings("");
  EXPECT_TRUE(nlohmann::json::parse(*RequestText(run, "1")).at("settings").empty());
  run.set_settings("[1]");
  EXPECT_EQ(RequestText(run, "1").status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(ProgramRequest, NumbersKeepTheirBits) {
  std::mt19937_64 random(5);
  v1::ProgramRun run;
  for (int k = 0; k < 5000; ++k) {
    if (const double value = std::bit_cast<double>(random()); std::isfinite(value)) {
      run.add_control_values(value);
    }
  }
  const auto values = nlohmann::json::parse(*RequestText(run, "1"))
                          .at("control")
                          .at("values")
                          .get<std::vector<double>>();
  ASSERT_EQ(static_cast<int>(values.size()), run.control_values_size());
  for (std::size_t k = 0; k < values.size(); ++k) {
    ASSERT_EQ(std::bit_cast<std::uint64_t>(values[k]),
              std::bit_cast<std::uint64_t>(run.control_values(static_cast<int>(k))));
  }
}

TEST(ProgramRequest, ExactNamesAloneAreReplacedAndNeverAfterADollar) {
  const auto names = *Replacements(Example(), "/scratch/run-1");
  const auto replaced = [&](const char* text) { return Replaced(text, names); };
  EXPECT_EQ(replaced("{scratch}/in -t {threads} --seed={seed}"),
            "/scratch/run-1/in -t 4 --seed=12");
  EXPECT_EQ(replaced("{stiffness} {rolling.friction} {confining_pressure} {packing} {flat}"),
            "100000 0.1 200000 a.txt true");
  EXPECT_EQ(replaced("${stiffness} $stiffness $${seed}"), "${stiffness} $stiffness $${seed}");
  EXPECT_EQ(replaced("{ stiffness} {Stiffness} {in} {} {other} {stiff{seed}ness}"),
            "{ stiffness} {Stiffness} {in} {} {other} {stiff12ness}");
  EXPECT_EQ(replaced("}{seed}{{seed}}{"), "}12{12}{");
  EXPECT_EQ(replaced("$ {seed} } ${x} {seed}"), "$ 12 } ${x} 12");
  EXPECT_EQ(replaced(""), "");
  // Once: what was put in is not looked at again.
  EXPECT_EQ(Replaced("{a}", {{"a", "{b}"}, {"b", "c"}}), "{b}");
}

TEST(ProgramRequest, AParameterComesBeforeASetting) {
  v1::ProgramRun run = Example();
  (*run.mutable_parameters())["confining_pressure"] = 3;
  EXPECT_EQ(Replaced("{confining_pressure}", *Replacements(run, "/s")), "3");
}

}  // namespace
}  // namespace calib::worker
