// Campaigns: taking them up, their states, and what they do next. Workers: scheduler_links.cc.
#include "server/scheduler/scheduler.h"

#include <algorithm>
#include <new>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"
#include "server/messages/attempt_spec.h"
#include "server/planning/phases/plan_next.h"

namespace calib::scheduler {

using store::AttemptOutcome;
using store::EvaluationKey;
using store::EvaluationStatus;
using store::Transaction;

namespace {

/// Too few samples say nothing about the share that fails.
constexpr int kFewestDoneToPause = 4;

/// Of the store: out of files, a lock, a disk that is full for a while. What is stored is whole.
bool MayPass(const absl::Status& error) {
  return absl::IsUnavailable(error) || absl::IsResourceExhausted(error) ||
         absl::IsPermissionDenied(error);
}

// One campaign that asks for too much must not end the service, now and at each start.
absl::StatusOr<planning::Plan> ReadAndPlan(Ports& ports, const planning::Definition& definition,
                                           const store::CampaignRecord& record) {
  try {
    ASSIGN_OR_RETURN(auto reader, ports.Read());
    return planning::PlanNext(definition, record, reader);
  } catch (const std::bad_alloc&) {
    return absl::FailedPreconditionError(absl::StrCat(
        "what follows from ", record.submitted.samples, " samples of ",
        definition.data.readings.size(),
        " readings needs more memory than this machine has: fewer of either, or a larger one"));
  }
}
}  // namespace

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
  for (const store::CampaignRecord& record : campaigns) {
    if (!IsOver(record.progress.state)) {
      TakeUp(record.submitted.id,
             CampaignRun::Load(*options_.methods, reader, record.submitted.id));
    }
  }
  for (const store::ActiveAttempt& attempt : attempts) {
    CampaignRun* run = FindRun(attempt.key.campaign);
    const LeaseEntry lease{.attempt = attempt.id,
                           .key = attempt.key,
                           .worker = attempt.worker,
                           .owner = run == nullptr ? "" : run->record().submitted.owner,
                           .shared = SharedDigest(attempt.key),
                           .started = ports_.Now()};
    if (run == nullptr) {
      GiveBack(lease, {}, AttemptOutcome::kLost, false);
    } else {
      Hold(lease);
    }
  }
  for (auto& [id, run] : runs_) {
    PauseIfOfOtherMechanics(*run);
    TakeFromOthers(*run);
    Enqueue(*run);
    Advance(id);
  }
  return absl::OkStatus();
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
    auto reader = ports_.Read();
    auto loaded = std::make_shared<absl::StatusOr<std::unique_ptr<CampaignRun>>>(
        reader.ok() ? CampaignRun::Load(*options_.methods, *reader, campaign) : reader.status());
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
  for (const auto& then : waiting.mapped()) {
    then();
  }
}

