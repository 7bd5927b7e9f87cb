// Workers: their links, leases and messages. Campaigns: scheduler.cc.
#include <algorithm>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "server/campaign/model/sha256.h"
#include "server/messages/attempt_spec.h"
#include "server/messages/others.h"
#include "server/scheduler/scheduler.h"

namespace calib::scheduler {

using store::AttemptOutcome;
using store::EvaluationKey;
using store::EvaluationStatus;
using store::Transaction;

namespace {

/// A worker that left is still shown this long.
constexpr std::chrono::minutes kRemembered{10};
/// Attempts that a worker may name, by slot: those leased, and those of a lease that has expired
/// while it was frozen, twice over.
constexpr int kAttemptsPerSlot = 4;
/// Leases granted in one turn of the strand. Chosen: some milliseconds of it, at a tenth of one
/// each.
constexpr int kGrantsPerTurn = 64;
/// Share of a lease: a server whose tick is later has stood still. Chosen: twice what is between
/// ticks at most (Core), and the other half is time enough to be heard in.
constexpr double kStoodStill = 0.5;
/// Attempts that one heartbeat gets refused; the next gets the rest. Chosen: some times those of a
/// node with many slots, and few enough that a flood of heartbeats is no flood of answers.
constexpr int kRefusedAtOnce = 64;

absl::Status TooManyAttempts(const v1::Hello& hello, int attempts) {
  return attempts <= static_cast<std::int64_t>(kAttemptsPerSlot) * hello.slots()
             ? absl::OkStatus()
             : absl::InvalidArgumentError(absl::StrCat("worker ", hello.name(), " names ", attempts,
                                                       " attempts, more than its ", hello.slots(),
                                                       " slots can hold"));
}

v1::Finished Because(std::int64_t attempt, const std::string& reason) {
  v1::Finished finished;
  finished.set_attempt(attempt);
  finished.set_reason(reason);
  return finished;
}

Shares::Holding HoldingOf(const LeaseEntry& lease) {
  return {.owner = lease.owner,
          .campaign = lease.key.campaign,
          .attempt = lease.attempt,
          .slots = lease.slots};
}

std::string NameOf(const CampaignRun& run, const EvaluationKey& key) {
  return absl::StrCat(
      "sample ", key.sample, ", experiment ",
      run.definition().campaign.experiments[static_cast<std::size_t>(key.experiment)].name);
}

}  // namespace

absl::Status Scheduler::Admit(const v1::Hello& hello) const {
  if (hello.slots() > options_.most_slots) {
    return absl::FailedPreconditionError(absl::StrCat(
        "worker ", hello.name(), " has ", hello.slots(), " slots, the server takes at most ",
        options_.most_slots, " of one (calibd --max-slots): start it with fewer --slots"));
  }
  if (absl::Status status = TooManyAttempts(hello, hello.attempts_size()); !status.ok()) {
    return status;
  }
  if (hello.engine_version() != dem::EngineVersion()) {
    return absl::FailedPreconditionError(
        absl::StrCat("worker ", hello.name(), " has mechanics version ", hello.engine_version(),
                     ", the server ", dem::EngineVersion(), ": update the node"));
  }
  if (hello.catalog_digest() != campaign::Sha256Hex(dem::CatalogText())) {
    return absl::FailedPreconditionError(
        absl::StrCat("worker ", hello.name(),
                     " offers other contacts, effects or tests than the server: update the node"));
  }
  const Clock::time_point now = ports_.Now();
  if (workers_.IsAnother(hello, leases_.HeardSince(now))) {
    const Clock::duration silence = now - workers_.all().at(hello.name()).heard;
    return absl::AlreadyExistsError(
        absl::StrCat("a worker ", hello.name(), " is connected already and was heard ",
                     std::chrono::duration_cast<std::chrono::seconds>(silence).count(),
                     " s ago: give this one another --name"));
  }
  return absl::OkStatus();
}

absl::Status Scheduler::Connected(std::int64_t session, const v1::Hello& hello) {
  constexpr std::size_t kRemembered = 16;
  std::erase_if(refused_,
                [&](const v1::RefusedWorker& worker) { return worker.name() == hello.name(); });
  if (absl::Status admitted = Admit(hello); !admitted.ok()) {
    if (refused_.size() == kRemembered) {
      refused_.erase(refused_.begin());
    }
    v1::RefusedWorker& worker = refused_.emplace_back();
    worker.set_name(hello.name());
    worker.set_reason(std::string(admitted.message()));
    worker.set_unix_ms(ports_.UnixMs());
    return admitted;
  }
  const Clock::time_point now = ports_.Now();
  FitSlots(hello);
  if (const std::int64_t before = workers_.Connect(hello, session, leases_.Busy(hello.name()), now);
      before != 0) {
    ports_.Close(before, absl::AbortedError("the worker has opened another stream"));
  }
  v1::ServerMessage welcome;
  welcome.mutable_welcome()->set_heartbeat_ms(static_cast<int>(options_.heartbeat.count()));
  welcome.mutable_welcome()->set_lease_ms(static_cast<int>(options_.lease.count()));
  welcome.mutable_welcome()->set_gather_ms(
      static_cast<int>(std::min(options_.gather, options_.heartbeat).count()));
  ports_.Send(session, std::move(welcome));
  if (workers_.Find(hello.name())->draining) {  // it may have missed the message
    SendDrain(*workers_.Find(hello.name()));
  }

  const std::set<std::int64_t> held(hello.attempts().begin(), hello.attempts().end());
  leases_.Heard(hello.name(), now);
  for (const std::int64_t attempt : held) {
    if (!leases_.Named(attempt, hello.name(), now)) {
      Refuse(session, attempt);
    }
  }
  for (const LeaseEntry& lease : leases_.OfWorker(hello.name())) {
    if (held.count(lease.attempt) == 0) {
      Release(lease.attempt);
      GiveBack(lease, Because(lease.attempt, "the worker came back without it"),
               AttemptOutcome::kLost, true);
    }
  }
  WorkersChanged();
  Dispatch();
  return absl::OkStatus();
}

// Those that are known from the store alone, or it has come back with other slots.
void Scheduler::FitSlots(const v1::Hello& hello) {
  for (const LeaseEntry& lease : leases_.OfWorker(hello.name())) {
    const int slots = std::max(1, FindRun(lease.key.campaign)->SlotsOf(WorkerTable::KindOf(hello)));
    if (slots != lease.slots) {
      shares_.Return(HoldingOf(lease));
      leases_.Resize(lease.attempt, slots);
      shares_.Take(HoldingOf(*leases_.Find(lease.attempt, hello.name())));
    }
  }
}

void Scheduler::Disconnected(std::int64_t session) {
  // Its leases stay: the worker may only have lost the connection and go on computing.
  workers_.Disconnect(session);
  WorkersChanged();
}

void Scheduler::SendDrain(const WorkerEntry& worker) {
  v1::ServerMessage message;
  message.mutable_drain();
  if (worker.drained_by.has_value()) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(*worker.drained_by - ports_.Now());
    message.mutable_drain()->set_within_ms(
        static_cast<int>(std::max<std::int64_t>(1, left.count())));
  }
  ports_.Send(worker.session, std::move(message));
}

