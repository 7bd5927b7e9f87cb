// Real processes: a server, workers, the mechanics.
#include <gtest/gtest.h>

#include <cmath>
#include <csignal>

#include "tests/support/deployment.h"
#include "tests/support/small_campaign.h"

namespace calib::testing {
namespace {

constexpr std::chrono::seconds kLong{60};

/// Runs a campaign to its end and returns everything that came out of it.
std::string RunToEnd(Deployment& deployment, const SmallCampaign& campaign) {
  Client client = deployment.client();
  const auto id =
      client.SubmitCampaign(campaign.yaml, campaign.files, "run-" + deployment.folder());
  EXPECT_TRUE(id.ok()) << id.status();
  const auto statuses = client.Watch(*id, kLong);
  EXPECT_TRUE(statuses.ok()) << statuses.status() << deployment.Logs();
  EXPECT_EQ(statuses->back().state(), "finished") << statuses->back().DebugString();
  const auto bytes = Fingerprint(client, *id);
  EXPECT_TRUE(bytes.ok()) << bytes.status();
  return bytes.value_or("");
}

TEST(Campaign, RunsToAPosteriorWithHeldOutExperiment) {
  Deployment deployment({.name = "held-out"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  deployment.StartWorker();
  deployment.StartWorker();
  RunToEnd(deployment, MakeSmallCampaign({.with_validation = true}));

  Client client = deployment.client();
  const auto status = client.Show("c1");
  EXPECT_EQ(status->phase(), "done");
  EXPECT_EQ(status->samples_done(), 8);
  const auto posterior = client.Posterior("c1");
  ASSERT_TRUE(posterior.ok()) << posterior.status();
  EXPECT_EQ(posterior->iterations(), 2);
  EXPECT_EQ(posterior->model_evaluations(), 16 + 2 * 8 + 8);  // eight twins in both tests
  ASSERT_EQ(posterior->parameters_size(), 2);
  EXPECT_EQ(posterior->parameters(0).name(), "young_modulus");
  EXPECT_GT(posterior->parameters(0).sd(), 0);

  const auto samples = client.Samples("c1");
  ASSERT_TRUE(samples.ok());
  EXPECT_EQ(samples->size(), 32U);
  double total = 0;
  for (const v1::Sample& sample : *samples) {
    EXPECT_EQ(sample.status(), "finished");
    EXPECT_EQ(sample.attempts() >= 1, true);
    EXPECT_EQ(std::isfinite(sample.log_likelihood()), sample.iteration() < 2);
    if (sample.iteration() >= 2) {
      EXPECT_EQ(sample.weight(), 0);
      EXPECT_EQ(sample.purpose(), sample.iteration() == 2 ? "replicate" : "draw");
    }
    total += sample.weight();
  }
  EXPECT_NEAR(total, 1, 1e-12);
  // Held out: run for the twins and for draws from the posterior (16 samples have to be emulated),
  // none of them counted in it.
  const auto states = client.States("c1");
  std::size_t held_out = 0;
  for (const v1::SampleStates& of_sample : *states) {
    EXPECT_EQ(of_sample.states_size(), 4);
    held_out += of_sample.experiment() == "tx2" ? 1 : 0;
  }
  EXPECT_EQ(held_out, 8U + 8U);
  EXPECT_EQ(states->size(), 16 + 8 + held_out);
  EXPECT_EQ(status->model_evaluations(), static_cast<std::int64_t>(16 + 8 + held_out));
}

TEST(Campaign, SameBitsForAnyNumberOfWorkers) {
  const SmallCampaign campaign = MakeSmallCampaign({});
  std::string first;
  for (const int workers : {1, 3}) {
    Deployment deployment({.name = "bits-" + std::to_string(workers)});
    ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
    for (int i = 0; i < workers; ++i) {
      deployment.StartWorker(workers);
    }
    const std::string bytes = RunToEnd(deployment, campaign);
    if (first.empty()) {
      first = bytes;
    }
    EXPECT_EQ(bytes, first) << workers << " workers";
  }
}

TEST(Campaign, EqualEvaluationsAreNotRunAgain) {
  Deployment deployment({.name = "reuse"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  deployment.StartWorker(2);
  const SmallCampaign campaign = MakeSmallCampaign({});
  RunToEnd(deployment, campaign);
  Client client = deployment.client();
  const auto again = client.SubmitCampaign(campaign.yaml, campaign.files, "again");
  ASSERT_TRUE(client.Watch(*again, kLong).ok());
  EXPECT_EQ(*again, "c2");
  EXPECT_EQ(client.Show("c2")->state(), "finished");
  EXPECT_EQ(client.Show("c2")->model_evaluations(), 0);
  EXPECT_EQ(client.Posterior("c2")->parameters(0).SerializeAsString(),
            client.Posterior("c1")->parameters(0).SerializeAsString());
}

TEST(Campaign, PausesResumesCancelsAndIsDeleted) {
  Deployment deployment({.name = "control"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  Client client = deployment.client();
  const SmallCampaign campaign = MakeSmallCampaign({});
  ASSERT_TRUE(client.SubmitCampaign(campaign.yaml, campaign.files, "r").ok());
  v1::ControlRequest request;
  request.set_campaign("c1");
  request.set_request_id("pause-1");
  EXPECT_EQ(client.Pause(request)->state(), "paused");
  EXPECT_TRUE(client.Pause(request).ok()) << "the same request again gets the first answer";
  request.set_request_id("pause-2");
  EXPECT_EQ(client.Pause(request).status().code(), absl::StatusCode::kFailedPrecondition);
  request.set_request_id("pause-1");
  EXPECT_EQ(client.Resume(request).status().code(), absl::StatusCode::kAlreadyExists);

  deployment.StartWorker();
  ASSERT_TRUE(Eventually(kLong, [&] { return client.Workers()->workers_size() == 1; }));
  EXPECT_EQ(client.Show("c1")->samples_done(), 0) << "a paused campaign is not worked on";
  request.set_request_id("");
  EXPECT_EQ(client.Delete(request).code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(client.Resume(request)->state(), "running");
  ASSERT_TRUE(Eventually(kLong, [&] { return client.Show("c1")->samples_done() > 0; }));
  EXPECT_EQ(client.Cancel(request)->state(), "cancelled");
  EXPECT_TRUE(Eventually(kLong, [&] { return client.Workers()->workers(0).busy() == 0; }));
  EXPECT_TRUE(client.Delete(request).ok());
  EXPECT_EQ(client.Show("c1").status().code(), absl::StatusCode::kNotFound);
}

TEST(Campaign, SubmissionIsIdempotentAndBadOnesAreRefused) {
  Deployment deployment({.name = "submit"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  Client client = deployment.client();
  const SmallCampaign campaign = MakeSmallCampaign({});
  EXPECT_EQ(*client.SubmitCampaign(campaign.yaml, campaign.files, "r"), "c1");
  EXPECT_EQ(*client.SubmitCampaign(campaign.yaml, campaign.files, "r"), "c1");
  EXPECT_EQ(client.SubmitCampaign(campaign.yaml + "\n", campaign.files, "r").status().code(),
            absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(*client.SubmitCampaign(campaign.yaml, campaign.files, "s"), "c2");
  EXPECT_EQ(client.SubmitCampaign("name: x\n", {}, "t").status().code(),
            absl::StatusCode::kInvalidArgument);
  v1::SubmitRequest request;
  request.set_request_id("u");
  request.set_campaign_file(campaign.yaml);
  (*request.mutable_files())["data.txt"] = std::string(64, '0');
  EXPECT_EQ(client.Submit(request).status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(client.List()->campaigns_size(), 2);
}

TEST(Worker, LeavesWithExitCodeZeroWhenToldToOrDrained) {
  Deployment deployment({.name = "leave"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  Client client = deployment.client();
  const SmallCampaign campaign = MakeSmallCampaign({.samples = 200, .max_iterations = 1});
  ASSERT_TRUE(client.SubmitCampaign(campaign.yaml, campaign.files, "r").ok());
  deployment.StartWorker();
  ASSERT_TRUE(Eventually(kLong, [&] { return client.Show("c1")->samples_done() >= 2; }));
  deployment.workers()[0].Signal(SIGTERM);
  EXPECT_EQ(deployment.workers()[0].Wait(kLong), 0) << deployment.Logs();
  EXPECT_TRUE(Eventually(kLong, [&] { return client.Show("c1")->samples_running() == 0; }))
      << "what it stopped is back in the queue";

  deployment.StartWorker();
  ASSERT_TRUE(Eventually(kLong, [&] { return client.Show("c1")->samples_running() > 0; }));
  EXPECT_TRUE(client.Drain("w2")->draining());
  EXPECT_EQ(deployment.workers()[1].Wait(kLong), 0) << deployment.Logs();
  deployment.server().Signal(SIGTERM);
  EXPECT_EQ(deployment.server().Wait(kLong), 0) << deployment.Logs();
}

TEST(Worker, OfAnotherBuildIsToldToUpdate) {
  Deployment deployment({.name = "build"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  v1::Hello hello = MatchingHello("old", 1);
  hello.set_engine_version("0");
  Client client = deployment.client();
  {
    FakeWorker worker(deployment.address(), hello);
    const auto welcome = worker.Receive(kLong);
    ASSERT_TRUE(welcome.has_value());
    EXPECT_NE(welcome->welcome().waits().find("mechanics version 0"), std::string::npos);
    const auto listed = client.Workers();
    ASSERT_TRUE(listed.ok()) << listed.status();
    ASSERT_EQ(listed->workers_size(), 1);
    EXPECT_EQ(listed->workers(0).waits(), welcome->welcome().waits());
    EXPECT_EQ(client.Examine()->refused_size(), 0) << "it waits";
  }
  FakeWorker updated(deployment.address(), MatchingHello("old", 1));
  const auto welcome = updated.Receive(kLong);
  ASSERT_TRUE(welcome.has_value());
  EXPECT_EQ(welcome->welcome().waits(), "");
}

TEST(Worker, UnderANameThatIsTakenIsToldToTakeAnother) {
  Deployment deployment({.name = "name"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  v1::Hello hello = MatchingHello("w1", 1);
  hello.set_instance("1");
  FakeWorker first(deployment.address(), hello);
  ASSERT_TRUE(first.Receive(kLong).has_value());
  const auto start_w1 = [&] {
    return Process({Program("calib-worker"), "--server", deployment.address(), "--name", "w1"},
                   deployment.folder() + "/worker-of-the-name.log");
  };
  EXPECT_EQ(start_w1().Wait(kLong), 1);
  EXPECT_NE(deployment.Logs().find("a worker w1 is connected already"), std::string::npos);
  Client client = deployment.client();
  const auto report = client.Examine();
  ASSERT_TRUE(report.ok()) << report.status();
  ASSERT_EQ(report->refused_size(), 1);
  EXPECT_NE(report->refused(0).reason().find("another --name"), std::string::npos);
  ASSERT_EQ(client.Workers()->workers_size(), 1);
  EXPECT_TRUE(client.Workers()->workers(0).connected()) << "the first is left alone";

  first.Cut();  // as by a kill
  ASSERT_TRUE(Eventually(kLong, [&] { return !client.Workers()->workers(0).connected(); }));
  Process next = start_w1();
  EXPECT_TRUE(Eventually(kLong, [&] { return client.Workers()->workers(0).connected(); }))
      << "its name is free at once";
  EXPECT_EQ(client.Examine()->refused_size(), 0);
  ASSERT_TRUE(client.Drain("w1").ok());
  EXPECT_EQ(next.Wait(kLong), 0);
  EXPECT_TRUE(Eventually(kLong, [&] { return client.Workers()->workers(0).left(); }));
}

TEST(Server, SecondOneOnTheSameFolderIsToldWhoServesIt) {
  Deployment deployment({.name = "second"});
  ASSERT_TRUE(deployment.StartServer()) << deployment.Logs();
  Process second({Program("calibd"), "--state", deployment.state(), "--listen", "127.0.0.1:0"},
                 deployment.folder() + "/second.log");
  EXPECT_EQ(second.Wait(kLong), 1);
  EXPECT_NE(deployment.Logs().find("is served by process"), std::string::npos);
  EXPECT_NE(deployment.Logs().find(deployment.address()), std::string::npos);
}

}  // namespace
}  // namespace calib::testing
