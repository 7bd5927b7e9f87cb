// A method that no room holds: who adds one writes a class of campaign::Method with its planner,
// and names it in a list. The reader, the schema and the scheduler take it from there.
#include <gmock/gmock.h>

#include "inference/filter/iterative_filter.h"
#include "server/campaign/file/shared/map_reader.h"
#include "server/methods/registry.h"
#include "server/planning/planner.h"
#include "server/planning/posterior_record.h"
#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

using ::testing::HasSubstr;

// Batches of one proposal, the prior; the last one's weights are the posterior's.
class PriorPlanner final : public planning::Planner {
 public:
  PriorPlanner(const planning::Definition& definition, int batches)
      : definition_(definition), batches_(batches) {}

  absl::StatusOr<planning::Batch> First() const override { return Draw(0); }

  absl::StatusOr<planning::Outcome> Conclude(const planning::History& history,
                                             bool affordable) const override {
    auto answer = planning::FindAnswer(definition_, history.iterations);
    if (!answer.ok()) return answer.status();
    planning::Outcome outcome{.answer = *std::move(answer), .log = "drawn", .next = {}};
    const auto made = static_cast<int>(history.iterations.size());
    if (affordable && made < batches_) {
      auto next = Draw(made);
      if (!next.ok()) return next.status();
      outcome.next = *std::move(next);
    }
    return outcome;
  }

 private:
  absl::StatusOr<planning::Batch> Draw(int batch) const {
    const campaign::Campaign& campaign = definition_.campaign;
    const inference::Proposal prior;
    auto drawn =
        inference::DrawSamples(prior, definition_.priors, campaign.filter, batch, campaign.samples);
    if (!drawn.ok()) return drawn.status();
    const std::vector<double> never(static_cast<std::size_t>(drawn->rows()), store::kUnknown);
    return planning::Batch{.proposal = planning::ProposalToJson(prior),
                           .parameters = *std::move(drawn),
                           .stop_below = never,
                           .refused = {}};
  }

  const planning::Definition& definition_;
  const int batches_;
};

class OneMoreMethod final : public campaign::Method {
 public:
  std::string name() const override { return "one_more_method"; }
  bool weighs_samples() const override { return true; }

  int MostBatches(const campaign::Campaign& /*campaign*/) const override { return batches_; }

  std::vector<campaign::Section> Keys() const override {
    return {{"inference",
             "inference",
             {{"batches", campaign::Whole(1, 9), "1", "one_more_method: batches of the prior"}}}};
  }

  std::shared_ptr<const campaign::Method> Read(campaign::MapReader& inference,
                                               campaign::Campaign& /*campaign*/) const override {
    auto read = std::make_shared<OneMoreMethod>();
    read->batches_ = static_cast<int>(inference.Integer("batches").value_or(1));
    return read;
  }

  std::unique_ptr<planning::Planner> MakePlanner(
      const planning::Definition& definition) const override {
    return std::make_unique<PriorPlanner>(definition, batches_);
  }

 private:
  int batches_ = 1;
};

const campaign::MethodList& WithOneMore() {
  static const campaign::MethodList all = [] {
    auto methods = methods::All().all();
    methods.push_back(std::make_shared<OneMoreMethod>());
    return campaign::MethodList(std::move(methods));
  }();
  return all;
}

testing::SmallCampaign WithMethod(const std::string& method, const std::string& inference) {
  return testing::MakeSmallCampaign({.samples = 12, .method = method, .inference = inference});
}

std::string FirstProblem(const campaign::MethodList& methods, const testing::SmallCampaign& c) {
  const auto read = [&c](const std::string& path) -> absl::StatusOr<std::string> {
    const auto found = c.files.find(path);
    return found != c.files.end() ? absl::StatusOr<std::string>(found->second)
                                  : absl::NotFoundError(path);
  };
  const auto outcome = campaign::ReadCampaign(methods, c.yaml, "c.yaml", read);
  return outcome.problems.empty() ? "" : campaign::ToString(outcome.problems.front());
}

