// calibctl as a user meets it: real processes and exit codes.
#include <gmock/gmock.h>

#include <chrono>
#include <fstream>
#include <map>
#include <regex>

#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

using ::testing::HasSubstr;

class Calibctl : public CalibctlFixture {
 protected:
  Calibctl() { Write("good.yaml", Campaign()); }
  static std::string Campaign() { return SmallCampaign(6, 2); }
};

TEST_F(Calibctl, BadInputIsTwoWithOneLinePerProblem) {
  std::string bad = Campaign();
  bad.replace(bad.find("min: 0.2, max: 0.8"), 18, "min: 0.8, max: 0.2");
  std::ofstream(work_ / "bad.yaml") << bad;
  const Answer answer = Call("validate bad.yaml");
  EXPECT_EQ(answer.code, 2);
  EXPECT_EQ(std::count(answer.err.begin(), answer.err.end(), '\n'), 1) << answer.err;
  EXPECT_THAT(
      answer.err,
      HasSubstr("bad.yaml:5: parameters.friction_coefficient.min: the prior is upside down"));
  EXPECT_EQ(Call("run bad.yaml").code, 2);
  EXPECT_FALSE(std::filesystem::exists(work_ / "calib-state"));  // refused before anything was made
  EXPECT_EQ(Call("validate nowhere.yaml").code, 2);
  EXPECT_EQ(Call("validate good.yaml").code, 0);
  EXPECT_EQ(Call("show c1 --state nowhere").code, 2);
}

TEST_F(Calibctl, ValidateShowsWhatWasRead) {
  const Answer words = Call("validate good.yaml");
  EXPECT_THAT(words.out, HasSubstr("\ntx: axial_strain from "));
  EXPECT_THAT(words.out, HasSubstr(" turning points; "));
  const Json json = Call("validate good.yaml --json").json();
  EXPECT_EQ(json["valid"], true);
  ASSERT_EQ(json["experiments"].size(), 1U) << json;
  const Json& experiment = json["experiments"][0];
  EXPECT_EQ(experiment["name"], "tx");
  EXPECT_GT(experiment["path"]["to"].get<double>(), experiment["path"]["from"].get<double>());
  EXPECT_EQ(experiment["path"]["turning_points"], 0);
  EXPECT_EQ(experiment["observables"][0]["missing"], 0);
  EXPECT_GT(experiment["observables"][0]["readings"].get<int>(), 1);
  EXPECT_GT(experiment["grains"].get<int>(), 0);
  EXPECT_GT(experiment["d50"].get<double>(), 0);
}

TEST_F(Calibctl, NoServerIsThreeWithinSeconds) {
  const auto begin = std::chrono::steady_clock::now();
  const Answer answer = Call("--server 127.0.0.1:9 list");
  EXPECT_EQ(answer.code, 3);
  EXPECT_THAT(answer.err, HasSubstr("no server answers at 127.0.0.1:9"));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
  EXPECT_EQ(Call("submit good.yaml --server 127.0.0.1:9").code, 3);
}

TEST_F(Calibctl, SimulateWritesARowPerLoadStep) {
  const Answer missing = Call("simulate good.yaml --set young_modulus='300 MPa'");
  EXPECT_EQ(missing.code, 2);
  EXPECT_THAT(missing.err,
              HasSubstr("friction_coefficient is calibrated in this campaign and needs a value"));
  const Answer answer = Call(
      "simulate good.yaml --set young_modulus='300 MPa' --set friction_coefficient=0.5 -o "
      "states.csv --vtk grains");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const std::string table = ReadAll(work_ / "states.csv");
  EXPECT_THAT(table, ::testing::StartsWith("experiment,load_step,axial_strain,volumetric_strain,"));
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 4);
  EXPECT_TRUE(std::filesystem::exists(work_ / "grains" / "tx" / "grains.pvd"));
  EXPECT_TRUE(std::filesystem::exists(work_ / "grains" / "tx" / "contacts_0002.vtp"));
}