bool Scheduler::IsLoading(std::int64_t campaign, std::function<void()> then) {
  const auto found = loading_.find(campaign);
  if (found == loading_.end()) {
    return false;
  }
  found->second.push_back(std::move(then));
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

void Scheduler::TakeIn(std::int64_t campaign, bool resumed) {
  CampaignRun* run = FindRun(campaign);
  if (run == nullptr) {
    return;
  }
  // What workers send of a campaign while it is read would be lost.
  if (resumed && leases_.OfCampaign(campaign).empty()) {
    ReloadAside(*run);
    return;
  }
  auto reader = ports_.Read();
  if (!reader.ok() || !(resumed ? run->Reload(*reader) : run->Extend(*reader)).ok()) {
    again_[campaign] = [this, campaign, resumed] { TakeIn(campaign, resumed); };
    return;
  }
  GoOn(*run);
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
        again_[campaign] = [this, campaign] { TakeIn(campaign, true); };
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

absl::Status Scheduler::WhyNoMore() const {
  if (runs_.size() + loading_.size() < static_cast<std::size_t>(options_.most_campaigns)) {
    return absl::OkStatus();
  }
  return absl::ResourceExhaustedError(
      absl::StrCat(options_.most_campaigns,
                   " campaigns are not over, and the server takes no more (calibd "
                   "--max-campaigns): wait for one to finish, or cancel one"));
}

void Scheduler::Submit(store::NewCampaign submitted, std::map<std::string, std::string> files,
                       const std::string& request_id, const store::RequestRecord& request,
                       std::function<void(absl::StatusOr<std::string>)> reply) {
  if (const absl::Status full = WhyNoMore(); !full.ok()) {
    reply(full);
    return;
  }
  submitted.id = ++last_campaign_;
  const std::int64_t id = submitted.id;
  const std::string answer = absl::StrCat("c", id);
  ports_.Write(
      [submitted = std::move(submitted), files = std::move(files), request_id, request, answer,
       now = ports_.UnixMs()](Transaction& transaction) {
        transaction.InsertCampaign(submitted, files);
        if (!request_id.empty()) {
          transaction.PutRequest(request_id, {.digest = request.digest, .answer = answer});
        }
        transaction.Log(submitted.id, now, "submitted");
      },
      [this, id, answer, reply = std::move(reply)](const absl::Status& status) {
        if (!status.ok()) {
          reply(status);
          return;
        }
        reply(answer);
        TakeUpNow(id);
      });
}

void Scheduler::SetState(CampaignRun& run, planning::CampaignEvent event, const std::string& reason,
                         const store::Store::Job& also, const Reply& reply) {
  if (absl::Status status = run.Apply(event, reason); !status.ok()) {
    reply(status);
    return;
  }
  StateChanged(run.id());
  Enqueue(run);
  Write(
      run.id(),
      [id = run.id(), progress = run.progress(), now = ports_.UnixMs(), also,
       line = reason.empty() ? absl::StrCat(ToString(event))
                             : absl::StrCat(ToString(event), ": ", reason)](Transaction& t) {
        if (also) {
          also(t);
        }
        t.SetProgress(id, progress);
        t.Log(id, now, line);
      },
      [this, id = run.id(), reply](const absl::Status& status) {
        reply(status);
        if (status.ok()) {
          Advance(id);
          Dispatch();
        }
      });
}

void Scheduler::Pause(std::int64_t campaign, const store::Store::Job& also, const Reply& reply) {
  if (IsLoading(campaign, [=, this] { Pause(campaign, also, reply); })) {
    return;
  }
  CampaignRun* run = LiveRun(campaign, reply);
  if (run == nullptr) {
    return;
  }
  SetState(*run, planning::CampaignEvent::kPause, "asked for", also, reply);
}

void Scheduler::Resume(std::int64_t campaign, const store::Store::Job& also, const Reply& reply) {
  if (IsLoading(campaign, [=, this] { Resume(campaign, also, reply); })) {
    return;
  }
  CampaignRun* run = LiveRun(campaign, reply);
  if (run == nullptr) {
    return;
  }
  if (run->state() == CampaignState::kPaused) {
    // What paused it is known to whoever resumes it: not asked again in this iteration.
    run->progress().pause_waived = run->progress().pause_waived || run->Diverged() > 0;
  }
  std::vector<EvaluationKey> again;
  std::map<EvaluationKey, std::string> others;
  store::Store::Job anew;
  if (run->state() == CampaignState::kPaused) {
    others = run->OfOtherMechanics();
    anew = BeginAnew(*run, others);
    again = run->With(EvaluationStatus::kFailed);
    const auto unknown = run->UnknownOfRunningIteration();
    again.insert(again.end(), unknown.begin(), unknown.end());
    for (const EvaluationKey& key : again) {
      run->Find(key)->losses = 0;
      SetStatus(*run, key, EvaluationStatus::kWaiting, 0);
    }
  }
  SetState(
      *run, planning::CampaignEvent::kResume,
      others.empty() ? ""
                     : absl::StrCat(others.size(), " evaluations begin anew by mechanics version ",
                                    dem::EngineVersion()),
      [again, anew, also](Transaction& transaction) {
        if (also) {
          also(transaction);
        }
        if (anew) {
          anew(transaction);
        }
        for (const EvaluationKey& key : again) {
          transaction.SetEvaluation(key, EvaluationStatus::kWaiting, "", 0);
          transaction.SetLosses(key, 0);
        }
      },
      reply);
}

void Scheduler::Cancel(std::int64_t campaign, const store::Store::Job& also, const Reply& reply) {
  if (IsLoading(campaign, [=, this] { Cancel(campaign, also, reply); })) {
    return;
  }
  if (unreadable_.count(campaign) > 0) {
    SetUnreadable(campaign, CampaignState::kCancelled, "asked for", also, reply);
    return;
  }
  CampaignRun* run = LiveRun(campaign, reply);
  if (run == nullptr) {
    return;
  }
  const auto held = leases_.OfCampaign(campaign);
  std::vector<store::AttemptEnd> ends;
  for (const LeaseEntry& lease : held) {
    Release(lease.attempt);
    v1::Finished finished;
    finished.set_attempt(lease.attempt);
    ends.push_back(ToRecord(finished, AttemptOutcome::kCancelled));
    SetStatus(*run, lease.key, EvaluationStatus::kWaiting, 0);
  }
  SetState(
      *run, planning::CampaignEvent::kCancel, "asked for",
      [held, ends, also](Transaction& transaction) {
        if (also) {
          also(transaction);
        }
        for (std::size_t i = 0; i < held.size(); ++i) {
          transaction.EndAttempt(ends[i]);
          transaction.SetEvaluation(held[i].key, EvaluationStatus::kWaiting, "", 0);
        }
      },
      reply);
  runs_.erase(campaign);
  arrivals_.erase(campaign);
  for (const LeaseEntry& lease : held) {
    if (const WorkerEntry* worker = workers_.Find(lease.worker); worker != nullptr) {
      v1::ServerMessage message;
      message.mutable_stop()->set_attempt(lease.attempt);
      ports_.Send(worker->session, std::move(message));
    }
  }
}

void Scheduler::SetPriority(const Priority& wish, const store::Store::Job& also,
                            const Reply& reply) {
  if (IsLoading(wish.campaign, [=, this] { SetPriority(wish, also, reply); })) {
    return;
  }
  if (CampaignRun* run = FindRun(wish.campaign); run != nullptr) {
    run->SetPriority(wish.priority);
  }
  ports_.Write(
      [wish, also, now = ports_.UnixMs()](Transaction& transaction) {
        transaction.SetPriority(wish.campaign, wish.priority);
        transaction.Log(wish.campaign, now, absl::StrCat("priority ", wish.priority));
        if (also) {
          also(transaction);
        }
      },
      [this, wish, reply](const absl::Status& status) {
        StateChanged(wish.campaign);
        reply(status);
      });
}

void Scheduler::SetQuota(const std::string& owner, std::optional<int> slots, const Reply& reply) {
  shares_.SetQuota(owner, slots);
  ports_.Write(
      [owner, slots, now = ports_.UnixMs()](Transaction& transaction) {
        transaction.SetQuota(owner, slots);
        transaction.Log(0, now,
                        absl::StrCat("quota of ", owner, ": ",
                                     slots.has_value() ? absl::StrCat(*slots, " slots") : "none"));
      },
      [this, reply](const absl::Status& status) {
        WorkersChanged();
        reply(status);
        Dispatch();
      });
}

std::vector<v1::OwnerShare> Scheduler::OwnerShares() const {
  std::map<std::string, int> campaigns;
  for (const std::string& owner : shares_.Owners()) campaigns[owner] = 0;
  for (const auto& [id, run] : runs_) ++campaigns[run->record().submitted.owner];
  std::vector<v1::OwnerShare> owners;
  for (const auto& [owner, count] : campaigns) {
    v1::OwnerShare& share = owners.emplace_back();
    share.set_owner(owner);
    share.set_campaigns(count);
    share.set_held(shares_.OfOwner(owner).held);
    if (const auto quota = shares_.Quota(owner)) share.set_slots(*quota);
  }
  return owners;
}

void Scheduler::Delete(std::int64_t campaign, const store::Store::Job& also, const Reply& reply) {
  if (IsLoading(campaign, [=, this] { Delete(campaign, also, reply); })) {
    return;
  }
  if (const CampaignRun* run = FindRun(campaign); run != nullptr) {
    reply(absl::FailedPreconditionError(absl::StrCat("cannot delete a campaign that is ",
                                                     ToString(run->state()), "; cancel it first")));
    return;
  }
  again_.erase(campaign);
  ports_.Write(
      [campaign, also](Transaction& transaction) {
        transaction.DeleteCampaign(campaign);
        transaction.ForgetRequests(absl::StrCat("c", campaign));  // the same file may come again
        if (also) {
          also(transaction);
        }
      },
      reply);
  StateChanged(campaign);
}

void Scheduler::Concluded(std::int64_t campaign) {
  Changed(campaign);
  changed_[campaign].concluded = version_;
}

void Scheduler::StateChanged(std::int64_t campaign) {
  Concluded(campaign);
  list_changed_ = version_;
}

void Scheduler::RefreshView(CampaignRun& run) {
  if (!run.ViewIsOld() || !viewing_.insert(run.id()).second) {
    return;
  }
  ports_.Load([this, id = run.id(), look = run.Look()]() -> std::function<void()> {
    return [this, id, view = look()] {
      viewing_.erase(id);
      if (CampaignRun* looked_at = FindRun(id); looked_at != nullptr) {
        looked_at->SetView(view);
        Changed(id);
      }
    };
  });
}

std::optional<LiveStatus> Scheduler::Live(std::int64_t campaign) {
  CampaignRun* run = FindRun(campaign);
  if (run == nullptr) {
    return std::nullopt;
  }
  RefreshView(*run);
  LiveStatus live{.view = run->view(), .states_per_second = StatesPerSecond(campaign)};
  const auto& [seconds, ended] = durations_[campaign];
  const int slots = workers_.Slots();
  if (ended > 0 && slots > 0) {
    const auto open =
        run->Count(EvaluationStatus::kWaiting) + run->Count(EvaluationStatus::kRunning);
    live.eta_seconds = seconds / ended * static_cast<double>(open) / slots;
  }
  if (run->Count(EvaluationStatus::kWaiting) > 0) {
    live.nobody_may = WhyNobodyMay(*run);
  }
  return live;
}

std::string Scheduler::WhyNobodyMay(const CampaignRun& run) const {
  const campaign::Campaign& campaign = run.definition().campaign;
  const campaign::Resources& needs = campaign.resources;
  const std::string& owner = run.record().submitted.owner;
  const std::optional<int> quota = shares_.Quota(owner);
  if (!campaign.program && !needs.threads && !needs.memory && quota != 0) {
    return "";
  }
  int connected = 0;
  int allowed = 0;
  int fewest = 0;  // slots of a run; 0: no worker has as many
  for (const auto& [name, worker] : workers_.all()) {
    if (worker.session == 0) continue;
    ++connected;
    const WorkerTable::Kind kind = WorkerTable::KindOf(worker.hello);
    allowed += run.MayBeRunBy(kind.programs) ? 1 : 0;
    const int slots = run.SlotsOf(kind);
    if (slots > 0 && (fewest == 0 || slots < fewest)) fewest = slots;
  }
  if (quota.has_value() && *quota < std::max(1, fewest)) {
    return absl::StrCat("the quota of ", owner, " is ", *quota,
                        *quota == 1 ? " slot, and a run holds " : " slots, and a run holds ",
                        std::max(1, fewest));
  }
  if (fewest > 0) {
    return "";
  }
  if (campaign.program && allowed == 0) {
    const std::string& command = campaign.program->command.front();
    const bool brought = command.find('/') != std::string::npos && command.front() != '/';
    return absl::StrCat(
        connected == 0
            ? absl::StrCat("no worker is connected; this campaign runs ", command)
            : absl::StrCat("none of ", connected, " connected workers may run ", command),
        ": start one with --allow-command ",
        brought ? "'*' (the program is brought along, so that it has to allow any)" : command);
  }
  if (connected == 0) {
    return "";
  }
  std::vector<std::string> wanted;
  if (needs.threads) wanted.push_back(absl::StrCat(*needs.threads, " threads"));
  if (needs.memory) wanted.push_back(absl::StrCat(1e-6 * *needs.memory, " MB"));
  return absl::StrCat("none of ", connected, " connected workers has the ",
                      absl::StrJoin(wanted, " and "),
                      " that a run needs (resources): `calibctl workers` lists what they have");
}

double Scheduler::StatesPerSecond(std::int64_t campaign) {
  const auto arrivals = arrivals_.find(campaign);
  return arrivals == arrivals_.end() ? 0 : arrivals->second.PerSecond(ports_.Now());
}

std::map<std::int64_t, LiveStatus> Scheduler::AllLive() {
  std::map<std::int64_t, LiveStatus> all;
  for (const auto& [campaign, run] : runs_) {
    all.emplace(campaign, *Live(campaign));
  }
  return all;
}

std::string Scheduler::TooManyDiverged(CampaignRun& run, const std::string& last) {
  const campaign::Failure& failure = run.definition().campaign.failure;
  const int samples = run.record().submitted.samples;
  const int diverged = run.Diverged();
  if (run.progress().pause_waived || !planning::IsLeasable(run.state()) ||
      run.Done() < kFewestDoneToPause || diverged <= failure.pause_above * samples) {
    return "";
  }
  return absl::StrCat(
      diverged, " of ", samples,
      run.definition().campaign.program ? " samples diverged or are unknown" : " samples diverged",
      ", more than failure.pause_above = ", failure.pause_above, " allows, last: ", last,
      "; see the reasons of the samples, then resume or cancel");
}

void Scheduler::Advance(std::int64_t campaign) {
  CampaignRun* run = FindRun(campaign);
  if (run == nullptr || computing_.count(campaign) > 0 || again_.count(campaign) > 0 ||
      !planning::IsLeasable(run->state()) || !run->WantsPlan()) {
    return;
  }
  run->Planned(false);
  computing_.insert(campaign);
  // An empty write: when it is done, everything that memory knows of this campaign is on disk.
  ports_.Write([](Transaction&) {},
               [this, campaign](const absl::Status& status) {
                 CampaignRun* current = FindRun(campaign);
                 if (!status.ok() || current == nullptr) {
                   computing_.erase(campaign);
                   return;
                 }
                 ComputePlan(*current);
               });
}

void Scheduler::ComputePlan(CampaignRun& run) {
  ports_.Compute([this, id = run.id(), definition = run.shared_definition(),
                  record = run.record()]() -> std::function<void()> {
    auto plan =
        std::make_shared<absl::StatusOr<planning::Plan>>(ReadAndPlan(ports_, *definition, record));
    return [this, id, plan] { Adopt(id, *plan); };
  });
}

void Scheduler::Adopt(std::int64_t campaign, const absl::StatusOr<planning::Plan>& computed) {
  CampaignRun* run = FindRun(campaign);
  if (run == nullptr) {  // cancelled meanwhile
    computing_.erase(campaign);
    return;
  }
  if (MayPass(computed.status())) {
    computing_.erase(campaign);
    run->Planned(true);
    again_[campaign] = [this, campaign] { Advance(campaign); };
    return;
  }
  planning::Plan plan;
  if (computed.ok()) {
    plan = *computed;
  } else {
    plan.phase = run->progress().phase;
    plan.event = planning::CampaignEvent::kFail;
    plan.reason = std::string(computed.status().message());
  }
  store::CampaignProgress& progress = run->progress();
  progress.phase = plan.phase;
  progress.converged = plan.converged;
  const bool begins = plan.start.has_value() && !plan.start->continues;
  if (begins) {
    progress.iteration = plan.start->iteration;
    if (!run->definition().campaign.method->chooses_while_running()) {
      progress.pause_waived = false;  // its iterations are blocks of one run of points
    }
  }
  if (plan.event.has_value()) {
    plan.log.push_back(
        absl::StrCat(ToString(*plan.event), plan.reason.empty() ? "" : ": ", plan.reason));
    // Allowed in every state in which a plan is computed (transitions.cc).
    (void)run->Apply(*plan.event, plan.reason);
  }
  if (plan.conclusion.has_value() || plan.start.has_value()) {
    run->Planned(true);
  }
  const bool over = IsOver(run->state());
  if (over) {  // with runs under way only where the plan could not be made
    Enqueue(*run);
    for (const LeaseEntry& lease : leases_.OfCampaign(campaign)) {
      Release(lease.attempt);
      GiveBack(lease, {}, AttemptOutcome::kCancelled, false);
      if (const WorkerEntry* worker = workers_.Find(lease.worker); worker != nullptr) {
        v1::ServerMessage message;
        message.mutable_stop()->set_attempt(lease.attempt);
        ports_.Send(worker->session, std::move(message));
      }
    }
  }
  // Where runs are under way memory may be ahead of the disk in them.
  const bool at_rest = run->AllTerminal();
  Write(
      campaign,
      [plan, campaign, progress, now = ports_.UnixMs()](Transaction& t) {
        planning::Write(plan, campaign, progress, now, t);
      },
      [this, campaign, over, at_rest, begins, resumed = !plan.resumed.empty(),
       changes_state = plan.event.has_value(),
       concludes = plan.conclusion.has_value() || plan.start.has_value() || plan.draws.has_value(),
       stop_below = plan.stop_below](const absl::Status& status) {
        computing_.erase(campaign);
        if (changes_state) {
          StateChanged(campaign);
        } else if (concludes) {
          Concluded(campaign);
        }
        CampaignRun* planned = FindRun(campaign);
        if (!status.ok() || planned == nullptr) {
          return;
        }
        if (over) {
          runs_.erase(campaign);
          arrivals_.erase(campaign);
          Dispatch();
          return;
        }
        if (at_rest || begins) {
          durations_.erase(campaign);
        }
        for (const auto& [sample, threshold] : stop_below) {
          planned->SetStopBelow(sample, threshold);  // Offer() follows in TakeIn()
        }
        TakeIn(campaign, resumed);
      });
}

}  // namespace calib::scheduler