void Scheduler::Refuse(std::int64_t session, std::int64_t attempt) {
  if (ending_.count(attempt) > 0) {
    return;  // the acknowledgement follows
  }
  v1::ServerMessage message;
  message.mutable_ack()->set_attempt(attempt);
  message.mutable_ack()->set_refused(true);
  ports_.Send(session, std::move(message));
}

void Scheduler::Reject(std::int64_t session, std::int64_t attempt, const std::string& why) {
  const WorkerEntry* worker = Heard(session);
  if (worker == nullptr) {
    return;
  }
  if (leases_.Find(attempt, worker->hello.name()) != nullptr) {
    GiveBack(*Release(attempt), Because(attempt, why), AttemptOutcome::kFailed, true);
  }
  Refuse(session, attempt);
  Dispatch();
}

absl::Status Scheduler::Receive(std::int64_t session, const v1::Heartbeat& heartbeat) {
  const WorkerEntry* worker = workers_.OfSession(session);
  if (worker == nullptr) {
    return absl::OkStatus();
  }
  if (absl::Status status = TooManyAttempts(worker->hello, heartbeat.attempts_size());
      !status.ok()) {
    return status;
  }
  Heard(session);
  const Clock::time_point now = ports_.Now();
  int refused = 0;
  for (const std::int64_t attempt : heartbeat.attempts()) {
    if (!leases_.Named(attempt, worker->hello.name(), now) && refused < kRefusedAtOnce) {
      Refuse(session, attempt);
      ++refused;
    }
  }
  const std::vector<LeaseEntry> unnamed = leases_.Unnamed(worker->hello.name(), now);
  for (const LeaseEntry& lease : unnamed) {
    Release(lease.attempt);
    GiveBack(lease,
             Because(lease.attempt, absl::StrCat("worker ", lease.worker, " has not named it for ",
                                                 options_.lease.count(), " ms")),
             AttemptOutcome::kLost, true);
    Refuse(session, lease.attempt);
  }
  if (!unnamed.empty()) {
    Dispatch();
  }
  return absl::OkStatus();
}

