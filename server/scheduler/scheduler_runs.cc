// What comes of the runs that workers have: states, ends, losses.
#include <algorithm>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/messages/others.h"
#include "server/scheduler/scheduler.h"

namespace calib::scheduler {

using store::AttemptOutcome;
using store::EvaluationKey;
using store::EvaluationStatus;
using store::Transaction;

namespace {

std::string NameOf(const CampaignRun& run, const EvaluationKey& key) {
  return absl::StrCat(
      "sample ", key.sample, ", experiment ",
      run.definition().campaign.experiments[static_cast<std::size_t>(key.experiment)].name);
}

}  // namespace

v1::Finished Scheduler::Because(std::int64_t attempt, const std::string& reason) {
  v1::Finished finished;
  finished.set_attempt(attempt);
  finished.set_reason(reason);
  return finished;
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
    SetState(run, planning::CampaignEvent::kPause, too_many, end, then);
  }
}

void Scheduler::GiveBack(const LeaseEntry& lease, const v1::Finished& how, AttemptOutcome outcome,
                         bool counts_as_failure) {
  v1::Finished finished = how;
  finished.set_attempt(lease.attempt);
  CampaignRun* run = FindRun(lease.key.campaign);
  Changed(lease.key.campaign);
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
  if (too_often && planning::IsLeasable(run->state())) {  // with its cause or not at all
    SetState(*run, planning::CampaignEvent::kPause,
             absl::StrCat(NameOf(*run, lease.key), " failed ", counted, " times, last: ",
                          finished.reason(), "; resume to try again once the cause is removed"),
             end, [](const absl::Status&) {});
    return;
  }
  Write(lease.key.campaign, end, [](const absl::Status&) {});
}

}  // namespace calib::scheduler
