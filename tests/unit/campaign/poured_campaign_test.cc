// Campaigns of tests that pour their grains: what they need, and what has no meaning there.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "server/campaign/model/specimen_notes.h"
#include "server/methods/registry.h"
#include "tests/support/stl_text.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using ::testing::HasSubstr;
using testing::ProblemsOf;
using testing::ReaderOf;

std::map<std::string, std::string> Files() {
  return {{"silo.csv", "opening,mass_flow_rate\n40,0.9\n20,0.2\n30.5,0.5\n20,0.21\n"}};
}

std::string PouredYaml() {
  return R"(name: silo
model:
  contact: hertz_mindlin
  effects: [wall_friction]
  density: 2500
  fixed: {young_modulus: 1e7, poisson_ratio: 0.25}
parameters:
  friction_coefficient: {prior: uniform, min: 0.2, max: 0.9}
  wall_friction.coefficient: {prior: uniform, min: 0.2, max: 0.9}
experiments:
  - name: outlet
    test: silo_discharge
    silo_width: 10 cm
    packing: {generate: {particles: 200, radii: {mean: 2 mm, spread: 0.1}, seed: 4}}
    data: {file: silo.csv, units: {opening: mm}}
    control: opening
    observables: {mass_flow_rate: {noise: {relative: 0.05}}}
inference: {samples: 10}
)";
}

TEST(PouredCampaign, TakesSizesOnlyAndReadingsInAnyOrder) {
  const ReadOutcome outcome =
      ReadCampaign(methods::All(), PouredYaml(), "c.yaml", ReaderOf(Files()));
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  ASSERT_EQ(outcome.campaign.experiments.size(), 1U);
  const Experiment& experiment = outcome.campaign.experiments[0];
  EXPECT_DOUBLE_EQ(experiment.settings.at("silo_width"), 0.1);
  ASSERT_EQ(experiment.path.size(), 4U);
  const double openings[] = {0.04, 0.02, 0.0305, 0.02};
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_DOUBLE_EQ(experiment.path[k].target, openings[k]);
    EXPECT_EQ(experiment.path[k].load_step, static_cast<int>(k));
    EXPECT_EQ(experiment.segment[k], "initial_loading");
  }
}

TEST(PouredCampaign, RealizationsOfAFilePourItsGrainsAnew) {
  auto files = Files();
  files["packing.txt"] = testing::GoodFiles().at("packing.txt");
  const std::string yaml = absl::StrReplaceAll(
      PouredYaml(), {{"{generate: {particles: 200, radii: {mean: 2 mm, spread: 0.1}, seed: 4}}\n",
                      "{file: packing.txt}\n    realizations: 2\n"}});
  const ReadOutcome outcome = ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(files));
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  ASSERT_EQ(outcome.campaign.experiments.size(), 1U);
  const auto& specimens = outcome.campaign.experiments[0].specimens;
  ASSERT_EQ(specimens.size(), 2U);
  EXPECT_EQ(std::get<PackingLike>(specimens[1]).recipe.particles, 20);
  EXPECT_EQ(
      SpecimenNotes(outcome.campaign),
      (std::vector<std::string>{"outlet: realization 2 pours the 20 grains of packing.txt anew."}));
}

TEST(PouredCampaign, TakesAGradingCurve) {
  const std::string yaml = absl::StrReplaceAll(
      PouredYaml(),
      {{"radii: {mean: 2 mm, spread: 0.1}", "diameters: {median: 4 mm, log_sd: 0.2}"}});
  const ReadOutcome outcome = ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(Files()));
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  ASSERT_EQ(outcome.campaign.experiments.size(), 1U);
  const auto& recipe =
      std::get<dem::PackingRecipe>(outcome.campaign.experiments[0].specimens.at(0));
  EXPECT_TRUE(dem::IsGrading(recipe.grading));
}

