// Campaigns whose model is a program of the user's own: what is read of it, what is refused, and
// what one of its runs is.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "server/campaign/model/sha256.h"
#include "server/messages/attempt_spec.h"
#include "server/methods/registry.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::ProblemsOf;
using testing::ReaderOf;

constexpr const char* kFileItself = "- \n";

std::map<std::string, std::string> ProgramFiles() {
  return {{"spring.py/", kFileItself},
          {"spring.py", "print('{}')\n"},
          {"in.liggghts/", kFileItself},
          {"in.liggghts", "variable mu equal {friction}\n"},
          {"a.txt/", kFileItself},
          {"a.txt", "one\n"},
          {"b.txt/", kFileItself},
          {"b.txt", "two\n"},
          {"case/", "x bin/go.sh\n- mesh.stl\n"},
          {"case/bin/go.sh", "#!/bin/sh\n"},
          {"case/mesh.stl", "solid\n"},
          {"a.csv", "pull,force,set\n0,0,1\n1,2,1\n2,4,1\n3,5,1\n"}};
}

std::string ProgramYaml() {
  return R"(name: spring
model:
  command: [python3, spring.py, "--seed={seed}"]
  files: [spring.py, case, a.txt, b.txt]
  templates: [in.liggghts]
  limits: {wall: 2 h, memory: 4 GB, disk: 500 MiB, silence: 20 min}
  version: "3"
  effects:
    rolling: {parameters: {rolling.friction: {null: 0, prior: {prior: uniform, min: 0, max: 1}, sign: positive}}}
parameters:
  stiffness: {prior: log_uniform, min: 1e3 N/m, max: 1e6 N/m}
  friction: {prior: uniform, min: 0.1, max: 0.9}
experiments:
  - name: pull
    settings: {rate: 2 mm/s, grains: 7, note: fast one, packing: a.txt, flag: true, box: [1 mm, 2 mm]}
    data: {file: a.csv, units: {pull: mm, force: kN}}
    control: pull
    observables: {force: {noise: {absolute: 0.1 kN}}}
inference: {samples: 10}
)";
}

ReadOutcome ReadProgramYaml(const std::string& yaml,
                            const std::map<std::string, std::string>& files = ProgramFiles()) {
  return ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(files));
}

std::string SpoiledProgram(const std::string& from, const std::string& to) {
  const std::string yaml = absl::StrReplaceAll(ProgramYaml(), {{from, to}});
  EXPECT_NE(yaml, ProgramYaml()) << from << " is not in the campaign";
  return yaml;
}

TEST(ProgramCampaign, IsReadAsItStands) {
  const ReadOutcome outcome = ReadProgramYaml(ProgramYaml());
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  const Campaign& campaign = outcome.campaign;
  ASSERT_TRUE(campaign.program.has_value());
  const Program& program = *campaign.program;
  EXPECT_THAT(program.command, ElementsAre("python3", "spring.py", "--seed={seed}"));
  EXPECT_EQ(program.limits.wall, 7200);
  EXPECT_EQ(program.limits.memory, 4e9);
  EXPECT_EQ(program.limits.disk, 500.0 * 1048576);
  EXPECT_EQ(program.limits.silence, 1200);
  ASSERT_EQ(program.files.size(), 6U);
  EXPECT_EQ(program.files[1].name, "case/bin/go.sh");
  EXPECT_TRUE(program.files[1].executable);
  EXPECT_EQ(program.files[1].digest, Sha256Hex("#!/bin/sh\n"));
  EXPECT_FALSE(program.files[2].executable);
  EXPECT_TRUE(program.files[5].is_template);
  EXPECT_EQ(campaign.parameters[0].unit, "N/m");
  EXPECT_THAT(campaign.experiments[0].control, ElementsAre(0, 1e-3, 2e-3, 3e-3));
  EXPECT_DOUBLE_EQ(campaign.experiments[0].observables[0].values[1], 2000);
  EXPECT_DOUBLE_EQ(campaign.experiments[0].observables[0].sd[1], 100);
}

TEST(ProgramCampaign, NamesEveryFileThatASubmissionHasToBring) {
  EXPECT_THAT(ReadProgramYaml(ProgramYaml()).files,
              ::testing::UnorderedElementsAre("spring.py/", "spring.py", "case/", "case/bin/go.sh",
                                              "case/mesh.stl", "a.txt/", "a.txt", "b.txt/", "b.txt",
                                              "in.liggghts/", "in.liggghts", "a.csv"));
}

