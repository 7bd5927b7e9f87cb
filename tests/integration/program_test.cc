// A program of the user's own as the model, by real processes: a straight line with normal errors
// and normal priors, whose posterior and evidence are known in closed form.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <csignal>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "tests/support/attacker.h"
#include "tests/support/deployment.h"

namespace calib::testing {
namespace {

using ::testing::HasSubstr;

constexpr std::chrono::seconds kLong{240};
constexpr int kReadings = 6;
constexpr double kSd = 0.3;     // of a reading
constexpr double kPriorSd = 1;  // of both parameters
constexpr const char* kPython = "/usr/bin/python3";

// What the program does with a run follows from its parameters alone, so that every attempt of it
// does the same. `faults`: a share of the runs goes wrong, in each of ten ways.
constexpr const char* kLine = R"(import json, hashlib, os, signal, sys, time

def answer(request, out):
    p, x = request["parameters"], request["control"]["values"]
    fault = int(hashlib.sha256(repr(p["a"]).encode()).hexdigest(), 16) % 50
    fault = fault if request["settings"].get("faults") else 99
    print("a line that is none of an answer", file=out)
    for k, at in enumerate(x):
        y = p["a"] + p["b"] * at
        if k == 2:
            if fault == 0: time.sleep(1000)
            if fault == 1: y = float("nan")
            if fault == 2: print("{this is not JSON", file=out)
            if fault == 3: os.kill(os.getpid(), signal.SIGSEGV)
            if fault == 4: sys.exit("the mesh is broken")
            if fault == 5: print("no such grain", file=sys.stderr); sys.exit(3)
            if fault == 6: sys.exit(0)
            if fault == 7: k = 4
            if fault == 8: out.write("x" * 1000 * 1000 * 100); out.write("\n")
        print(json.dumps({"load_step": k, "y": y, "twice": 2 * y, "fault": fault, "run": request["run"]}), file=out, flush=True)
    if fault == 9: os.abort()

if __name__ == "__main__":
    for line in sys.stdin:
        request = json.loads(line)
        if "stop" in request: continue
        answer(request, sys.stdout)
        print(json.dumps({"run": request["run"], "end": "complete"}), flush=True)
)";

struct LineOptions {
  std::string method = "iterative_bayesian_filter";
  int samples = 200;
  int iterations = 2;
  std::string model{};  ///< further lines of the section
  std::string settings = "{}";
  std::string extra{};  ///< further sections
};

std::vector<double> At() {
  std::vector<double> at;
  for (int k = 0; k < kReadings; ++k) at.push_back(0.25 * k);
  return at;
}

// With a reading that no line of these parameters has, so that the answer is no trivial one.
std::vector<double> Readings() { return {0.41, 0.62, 0.57, 1.1, 0.93, 1.42}; }

struct LineCampaign {
  std::string yaml;
  std::map<std::string, std::string> files;
};

LineCampaign MakeLine(const LineOptions& options) {
  std::string table = "x,y\n";
  for (int k = 0; k < kReadings; ++k) {
    absl::StrAppend(&table, At()[static_cast<std::size_t>(k)], ",",
                    Readings()[static_cast<std::size_t>(k)], "\n");
  }
  const std::string yaml = absl::StrCat(
      "name: line\nmodel:\n  command: [", kPython, ", line.py]\n  files: [line.py]\n",
      options.model, "parameters:\n  a: {prior: normal, mean: 0, sd: ", kPriorSd,
      "}\n  b: {prior: normal, mean: 0, sd: ", kPriorSd,
      "}\nexperiments:\n  - name: line\n    settings: ", options.settings,
      "\n    data: {file: line.csv}\n    control: x\n    observables: {y: {noise: {absolute: ", kSd,
      "}}}\ninference: {method: ", options.method, ", samples: ", options.samples,
      ", max_iterations: ", options.iterations, "}\nseed: 3\n", options.extra);
  return {yaml, {{"line.py/", "- \n"}, {"line.py", kLine}, {"line.csv", table}}};
}

struct ClosedForm {
  Eigen::Vector2d mean;
  Eigen::Matrix2d covariance;
  double log_evidence = 0;
};

ClosedForm Exact() {
  Eigen::MatrixXd design(kReadings, 2);
  Eigen::VectorXd y(kReadings);
  for (int k = 0; k < kReadings; ++k) {
    design.row(k) << 1, At()[static_cast<std::size_t>(k)];
    y[k] = Readings()[static_cast<std::size_t>(k)];
  }
  ClosedForm exact;
  const Eigen::Matrix2d precision = design.transpose() * design / (kSd * kSd) +
                                    Eigen::Matrix2d::Identity() / (kPriorSd * kPriorSd);
  exact.covariance = precision.inverse();
  exact.mean = exact.covariance * design.transpose() * y / (kSd * kSd);
  const Eigen::MatrixXd marginal = design * design.transpose() * kPriorSd * kPriorSd +
                                   Eigen::MatrixXd::Identity(kReadings, kReadings) * kSd * kSd;
  exact.log_evidence = -0.5 * (y.dot(marginal.ldlt().solve(y)) + std::log(marginal.determinant()) +
                               kReadings * std::log(2 * std::numbers::pi));
  return exact;
}

v1::CampaignStatus RunLine(Deployment& deployment, const LineCampaign& line,
                           const std::string& request) {
  Client client = deployment.client();
  const auto id = client.SubmitCampaign(line.yaml, line.files, request);
  EXPECT_TRUE(id.ok()) << id.status();
  if (!id.ok()) return {};
  const auto statuses = client.Watch(*id, kLong);
  EXPECT_TRUE(statuses.ok()) << statuses.status() << deployment.Logs();
  if (!statuses.ok() || statuses->empty()) return {};
  EXPECT_EQ(statuses->back().state(), "finished") << statuses->back().DebugString();
  return statuses->back();
}

std::vector<std::string> MayRun() { return {"--allow-command", kPython}; }

TEST(ProgramModel, MethodsAgreeWithTheClosedForm) {
  Deployment deployment({.name = "program-line"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  deployment.StartWorker(1, MayRun());
  deployment.StartWorker(1, MayRun());
  const ClosedForm exact = Exact();
  struct Case {
    std::string method;
    int samples;
    int iterations;
  };
  for (const Case& one :
       {Case{"iterative_bayesian_filter", 200, 3}, Case{"sqmc", 400, 1}, Case{"tmcmc", 100, 12}}) {
    SCOPED_TRACE(one.method);
    const auto status = RunLine(deployment,
                                MakeLine({.method = one.method,
                                          .samples = one.samples,
                                          .iterations = one.iterations,
                                          .model = "  persistent: true\n"}),
                                one.method);
    Client client = deployment.client();
    const auto posterior = client.Posterior(status.campaign());
    ASSERT_TRUE(posterior.ok()) << posterior.status();
    ASSERT_EQ(posterior->parameters_size(), 2);
    SCOPED_TRACE(::testing::PrintToString(
        std::vector<std::string>(posterior->warnings().begin(), posterior->warnings().end())));
    // Monte Carlo error of a mean of the effective samples, four times over; an emulated posterior
    // has its draws' instead.
    const double ess = std::max(30.0, posterior->ess());
    for (int j = 0; j < 2; ++j) {
      const double sd = std::sqrt(exact.covariance(j, j));
      EXPECT_NEAR(posterior->parameters(j).mean(), exact.mean[j], 4 * sd / std::sqrt(ess));
      EXPECT_NEAR(posterior->parameters(j).sd(), sd, 4 * sd / std::sqrt(2 * ess));
    }
    EXPECT_NEAR(posterior->log_evidence(), exact.log_evidence,
                std::max(0.1, 4 * posterior->log_evidence_se()));
  }
}

TEST(ProgramModel, WhatItTellsBesidesIsKept) {
  Deployment deployment({.name = "program-others"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  deployment.StartWorker(2, MayRun());
  const auto status = RunLine(deployment, MakeLine({.samples = 4, .iterations = 1}), "others");
  const auto states = deployment.client().States(status.campaign());
  ASSERT_TRUE(states.ok() && !states->empty());
  const v1::State& state = states->front().states(1);
  ASSERT_EQ(state.values_size(), 1);
  EXPECT_EQ(state.others().at("twice"), 2 * state.values(0));
}

TEST(ProgramModel, FilesStayWithTheirRunsUnderTheirDigestAlone) {
  Deployment deployment({.name = "program-kept"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  Attacker attacker(deployment.address());
  v1::BlobChunk lie;
  lie.set_digest(std::string(64, 'a'));
  lie.set_data("of another digest");
  const auto* const put = google::protobuf::DescriptorPool::generated_pool()->FindMethodByName(
      "calib.v1.WorkerLink.PutBlob");
  ASSERT_NE(put, nullptr);
  EXPECT_EQ(attacker.Call(*put, lie).code(), absl::StatusCode::kInvalidArgument);
  lie.clear_digest();
  EXPECT_EQ(attacker.Call(*put, lie).code(), absl::StatusCode::kInvalidArgument);
  deployment.StartWorker(2, MayRun());
  const auto status = RunLine(
      deployment,
      MakeLine({.samples = 4, .iterations = 1, .model = "  keep: [request.json, dump.vtk]\n"}),
      "kept");
  Client client = deployment.client();
  const auto samples = client.Samples(status.campaign());
  ASSERT_TRUE(samples.ok() && !samples->empty());
  for (const v1::Sample& sample : *samples) {
    EXPECT_EQ(sample.status(), "finished") << "a missing file is no failure";
    ASSERT_EQ(sample.kept_size(), 2);
    EXPECT_EQ(sample.kept(0).name(), "dump.vtk");
    EXPECT_EQ(sample.kept(0).digest(), "");
    EXPECT_EQ(sample.kept(0).reason(), "is not there");
    EXPECT_EQ(sample.kept(1).name(), "request.json");
    EXPECT_EQ(sample.kept(1).digest().size(), 64U);
  }
  EXPECT_NE(samples->at(0).kept(1).digest(), samples->at(1).kept(1).digest());
}

TEST(ProgramModel, RunsThatGoWrongAreTakenForWhatTheyAre) {
  Deployment deployment({.name = "program-faults"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  deployment.StartWorker(2, MayRun());
  const auto status =
      RunLine(deployment,
              MakeLine({.samples = 150,
                        .iterations = 1,
                        .model = "  limits: {silence: 6 s, memory: 2 GB, wall: 60 s}\n",
                        .settings = "{faults: true}",
                        .extra = "failure: {attempts: 2, pause_above: 0.5}\n"}),
              "faults");
  Client client = deployment.client();
  const auto samples = client.Samples(status.campaign());
  const auto states = client.States(status.campaign());
  ASSERT_TRUE(samples.ok() && states.ok());
  std::map<int, int> fault_of;  // by sample: the program tells it beside its first state
  for (const v1::SampleStates& of_sample : *states) {
    fault_of[of_sample.sample()] = static_cast<int>(of_sample.states(0).others().at("fault"));
  }
  struct Told {
    std::string status, reason, words;
  };
  const std::map<int, Told> told = {
      {0, {"unknown", "silence limit", ""}},
      {1, {"diverged", "y is NaN at load step 2", ""}},
      {2, {"unknown", "is no JSON object", ""}},
      {3, {"unknown", "ended by SIGSEGV", ""}},
      {4, {"unknown", "the mesh is broken", "the mesh is broken"}},
      {5, {"diverged", "no such grain", "no such grain"}},
      {6, {"unknown", "exit 0 with 2 of 6 states", ""}},
      {7, {"unknown", "load step 4 is out of order", ""}},
      {8, {"finished", "", ""}},  // a line of 100 MB that is no answer is dropped
      {9, {"finished", "", ""}},  // it ends as it must not, after its last state
  };
  std::map<int, int> seen;  // runs by fault
  std::map<std::string, int> by_status;
  for (const v1::Sample& sample : *samples) {
    ++by_status[sample.status()];
    const int fault = fault_of.at(sample.index());
    ++seen[fault];
    const auto as_told = told.find(fault);
    const Told expected = as_told == told.end() ? Told{"finished", "", ""} : as_told->second;
    EXPECT_EQ(sample.status(), expected.status) << fault << ": " << sample.reason();
    EXPECT_THAT(sample.reason(), HasSubstr(expected.reason)) << fault;
    EXPECT_THAT(sample.words(), HasSubstr(expected.words)) << fault;
    EXPECT_EQ(sample.attempts(), expected.status == "unknown" ? 2 : 1) << fault;
    if (sample.status() == "unknown") {
      EXPECT_EQ(sample.weight(), 0);
    }
  }
  for (const auto& [fault, as] : told) EXPECT_GT(seen[fault], 0) << "no run had fault " << fault;
  const auto posterior = client.Posterior(status.campaign());
  ASSERT_TRUE(posterior.ok());
  EXPECT_EQ(posterior->unknown(), by_status["unknown"]);
  EXPECT_GT(posterior->unknown_mass(), 0);
  EXPECT_FALSE(posterior->converged());
}

TEST(ProgramModel, WaitsForAWorkerThatMayRunItAndSaysSo) {
  Deployment deployment({.name = "program-allowed"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  deployment.StartWorker(1);
  deployment.StartWorker(1, {"--allow-command", "sh"});
  const LineCampaign line = MakeLine({.samples = 4, .iterations = 1});
  Client client = deployment.client();
  const auto id = client.SubmitCampaign(line.yaml, line.files, "allowed");
  ASSERT_TRUE(id.ok()) << id.status();
  EXPECT_TRUE(Eventually(std::chrono::seconds(10), [&] {
    const auto workers = client.Workers();
    return workers.ok() && workers->workers_size() == 2;
  }));
  EXPECT_TRUE(Eventually(std::chrono::seconds(10), [&] {
    const auto status = client.Show(*id);
    return status.ok() &&
           status->nobody_may() == absl::StrCat("none of 2 connected workers may run ", kPython,
                                                ": start one with --allow-command ", kPython);
  })) << client.Show(*id)->DebugString();
  EXPECT_EQ(client.Show(*id)->model_evaluations(), 0);
  deployment.StartWorker(1, MayRun());
  const auto statuses = client.Watch(*id, kLong);
  ASSERT_TRUE(statuses.ok());
  EXPECT_EQ(statuses->back().state(), "finished");
  EXPECT_EQ(client.Show(*id)->nobody_may(), "");
}

TEST(ProgramModel, SameBitsWhenWorkersAreKilledAndWhereItStays) {
  std::string undisturbed;
  for (const bool persistent : {false, true}) {
    for (const bool disturbed : {false, true}) {
      Deployment deployment(
          {.name = absl::StrCat("program-bits-", persistent, disturbed), .lease_ms = 1000});
      ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
      deployment.StartWorker(2, MayRun());
      const LineCampaign line =
          MakeLine({.samples = 40,
                    .iterations = 2,
                    .model = persistent ? "  persistent: true\n" : "  persistent: false\n"});
      Client client = deployment.client();
      const auto id = client.SubmitCampaign(line.yaml, line.files, "bits");
      ASSERT_TRUE(id.ok()) << id.status();
      if (disturbed) {
        EXPECT_TRUE(Eventually(std::chrono::seconds(30), [&] {
          const auto status = client.Show(*id);
          return status.ok() && status->samples_done() > 3;
        }));
        deployment.workers().front().Kill();
        deployment.StartWorker(2, MayRun());
      }
      const auto statuses = client.Watch(*id, kLong);
      ASSERT_TRUE(statuses.ok()) << deployment.Logs();
      EXPECT_EQ(statuses->back().state(), "finished") << statuses->back().DebugString();
      const auto bytes = Fingerprint(client, *id);
      ASSERT_TRUE(bytes.ok());
      if (undisturbed.empty()) undisturbed = *bytes;
      EXPECT_EQ(*bytes, undisturbed) << persistent << disturbed;
    }
  }
}

TEST(ProgramModel, EarlyStoppingSavesLoadSteps) {
  Deployment deployment({.name = "program-stopping"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  deployment.StartWorker(2, MayRun());
  const auto status = RunLine(deployment,
                              MakeLine({.samples = 100,
                                        .iterations = 3,
                                        .extra = "early_stopping: {discard_at_most: 1e-3, "
                                                 "exponent: 1}\n"}),
                              "stopping");
  Client client = deployment.client();
  const auto posterior = client.Posterior(status.campaign());
  ASSERT_TRUE(posterior.ok());
  EXPECT_GT(posterior->stopped_early(), 0);
  EXPECT_LE(posterior->stated_loss(), 1e-3);
  const auto states = client.States(status.campaign());
  ASSERT_TRUE(states.ok());
  std::size_t load_steps = 0;
  for (const v1::SampleStates& of_sample : *states) {
    load_steps += static_cast<std::size_t>(of_sample.states_size());
  }
  EXPECT_LT(load_steps, states->size() * kReadings);
}

}  // namespace
}  // namespace calib::testing