TEST(PouredCampaign, RefusesWhatHasNoMeaningThere) {
  const std::string packed = absl::StrReplaceAll(
      PouredYaml(), {{"particles: 200", "particles: 200, porosity: 0.4"},
                     {"    control: opening", "    staging: {rate: 0.1}\n    control: opening"}});
  EXPECT_EQ(ProblemsOf(packed, Files()),
            "c.yaml:14: experiments[1].packing.generate.porosity: has no meaning here: the test "
            "pours the grains itself\n"
            "c.yaml:16: experiments[1].staging: has no meaning in silo_discharge; remove it\n");
  auto files = Files();
  files["silo.csv"] = "opening,mass_flow_rate\n40,0.9\n-20,0.2\n";
  EXPECT_THAT(ProblemsOf(PouredYaml(), files), HasSubstr("silo.csv:3: opening: is -0.02"));
}

// Their parameters could only come back as their priors.
TEST(PouredCampaign, AnEffectThatNoTestHasIsRefused) {
  for (const char* effect : {"initial_density.densification", "initial_fabric.stress_anisotropy"}) {
    const std::string name(effect, std::string(effect).find('.'));
    const std::string yaml = absl::StrReplaceAll(
        PouredYaml(), {{"effects: [wall_friction]", "effects: [" + name + "]"},
                       {"wall_friction.coefficient: {prior: uniform, min: 0.2, max: 0.9}",
                        std::string(effect) + ": {prior: uniform, min: -0.01, max: 0.01}"}});
    EXPECT_THAT(
        ProblemsOf(yaml, Files()),
        HasSubstr("c.yaml:2: model: effect " + name +
                  " has no part in any of the experiments: it acts in isotropic, oedometric, "
                  "triaxial_drained, triaxial_undrained, simple_shear\n"));
  }
  const std::string impacts = absl::StrReplaceAll(
      PouredYaml(),
      {{"effects: [wall_friction]", "effects: [nonspherical_shape]"},
       {"wall_friction.coefficient: {prior: uniform, min: 0.2, max: 0.9}",
        "nonspherical_shape.aspect: {prior: uniform, min: 1, max: 2}"},
       {"silo_discharge", "collision"},
       {"    silo_width: 10 cm\n", "    radius: 2 mm\n    impact_angle: 0\n"},
       {"    packing: {generate: {particles: 200, radii: {mean: 2 mm, spread: 0.1}, seed: 4}}\n",
        ""},
       {", units: {opening: mm}", ""},
       {"control: opening", "control: impact_speed"},
       {"mass_flow_rate:", "normal_restitution:"}});
  EXPECT_THAT(ProblemsOf(impacts, {{"silo.csv", "impact_speed,normal_restitution\n1,0.9\n"}}),
              HasSubstr("effect nonspherical_shape has no part in any of the experiments"));
}

std::string WithMesh(const std::string& meshes) {
  return absl::StrReplaceAll(PouredYaml(),
                             {{"    silo_width: 10 cm\n", "    meshes: " + meshes + "\n"}});
}

TEST(PouredCampaign, AMeshIsReadInItsUnit) {
  auto files = Files();
  files["silo.stl"] =
      calib::testing::TextStl(calib::testing::FourSides({.lower = 20, .upper = 40, .height = 300}));
  const ReadOutcome outcome = ReadCampaign(
      methods::All(), WithMesh("{silo: {file: silo.stl, unit: mm}}"), "c.yaml", ReaderOf(files));
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  ASSERT_EQ(outcome.campaign.experiments.size(), 1U);
  const MeshFile& mesh = outcome.campaign.experiments[0].meshes.at("silo");
  EXPECT_EQ(mesh.mesh.size(), 8);
  EXPECT_DOUBLE_EQ(mesh.scale, 1e-3);
  EXPECT_DOUBLE_EQ(dem::BoundsOf(mesh.mesh).high.z, 0.3);
  EXPECT_EQ(outcome.files, (std::vector<std::string>{"silo.stl", "silo.csv"}));
  const dem::Scenario scenario =
      MakeScenario(outcome.campaign, outcome.campaign.experiments[0], {{0.5, 0.5}, 0});
  EXPECT_EQ(scenario.meshes.at("silo").size(), 8);
}