TEST_F(Calibctl, RowsAreRunAndNothingIsInferred) {
  Write("rows.yaml",
        Rebounds("{contact: hertz_mindlin, density: 2700, fixed: {poisson_ratio: 0.3}}", "0.02",
                 "{method: design, rows: [{young_modulus: 1 GPa, friction_coefficient: 0.1}, "
                 "{young_modulus: 1 GPa, friction_coefficient: 0.4}]}"));
  EXPECT_THAT(Call("validate rows.yaml").out, HasSubstr("3 measured numbers, 2 row(s) to run.\n"));
  const Answer run = Call("run rows.yaml --state s --workers 1");
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("2 rows run, 2 model evaluations, nothing inferred."));
  EXPECT_EQ(Call("samples c1 --state s --json").json()["samples"].size(), 2U);
  for (const char* verb : {"posterior", "compare", "diagnose", "improve"}) {
    const Answer answer = Call(std::string(verb) + " c1 --state s");
    EXPECT_EQ(answer.code, 1) << verb;
    EXPECT_THAT(answer.err, HasSubstr("campaign c1 runs the rows of its design and infers nothing"))
        << verb;
  }
}

TEST_F(Calibctl, AFileWhoseCampaignWasCancelledIsSaidToBe) {
  EXPECT_EQ(Call("submit good.yaml --state s").out, "c1\n");
  const Json shown = Call("show c1 --state s --json").json();
  EXPECT_TRUE(shown["best_misfit"].is_null()) << "nothing has run";
  EXPECT_TRUE(shown["effective_sample_size"].is_null());
  const Json listed = Call("list --state s --json").json();
  for (const auto& [key, value] : listed[0].items()) EXPECT_EQ(value, shown[key]) << key;
  ASSERT_EQ(Call("cancel c1 --state s").code, 0);
  for (const char* verb : {"submit", "run"}) {
    const Answer again = Call(std::string(verb) + " good.yaml --state s");
    EXPECT_EQ(again.code, 1) << verb;
    EXPECT_THAT(again.err, HasSubstr("c1, the same file, is cancelled; `calibctl delete c1` or "
                                     "another --seed starts it anew"));
    EXPECT_EQ(again.out, "");
  }
  EXPECT_EQ(Call("submit good.yaml --state s --seed 9").out, "c2\n");
}

TEST_F(Calibctl, ACalibrationFromEndToEnd) {
  const Answer run = Call("run good.yaml --workers 2 --state s --json");
  ASSERT_EQ(run.code, 0) << run.err;
  const Json posterior = run.json();
  const std::string id = posterior["campaign"];
  EXPECT_TRUE(posterior["parameters"]["friction_coefficient"]["mean"].is_number());
  EXPECT_EQ(posterior["model_evaluations"], 12 + 6) << "twins are as many as samples at most";

  const Answer again = Call(
      "run good.yaml --workers 2 --state s --json");  // finished already: the same answer at once
  EXPECT_EQ(again.out, run.out);
  EXPECT_EQ(Call("posterior " + id + " --state s --json").json()["parameters"],
            posterior["parameters"]);

  const Json samples = Call("--state s samples " + id + " --json").json()["samples"];
  EXPECT_EQ(samples.size(), 18U);
  EXPECT_EQ(Call("states " + id + " 0 --state s --json").json()["experiments"][0]["states"].size(),
            3U);
  EXPECT_EQ(Call("list --state s --json").json()[0]["state"], "finished");
  const Json comparison = Call("compare " + id + " --state s --json").json();
  EXPECT_TRUE(comparison["rms_error"].is_number());
  EXPECT_TRUE(comparison["heldout_rms_error"].is_null());
  for (const std::string verb : {"show", "posterior", "samples", "compare", "watch"}) {
    const Answer answer = Call(verb + " " + id + " --state s");
    EXPECT_EQ(answer.code, 0) << verb << ": " << answer.err;
    EXPECT_FALSE(answer.out.empty()) << verb;
  }

  const Answer twice = Call("models " + id + " " + id + " --state s");
  EXPECT_EQ(twice.code, 2);
  EXPECT_THAT(twice.err, HasSubstr("is named twice"));

  EXPECT_EQ(Call("report " + id + " --state s -o r.html").code, 0);
  EXPECT_THAT(ReadAll(work_ / "r.html"), HasSubstr("campaigns/" + id + "/posterior"));
  EXPECT_EQ(Call("export " + id + " --state s -o all").code, 0);
  for (const char* name : {"samples.csv", "states.csv", "posterior.json", "fit.csv", "data.json",
                           "record.json", "posterior.tex", "report.html"}) {
    EXPECT_GT(ReadAll(work_ / "all" / name).size(), 50U) << name;
  }
  const Answer unknown = Call("show nosuch --state s");
  EXPECT_EQ(unknown.code, 1);
  EXPECT_THAT(unknown.err, HasSubstr("nosuch"));
  EXPECT_EQ(Call("delete " + id + " --state s").code, 0);
  EXPECT_EQ(Call("list --state s --json").json().size(), 0U);
}

