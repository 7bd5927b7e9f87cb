// What is stored and cannot be told hides nothing else.
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "proto/rpc/check_message.h"
#include "server/campaign/file/text/origin.h"
#include "server/campaign/model/sha256.h"
#include "server/planning/posterior_record.h"
#include "server/service/calls.h"
#include "server/service/queries.h"
#include "server/service/server.h"
#include "server/service/state_pieces.h"
#include "server/service/submission.h"
#include "server/store/store.h"
#include "tests/support/client.h"
#include "tests/support/process.h"
#include "tests/support/small_campaign.h"

namespace calib::service {
namespace {

/// A store with some campaigns, each with one iteration that has ended.
class Answers : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = testing::FreshFolder("answers");
    auto opened = store::Store::Open(folder_ + "/calib.db");
    ASSERT_TRUE(opened.ok()) << opened.status();
    store_ = *std::move(opened);
    campaign_ = testing::MakeSmallCampaign({.samples = 2, .load_steps = 2});
    for (const auto& [path, content] : campaign_.files) {
      files_[path] = campaign::Sha256Hex(content);
    }
    Write([this](store::Transaction& t) {
      for (const auto& [path, content] : campaign_.files) t.PutBlob(files_[path], content);
    });
  }

  void Write(const store::Store::Job& job) {
    const absl::Status status = store_->WriteNow(job);
    ASSERT_TRUE(status.ok()) << status;
  }

  store::Reader Read() { return *store_->Read(); }

  void AddCampaign(std::int64_t id, const std::string& posterior,
                   const std::string& name = "sand") {
    Write([&](store::Transaction& t) {
      t.InsertCampaign({.id = id, .name = name, .yaml = campaign_.yaml, .samples = 2}, files_);
      t.InsertIteration(id, 0, "{}");
      t.SetPosterior(id, 0, posterior);
      for (int sample = 0; sample < 2; ++sample) {
        const store::EvaluationKey key{.campaign = id, .sample = sample, .experiment = 0};
        t.InsertSample(id, {.sample = sample, .parameters = {1e8, 0.4}});
        t.InsertEvaluation({.key = key, .digest = "d"});
        for (int step = 0; step < 2; ++step) {
          t.PutState({.key = key, .load_step = step, .observables = {1.0 * sample, 1.0 * step}}, 0);
        }
      }
    });
  }

  static std::string Posterior(double misfit) {
    v1::Posterior posterior;
    posterior.set_best_misfit(misfit);
    return planning::PosteriorToJson(posterior);
  }

  std::string folder_;
  testing::SmallCampaign campaign_;
  std::map<std::string, std::string> files_;
  std::unique_ptr<store::Store> store_;
};

TEST_F(Answers, OneUnreadablePosteriorIsSaidOfItsCampaignAndTheOthersAreListed) {
  AddCampaign(1, Posterior(2));
  AddCampaign(2, "{\"best_misfit\": tw");
  AddCampaign(3, Posterior(std::numeric_limits<double>::quiet_NaN()));
  store::Reader reader = Read();
  const auto list = Outgoing(ListOf(reader, *reader.Campaigns(), {}));
  ASSERT_TRUE(list.ok()) << list.status();
  ASSERT_EQ(list->campaigns_size(), 3);
  EXPECT_EQ(list->campaigns(0).problem(), "");
  EXPECT_EQ(list->campaigns(0).best_misfit(), 2);
  EXPECT_NE(list->campaigns(1).problem().find("posterior of iteration 0 cannot be read"),
            std::string::npos);
  EXPECT_EQ(list->campaigns(1).name(), "sand");
  EXPECT_EQ(list->campaigns(1).samples(), 2);
  EXPECT_EQ(list->campaigns(2).problem(), "");
}

