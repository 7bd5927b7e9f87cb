#include "dem/registry/scenario_problems.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "dem/model/scenario.h"
#include "dem/simulate/simulate.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

Scenario Good() {
  Scenario s;
  s.model = test::HertzModel();
  s.test = "triaxial_drained";
  s.settings = {{"confining_pressure", 2e5}};
  const double along_x[3] = {1, 0, 0};
  s.packing = test::TwoSpheres(1e-3, 2e-3, along_x);
  s.path = {{.target = 0.01, .load_step = 0}};
  return s;
}

TEST(ScenarioProblems, AGoodScenarioHasNone) { EXPECT_THAT(ScenarioProblems(Good()), IsEmpty()); }

TEST(ScenarioProblems, NamesWhatIsUnknown) {
  Scenario s = Good();
  s.model.contact = "hertz_mindln";
  s.test = "triaxal";
  EXPECT_THAT(ScenarioProblems(s),
              ElementsAre(HasSubstr("hertz_mindlin, linear"), HasSubstr("triaxial_drained")));
  s = Good();
  s.model.effects = {"rolling", "rolling"};
  EXPECT_THAT(ScenarioProblems(s), testing::Contains(HasSubstr("no effect \"rolling\"")));
  s = Good();
  s.model.parameters["poison_ratio"] = 0.2;
  EXPECT_THAT(ScenarioProblems(s), ElementsAre(HasSubstr("poison_ratio")));
}

TEST(ScenarioProblems, ParametersMustBePresentOnceAndInRange) {
  Scenario s = Good();
  s.model.parameters.erase("young_modulus");
  s.model.parameters["poisson_ratio"] = 0.6;
  s.model.parameters["friction_angle"] = 0.3;
  EXPECT_THAT(
      ScenarioProblems(s),
      testing::UnorderedElementsAre(HasSubstr("young_modulus is missing"),
                                    HasSubstr("poisson_ratio is 0.6"), HasSubstr("alternatives")));
  s = Good();
  s.model.parameters.erase("friction_coefficient");
  EXPECT_THAT(ScenarioProblems(s), ElementsAre(HasSubstr("friction_angle is missing")));
  s = Good();
  s.model.parameters["young_modulus"] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(ScenarioProblems(s), ElementsAre(HasSubstr("young_modulus")));
}

TEST(ScenarioProblems, RollingStiffnessAndRatioExcludeEachOther) {
  Scenario s = Good();
  s.model.effects = {"rolling_resistance"};
  s.model.parameters["rolling_resistance.stiffness"] = 0.5;
  s.model.parameters["rolling_resistance.stiffness_ratio"] = 0.5;
  s.model.parameters["rolling_resistance.friction"] = std::numeric_limits<double>::infinity();
  EXPECT_THAT(ScenarioProblems(s), ElementsAre(HasSubstr("alternatives")));
  s.model.parameters.erase("rolling_resistance.stiffness");
  EXPECT_THAT(ScenarioProblems(s), IsEmpty());
  s.model.parameters.erase("rolling_resistance.stiffness_ratio");
  EXPECT_THAT(ScenarioProblems(s),
              ElementsAre(HasSubstr("rolling_resistance.stiffness is missing")));
}

TEST(ScenarioProblems, StiffnessesOfMomentsAreFinite) {
  for (const char* effect : {"rolling_resistance", "twisting_resistance"}) {
    for (const char* parameter : {".stiffness", ".stiffness_ratio"}) {
      for (const double value : {std::numeric_limits<double>::infinity(), 1e300}) {
        Scenario s = Good();
        s.model.effects = {effect};
        s.model.parameters[effect + std::string(parameter)] = value;
        s.model.parameters[effect + std::string(".friction")] = 0.1;
        EXPECT_THAT(ScenarioProblems(s), ElementsAre(HasSubstr(", allowed is [0, 1e+")));
      }
    }
  }
}

TEST(ScenarioProblems, ClumpsMustLieTogetherAndDoNotCrush) {
  Scenario s = Good();
  s.packing.clump[0] = s.packing.clump[1] = 3;
  s.packing.x[1] = s.packing.x[0] + 0.5 * s.packing.length[0];
  EXPECT_THAT(ScenarioProblems(s), ElementsAre(HasSubstr("of clump 3 lie")));
  s.packing.x[1] = s.packing.x[0] + 0.5 * s.packing.radius[0];
  s.packing.y[1] = s.packing.y[0];
  s.packing.z[1] = s.packing.z[0];
  EXPECT_THAT(ScenarioProblems(s), IsEmpty());
  s.model.effects = {"particle_crushing"};
  s.model.parameters["particle_crushing.weakness"] = 1e-7;
  EXPECT_THAT(ScenarioProblems(s), ElementsAre(HasSubstr("needs a packing of single spheres")));
}

