// Who runs what next: leases are granted, held and released.
#include <algorithm>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/messages/attempt_spec.h"
#include "server/scheduler/scheduler.h"

namespace calib::scheduler {

using store::EvaluationKey;
using store::EvaluationStatus;
using store::Transaction;

namespace {

/// Leases granted in one turn of the strand. Chosen: some milliseconds of it, at a tenth of one
/// each.
constexpr int kGrantsPerTurn = 64;

}  // namespace

Shares::Holding Scheduler::HoldingOf(const LeaseEntry& lease) {
  return {.owner = lease.owner,
          .campaign = lease.key.campaign,
          .attempt = lease.attempt,
          .slots = lease.slots};
}

void Scheduler::Dispatch() {
  if (waiting_.empty() || !workers_.AnyFree()) {
    return;
  }
  FairLine line(shares_);
  WorkerTable::Others held_free;  // for runs that need more slots than any worker has free
  std::set<std::string> waits;    // owners of these
  std::set<std::string> saves;    // who hold too much of their quota for their next run
  for (const WaitingRuns::Group& group : waiting_.Groups()) {
    Enter(line, group);
  }
  for (int granted = 0; !line.empty() && workers_.AnyFree();) {
    if (granted == kGrantsPerTurn) {
      if (!std::exchange(dispatches_later_, true)) {
        ports_.Later([this] {
          dispatches_later_ = false;
          Dispatch();
        });
      }
      return;
    }
    const FairLine::Place next = line.Take();
    if (WaitsForAnother(next.first)) {  // since another group was leased the same
      Enter(line, next.group);
      continue;
    }
    const WorkerTable::Choice choice = WorkerFor(next.group, held_free);
    if (choice.worker == nullptr || saves.count(next.owner) > 0) {
      continue;
    }
    if (choice.slots > shares_.Left(next.owner)) {
      if (choice.slots <= shares_.Quota(next.owner)) saves.insert(next.owner);
      continue;
    }
    if (choice.missing > 0) {  // smaller runs would take for ever what becomes free
      if (choice.slots > 1 && waits.insert(next.owner).second) {
        held_free.insert(choice.worker->hello.name());
      }
      continue;
    }
    Grant(choice, next.first);
    ++granted;
    line.Served(next.owner, next.first.campaign);
    Enter(line, next.group);
  }
}

void Scheduler::Enter(FairLine& line, const WaitingRuns::Group& group) {
  auto key = waiting_.First(group);
  while (key.has_value() && WaitsForAnother(*key)) {
    key = waiting_.First(group);
  }
  if (key.has_value()) {
    const store::CampaignRecord& record = FindRun(key->campaign)->record();
    line.Enter({.first = *key,
                .group = group,
                .owner = record.submitted.owner,
                .priority = record.priority});
  }
}

WorkerTable::Choice Scheduler::WorkerFor(const WaitingRuns::Group& group,
                                         const WorkerTable::Others& without) {
  const auto& [campaign, held_in] = group;
  const auto needs = [run = FindRun(campaign)](const WorkerTable::Kind& kind) {
    return run->SlotsOf(kind);
  };
  return held_in.empty() || !workers_.IsThere(held_in) ? workers_.Freest(needs, without)
                                                       : workers_.FreestAt(held_in, needs, without);
}

void Scheduler::Hold(const LeaseEntry& lease) {
  leases_.Grant(lease);
  shares_.Take(HoldingOf(lease));
  workers_.SetBusy(lease.worker, leases_.Busy(lease.worker));
  UnderWay(lease.shared);
}

std::optional<LeaseEntry> Scheduler::Release(std::int64_t attempt) {
  std::optional<LeaseEntry> lease = leases_.Release(attempt);
  if (lease.has_value()) {
    shares_.Return(HoldingOf(*lease));
    workers_.SetBusy(lease->worker, leases_.Busy(lease->worker));
    NoLongerUnderWay(lease->shared);
    WorkersChanged();
  }
  return lease;
}

void Scheduler::Grant(const WorkerTable::Choice& choice, const EvaluationKey& key) {
  const WorkerEntry& worker = *choice.worker;
  CampaignRun& run = *FindRun(key.campaign);  // the queue holds live campaigns only
  const std::int64_t attempt = ++last_attempt_;
  Hold({.attempt = attempt,
        .key = key,
        .worker = worker.hello.name(),
        .owner = run.record().submitted.owner,
        .slots = choice.slots,
        .shared = SharedDigest(key),
        .started = ports_.Now()});
  const int failures = run.Find(key)->failures;
  SetStatus(run, key, EvaluationStatus::kRunning, failures);
  Changed(key.campaign);
  WorkersChanged();
  if (run.state() == CampaignState::kQueued) {
    SetState(run, planning::CampaignEvent::kStart, "", nullptr, [](const absl::Status&) {});
  }
  v1::ServerMessage message;
  *message.mutable_lease() =
      messages::LeaseOf(run.definition().campaign, key.experiment, run.RunOfSample(key.sample));
  message.mutable_lease()->set_attempt(attempt);
  const double memory = worker.hello.memory() * choice.slots / worker.hello.slots();
  messages::SetResources(
      run.definition().campaign,
      {.threads = worker.hello.threads_per_slot() * choice.slots, .memory = memory},
      *message.mutable_lease());
  const CampaignRun::Evaluation& evaluation = *run.Find(key);
  if (message.lease().has_spec()) message.mutable_lease()->set_run(evaluation.digest);
  if (evaluation.rest_after.has_value()) {
    message.mutable_lease()->set_rest_after(*evaluation.rest_after);
  }
  Write(
      key.campaign,
      [key, failures,
       record = store::NewAttempt{.id = attempt,
                                  .key = key,
                                  .worker = worker.hello.name(),
                                  .cpu = worker.hello.cpu(),
                                  .engine = worker.hello.engine_version(),
                                  .started_unix_ms = ports_.UnixMs()}](Transaction& t) {
        t.InsertAttempt(record);
        t.SetEvaluation(key, EvaluationStatus::kRunning, "", failures);
      },
      [this, attempt, session = worker.session, name = worker.hello.name(),
       message = std::move(message)](const absl::Status& status) {
        // It is named from when it is sent: until now nobody could.
        if (status.ok() && leases_.Named(attempt, name, ports_.Now())) {
          ports_.Send(session, message);
        }
      });
}

}  // namespace calib::scheduler