// Of most texts two keys alone are read; of those that may mean something else all of them.
TEST_F(Answers, ATextTellsItsOriginHoweverItIsWritten) {
  const std::string model = "model:\n  contact: linear\n  effects:\n  - rolling_resistance\n";
  const std::string lineage = "lineage:\n  parent: c7\n\n  # by diagnose\n  purpose: extension\n";
  const std::string rest = "name: sand\nparameters:\n  model_like: {min: 1}\n";
  for (const std::string& text :
       {rest + model + lineage, lineage + rest + model, model + "seed: 2\n" + lineage + rest,
        "note: 90 %\n" + rest + lineage + model,
        std::string("\"lineage\": {parent: c7, purpose: extension}\n") + model,
        std::string("{model: {effects: [rolling_resistance]},\n"
                    "lineage: {parent: c7, purpose: extension}}\n"),
        std::string("model: {effects: rolling_resistance}\nlineage: {parent: c7,\n"
                    "  purpose: extension\n}\nseed: 3\n")}) {
    const campaign::Origin origin = campaign::OriginOf(text);
    EXPECT_EQ(origin.parent, "c7") << text;
    EXPECT_EQ(origin.purpose, "extension") << text;
    EXPECT_EQ(origin.effects, std::vector<std::string>{"rolling_resistance"}) << text;
  }
  EXPECT_EQ(campaign::OriginOf(rest + model).parent, "");
}

TEST_F(Answers, ListsComeByPagesAndByWhatTheyComeFrom) {
  for (const std::int64_t id : {1, 2, 3, 5}) AddCampaign(id, Posterior(2));
  campaign_.yaml += "lineage: {parent: c2, purpose: extension}\n";
  for (const std::int64_t id : {6, 7}) AddCampaign(id, Posterior(2));
  Descent descent;
  const auto ids = [&](int limit, const std::string& after, const std::string& parent = "") {
    v1::ListRequest request;
    request.set_limit(limit);
    request.set_after(after);
    request.set_parent(parent);
    store::Reader reader = Read();
    std::string text;
    const auto asked = Asked(reader, request, descent);
    if (!asked.ok()) return std::string(asked.status().message());
    for (const auto& record : *asked) text += std::to_string(record.submitted.id) + " ";
    return text;
  };
  EXPECT_EQ(ids(0, ""), "1 2 3 5 6 7 ");
  EXPECT_EQ(ids(2, ""), "1 2 ");
  EXPECT_EQ(ids(2, "c2"), "3 5 ");
  EXPECT_EQ(ids(3, "c4"), "5 6 7 ") << "one that was deleted since the page before";
  EXPECT_EQ(ids(3, "c7"), "");
  EXPECT_EQ(ids(3, "c8"), "there is no campaign \"c8\"");
  EXPECT_EQ(ids(0, "", "c2"), "6 7 ");
  EXPECT_EQ(ids(1, "c6", "c2"), "7 ");
  AddCampaign(8, Posterior(2));
  Write([](store::Transaction& t) { t.DeleteCampaign(7); });
  EXPECT_EQ(ids(0, "", "c2"), "6 8 ");
  EXPECT_EQ(ids(0, "", "c1"), "");
}

// What has finished is counted once; a batch that is added to a design is counted too.
TEST_F(Answers, WhatHasFinishedIsKnownUntilItGoesOn) {
  AddCampaign(1, Posterior(2));
  FinishedStatuses finished;
  store::Reader reader = Read();
  ASSERT_TRUE(StatusOf(reader, 1, std::nullopt, "", &finished).ok());
  EXPECT_FALSE(finished.Find(*reader.Campaign(1)).has_value()) << "it runs";
  Write([](store::Transaction& t) {
    t.SetProgress(1, {.state = store::CampaignState::kFinished, .converged = true});
  });
  store::Reader later = Read();
  const auto first = StatusOf(later, 1, std::nullopt, "", &finished);
  ASSERT_TRUE(first.ok()) << first.status();
  ASSERT_TRUE(finished.Find(*later.Campaign(1)).has_value());
  const auto again = StatusOf(later, 1, std::nullopt, "disk full", &finished);
  EXPECT_EQ(again->server_waits(), "disk full");
  EXPECT_EQ(again->best_misfit(), first->best_misfit());
  const auto list = ListOf(later, *later.Campaigns(), {}, "", &finished);
  EXPECT_EQ(list->campaigns(0).SerializeAsString(), first->SerializeAsString());
  Write([](store::Transaction& t) {
    t.SetProgress(1, {.state = store::CampaignState::kFinished, .iteration = 1});
  });
  store::Reader last = Read();
  EXPECT_EQ(StatusOf(last, 1, std::nullopt, "", &finished)->iteration(), 1);
}