TEST_F(Calibctl, AnInterruptedRunGoesOnToTheSameAnswer) {
  const Json undisturbed = Call("run good.yaml --workers 2 --state s1 --json").json();
  // --foreground: one signal, not a second one to the group, which would end it at once.
  const Answer stopped = CallWith("timeout --foreground --preserve-status -s INT 1.5",
                                  "run good.yaml --workers 2 --state s2 --json");
  if (stopped.code != 0) {  // a fast machine may be done already
    EXPECT_EQ(stopped.code, 1) << stopped.err;
    EXPECT_THAT(stopped.err, HasSubstr("`calibctl run good.yaml --state s2` goes on from here"));
  }
  const Answer resumed = Call("run good.yaml --workers 1 --state s2 --json");
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  EXPECT_EQ(resumed.json()["parameters"], undisturbed["parameters"]);
  EXPECT_EQ(resumed.json()["log_evidence"], undisturbed["log_evidence"]);
}

TEST_F(Calibctl, SubmittedWorkWaitsForWorkers) {
  const Answer submitted = Call("submit good.yaml --state s");
  ASSERT_EQ(submitted.code, 0) << submitted.err;
  EXPECT_EQ(submitted.out, "c1\n");
  EXPECT_EQ(Call("pause c1 --state s").code, 0);
  EXPECT_EQ(Call("show c1 --state s --json").json()["state"], "paused");
  EXPECT_EQ(Call("posterior c1 --state s").code, 1);  // nothing to tell yet
  EXPECT_EQ(Call("report c1 --state s -o r.html").code, 0);
  const Answer resumed = Call("resume c1 --state s");
  EXPECT_EQ(resumed.code, 0);
  EXPECT_EQ(resumed.out,
            "c1 is running; nobody serves s now: it goes on with `calibctl watch c1 --state s "
            "--workers N`.\n");
  const Answer watched = Call("watch c1 --state s --workers 2");
  EXPECT_EQ(watched.code, 0) << watched.err;
  EXPECT_THAT(watched.out, HasSubstr("c1 is finished"));
}

TEST_F(Calibctl, CataloguesNeedNoServer) {
  for (const std::string verb : {"effects", "tests", "contacts"}) {
    EXPECT_TRUE(Call(verb + " --json").json().is_array());
    EXPECT_EQ(Call(verb).code, 0);
  }
}

// Spheres on a lattice become clumps in a file that a campaign can name.
TEST_F(Calibctl, PackMakesClumpsOfSpheres) {
  std::string spheres = "##PERIODIC:: 0.03 0.03 0.03\n";
  for (int k = 0; k < 27; ++k) {
    spheres += std::to_string(0.005 + 0.01 * (k % 3)) + " " +
               std::to_string(0.005 + 0.01 * (k / 3 % 3)) + " " +
               std::to_string(0.005 + 0.01 * (k / 9)) + " 0.003 -1\n";
  }
  Write("spheres.txt", spheres);
  Write("corner.txt", "0 0 0 1\n1 0 0 1\n0 1 0 0.8\n");
  const Answer corner = Call("pack spheres.txt --clumps corner.txt -o clumps.txt --json");
  ASSERT_EQ(corner.code, 0) << corner.err;
  EXPECT_EQ(corner.json()["clumps"], 27);
  EXPECT_EQ(corner.json()["spheres"], 81);
  EXPECT_NEAR(corner.json()["porosity"].get<double>(),
              corner.json()["porosity_of_spheres"].get<double>(), 2e-4);
  const Answer dumbbells = Call("pack spheres.txt --clumps dumbbell:1.5 -o dumbbells.txt");
  ASSERT_EQ(dumbbells.code, 0) << dumbbells.err;
  EXPECT_THAT(dumbbells.out, HasSubstr("27 clumps of 2 spheres in dumbbells.txt"));
  Write("clumped.yaml", std::regex_replace(SmallCampaign(8, 1), std::regex("packing: .*"),
                                           "packing: {file: clumps.txt}"));
  const Answer good = Call("validate clumped.yaml");
  EXPECT_EQ(good.code, 0) << good.err;
  const std::vector<std::pair<std::string, std::string>> bad = {
      {"pack spheres.txt --clumps dumbbell:2.5 -o x.txt", "above 1 and at most 2"},
      {"pack spheres.txt --clumps nowhere.txt -o x.txt", "nowhere.txt: no such file"},
      {"pack corner.txt --clumps dumbbell:1.5 -o x.txt", "the first line must be ##PERIODIC::"},
      {"pack clumps.txt --clumps dumbbell:1.5 -o x.txt", "is part of clump 0 already"},
      {"pack spheres.txt --clumps spheres.txt -o x.txt", "spheres.txt:2: \"0.005"}};
  for (const auto& [call, what] : bad) {
    const Answer answer = Call(call);
    EXPECT_EQ(answer.code, 2) << call;
    EXPECT_THAT(answer.err, HasSubstr(what)) << call;
  }
}

