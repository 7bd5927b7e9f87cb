#pragma once
// What a campaign gives when nothing goes wrong, and what must hold when something does.

#include <gtest/gtest.h>

#include <chrono>
#include <set>
#include <string>

#include "proto/rpc/digest.h"
#include "tests/support/deployment.h"
#include "tests/support/small_campaign.h"

namespace calib::testing {

#ifndef CALIB_SLOWER  // a sanitizer's preset says how many times
#define CALIB_SLOWER 1
#endif
inline constexpr std::chrono::seconds kLong{100 * CALIB_SLOWER};

/// The campaign of the fault tests: enough evaluations to be hit at any stage of two iterations and
/// the validation. Every lost attempt counts as a failure, so many are allowed.
inline SmallCampaign FaultCampaign() {
  return MakeSmallCampaign({.samples = 24,
                            .max_iterations = 2,
                            .load_steps = 6,
                            .failure_attempts = 100,
                            .with_validation = true});
}

/// Fingerprint of the undisturbed run, computed once per test binary.
inline const std::string& Undisturbed() {
  static const std::string bytes = [] {
    Deployment deployment({.name = "undisturbed"});
    EXPECT_TRUE(deployment.StartServer()) << deployment.Logs();
    deployment.StartWorker(2);
    Client client = deployment.client();
    const SmallCampaign campaign = FaultCampaign();
    const auto id = client.SubmitCampaign(campaign.yaml, campaign.files, "r");
    EXPECT_TRUE(id.ok()) << id.status();
    EXPECT_TRUE(client.Watch(*id, kLong).ok());
    const auto result = Fingerprint(client, *id);
    EXPECT_TRUE(result.ok()) << result.status();
    return result.value_or("");
  }();
  return bytes;
}

/// Waits for the end of c1, whatever happens to the server meanwhile.
inline bool WaitFinished(const Deployment& deployment) {
  Client client = deployment.client();
  return Eventually(kLong, [&] {
    const auto status = client.Show("c1");
    return status.ok() && status->state() == "finished";
  });
}

/// Bit for bit the undisturbed result, each sample counted once, nothing computed with other bits.
inline void ExpectUndisturbed(const Deployment& deployment) {
  Client client = deployment.client();
  const auto bytes = Fingerprint(client, "c1");
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  EXPECT_TRUE(*bytes == Undisturbed()) << "other bits than the undisturbed run";
  const auto samples = client.Samples("c1");
  ASSERT_TRUE(samples.ok()) << samples.status();
  std::set<int> indices;
  double total = 0;
  for (const v1::Sample& sample : *samples) {
    EXPECT_TRUE(indices.insert(sample.index()).second) << "sample " << sample.index();
    total += sample.weight();
  }
  EXPECT_NEAR(total, 1, 1e-12);
  // Two iterations of 24, 8 twins, and 20 draws from the posterior for the held-out test.
  EXPECT_EQ(indices.size(), 76U);
  const auto log = client.Log("c1");
  ASSERT_TRUE(log.ok()) << log.status();
  for (const v1::LogEntry& entry : *log) {
    EXPECT_EQ(entry.what().find("nondeterminism"), std::string::npos) << entry.what();
  }
}

/// States that the server has acknowledged to a client that asked for them must never vanish.
inline std::set<std::string> StatesNow(Client& client) {
  std::set<std::string> seen;
  if (const auto states = client.States("c1"); states.ok()) {
    for (const v1::SampleStates& of_sample : *states) {
      for (const v1::State& state : of_sample.states()) {
        seen.insert(std::to_string(of_sample.sample()) + " " + of_sample.experiment() + " " +
                    rpc::BytesOf(state));
      }
    }
  }
  return seen;
}

inline void ExpectContains(const std::set<std::string>& all, const std::set<std::string>& some) {
  for (const std::string& state : some) {
    EXPECT_EQ(all.count(state), 1U) << "an acknowledged state is gone: " << state.substr(0, 12);
  }
}

}  // namespace calib::testing