void Scheduler::Receive(std::int64_t session, const v1::Leaving& /*leaving*/) {
  const WorkerEntry* worker = workers_.OfSession(session);
  if (worker == nullptr) {
    return;
  }
  workers_.Leave(session);
  for (const LeaseEntry& lease : leases_.OfWorker(worker->hello.name())) {
    Release(lease.attempt);
    GiveBack(lease, Because(lease.attempt, "the worker left"), AttemptOutcome::kStopped, false);
  }
  Dispatch();
}

void Scheduler::Receive(std::int64_t session, const v1::StateBatch& batch) {
  const WorkerEntry* worker = Heard(session);
  if (worker == nullptr) {
    return;
  }
  auto taken = TakeStates(session, *worker, batch);
  if (!taken.has_value()) {
    return;
  }
  v1::ServerMessage answer;
  *answer.mutable_ack() = taken->ack;
  WriteStates(session, taken->campaign, std::move(taken->records), std::move(answer));
}

void Scheduler::Receive(std::int64_t session, const v1::StateBatches& gathered) {
  const WorkerEntry* worker = Heard(session);
  if (worker == nullptr) {
    return;
  }
  struct Together {
    std::vector<store::StateRecord> records;
    v1::ServerMessage answer;
  };
  std::map<std::int64_t, Together> by_campaign;  // what the store refuses is the trouble of one
  for (const v1::StateBatch& batch : gathered.batches()) {
    if (auto taken = TakeStates(session, *worker, batch); taken.has_value()) {
      Together& together = by_campaign[taken->campaign];
      std::move(taken->records.begin(), taken->records.end(), std::back_inserter(together.records));
      *together.answer.mutable_acks()->add_acks() = taken->ack;
    }
  }
  for (auto& [campaign, together] : by_campaign) {
    WriteStates(session, campaign, std::move(together.records), std::move(together.answer));
  }
}

void Scheduler::WriteStates(std::int64_t session, std::int64_t campaign,
                            std::vector<store::StateRecord> records, v1::ServerMessage answer) {
  Write(
      campaign,
      [records = std::move(records), now = ports_.UnixMs()](Transaction& transaction) {
        for (const store::StateRecord& record : records) {
          transaction.PutState(record, now);
        }
      },
      [this, session, answer = std::move(answer)](const absl::Status& status) mutable {
        if (status.ok()) {
          ports_.Send(session, std::move(answer));
        }
      });
}