TEST(ProgramCampaign, TellsQuantitiesInSiFilesByTheirNameAndTheRestAsItIs) {
  const ReadOutcome outcome = ReadProgramYaml(ProgramYaml());
  const v1::ProgramRun run =
      messages::ProgramRunOf(outcome.campaign, 0, {.values = {2e3, 0.5}, .stream = 0});
  EXPECT_EQ(run.settings(), R"({"box":[0.001,0.002],"flag":true,"grains":7,"note":"fast one",)"
                            R"("packing":"a.txt","rate":0.002})");
  EXPECT_EQ(run.parameters().at("stiffness"), 2e3);
  EXPECT_EQ(run.units().at("stiffness"), "N/m");
  EXPECT_EQ(run.control(), "pull");
  EXPECT_THAT(run.control_values(), ElementsAre(0, 1e-3, 2e-3, 3e-3));
  EXPECT_THAT(run.observables(), ElementsAre("force"));
}

TEST(ProgramCampaign, RealizationsHaveTheirSettingsAndASeedEach) {
  const ReadOutcome outcome =
      ReadProgramYaml(SpoiledProgram("packing: a.txt, flag", "flag") + "\n");
  const std::string yaml =
      absl::StrReplaceAll(SpoiledProgram("packing: a.txt, flag", "flag"),
                          {{"    control: pull\n",
                            "    realizations: {packing: [a.txt, b.txt]}\n    control: pull\n"}});
  const ReadOutcome two = ReadProgramYaml(yaml);
  for (const Problem& problem : two.problems) ADD_FAILURE() << ToString(problem);
  const auto run = [&](int stream) {
    return messages::ProgramRunOf(two.campaign, 0, {.values = {2e3, 0.5}, .stream = stream});
  };
  EXPECT_THAT(run(0).settings(), HasSubstr(R"("packing":"a.txt")"));
  EXPECT_THAT(run(1).settings(), HasSubstr(R"("packing":"b.txt")"));
  EXPECT_EQ(run(3).realization(), 1);
  EXPECT_NE(run(0).seed(), run(1).seed());
  EXPECT_EQ(run(0).seed(), run(2).seed());
}

TEST(ProgramCampaign, ARunIsItsProgramFilesParametersSettingsAndSeed) {
  const auto digest = [](const std::string& yaml, const std::map<std::string, std::string>& files,
                         double stiffness, int stream) {
    const ReadOutcome outcome = ReadProgramYaml(yaml, files);
    for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
    return messages::RunDigest(
        messages::LeaseOf(outcome.campaign, 0, {.values = {stiffness, 0.5}, .stream = stream}));
  };
  const std::string own = digest(ProgramYaml(), ProgramFiles(), 2e3, 0);
  EXPECT_EQ(digest(ProgramYaml(), ProgramFiles(), 2e3, 1), own) << "one realization";
  EXPECT_EQ(digest(SpoiledProgram("wall: 2 h", "wall: 3 h"), ProgramFiles(), 2e3, 0), own)
      << "a limit";
  EXPECT_NE(digest(ProgramYaml(), ProgramFiles(), 2.1e3, 0), own);
  EXPECT_NE(digest(SpoiledProgram("rate: 2 mm/s", "rate: 3 mm/s"), ProgramFiles(), 2e3, 0), own);
  EXPECT_NE(digest(SpoiledProgram("version: \"3\"", "version: \"4\""), ProgramFiles(), 2e3, 0),
            own);
  EXPECT_NE(digest(SpoiledProgram("name: pull", "name: push"), ProgramFiles(), 2e3, 0), own);
  auto files = ProgramFiles();
  files["case/mesh.stl"] = "solid other\n";
  EXPECT_NE(digest(ProgramYaml(), files, 2e3, 0), own);
  files = ProgramFiles();
  files["case/"] = "x bin/go.sh\nx mesh.stl\n";
  EXPECT_NE(digest(ProgramYaml(), files, 2e3, 0), own) << "may be executed";
}