// Misfit and spread of a population on its way to the posterior are not those of the posterior.
TEST_F(Calibctl, WhoeverLooksAtAnUnfinishedTemperingIsTold) {
  Write("tempered.yaml",
        Rebounds("{contact: hertz_mindlin, density: 2500, fixed: {poisson_ratio: 0.2}}", "0.002",
                 "{method: tmcmc, samples: 20, steps: 2, max_iterations: 1}"));
  ASSERT_EQ(Call("run tempered.yaml --state s --workers 1").code, 0) << Read("err");
  for (const std::string verb : {"compare", "sensitivity"}) {
    const Answer words = Call(verb + " c1 --state s");
    EXPECT_EQ(words.code, 0) << words.err;
    EXPECT_THAT(words.out, HasSubstr("have not reached the posterior")) << verb;
    const Json json = Call(verb + " c1 --state s --json").json();
    ASSERT_FALSE(json["warnings"].empty()) << verb;
    EXPECT_THAT(json["warnings"][0].get<std::string>(), HasSubstr("have not reached")) << verb;
  }
}

TEST_F(Calibctl, DoctorLooksAtANodeAndAtAServer) {
  const Answer node = Call("doctor --json");
  ASSERT_EQ(node.code, 0) << node.out << node.err;
  const Json seen = node.json();
  EXPECT_TRUE(seen["healthy"]);
  std::map<std::string, std::string> health;
  for (const Json& check : seen["checks"]) {
    health[check["name"].get<std::string>() + ", " + check["subject"].get<std::string>()] =
        check["health"];
  }
  EXPECT_EQ(health["time_step, this node"], "ok") << node.out;
  EXPECT_EQ(health["file_system, temporary folder"], "ok") << node.out;
  EXPECT_EQ(health.count("clock, this node"), 1U);

  EXPECT_EQ(Call("doctor --server 127.0.0.1:9").code, 3);
  const Answer fresh = Call("doctor --state new");
  EXPECT_EQ(fresh.code, 0) << fresh.out;
  EXPECT_THAT(fresh.out, HasSubstr("It holds no campaigns yet."));
  EXPECT_FALSE(std::filesystem::exists(work_ / "new")) << "looking makes nothing";

  ASSERT_EQ(Call("run good.yaml --state state --workers 2").code, 0);
  const Answer used = Call("doctor --state state");
  EXPECT_EQ(used.code, 0) << used.out;
  EXPECT_THAT(used.out, HasSubstr("SQLite finds no fault."));
  // Damaged in its middle.
  const auto path = work_ / "state" / "calib.db";
  const auto size = std::filesystem::file_size(path);
  {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(size / 4));
    file << std::string(size / 2, 'x');
  }
  const Answer damaged = Call("doctor --state state");
  EXPECT_EQ(damaged.code, 1) << damaged.out;
  EXPECT_THAT(damaged.out, HasSubstr("problem"));
}

}  // namespace
}  // namespace calib::ctl