std::optional<Scheduler::TakenStates> Scheduler::TakeStates(std::int64_t session,
                                                            const WorkerEntry& worker,
                                                            const v1::StateBatch& batch) {
  if (!leases_.Named(batch.attempt(), worker.hello.name(), ports_.Now())) {
    Refuse(session, batch.attempt());
    return std::nullopt;
  }
  const EvaluationKey key = leases_.Find(batch.attempt(), worker.hello.name())->key;
  CampaignRun& run = *FindRun(key.campaign);  // leases end with their campaign
  const auto fail = [&](const std::string& why) {
    GiveBack(*Release(batch.attempt()), Because(batch.attempt(), why), AttemptOutcome::kFailed,
             true);
    Refuse(session, batch.attempt());
  };
  if (const auto most = run.PathLength(key.experiment);
      static_cast<std::size_t>(batch.states_size()) > most &&
      !run.definition().campaign.program) {  // which may tell more of one step line by line
    fail(absl::StrCat(batch.states_size(), " states at once of a path of ", most, " load steps"));
    return std::nullopt;
  }
  std::vector<store::StateRecord> records;
  for (const v1::State& state : batch.states()) {
    store::StateRecord record{.key = key,
                              .load_step = state.load_step(),
                              .observables = {state.values().begin(), state.values().end()},
                              .others = messages::OthersToText(state.others())};
    if (const std::string refusal = run.Refusal(key, record.load_step, record.observables);
        !refusal.empty()) {
      fail(refusal);
      return std::nullopt;
    }
    records.push_back(std::move(record));
  }
  bool stop = false;
  for (std::size_t i = 0; i < records.size() && !stop; ++i) {
    run.AddState(key, records[i].load_step, records[i].observables);
    stop = run.ShouldStop(key) && !run.Find(key)->missing.empty();
    if (stop) {
      records.resize(i + 1);  // what was computed beyond is not kept: it depends on who was faster
    }
  }
  Changed(key.campaign);
  arrivals_[key.campaign].Add(ports_.Now(), static_cast<std::int64_t>(records.size()));
  if (stop) {
    StopEarly(session, *Release(batch.attempt()), std::move(records));
    return std::nullopt;
  }
  TakenStates taken{.campaign = key.campaign, .records = std::move(records)};
  taken.ack.set_attempt(batch.attempt());
  taken.ack.set_up_to(batch.first() + batch.states_size());
  return taken;
}

void Scheduler::Receive(std::int64_t session, const v1::Finished& finished) {
  const WorkerEntry* worker = Heard(session);
  if (worker == nullptr) {
    return;
  }
  if (leases_.Find(finished.attempt(), worker->hello.name()) == nullptr) {
    Refuse(session, finished.attempt());
    return;
  }
  const LeaseEntry lease = *Release(finished.attempt());
  CampaignRun& run = *FindRun(lease.key.campaign);
  auto& [seconds, ended] = durations_[lease.key.campaign];
  seconds += std::chrono::duration<double>(ports_.Now() - lease.started).count();
  ++ended;
  switch (finished.outcome()) {
    case v1::Finished::OUTCOME_COMPLETED:
    case v1::Finished::OUTCOME_RESTING: {
      const auto missing = run.Find(lease.key)->missing.size();
      if (missing == 0) {
        End(session, lease, EvaluationStatus::kFinished, finished);
      } else if (finished.outcome() == v1::Finished::OUTCOME_RESTING && run.HasArrived(lease.key)) {
        Rest(session, lease, finished, worker->hello.checkpoints());
      } else {
        GiveBack(lease,
                 Because(lease.attempt, absl::StrCat("said to be complete, but ", missing,
                                                     " load steps are missing")),
                 AttemptOutcome::kFailed, true);
        Refuse(session, finished.attempt());
      }
      break;
    }
    case v1::Finished::OUTCOME_DIVERGED:
      End(session, lease, EvaluationStatus::kDiverged, finished);
      break;
    case v1::Finished::OUTCOME_STOPPED:  // of its own accord: the node is going down
      workers_.Leave(session);
      GiveBack(lease, finished, AttemptOutcome::kStopped, false);
      Refuse(session, finished.attempt());
      break;
    case v1::Finished::OUTCOME_MODEL_FAILED:
      ModelFailed(session, lease, finished);
      break;
    default:
      GiveBack(lease, finished, AttemptOutcome::kFailed, true);
      Refuse(session, finished.attempt());
  }
  Dispatch();
}

void Scheduler::ModelFailed(std::int64_t session, const LeaseEntry& lease,
                            const v1::Finished& finished) {
  CampaignRun& run = *FindRun(lease.key.campaign);
  const int failures = run.Find(lease.key)->failures + 1;
  if (failures < run.definition().campaign.failure.attempts) {
    GiveBack(lease, finished, AttemptOutcome::kModelFailed, true);
    Refuse(session, finished.attempt());
    return;
  }
  SetStatus(run, lease.key, EvaluationStatus::kRunning, failures);
  v1::Finished last = finished;
  last.set_reason(absl::StrCat("failed ", failures, failures == 1 ? " time, " : " times, ",
                               "last: ", finished.reason()));
  End(session, lease, EvaluationStatus::kUnknown, last);
}