TEST(OneMoreMethod, IsReadByTheListAlone) {
  const auto campaign = WithMethod("one_more_method", "  batches: 3\n");
  EXPECT_EQ(FirstProblem(WithOneMore(), campaign), "");
  EXPECT_THAT(FirstProblem(methods::All(), campaign), HasSubstr("one_more_method"));
  EXPECT_THAT(
      FirstProblem(WithOneMore(), WithMethod("iterative_bayesian_filter", "  batches: 3\n")),
      HasSubstr("batches: belongs to method: one_more_method; remove it"));
  EXPECT_THAT(FirstProblem(WithOneMore(), WithMethod("one_more_method", "  batches: 10\n")),
              HasSubstr("'10' is not a whole number from 1 to 9"));
}

TEST(OneMoreMethod, RunsWithTheSameBitsWhateverGoesWrong) {
  const auto campaign = WithMethod("one_more_method", "  batches: 3\n");
  SimulatedService calm("one_more_calm", WithOneMore());
  calm.Submit(campaign);
  calm.RunToEnd(1, true);
  const auto progress = Value(calm.Read().Campaign(1)).progress;
  EXPECT_EQ(progress.state, store::CampaignState::kFinished) << progress.reason;
  EXPECT_GE(Value(calm.Read().Iterations(1)).size(), 3U);
  for (unsigned seed = 1; seed <= 3; ++seed) {
    SimulatedService storm("one_more_storm", WithOneMore());
    storm.Submit(campaign);
    storm.RunToEnd(seed, false);
    EXPECT_EQ(storm.Fingerprint(), calm.Fingerprint()) << seed;
  }
}

// What another build accepted is not lost for one that cannot read it.
TEST(OneMoreMethod, ABuildWithoutItPausesItsCampaignsAndOneWithItGoesOn) {
  const auto campaign = WithMethod("one_more_method", "  batches: 2\n");
  SimulatedService calm("one_more_kept", WithOneMore());
  calm.Submit(campaign);
  calm.RunToEnd(1, true);
  SimulatedService service("one_more_lost", WithOneMore());
  service.Submit(campaign);
  service.Submit(WithMethod("iterative_bayesian_filter", ""));
  for (int again = 0; again < 2; ++again) {
    service.RestartWith(methods::All());
    const auto progress = Value(service.Read().Campaign(1)).progress;
    EXPECT_EQ(progress.state, store::CampaignState::kPaused);
    EXPECT_THAT(progress.reason, HasSubstr("this program refuses the campaign as submitted"));
    EXPECT_THAT(progress.reason, HasSubstr("one_more_method"));
  }
  absl::Status answer;
  service.scheduler().Resume(1, nullptr, [&](const absl::Status& status) { answer = status; });
  service.ports().Run();
  EXPECT_EQ(answer.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(answer.message()), HasSubstr("one_more_method"));
  const std::int64_t worker = service.Connect("w", 1);
  EXPECT_TRUE(service.Next(worker, v1::ServerMessage::kLease).has_lease()) << "of the other";
  service.scheduler().Cancel(2, nullptr, [](const absl::Status&) {});
  service.ports().Run();
  service.RestartWith(WithOneMore());
  EXPECT_EQ(Value(service.Read().Campaign(1)).progress.state, store::CampaignState::kPaused);
  service.scheduler().Resume(1, nullptr, [&](const absl::Status& status) { answer = status; });
  service.ports().Run();
  EXPECT_TRUE(answer.ok()) << answer;
  service.RunToEnd(1, true);
  EXPECT_EQ(Value(service.Read().Campaign(1)).progress.state, store::CampaignState::kFinished);
  EXPECT_TRUE(service.Runs(1) == calm.Runs(1));
}

TEST(OneMoreMethod, ACampaignThatNobodyCanReadIsCancelled) {
  SimulatedService service("one_more_cancelled", WithOneMore());
  service.Submit(WithMethod("one_more_method", ""));
  service.RestartWith(methods::All());
  absl::Status answer = absl::UnknownError("none");
  service.scheduler().Cancel(1, nullptr, [&](const absl::Status& status) { answer = status; });
  service.ports().Run();
  EXPECT_TRUE(answer.ok()) << answer;
  EXPECT_EQ(Value(service.Read().Campaign(1)).progress.state, store::CampaignState::kCancelled);
}

}  // namespace
}  // namespace calib::scheduler