TEST(ProgramCampaign, AnEffectThatActsIsNamedToTheProgram) {
  const std::string yaml =
      absl::StrReplaceAll(SpoiledProgram("sign: positive}}}", "sign: positive}}, acts: true}"),
                          {{"  friction: {prior: uniform, min: 0.1, max: 0.9}\n",
                            "  friction: {prior: uniform, min: 0.1, max: 0.9}\n"
                            "  rolling.friction: {prior: uniform, min: 0, max: 1}\n"}});
  const ReadOutcome outcome = ReadProgramYaml(yaml);
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  const v1::ProgramRun run =
      messages::ProgramRunOf(outcome.campaign, 0, {.values = {2e3, 0.5, 0.2}, .stream = 0});
  EXPECT_THAT(run.effects(), ElementsAre("rolling"));
  EXPECT_EQ(run.parameters().at("rolling.friction"), 0.2);
}

TEST(ProgramCampaign, ATestThatIsNamedHasItsObservablesUnitsAndRanges) {
  auto files = ProgramFiles();
  files["a.csv"] = "e,s\n0,1\n1,1.5\n2,1.8\n";
  const std::string yaml = absl::StrReplaceAll(
      ProgramYaml(),
      {{"  - name: pull\n    settings: {rate: 2 mm/s, ",
        "  - name: tx\n    test: triaxial_drained\n    settings: {confining_pressure: 0.2 MPa, "},
       {"units: {pull: mm, force: kN}",
        "columns: {axial_strain: e, stress_ratio: s}, units: {axial_strain: percent}"},
       {"control: pull", "control: axial_strain"},
       {"force: {noise: {absolute: 0.1 kN}}",
        "stress_ratio: {noise: {relative: 0.02, floor: 0.1}}"}});
  const ReadOutcome outcome = ReadProgramYaml(yaml, files);
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  EXPECT_EQ(outcome.campaign.experiments[0].settings.at("confining_pressure"), 2e5);
  const Campaign unnamed = ReadProgramYaml(ProgramYaml()).campaign;
  const RunOf values{.values = {2e3, 0.5}, .stream = 0};
  EXPECT_EQ(messages::ProgramRunOf(outcome.campaign, 0, values).test(), "triaxial_drained");
  EXPECT_EQ(messages::ProgramRunOf(unnamed, 0, values).test(), "");
  EXPECT_DOUBLE_EQ(outcome.campaign.experiments[0].control[1], -std::log1p(-0.01));
  EXPECT_THAT(ProblemsOf(absl::StrReplaceAll(yaml, {{"0.2 MPa", "-1 MPa"}}), files),
              HasSubstr("confining_pressure"));
  EXPECT_THAT(
      ProblemsOf(absl::StrReplaceAll(yaml, {{"stress_ratio: {n", "angle_of_repose: {n"}}), files),
      HasSubstr("is not an observable of triaxial_drained"));
}