void Scheduler::StopEarly(std::int64_t session, const LeaseEntry& lease,
                          std::vector<store::StateRecord> records) {
  CampaignRun& run = *FindRun(lease.key.campaign);
  const int failures = run.Find(lease.key)->failures;
  const std::string reason =
      absl::StrCat("cannot reach a weight that counts, by load step ", records.back().load_step);
  SetStatus(run, lease.key, EvaluationStatus::kStoppedEarly, failures);
  // The sample's further experiments would be run in vain.
  std::map<EvaluationKey, int> spared;
  for (const EvaluationKey& beside : run.WaitingBeside(lease.key)) {
    spared[beside] = run.Find(beside)->failures;
    SetStatus(run, beside, EvaluationStatus::kStoppedEarly, spared[beside]);
  }
  const std::string beside_reason =
      absl::StrCat("not run: the sample ", reason, " of ", NameOf(run, lease.key));
  const std::chrono::duration<double> elapsed = ports_.Now() - lease.started;
  v1::Finished finished = Because(lease.attempt, reason);
  if (const WorkerEntry* worker = workers_.OfSession(session); worker != nullptr) {
    finished.set_core_seconds(elapsed.count() * worker->hello.threads_per_slot() * lease.slots);
  }
  v1::ServerMessage message;
  message.mutable_stop()->set_attempt(lease.attempt);
  Write(
      lease.key.campaign,
      [key = lease.key, failures, reason, records = std::move(records), now = ports_.UnixMs(),
       spared, beside_reason,
       end = ToRecord(finished, AttemptOutcome::kStoppedEarly)](Transaction& transaction) {
        for (const store::StateRecord& record : records) {
          transaction.PutState(record, now);
        }
        transaction.EndAttempt(end);
        transaction.SetEvaluation(key, EvaluationStatus::kStoppedEarly, reason, failures);
        for (const auto& [beside, so_far] : spared) {
          transaction.SetEvaluation(beside, EvaluationStatus::kStoppedEarly, beside_reason, so_far);
        }
      },
      [this, session, message, campaign = lease.key.campaign](const absl::Status& status) {
        if (status.ok()) {
          ports_.Send(session, message);
          Advance(campaign);
        }
      });
  Dispatch();
}

store::AttemptEnd Scheduler::ToRecord(const v1::Finished& finished, AttemptOutcome outcome) {
  std::vector<store::KeptFile> kept;
  for (const v1::KeptFile& file : finished.kept()) {
    kept.push_back({.name = file.name(), .digest = file.digest(), .reason = file.reason()});
  }
  return {.id = finished.attempt(),
          .outcome = outcome,
          .reason = finished.reason(),
          .ended_unix_ms = ports_.UnixMs(),
          .steps = finished.steps(),
          .contact_updates = finished.contact_updates(),
          .core_seconds = finished.core_seconds(),
          .staging = finished.staging(),
          .words = finished.words(),
          .kept = std::move(kept)};
}

void Scheduler::Rest(std::int64_t session, const LeaseEntry& lease, const v1::Finished& finished,
                     const std::string& held_in) {
  CampaignRun::Evaluation& evaluation = *FindRun(lease.key.campaign)->Find(lease.key);
  evaluation.held_in = held_in;
  v1::Finished resting = finished;
  resting.set_reason(absl::StrCat("rests after load step ", evaluation.rest_after.value_or(-1)));
  End(session, lease, EvaluationStatus::kStoppedEarly, resting, held_in);
}