TEST(ScenarioProblems, CollectsEverythingAtOnce) {
  Scenario s = Good();
  s.settings.clear();
  s.path = {{.target = 5, .load_step = 0}, {.target = 0.1, .load_step = 0}};
  s.staging.rate = -1;
  s.staging.damping_loading = 1.5;
  s.consolidation = {.friction_coefficient = 0.1, .porosity = 0.4};
  s.initial_stress = InitialStress{.axial = 0, .lateral = 1};
  s.threads = 0;
  EXPECT_EQ(ScenarioProblems(s).size(), 8U);
  const auto summary = Simulate(s, [](const State&) {}, {});
  EXPECT_EQ(summary.status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(ScenarioProblems, AStressDrivesWhereTheTestHasOne) {
  Scenario s = Good();
  s.test = "oedometric";
  s.settings[kStressDriven] = 1;
  s.path = {{.target = 5e5, .load_step = 0}};
  EXPECT_THAT(ScenarioProblems(s), IsEmpty());
  s.path[0].target = -5e5;
  EXPECT_THAT(ScenarioProblems(s),
              ElementsAre(HasSubstr("axial_stress is -500000, it must be positive")));
  s.path[0].target = 5e5;
  s.loading_rate = 0.1;
  EXPECT_THAT(ScenarioProblems(s), ElementsAre(HasSubstr("is driven by stress")));
  s = Good();
  s.settings[kStressDriven] = 1;
  EXPECT_THAT(ScenarioProblems(s), ElementsAre(HasSubstr("has no setting \"stress_driven\"")));
}

// Grains of 1.6 to 2.4 mm, mean 2 mm.
std::vector<double> SpreadRadii(std::size_t count) {
  std::vector<double> radii;
  for (std::size_t i = 0; i < count; ++i) {
    radii.push_back(0.8e-3 + 0.4e-3 * static_cast<double>(i) / static_cast<double>(count - 1));
  }
  return radii;
}

Scenario Poured(const std::string& test, const std::map<std::string, double>& settings,
                double control) {
  Scenario s = Good();
  s.test = test;
  s.settings = settings;
  s.path = {{.target = control, .load_step = 0}};
  return s;
}

TEST(GrainRemarks, LengthsThatTheGrainsDoNotPassAreRefused) {
  struct Case {
    const char* test;
    std::map<std::string, double> settings;
    double control;
    const char* refused;  // "": nothing
  };
  for (const Case& c : {
           Case{"silo_discharge", {}, 0.05, "opening 0.05 m is not smaller than silo_width, 0.024"},
           Case{"silo_discharge", {}, 0.001, "not wider than the smallest grain, 0.0016"},
           Case{"silo_discharge", {}, 12, "is not smaller than silo_width, 0.024"},
           Case{"silo_discharge", {}, 0.01, ""},
           Case{"silo_discharge", {{"flat", 1}}, 0.05, ""},
           Case{"silo_discharge", {{"silo_width", 0.06}}, 0.05, ""},
           Case{"silo_discharge", {{"silo_width", 0.002}}, 0.0018, "the largest grain 0.0024"},
           Case{"angle_of_repose", {{"cylinder_diameter", 0.002}}, 1, "cylinder_diameter is 0.002"},
           Case{"angle_of_repose", {{"cylinder_diameter", 0.02}}, 1, ""},
           Case{"calibration_device", {{"opening", 0.0015}}, 1, "opening is 0.0015"},
           Case{"calibration_device", {{"opening", 0.012}}, 1, ""},
           Case{"shaken_box", {{"box_width", 0.004}}, 1, "the intruder 0.0048"},
           Case{"shaken_box", {{"intruder_ratio", 9}}, 1, "intruder_ratio is 9"},
           Case{"shaken_box", {{"box_width", 0.03}}, 1, ""},
           Case{"rotating_drum", {{"drum_diameter", 0.002}}, 1, "drum_diameter is 0.002"},
           Case{"rotating_drum", {{"drum_diameter", 0.01}}, 1, "grains have"},
           Case{"rotating_drum", {{"drum_diameter", 0.1}}, 1, ""},
       }) {
    const Scenario scenario = Poured(c.test, c.settings, c.control);
    ASSERT_THAT(ScenarioProblems(scenario), IsEmpty()) << c.test;
    const auto refused = GrainRemarksOf(scenario, SpreadRadii(1500)).refused;
    if (*c.refused == '\0') {
      EXPECT_THAT(refused, IsEmpty()) << c.test << " " << c.control;
    } else {
      EXPECT_THAT(refused, ElementsAre(HasSubstr(c.refused))) << c.test << " " << c.control;
    }
  }
}

// Elongated grains pass an outlet lengthwise.
TEST(GrainRemarks, ElongatedGrainsAreThinner) {
  Scenario scenario = Poured("silo_discharge", {}, 1.5e-3);
  EXPECT_THAT(GrainRemarksOf(scenario, SpreadRadii(100)).refused, testing::SizeIs(1));
  scenario.model.effects = {"nonspherical_shape"};
  scenario.model.parameters["nonspherical_shape.aspect"] = 2;
  EXPECT_THAT(GrainRemarksOf(scenario, SpreadRadii(100)).refused, IsEmpty());
}

TEST(GrainRemarks, AHeapOfFewGrainsIsRemarkedOn) {
  const Scenario heap = Poured("angle_of_repose", {}, 1);
  EXPECT_THAT(GrainRemarksOf(heap, SpreadRadii(64)).few, HasSubstr("fewer than about 1000"));
  EXPECT_EQ(GrainRemarksOf(heap, SpreadRadii(1000)).few, "");
  EXPECT_EQ(GrainRemarksOf(Good(), SpreadRadii(64)).few, "");
}

}  // namespace
}  // namespace calib::dem