TEST(ProgramCampaign, RefusesWhatCannotBeMeantInOneSentenceEach) {
  const struct {
    std::string yaml;
    const char* says;
  } cases[] = {
      {SpoiledProgram("command: [python3, spring.py, \"--seed={seed}\"]",
                      "command: python3 spring.py"),
       "write a list: [python3, ...]"},
      {SpoiledProgram("[python3, spring.py, \"--seed={seed}\"]", "[spring.py]"),
       "write ./spring.py"},
      {SpoiledProgram("[python3, spring.py, \"--seed={seed}\"]", "[./spring.py]"),
       "chmod +x spring.py"},
      {SpoiledProgram("[python3, spring.py, \"--seed={seed}\"]", "[./other.sh]"),
       "none of model.files"},
      {SpoiledProgram("files: [spring.py, ", "files: [missing.py, "), "cannot read 'missing.py'"},
      {SpoiledProgram("files: [spring.py, ", "files: [spring.py, spring.py, "),
       "scratch folder twice"},
      {SpoiledProgram("memory: 4 GB", "memory: 4"), "no size above 0 with its unit"},
      {SpoiledProgram("wall: 2 h", "wall: -2 h"), "wall"},
      {SpoiledProgram("  version:", "  contact: hertz_mindlin\n  version:"),
       "the model is a command"},
      {SpoiledProgram("  friction: {prior", "  seed: {prior"), "seed is a reserved name"},
      {SpoiledProgram("grains: 7", "friction: 7"), "the name of a setting and of a parameter"},
      {SpoiledProgram("rate: 2 mm/s", "rate: 2 mmm/s"), "begins as a quantity"},
      {SpoiledProgram("    control: pull\n", "    control: pull\n    packing: {file: a.txt}\n"),
       "move it there"},
      {SpoiledProgram("    control: pull\n",
                      "    control: pull\n    realizations: {packing: [a.txt]}\n"),
       "stands under settings as well"},
      {SpoiledProgram("sign: positive}}}", "sign: positive}}, acts: true}"), "is not calibrated"},
      {SpoiledProgram("    rolling: {p", "    rolling_resistance: {p"),
       "is an effect of this build; call that of your runs another"},
      {SpoiledProgram("force: {noise", "pull: {noise"), "is the control"},
      {absl::StrReplaceAll(ProgramYaml(),
                           {{"  command: [python3, spring.py, \"--seed={seed}\"]\n", ""}}),
       "command is missing"},
      {absl::StrCat(ProgramYaml(), "early_stopping: {discard_at_most: 1e-3, rungs: [0.5]}\n"),
       "would begin anew"},
      {SpoiledProgram("  version:", "  keep: [../up]\n  version:"), "no name of a file"},
      {SpoiledProgram("  version:", "  keep: [/tmp/a]\n  version:"), "no name of a file"},
      {SpoiledProgram("  version:", "  keep: [a, a]\n  version:"), "stands here twice"},
      {SpoiledProgram("  version:", "  numerics: {seed: {null: 1, sd: 1}}\n  version:"),
       "numerics.seed is a reserved name"},
      {SpoiledProgram("  version:", "  numerics: {friction: {null: 1, sd: 1}}\n  version:"),
       "what is calibrated matters"},
      {SpoiledProgram("  version:", "  numerics: {rate: {null: 1, sd: 1}}\n  version:"),
       "the name of a setting and of a parameter"},
      {SpoiledProgram("  version:", "  numerics: {step: {null: 1, sd: 0}}\n  version:"),
       "model.numerics.step.sd"},
      {SpoiledProgram("  version:", "  numerics: {step: {null: 1}}\n  version:"), "sd: is missing"},
      {SpoiledProgram("inference:", "failure: {at_limit: perhaps}\ninference:"), "at_limit"},
  };
  for (const auto& one : cases) {
    EXPECT_THAT(ProblemsOf(one.yaml, ProgramFiles()), HasSubstr(one.says));
  }
}

TEST(ProgramCampaign, SettingsThatShouldNotMatterAreToldAtTheirNull) {
  const ReadOutcome outcome = ReadProgramYaml(SpoiledProgram(
      "  version:", "  numerics: {time_step_factor: {null: 0.8, sd: 0.2}}\n  version:"));
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  const auto told = [](const Campaign& campaign, std::vector<double> values) {
    const v1::ProgramRun run =
        messages::ProgramRunOf(campaign, 0, {.values = std::move(values), .stream = 0});
    EXPECT_EQ(run.parameters_size(), 3);  // what a design calls it has no part in the request
    return run.parameters().at("time_step_factor");
  };
  EXPECT_EQ(told(outcome.campaign, {2e3, 0.5}), 0.8);
  Campaign design = outcome.campaign;
  design.method = methods::All().Find("design");
  design.parameters.push_back({.name = "numerics.time_step_factor", .unit = "1", .prior = {}});
  EXPECT_EQ(told(design, {2e3, 0.5, 1}), 1);
  EXPECT_EQ(told(design, {2e3, 0.5, 0.8}), 0.8);
}

std::string WithNext(const std::string& next) {
  return SpoiledProgram("  version:", "  next: " + next + "\n  version:");
}

TEST(ProgramCampaign, ATestThatMayBeProposedIsAnExperimentWithoutReadings) {
  const ReadOutcome outcome = ReadProgramYaml(
      WithNext("[{name: fast, settings: {rate: 4 mm/s}, control: pull, values: [1 mm, 2 mm]}, "
               "{name: twist, control: angle, values: [0, 45 deg], realizations: 3, "
               "observables: {torque: {noise: {relative: 0.1, floor: 2 N m}}}}]"));
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  ASSERT_EQ(outcome.campaign.next.size(), 2U);
  const Experiment& fast = outcome.campaign.next[0];
  EXPECT_EQ(fast.told.at("rate"), "0.004");
  EXPECT_THAT(fast.control, ElementsAre(1e-3, 2e-3));
  EXPECT_EQ(fast.control_unit, "m");
  ASSERT_EQ(fast.observables.size(), 1U) << "as of the experiment";
  EXPECT_EQ(fast.observables[0].name, "force");
  EXPECT_EQ(fast.observables[0].unit, "N");
  EXPECT_EQ(fast.observables[0].noise->absolute, 100);
  const Experiment& twist = outcome.campaign.next[1];
  EXPECT_EQ(twist.specimens.size(), 3U);
  EXPECT_EQ(twist.observables[0].noise->floor, 2);
  EXPECT_EQ(twist.observables[0].noise->relative, 0.1);
}