void Scheduler::End(std::int64_t session, const LeaseEntry& lease, EvaluationStatus status,
                    const v1::Finished& finished, const std::string& held_in) {
  CampaignRun& run = *FindRun(lease.key.campaign);
  const int failures = run.Find(lease.key)->failures;
  SetStatus(run, lease.key, status, failures);
  Changed(lease.key.campaign);
  WorkersChanged();
  // Before an iteration is complete, and where held-out tests are run, each run counts by itself.
  if (run.progress().iteration == 0 || run.progress().phase != campaign::Phase::kCalibrating) {
    Concluded(lease.key.campaign);
  }
  const bool diverged = status == EvaluationStatus::kDiverged;
  const bool unknown = status == EvaluationStatus::kUnknown;
  const bool resting = status == EvaluationStatus::kStoppedEarly;
  const std::string digest = resting ? "" : run.Find(lease.key)->digest;
  ending_[lease.attempt] = digest;
  UnderWay(digest);
  const store::Store::Job end =
      [key = lease.key, status, failures, diverged, unknown, resting, held_in,
       now = ports_.UnixMs(), name = NameOf(run, lease.key),
       end = ToRecord(finished, diverged  ? AttemptOutcome::kDiverged
                                : unknown ? AttemptOutcome::kModelFailed
                                : resting ? AttemptOutcome::kResting
                                          : AttemptOutcome::kCompleted)](Transaction& t) {
        t.EndAttempt(end);
        t.SetEvaluation(key, status, end.reason, failures);
        if (resting) {
          t.SetHeldIn(key, held_in);
        }
        if (diverged) {
          t.Log(key.campaign, now, absl::StrCat(name, " diverged: ", end.reason));
        }
        if (unknown) {
          t.Log(key.campaign, now, absl::StrCat(name, " is set aside as unknown: ", end.reason));
        }
      };
  const Reply then = [this, session, lease, states = finished.states(),
                      digest](const absl::Status& committed) {
    ending_.erase(lease.attempt);
    NoLongerUnderWay(digest);
    if (!committed.ok()) {
      return;
    }
    v1::ServerMessage ack;
    ack.mutable_ack()->set_attempt(lease.attempt);
    ack.mutable_ack()->set_up_to(states);
    ack.mutable_ack()->set_finished(true);
    ports_.Send(session, std::move(ack));
    Advance(lease.key.campaign);
    if (digest.empty() || runs_.size() < 2) {
      return;
    }
    for (const auto& [id, other] : runs_) {
      TakeFromOthers(*other, digest);
    }
    Dispatch();
  };
  const std::string too_many = diverged || unknown ? TooManyDiverged(run, finished.reason()) : "";
  if (too_many.empty()) {
    Write(lease.key.campaign, end, then);
  } else {  // with its cause or not at all
    SetState(run, CampaignEvent::kPause, too_many, end, then);
  }
}

void Scheduler::GiveBack(const LeaseEntry& lease, const v1::Finished& how, AttemptOutcome outcome,
                         bool counts_as_failure) {
  v1::Finished finished = how;
  finished.set_attempt(lease.attempt);
  CampaignRun* run = FindRun(lease.key.campaign);
  Changed(lease.key.campaign);
  WorkersChanged();
  if (run == nullptr) {
    ports_.Write([end = ToRecord(finished, outcome)](Transaction& t) { t.EndAttempt(end); },
                 [](const absl::Status&) {});
    return;
  }
  CampaignRun::Evaluation& evaluation = *run->Find(lease.key);
  const campaign::Campaign& campaign = run->definition().campaign;
  // What an engine or program itself failed at is counted apart from lost nodes.
  const bool by_node = outcome != AttemptOutcome::kModelFailed;
  evaluation.losses += counts_as_failure && by_node ? 1 : 0;
  const int failures = evaluation.failures + (counts_as_failure && !by_node ? 1 : 0);
  const int counted = by_node ? evaluation.losses : failures;
  const bool too_often = counts_as_failure && counted >= campaign.failure.attempts;
  const auto status = too_often ? EvaluationStatus::kFailed : EvaluationStatus::kWaiting;
  SetStatus(*run, lease.key, status, failures);
  const store::Store::Job end = [key = lease.key, status, failures, now = ports_.UnixMs(),
                                 losses = evaluation.losses, name = NameOf(*run, lease.key),
                                 end = ToRecord(finished, outcome)](Transaction& t) {
    t.EndAttempt(end);
    t.SetEvaluation(key, status, end.reason, failures);
    t.SetLosses(key, losses);
    t.Log(key.campaign, now,
          absl::StrCat(name, ": attempt ", end.id, " ", ToString(end.outcome), ": ", end.reason));
  };
  if (too_often && IsLeasable(run->state())) {  // with its cause or not at all
    SetState(*run, CampaignEvent::kPause,
             absl::StrCat(NameOf(*run, lease.key), " failed ", counted, " times, last: ",
                          finished.reason(), "; resume to try again once the cause is removed"),
             end, [](const absl::Status&) {});
    return;
  }
  Write(lease.key.campaign, end, [](const absl::Status&) {});
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
  }
  return lease;
}