// The engine would say so of each run.
TEST(PouredCampaign, AMeshThatDoesNotFitTheGrainsIsRefused) {
  auto files = Files();
  auto sides = calib::testing::FourSides({.lower = 20, .upper = 40, .height = 300});
  files["silo.stl"] = calib::testing::TextStl(sides);
  EXPECT_THAT(ProblemsOf(WithMesh("{silo: {file: silo.stl, unit: m}}"), files),
              HasSubstr("c.yaml:10: experiments: outlet: mesh silo is 300 m long, the largest "
                        "grain 0.00439354 m: is the mesh's unit right?"));
  EXPECT_THAT(ProblemsOf(WithMesh("{silo: {file: silo.stl, unit: um}}"), files),
              HasSubstr("mesh silo is 0.0003 m long, the largest grain 0.00439354 m"));
  const std::string graded =
      absl::StrReplaceAll(WithMesh("{silo: {file: silo.stl, unit: m}}"),
                          {{"{mean: 2 mm, spread: 0.1}", "{cumulative: [[1 mm, 0], [3 mm, 1]]}"}});
  const double largest = dem::GradedRadii({{1e-3, 0}, {3e-3, 1}}, 200).front();
  EXPECT_THAT(ProblemsOf(graded, files),
              HasSubstr(absl::StrCat("the largest grain ", 2 * largest, " m")));
  const auto raised_by = [&](double up) {
    auto raised = sides;
    for (auto& triangle : raised) {
      for (auto& p : triangle) p[2] += up;
    }
    files["silo.stl"] = calib::testing::TextStl(raised);
    return ProblemsOf(WithMesh("{silo: {file: silo.stl, unit: mm}}"), files);
  };
  EXPECT_EQ(raised_by(4), "") << "a gap that no grain passes";
  EXPECT_THAT(raised_by(50), HasSubstr("mesh silo ends 0.05 m above the floor"));
}

TEST(PouredCampaign, AVesselWithAHoleOrWithoutAnOutletIsRefused) {
  auto files = Files();
  const auto sides = calib::testing::FourSides({.lower = 20, .upper = 40, .height = 300});
  const auto problems = [&](const std::vector<calib::testing::StlTriangle>& triangles) {
    files["silo.stl"] = calib::testing::TextStl(triangles);
    return ProblemsOf(WithMesh("{silo: {file: silo.stl, unit: mm}}"), files);
  };
  for (std::size_t missing = 0; missing < sides.size(); ++missing) {
    auto holed = sides;
    holed.erase(holed.begin() + static_cast<std::ptrdiff_t>(missing));
    EXPECT_THAT(problems(holed), HasSubstr("c.yaml:10: experiments: outlet: mesh silo has a hole "
                                           "near ("))
        << missing;
  }
  EXPECT_THAT(problems(calib::testing::FourSides(
                  {.lower = 20, .upper = 40, .height = 300, .middle_y = 100})),
              HasSubstr("mesh silo does not stand around its origin, where the outlet is: it "
                        "reaches from (-0.04, 0.06) to (0.04, 0.14) m"));
  auto closed = sides;
  closed.push_back({{{-20, -20, 0}, {20, -20, 0}, {20, 20, 0}}});
  closed.push_back({{{-20, -20, 0}, {20, 20, 0}, {-20, 20, 0}}});
  EXPECT_THAT(problems(closed), HasSubstr("mesh silo is closed at its origin"));
  for (const double slope : {3e-3, 1e-5}) {  // the rim, not a hole
    auto slanted = sides;
    for (auto& triangle : slanted) {
      for (auto& p : triangle) p[2] *= 1 + slope * p[0];
    }
    EXPECT_EQ(problems(slanted), "") << slope;
  }
}