TEST_F(Answers, AReasonOfMegabytesOfAnEarlierProgramIsCut) {
  AddCampaign(1, Posterior(2), "sand\nof two lines");
  Write([](store::Transaction& t) {
    t.SetProgress(1,
                  {.state = store::CampaignState::kPaused, .reason = std::string(3'000'000, 'x')});
    t.Log(1, 0, std::string(3'000'000, 'y'));
  });
  store::Reader reader = Read();
  const auto status = Outgoing(StatusOf(reader, 1, std::nullopt));
  ASSERT_TRUE(status.ok()) << status.status();
  EXPECT_LT(status->reason().size(), 10'000U);
  EXPECT_EQ(status->name(), "sand?of two lines");
  EXPECT_TRUE(Outgoing(ListOf(reader, *reader.Campaigns(), {})).ok());
  EXPECT_LT(Outgoing(absl::StatusOr<v1::LogEntry>((*LogOf(reader, 1))[0]))->what().size(), 10'000U);
}

TEST_F(Answers, AServerStartsOnNumbersThatAreNone) {
  AddCampaign(1, "no posterior");
  AddCampaign(2, Posterior(2));
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  Write([](store::Transaction& t) {
    const store::EvaluationKey key{.campaign = 1, .sample = 2, .experiment = 0};
    t.InsertSample(1, {.sample = 2, .parameters = {kNone, kNone}});
    t.InsertEvaluation({.key = key, .status = store::EvaluationStatus::kRunning, .digest = "e"});
    t.PutState({.key = key, .load_step = 0, .observables = {kNone}}, 0);
    t.InsertAttempt({.id = 1, .key = key, .worker = "w"});
    t.InsertAttempt({.id = 2, .key = key, .worker = "w"});
    t.EndAttempt({.id = 2, .core_seconds = std::numeric_limits<double>::infinity()});
    t.SetProgress(1, {.state = store::CampaignState::kRunning});
  });
  store_.reset();
  const auto server = Server::Start({.state_dir = folder_});
  ASSERT_TRUE(server.ok()) << server.status();
  testing::Client client((*server)->address());
  const auto list = client.List();
  ASSERT_TRUE(list.ok()) << list.status();
  ASSERT_EQ(list->campaigns_size(), 2);
  EXPECT_EQ(list->campaigns(0).core_hours(), 0);
  EXPECT_NE(list->campaigns(0).problem().find("cannot be read"), std::string::npos);
  EXPECT_EQ(list->campaigns(1).problem(), "");
  EXPECT_EQ(client.Samples("c1").status().code(), absl::StatusCode::kDataLoss);
  EXPECT_TRUE(client.Samples("c2").ok());
}

TEST_F(Answers, StatesComeInPiecesAndAllOfThem) {
  AddCampaign(1, Posterior(2));
  ToldExperiments told;
  StatePieces pieces(told, "c1", std::nullopt);
  std::vector<v1::SampleStates> all;
  for (int k = 0; k < 10; ++k) {
    store::Reader reader = Read();
    const auto next = pieces.Next(reader);
    ASSERT_TRUE(next.ok()) << next.status();
    if (next->empty()) break;
    all.insert(all.end(), next->begin(), next->end());
  }
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[1].sample(), 1);
  EXPECT_EQ(all[1].experiment(), "tx");
  ASSERT_EQ(all[1].states_size(), 2);
  EXPECT_EQ(all[1].states(1).values(0), 1);
  EXPECT_EQ(all[1].states(1).load_step(), 1);
  store::Reader reader = Read();
  EXPECT_EQ(StatePieces(told, "c1", 7).Next(reader).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(StatePieces(told, "c9", std::nullopt).Next(reader).status().code(),
            absl::StatusCode::kNotFound);
  StatePieces second(told, "c1", 1);
  EXPECT_EQ(second.Next(reader)->size(), 1U);
  EXPECT_TRUE(second.Next(reader)->empty());
}

/// What a submission of the small campaign is refused for under these limits; "": it is not.
class Submissions : public Answers {
 protected:
  std::string Refusal(const Limits& limits) {
    v1::SubmitRequest request;
    request.set_request_id("r");
    request.set_campaign_file(campaign_.yaml);
    request.set_file_name("campaign.yaml");
    request.mutable_files()->insert(files_.begin(), files_.end());
    store::Reader reader = Read();
    const auto checked = CheckSubmission(request, limits, reader);
    if (!checked.ok()) return std::string(checked.status().message());
    const auto* refused = std::get_if<v1::SubmitReply>(&*checked);
    if (refused == nullptr) return "";
    EXPECT_EQ(refused->problems_size(), 1);
    return refused->problems(0).message();
  }
};

TEST_F(Submissions, BeyondALimitAreRefusedWithItsOption) {
  EXPECT_EQ(Refusal({}), "");
  EXPECT_EQ(Refusal({.samples = 2, .readings = 2, .predictions = 4, .packings = 1, .grains = 64}),
            "");
  EXPECT_EQ(Refusal({.samples = 1}),
            "2 samples, and this server takes at most 1 (calibd --max-samples)");
  EXPECT_NE(Refusal({.readings = 1}).find("--max-readings"), std::string::npos);
  EXPECT_NE(Refusal({.predictions = 3}).find("--max-predictions"), std::string::npos);
  EXPECT_NE(Refusal({.packings = 0}).find("--max-packings"), std::string::npos);
  EXPECT_NE(Refusal({.grains = 63}).find("--max-grains"), std::string::npos);
  EXPECT_NE(Refusal({.campaign_mib = 0}).find("--max-campaign-mib"), std::string::npos);
}

TEST_F(Submissions, ACovarianceBeyondTheLimitIsRefusedBeforeItIsRead) {
  const std::string noise = "noise: {relative: 0.1, floor: 0.1}";
  campaign_.yaml.replace(campaign_.yaml.find(noise), noise.size(), "noise: {covariance: c.txt}");
  files_["c.txt"] = campaign::Sha256Hex("0.01 0\n0 0.01\n");
  Write([this](store::Transaction& t) { t.PutBlob(files_["c.txt"], "0.01 0\n0 0.01\n"); });
  EXPECT_EQ(Refusal({.covariance = 2}), "");
  EXPECT_NE(Refusal({.covariance = 1}).find("is of 2 readings, and this server factorises at most"),
            std::string::npos);
}

TEST_F(Submissions, WhatNoWorkerWouldTakeIsRefused) {
  const std::string density = "  density: 2650 kg/m^3\n";
  const auto with_formula = [&](std::size_t blanks) {
    std::string yaml = testing::MakeSmallCampaign({.samples = 2, .load_steps = 2}).yaml;
    yaml.insert(yaml.find(density) + density.size(),
                "  effects: [my_damping]\n"
                "  user_effects:\n"
                "    my_damping:\n"
                "      adds: normal_force\n"
                "      formula: \"c * overlap" +
                    std::string(blanks, ' ') +
                    "\"\n"
                    "      parameters:\n"
                    "        c: {unit: N/m, null: 0, prior: {prior: log_uniform, min: 0.01, max: "
                    "10}}\n");
    yaml.insert(yaml.find("experiments:"), "  my_damping.c: {prior: uniform, min: 0.01, max: 1}\n");
    return yaml;
  };
  campaign_.yaml = with_formula(1);
  EXPECT_EQ(Refusal({}), "");
  campaign_.yaml = with_formula(9000);
  EXPECT_NE(Refusal({}).find("user_effects[0].formula has 9011 bytes, at most 8192"),
            std::string::npos)
      << Refusal({});
}

}  // namespace
}  // namespace calib::service