const WorkerEntry* Scheduler::Heard(std::int64_t session) {
  bool was_silent = false;
  const WorkerEntry* worker = workers_.Heard(session, ports_.Now(), &was_silent);
  if (worker != nullptr) {
    leases_.Heard(worker->hello.name(), ports_.Now());
  }
  if (was_silent) {
    Dispatch();
  }
  return worker;
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
    SetState(run, CampaignEvent::kStart, "", nullptr, [](const absl::Status&) {});
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

void Scheduler::Tick() {
  const Clock::time_point now = ports_.Now();
  if (now - std::exchange(ticked_, now) > kStoodStill * options_.lease) {
    leases_.Pardon(now);
  }
  for (const LeaseEntry& lease : leases_.Expired(now)) {
    Release(lease.attempt);
    GiveBack(lease,
             Because(lease.attempt, absl::StrCat("nothing was heard from worker ", lease.worker,
                                                 " for ", options_.lease.count(), " ms")),
             AttemptOutcome::kLost, true);
    if (const WorkerEntry* worker = workers_.Find(lease.worker); worker != nullptr) {
      Refuse(worker->session, lease.attempt);
    }
  }
  workers_.Review(leases_.HeardSince(now), now - kRemembered);
  for (auto& [campaign, arrivals] : arrivals_) {
    if (arrivals.HasCeased(now)) {
      Changed(campaign);
    }
  }
  for (const auto& [campaign, task] : std::exchange(again_, {})) {
    task();
  }
  Dispatch();
}

absl::StatusOr<v1::WorkerInfo> Scheduler::Drain(const std::string& name,
                                                std::chrono::milliseconds within) {
  const WorkerEntry* worker = workers_.Find(name);
  if (worker == nullptr) {
    return absl::NotFoundError(absl::StrCat("there is no worker ", name));
  }
  workers_.Drain(name, within.count() > 0 ? std::optional(ports_.Now() + within) : std::nullopt);
  SendDrain(*worker);
  WorkersChanged();
  for (const v1::WorkerInfo& info : Workers()) {
    if (info.name() == name) {
      return info;
    }
  }
  return absl::NotFoundError(absl::StrCat("there is no worker ", name));
}

std::vector<v1::WorkerInfo> Scheduler::Workers() const {
  std::vector<v1::WorkerInfo> infos;
  for (const auto& [name, entry] : workers_.all()) {
    v1::WorkerInfo& info = infos.emplace_back();
    info.set_name(name);
    info.set_slots(entry.hello.slots());
    info.set_contact_updates_per_second(entry.hello.contact_updates_per_second());
    info.set_cpu(entry.hello.cpu());
    info.set_engine_version(entry.hello.engine_version());
    info.set_draining(entry.draining);
    info.set_connected(entry.session != 0);
    *info.mutable_programs() = entry.hello.programs();
    info.set_threads(entry.hello.threads_per_slot());
    info.set_memory(entry.hello.memory());
    info.set_user(entry.hello.user());
    info.set_left(entry.leaving && entry.session == 0);
    info.set_seconds_since_heard(std::chrono::duration<double>(ports_.Now() - entry.heard).count());
    for (const LeaseEntry& lease : leases_.OfWorker(name)) {
      const auto run = runs_.find(lease.key.campaign);
      info.add_running(absl::StrCat(
          "c", lease.key.campaign, "/", lease.key.sample, "/",
          run == runs_.end()
              ? absl::StrCat(lease.key.experiment)
              : run->second->definition()
                    .campaign.experiments[static_cast<std::size_t>(lease.key.experiment)]
                    .name));
    }
    info.set_busy(entry.busy);
  }
  return infos;
}

}  // namespace calib::scheduler
