// Runs that are added to a design.
#include <memory>
#include <new>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/planning/growth.h"
#include "server/scheduler/scheduler.h"

namespace calib::scheduler {
namespace {

absl::StatusOr<planning::Growth> ReadAndGrow(Ports& ports, const campaign::MethodList& methods,
                                             const planning::NewRuns& runs) {
  try {
    ASSIGN_OR_RETURN(auto reader, ports.Read());
    return planning::PlanGrowth(methods, reader, runs);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(
        absl::StrCat("campaign c", runs.campaign, " needs more memory than there is now"));
  }
}

}  // namespace

void Scheduler::AddRuns(const planning::NewRuns& runs, const GrowthReply& reply) {
  // An empty write: when it is done, memory has seen the end of what a reader could have seen end.
  ports_.Write([](store::Transaction&) {},
               [this, runs, reply](const absl::Status& status) {
                 if (status.ok()) {
                   Grow(runs, reply);
                 } else {
                   reply(status);
                 }
               });
}

void Scheduler::Grow(const planning::NewRuns& runs, const GrowthReply& reply) {
  if (IsLoading(
          runs.campaign, [this, runs, reply] { Grow(runs, reply); },
          [reply](const absl::Status& why) { reply(why); })) {
    return;
  }
  // Of a live campaign nothing but whether the batch is there.
  const bool live = FindRun(runs.campaign) != nullptr;
  if (const absl::Status full = WhyNoMore(); !live && !full.ok()) {
    reply(full);
    return;
  }
  if (!live) {
    loading_.try_emplace(runs.campaign);
  }
  ports_.Load([this, runs, reply, live]() -> std::function<void()> {
    auto growth = std::make_shared<absl::StatusOr<planning::Growth>>(
        ReadAndGrow(ports_, *options_.methods, runs));
    return [this, runs, reply, live, growth] {
      if (growth->ok() && !(*growth)->is_there && live) {
        AddRuns(runs, reply);  // it has finished since
      } else if (growth->ok() && !(*growth)->is_there) {
        WriteGrowth(runs.campaign, **growth, reply);
      } else {
        reply(growth->ok() ? absl::StatusOr<bool>(false) : growth->status());
        if (!live) {
          DoneLoading(runs.campaign);
        }
      }
    };
  });
}

void Scheduler::WriteGrowth(std::int64_t campaign, const planning::Growth& growth,
                            const GrowthReply& reply) {
  ports_.Write(
      [growth, campaign, now = ports_.UnixMs()](store::Transaction& transaction) {
        planning::Write(growth.plan, campaign, growth.progress, now, transaction);
      },
      [this, campaign, reply](const absl::Status& status) {
        reply(status.ok() ? absl::StatusOr<bool>(true) : status);
        if (status.ok()) {
          LoadAside(campaign);
        } else {
          DoneLoading(campaign);
        }
      });
}

}  // namespace calib::scheduler