TEST(PouredCampaign, NumbersOfThingsAreWhole) {
  EXPECT_THAT(
      ProblemsOf(absl::StrReplaceAll(PouredYaml(), {{"silo_width: 10 cm", "flat: 0.5"}}), Files()),
      HasSubstr("c.yaml:13: experiments[1].flat: is 0.5, allowed are whole numbers from 0 "
                "to 1\n"));
  const std::string heap =
      absl::StrReplaceAll(PouredYaml(), {{"    silo_width: 10 cm\n", ""},
                                         {"silo_discharge", "angle_of_repose"},
                                         {"file: silo.csv, units: {opening: mm}", "file: heap.csv"},
                                         {"control: opening", "control: repetition"},
                                         {"mass_flow_rate:", "angle_of_repose:"}});
  EXPECT_EQ(ProblemsOf(heap, {{"heap.csv", "repetition,angle_of_repose\n1,0.5\n2,0.5\n"}}), "");
  EXPECT_EQ(
      ProblemsOf(heap, {{"heap.csv", "repetition,angle_of_repose\n1,0.5\n1.5,0.5\n"}}),
      "heap.csv:3: repetition: is 1.5; angle_of_repose allows whole numbers between 0 and 1e+06\n");
}

TEST(PouredCampaign, ADrumThatCarriesItsGrainsAroundIsRefused) {
  const std::string drum =
      absl::StrReplaceAll(PouredYaml(), {{"silo_width: 10 cm", "drum_diameter: 80 mm"},
                                         {"silo_discharge", "rotating_drum"},
                                         {"file: silo.csv, units: {opening: mm}", "file: drum.csv"},
                                         {"control: opening", "control: rotation_speed"},
                                         {"mass_flow_rate:", "angle_of_repose:"}});
  EXPECT_EQ(ProblemsOf(drum, {{"drum.csv", "rotation_speed,angle_of_repose\n2,0.5\n15,0.6\n"}}),
            "");
  EXPECT_EQ(
      ProblemsOf(drum, {{"drum.csv", "rotation_speed,angle_of_repose\n2,0.5\n200,0.6\n"}}),
      "c.yaml:10: experiments: outlet: rotation_speed 200 rad/s has a Froude number omega^2 R "
      "/ g of 163.155 in a drum of 0.08 m, which carries the grains around from 1 on: have it "
      "turn slower than 15.6578 rad/s\n");
}

TEST(PouredCampaign, WhatIsWrongWithAMeshIsSaidInOneLine) {
  auto files = Files();
  auto sides = calib::testing::FourSides({.lower = 20, .upper = 40, .height = 300});
  files["silo.stl"] = calib::testing::TextStl(sides);
  const auto problems = [&](const std::string& meshes) {
    return ProblemsOf(WithMesh(meshes), files);
  };
  EXPECT_EQ(problems("{silo: {file: silo.stl}}"),
            "c.yaml:13: experiments[1].meshes.silo.unit: is missing; an STL file does not say its "
            "unit, e.g. mm\n");
  EXPECT_THAT(problems("{silo: {file: silo.stl, unit: kPa}}"),
              HasSubstr("c.yaml:13: experiments[1].meshes.silo.unit: kPa is a pressure"));
  EXPECT_EQ(problems("{funnel: {file: silo.stl, unit: mm}}"),
            "c.yaml:13: experiments[1].meshes.funnel: is no piece of silo_discharge that a mesh "
            "can replace; there is silo\n");
  EXPECT_THAT(problems("{silo: {file: none.stl, unit: mm}}"),
              HasSubstr("c.yaml:13: experiments[1].meshes.silo.file: "));
  EXPECT_EQ(problems("{silo: {file: silo.stl, unit: mm}}\n    flat: 1"),
            "c.yaml:10: experiments: outlet: mesh silo says how wide the silo is: flat has no "
            "meaning with it, remove it\n");
  sides[1] = sides[0];
  files["silo.stl"] = calib::testing::TextStl({sides[0], sides[0], sides[0]});
  EXPECT_THAT(problems("{silo: {file: silo.stl, unit: mm}}"), HasSubstr("silo.stl: "));
  EXPECT_EQ(ProblemsOf(absl::StrReplaceAll(WithMesh("{silo: {file: silo.stl, unit: mm}}"),
                                           {{"test: silo_discharge", "test: shaken_box"},
                                            {"control: opening", "control: time"},
                                            {"mass_flow_rate:", "exit_time:"}}),
                       {{"silo.csv", "time,exit_time\n1,0.9\n"}, {"silo.stl", ""}}),
            "c.yaml:13: experiments[1].meshes: shaken_box has no piece that a mesh can replace; "
            "remove it\n");
}

}  // namespace
}  // namespace calib::campaign
