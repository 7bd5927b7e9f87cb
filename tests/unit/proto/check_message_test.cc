// Each rule of each field is broken and, by its nearest neighbour, kept.
#include "proto/rpc/check_message.h"

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "calib/v1/campaign.pb.h"
#include "calib/v1/common.pb.h"
#include "calib/v1/worker.pb.h"
#include "tests/support/broken_messages.h"

namespace calib::rpc {
namespace {

using google::protobuf::Descriptor;

void ForEveryMessage(const std::function<void(const Descriptor&)>& visit) {
  const std::function<void(const Descriptor&)> go = [&](const Descriptor& type) {
    if (type.options().map_entry()) return;
    visit(type);
    for (int k = 0; k < type.nested_type_count(); ++k) go(*type.nested_type(k));
  };
  for (const auto* file :
       {v1::Problem::descriptor()->file(), v1::WorkerMessage::descriptor()->file(),
        v1::SubmitRequest::descriptor()->file()}) {
    for (int k = 0; k < file->message_type_count(); ++k) go(*file->message_type(k));
  }
}

TEST(CheckMessage, EveryFieldThatNeedsARuleHasOne) {
  EXPECT_THAT(ProblemsOfRules(), ::testing::IsEmpty());
}

TEST(CheckMessage, EveryRuleIsKeptByItsNeighbourAndBrokenBeyondIt) {
  int broken = 0;
  ForEveryMessage([&broken](const Descriptor& type) {
    EXPECT_EQ(CheckMessage(*testing::GoodMessage(type)), absl::OkStatus())
        << std::string(type.full_name());
    testing::ForEveryTrial(type, [&broken](const testing::Trial& trial) {
      const absl::Status status = CheckMessage(*trial.message);
      EXPECT_EQ(status.ok(), !trial.is_broken)
          << std::string(trial.field->full_name()) << ", " << trial.what << ": " << status;
      if (trial.is_broken) {
        ++broken;
        EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
        EXPECT_THAT(std::string(status.message()),
                    ::testing::HasSubstr(std::string(trial.field->name())));
      }
    });
  });
  EXPECT_GT(broken, 300);
}

TEST(CheckMessage, SaysWhereAndWhatIsAllowed) {
  v1::WorkerMessage message;
  message.mutable_finished()->set_attempt(7);
  message.mutable_finished()->set_core_seconds(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(CheckMessage(message).message(),
            "WorkerMessage.finished.core_seconds is nan, it has to be finite and at least 0 and at "
            "most 1e+12");
  v1::WorkerMessage states;
  states.mutable_states()->set_attempt(7);
  states.mutable_states()->add_states()->add_values(1);
  states.mutable_states()->add_states()->add_values(std::numeric_limits<double>::infinity());
  EXPECT_EQ(CheckMessage(states).message(),
            "WorkerMessage.states.states[1].values[0] is inf, it has to be finite");
}

}  // namespace
}  // namespace calib::rpc
