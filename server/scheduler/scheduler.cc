// Campaigns: taking them up, reading them again, which of their runs wait. What is wished of them:
// scheduler_commands.cc. What they do next: scheduler_plans.cc.
#include "server/scheduler/scheduler.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"

namespace calib::scheduler {

using store::AttemptOutcome;
using store::EvaluationKey;
using store::EvaluationStatus;
using store::Transaction;

// Of the store: out of files, a lock, a disk that is full for a while. What is stored is whole.
bool Scheduler::MayPass(const absl::Status& error) {
  return absl::IsUnavailable(error) || absl::IsResourceExhausted(error) ||
         absl::IsPermissionDenied(error);
}

absl::Status Scheduler::Load() {
  ASSIGN_OR_RETURN(auto reader, ports_.Read());
  ASSIGN_OR_RETURN(const auto last_attempt, reader.LastAttempt());
  ASSIGN_OR_RETURN(const auto last_campaign, reader.LastCampaign());
  ASSIGN_OR_RETURN(const auto campaigns, reader.Campaigns());
  ASSIGN_OR_RETURN(const auto attempts, reader.ActiveAttempts());
  ASSIGN_OR_RETURN(const auto quotas, reader.Quotas());
  for (const auto& [owner, slots] : quotas) {
    shares_.SetQuota(owner, slots);
  }
  ticked_ = ports_.Now();
  last_attempt_ = last_attempt;
  last_campaign_ = last_campaign;
  attempts_at_start_ = attempts;
  for (const store::CampaignRecord& record : campaigns) {
    if (IsOver(record.progress.state)) continue;
    started_with_.insert(record.submitted.id);
    loading_.try_emplace(record.submitted.id);
  }
  if (started_with_.empty()) {
    TakeUpAll();
    return absl::OkStatus();
  }
  for (const std::int64_t campaign : std::set<std::int64_t>(started_with_)) {
    ports_.Load([this, campaign]() -> std::function<void()> {
      if (stops_reading_) return [] {};
      auto loaded = ReadCampaign(campaign);
      return [this, campaign, loaded] {
        read_.emplace(campaign, std::move(*loaded));
        if (being_read() == 0) TakeUpAll();
      };
    });
  }
  return absl::OkStatus();
}

std::shared_ptr<absl::StatusOr<std::unique_ptr<CampaignRun>>> Scheduler::ReadCampaign(
    std::int64_t campaign) {
  auto reader = ports_.Read();
  return std::make_shared<absl::StatusOr<std::unique_ptr<CampaignRun>>>(
      reader.ok() ? CampaignRun::Load(*options_.methods, *reader, campaign) : reader.status());
}

void Scheduler::StopReading() {
  stops_reading_ = true;
  for (const std::int64_t campaign : started_with_) {
    for (const Waiting& waits : std::exchange(loading_[campaign], {})) {
      waits.refuse(absl::UnavailableError("the server is going down"));
    }
  }
}

void Scheduler::TakeUpAll() {
  started_with_.clear();
  auto read = std::exchange(read_, {});
  for (auto& [campaign, loaded] : read) TakeUp(campaign, std::move(loaded));
  for (const store::ActiveAttempt& attempt : std::exchange(attempts_at_start_, {})) {
    CampaignRun* run = FindRun(attempt.key.campaign);
    const LeaseEntry lease{.attempt = attempt.id,
                           .key = attempt.key,
                           .worker = attempt.worker,
                           .owner = run == nullptr ? "" : run->record().submitted.owner,
                           .shared = SharedDigest(attempt.key),
                           .started = ports_.Now()};
    if (run == nullptr) {  // over, or to be read again: nobody's loss
      GiveBack(lease, Because(attempt.id, "its campaign did not run when the server started"),
               AttemptOutcome::kStopped, false);
    } else {
      Hold(lease);
    }
  }
  for (const auto& [campaign, loaded] : read) {
    CampaignRun* run = FindRun(campaign);
    if (run == nullptr) continue;
    ReturnUnleased(*run);  // given back by a server that could not read the campaign
    PauseIfOfOtherMechanics(*run);
    TakeFromOthers(*run);
    Enqueue(*run);
    Advance(campaign);
  }
  for (const auto& [campaign, loaded] : read) {
    StateChanged(campaign);
    DoneLoading(campaign);
  }
  for (const auto& [session, hello] : std::exchange(early_, {})) {
    if (const absl::Status admitted = Connected(session, hello); !admitted.ok()) {
      ports_.Close(session, admitted);
    }
  }
}

store::Store::Job Scheduler::BeginAnew(CampaignRun& run,
                                       const std::map<EvaluationKey, std::string>& others) {
  std::vector<store::AttemptEnd> ends;
  for (const LeaseEntry& lease : leases_.OfCampaign(run.id())) {
    if (others.count(lease.key) == 0) continue;
    Release(lease.attempt);
    v1::Finished finished;
    finished.set_attempt(lease.attempt);
    finished.set_reason("of other mechanics");
    ends.push_back(ToRecord(finished, AttemptOutcome::kStopped));
  }
  for (const auto& [key, digest] : others) {
    run.BeginAnew(key, digest);
    Offer(run, key.sample);
  }
  return [others, ends](Transaction& transaction) {
    for (const store::AttemptEnd& end : ends) {
      transaction.EndAttempt(end);
    }
    for (const auto& [key, digest] : others) {
      transaction.BeginAnew(key, digest);
    }
  };
}

void Scheduler::PauseIfOfOtherMechanics(CampaignRun& run) {
  const std::map<EvaluationKey, std::string> others = run.OfOtherMechanics();
  if (!planning::IsLeasable(run.state()) || others.empty()) {
    return;
  }
  if (!run.HasBegun()) {  // there is nothing that could be mixed
    Write(run.id(), BeginAnew(run, others), [](const absl::Status&) {});
    return;
  }
  SetState(run, planning::CampaignEvent::kPause,
           absl::StrCat("begun by a program with other mechanics than this one's, version ",
                        dem::EngineVersion(),
                        ": resume runs what is open with these, so that the ensemble is of both; "
                        "cancel keeps what there is"),
           nullptr, [](const absl::Status&) {});
}

void Scheduler::TakeUp(std::int64_t campaign, absl::StatusOr<std::unique_ptr<CampaignRun>> run) {
  if (run.ok()) {
    runs_[campaign] = *std::move(run);
    return;
  }
  if (MayPass(run.status())) {
    again_[campaign] = [this, campaign] { TakeUpNow(campaign); };
    return;
  }
  if (absl::IsNotFound(run.status())) {  // deleted since
    return;
  }
  // It keeps the others from nothing, and waits for a program that can read it: it was accepted
  // once.
  SetUnreadable(campaign, CampaignState::kPaused, std::string(run.status().message()), nullptr,
                [](const absl::Status&) {});
}

void Scheduler::SetUnreadable(std::int64_t campaign, CampaignState state, const std::string& reason,
                              const store::Store::Job& also, const Reply& reply) {
  unreadable_[campaign] = reason;
  if (IsOver(state)) unreadable_.erase(campaign);
  ports_.Write(
      [=, now = ports_.UnixMs()](Transaction& transaction) {
        if (also) also(transaction);
        transaction.SetState(campaign, state, reason);
        transaction.Log(campaign, now, absl::StrCat(ToString(state), ": ", reason));
      },
      reply);
  StateChanged(campaign);
}

void Scheduler::TakeUpNow(std::int64_t campaign) {
  if (loading_.try_emplace(campaign).second) {
    LoadAside(campaign);
  }
}

void Scheduler::LoadAside(std::int64_t campaign) {
  ports_.Load([this, campaign]() -> std::function<void()> {
    auto loaded = ReadCampaign(campaign);
    return [this, campaign, loaded] {
      TakeUp(campaign, std::move(*loaded));
      if (CampaignRun* run = FindRun(campaign); run != nullptr) {
        ReturnUnleased(*run);
        PauseIfOfOtherMechanics(*run);
        Enqueue(*run);
        Advance(campaign);
        Dispatch();
      }
      StateChanged(campaign);
      DoneLoading(campaign);
    };
  });
}

void Scheduler::DoneLoading(std::int64_t campaign) {
  const auto waiting = loading_.extract(campaign);
  if (waiting.empty()) {
    return;
  }
  for (const Waiting& waits : waiting.mapped()) {
    waits.then();
  }
}

bool Scheduler::IsLoading(std::int64_t campaign, std::function<void()> then, Reply refuse) {
  const auto found = loading_.find(campaign);
  if (found == loading_.end()) {
    return false;
  }
  found->second.push_back({.then = std::move(then), .refuse = std::move(refuse)});
  return true;
}

void Scheduler::Write(std::int64_t campaign, store::Store::Job job, Reply then) {
  ports_.Write(std::move(job),
               [this, campaign, then = std::move(then)](const absl::Status& status) {
                 then(status);
                 if (absl::IsInvalidArgument(status)) {
                   ReadAgain(campaign, status);
                 }
               });
}

void Scheduler::ReadAgain(std::int64_t campaign, const absl::Status& why) {
  if (FindRun(campaign) == nullptr) {
    return;
  }
  for (const LeaseEntry& lease : leases_.OfCampaign(campaign)) {
    Release(lease.attempt);
    if (const WorkerEntry* worker = workers_.Find(lease.worker); worker != nullptr) {
      Refuse(worker->session, lease.attempt);
    }
  }
  waiting_.TakeAll(campaign);
  runs_.erase(campaign);
  loading_.try_emplace(campaign);
  const std::string reason =
      absl::StrCat("the store refuses what follows from the last results: ", why.message(),
                   "; resume to go on from what it holds");
  ports_.Write(
      [campaign, reason, now = ports_.UnixMs()](Transaction& transaction) {
        transaction.EndOpenAttempts(campaign, {.outcome = AttemptOutcome::kStopped,
                                               .reason = "the campaign was read again",
                                               .ended_unix_ms = now});
        transaction.Pause(campaign, reason);
        transaction.Log(campaign, now, absl::StrCat("paused: ", reason));
      },
      [this, campaign](const absl::Status& /*status*/) { LoadAside(campaign); });
}

void Scheduler::ReturnUnleased(CampaignRun& run) {
  std::set<EvaluationKey> leased;
  for (const LeaseEntry& lease : leases_.OfCampaign(run.id())) leased.insert(lease.key);
  for (const EvaluationKey& key : run.With(EvaluationStatus::kRunning)) {
    if (leased.count(key) > 0) continue;
    const int failures = run.Find(key)->failures;
    SetStatus(run, key, EvaluationStatus::kWaiting, failures);
    Write(
        run.id(),
        [key, failures](Transaction& transaction) {
          transaction.SetEvaluation(key, EvaluationStatus::kWaiting, "", failures);
        },
        [](const absl::Status&) {});
  }
}

void Scheduler::TakeIn(const PlanWritten& written) {
  CampaignRun* run = FindRun(written.campaign);
  if (run == nullptr) {
    return;
  }
  for (const auto& [sample, threshold] : written.stop_below) run->SetStopBelow(sample, threshold);
  if (!written.resumed) {
    ExtendAside(*run, written);
    return;
  }
  // What workers send of a campaign while it is read would be lost.
  if (leases_.OfCampaign(written.campaign).empty()) {
    ReloadAside(*run);
    return;
  }
  auto reader = ports_.Read();
  if (!reader.ok() || !run->Reload(*reader).ok()) {
    again_[written.campaign] = [this, written] { TakeIn(written); };
    return;
  }
  GoOn(*run);
}

void Scheduler::ExtendAside(const CampaignRun& run, const PlanWritten& written) {
  computing_.insert(written.campaign);
  ports_.Load([this, written, look = run.LookForMore()]() -> std::function<void()> {
    auto reader = ports_.Read();
    const auto more = std::make_shared<absl::StatusOr<CampaignRun::More>>(
        reader.ok() ? look(*reader) : reader.status());
    return [this, written, more] {
      computing_.erase(written.campaign);
      CampaignRun* extended = FindRun(written.campaign);
      if (extended == nullptr) {  // cancelled meanwhile
        return;
      }
      if (!more->ok()) {
        again_[written.campaign] = [this, written] { TakeIn(written); };
        return;
      }
      extended->Take(**more);
      GoOn(*extended);
    };
  });
}

void Scheduler::ReloadAside(const CampaignRun& run) {
  const std::int64_t campaign = run.id();
  if (!loading_.try_emplace(campaign).second) {
    return;
  }
  ports_.Load([this, campaign,
               unfilled = std::shared_ptr<CampaignRun>(run.Unfilled())]() -> std::function<void()> {
    auto reader = ports_.Read();
    const absl::Status status = reader.ok() ? unfilled->Reload(*reader) : reader.status();
    return [this, campaign, unfilled, status] {
      CampaignRun* reloaded = FindRun(campaign);
      if (reloaded != nullptr && status.ok()) {
        reloaded->Fill(std::move(*unfilled));
        GoOn(*reloaded);
      } else if (reloaded != nullptr) {
        again_[campaign] = [this, campaign] { TakeIn({.campaign = campaign, .resumed = true}); };
      }
      DoneLoading(campaign);
    };
  });
}

void Scheduler::GoOn(CampaignRun& run) {
  if (runs_.size() > 1) {  // something may have ended since the plan was made
    TakeFromOthers(run);
  }
  Enqueue(run);
  Advance(run.id());
  Dispatch();
}

CampaignRun* Scheduler::FindRun(std::int64_t campaign) {
  const auto found = runs_.find(campaign);
  return found == runs_.end() ? nullptr : found->second.get();
}

CampaignRun* Scheduler::LiveRun(std::int64_t campaign, const Reply& reply) {
  CampaignRun* run = FindRun(campaign);
  if (run == nullptr) {
    reply(again_.count(campaign) > 0
              ? absl::UnavailableError(absl::StrCat("campaign c", campaign,
                                                    " cannot be read now; try again in a moment"))
          : unreadable_.count(campaign) > 0
              ? absl::FailedPreconditionError(unreadable_.at(campaign))
              : absl::FailedPreconditionError(absl::StrCat("campaign c", campaign, " is over")));
  }
  return run;
}

void Scheduler::Enqueue(CampaignRun& run) {
  if (!planning::IsLeasable(run.state())) {
    waiting_.TakeAll(run.id());
    return;
  }
  std::optional<int> last;
  for (const EvaluationKey& key : run.With(EvaluationStatus::kWaiting)) {
    if (last != key.sample) {
      Offer(run, key.sample);
    }
    last = key.sample;
  }
}

void Scheduler::Offer(CampaignRun& run, int sample) {
  for (const EvaluationKey& key : run.OfSample(sample)) {
    const CampaignRun::Evaluation& evaluation = *run.Find(key);
    if (evaluation.status == EvaluationStatus::kWaiting && planning::IsLeasable(run.state()) &&
        run.IsItsTurn(key)) {
      waiting_.Put(key, evaluation.held_in);
    } else {
      waiting_.Take(key);
    }
  }
}

void Scheduler::SetStatus(CampaignRun& run, const EvaluationKey& key, EvaluationStatus status,
                          int failures) {
  run.SetStatus(key, status, failures);
  Offer(run, key.sample);  // it may now be the turn of another of its experiments
}

}  // namespace calib::scheduler