TEST(ProgramCampaign, TestsThatMayBeProposedAreHeldToTheirForm) {
  const std::string fast = "name: fast, control: pull, values: [1 mm, 2 mm]";
  const struct {
    std::string next;
    const char* says;
  } cases[] = {
      {"[{name: fast, control: pull}]", "model.next[1].values: is missing"},
      {"fast", "has to be a list"},
      {"[{name: fast, control: pull, values: [1 mm]}]", "two values or more"},
      {"[{name: fast, control: pull, values: [1 mm, 1 mm]}]", "two values or more"},
      {"[{name: fast, control: pull, values: [1 mm, 2 s]}]", "another unit"},
      {"[{name: fast, control: pull, values: [1 mm, 2 mmm]}]", "mmm"},
      {"[{name: fast one, control: pull, values: [1 mm, 2 mm]}]", "not a short word"},
      {"[{name: pull, control: pull, values: [1 mm, 2 mm]}]", "is an experiment of the campaign"},
      {"[{" + fast + "}, {" + fast + "}]", "the name of two tests"},
      {"[{" + fast + ", test: pulling}]", "is unknown"},
      {"[{" + fast + ", test: triaxial_drained}]", "observables: is missing"},
      {"[{" + fast + ", packing: a.txt}]", "move it there"},
      {"[{" + fast + ", observables: {force: {noise: {column: sd}}}}]", "there are none yet"},
      {"[{" + fast + ", observables: {force: {}}}]", "noise: is missing"},
      {"[{" + fast + ", observables: {pull: {noise: {absolute: 1 mm}}}}]", "is the control"},
      {"[{" + fast + ", settings: {friction: 3}}]", "the name of a setting and of a parameter"},
      {"[{" + fast + ", settings: {seed: 3}}]", "seed is a reserved name"},
  };
  for (const auto& one : cases) {
    EXPECT_THAT(ProblemsOf(WithNext(one.next), ProgramFiles()), HasSubstr(one.says)) << one.next;
  }
}

TEST(ProgramCampaign, ATestIsNotToldWhatItsRealizationsDifferBy) {
  const auto with = [](const std::string& more) {
    return absl::StrReplaceAll(
        WithNext("[{name: fast, control: pull, values: [1 mm, 2 mm], settings: {packing: b.txt}" +
                 more + "}]"),
        {{"packing: a.txt, flag", "flag"},
         {"    control: pull\n",
          "    realizations: {packing: [a.txt, b.txt]}\n    control: pull\n"}});
  };
  EXPECT_THAT(ProblemsOf(with(""), ProgramFiles()), HasSubstr("give it realizations of its own"));
  EXPECT_EQ(ProblemsOf(with(", realizations: 2"), ProgramFiles()), "");
}

TEST(ProgramCampaign, SaysOfAScriptBesideTheCampaignThatItIsNotBrought) {
  EXPECT_THAT(ProblemsOf(SpoiledProgram("files: [spring.py, case", "files: [case"), ProgramFiles()),
              HasSubstr("spring.py lies beside the campaign file"));
}

TEST(ProgramCampaign, TheDiskListsAFolderWithWhatMayBeExecuted) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::path(::testing::TempDir()) / "program_campaign_listing";
  fs::remove_all(folder);
  fs::create_directories(folder / "case" / "bin");
  std::ofstream(folder / "case" / "bin" / "go.sh") << "#!/bin/sh\n";
  std::ofstream(folder / "case" / "mesh.stl") << "solid\n";
  fs::permissions(folder / "case" / "bin" / "go.sh", fs::perms::owner_all);
  const FileReader reader = DiskReader((folder / "c.yaml").string());
  EXPECT_EQ(reader("case/").value_or("?"), "x bin/go.sh\n- mesh.stl\n");
  EXPECT_EQ(reader("case/mesh.stl/").value_or("?"), "- \n");
  EXPECT_TRUE(absl::IsNotFound(reader("nothing/").status()));
  fs::remove_all(folder);
}

}  // namespace
}  // namespace calib::campaign
