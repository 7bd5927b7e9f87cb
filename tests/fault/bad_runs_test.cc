// Runs that crash, take all memory, hang or give up, on one worker beside good ones: each ends
// alone, what is bad is set aside with its reason, and every campaign goes on to its end.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/fault/undisturbed.h"

namespace calib::testing {
namespace {

using ::testing::HasSubstr;

constexpr const char* kPython = "/usr/bin/python3";
constexpr int kSamples = 40;
constexpr int kAttempts = 2;

// What becomes of a run follows from its parameter, so that every attempt of it ends alike.
constexpr const char* kProgram = R"(import json, hashlib, os, signal, sys, time
request = json.loads(sys.stdin.readline())
a = request["parameters"]["a"]
fault = int(hashlib.sha256(repr(a).encode()).hexdigest(), 16) % 12
for k, x in enumerate(request["control"]["values"]):
    if k == 1 and fault == 0: os.kill(os.getpid(), signal.SIGSEGV)
    if k == 1 and fault == 1:
        taken = []
        while True: taken.append(b"x" * 4000000)
    if k == 1 and fault == 2: time.sleep(1000)
    if k == 1 and fault == 3: print("the mesh is broken", file=sys.stderr); os._exit(7)
    print(json.dumps({"load_step": k, "y": a * x, "fault": fault}), flush=True)
)";

std::string BadCampaign() {
  return absl::StrCat("name: bad\nmodel:\n  command: [", kPython, ", p.py]\n  files: [p.py]\n",
                      "  limits: {silence: 5 s}\n",
                      "parameters:\n  a: {prior: normal, mean: 1, sd: 0.3}\n",
                      "experiments:\n  - name: line\n    data: {file: line.csv}\n    control: x\n",
                      "    observables: {y: {noise: {absolute: 0.3}}}\n",
                      "inference: {method: iterative_bayesian_filter, samples: ", kSamples,
                      ", max_iterations: 1}\nfailure: {attempts: ", kAttempts,
                      ", pause_above: 0.9}\n", "resources: {memory: 60 MB}\nseed: 5\n");
}

/// The engines of a worker.
std::vector<pid_t> EnginesOf(pid_t worker) {
  std::vector<pid_t> engines;
  std::error_code error;
  for (const auto& thread :
       std::filesystem::directory_iterator(absl::StrCat("/proc/", worker, "/task"), error)) {
    std::ifstream children(thread.path() / "children");
    for (pid_t child = 0; children >> child;) {
      std::ifstream file(absl::StrCat("/proc/", child, "/cmdline"));
      std::string line;
      std::getline(file, line);
      if (line.find("--engine") != std::string::npos) engines.push_back(child);
    }
  }
  return engines;
}

TEST(BadRuns, EndAloneBesideGoodOnesOfTwoCampaignsOnOneWorker) {
  Undisturbed();
  Deployment deployment({.name = "bad-runs"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  deployment.StartWorker(3, {"--allow-command", kPython});
  Client client = deployment.client();
  const SmallCampaign good = FaultCampaign();
  ASSERT_EQ(client.SubmitCampaign(good.yaml, good.files, "good").value_or(""), "c1");
  const auto bad = client.SubmitCampaign(
      BadCampaign(), {{"p.py/", "- \n"}, {"p.py", kProgram}, {"line.csv", "x,y\n0,0\n1,1\n2,2\n"}},
      "bad");
  ASSERT_EQ(bad.value_or(bad.status().ToString()), "c2");

  // An engine that crashes, in the midst of it.
  std::vector<pid_t> engines;
  EXPECT_TRUE(Eventually(kLong, [&] {
    engines = EnginesOf(deployment.workers().front().id());
    const auto status = client.Show("c1");
    return !engines.empty() && status.ok() && status->samples_running() > 0;
  }));
  if (!engines.empty()) kill(engines.front(), SIGSEGV);

  ASSERT_TRUE(WaitFinished(deployment)) << deployment.Logs();
  ExpectUndisturbed(deployment);
  EXPECT_TRUE(Eventually(kLong, [&] {
    const auto status = client.Show("c2");
    return status.ok() && status->state() == "finished";
  })) << client.Show("c2")->DebugString();
  EXPECT_TRUE(deployment.workers().front().Running()) << "nothing has taken the worker along";

  const auto samples = client.Samples("c2");
  const auto states = client.States("c2");
  ASSERT_TRUE(samples.ok() && states.ok());
  std::map<int, const v1::SampleStates*> states_of;
  for (const v1::SampleStates& of_sample : *states) states_of[of_sample.sample()] = &of_sample;
  const std::map<int, std::string> reasons = {{0, "ended by SIGSEGV"},
                                              {1, "came to its memory limit: "},
                                              {2, "came to its silence limit: no state for 5 s"},
                                              {3, "exit 7 with 1 of 3 states: the mesh is broken"}};
  std::map<int, int> seen;
  for (const v1::Sample& sample : *samples) {
    ASSERT_EQ(states_of.count(sample.index()), 1U);
    const v1::SampleStates& of_sample = *states_of[sample.index()];
    ASSERT_GT(of_sample.states_size(), 0) << sample.reason();
    const int fault = static_cast<int>(of_sample.states(0).others().at("fault"));
    ++seen[fault];
    const auto reason = reasons.find(fault);
    if (reason == reasons.end()) {
      EXPECT_EQ(sample.status(), "finished") << sample.reason();
      EXPECT_EQ(sample.attempts(), 1);
      ASSERT_EQ(of_sample.states_size(), 3);
      for (int k = 0; k < 3; ++k) {
        EXPECT_EQ(of_sample.states(k).values(0), sample.parameters(0) * k) << "other bits";
      }
      continue;
    }
    EXPECT_EQ(sample.status(), "unknown") << fault << ": " << sample.reason();
    EXPECT_THAT(sample.reason(), HasSubstr(absl::StrCat("failed ", kAttempts, " times, last: ")));
    EXPECT_THAT(sample.reason(), HasSubstr(reason->second));
    EXPECT_EQ(sample.attempts(), kAttempts);
    EXPECT_EQ(sample.weight(), 0);
    EXPECT_EQ(of_sample.states_size(), 1);
  }
  for (const auto& [fault, reason] : reasons) EXPECT_GT(seen[fault], 0) << reason;
}

}  // namespace
}  // namespace calib::testing
