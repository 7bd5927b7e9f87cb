// What people wish of campaigns and owners: submit, pause, resume, cancel, priority, quota, delete.
#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "server/scheduler/scheduler.h"

namespace calib::scheduler {

using store::AttemptOutcome;
using store::EvaluationKey;
using store::EvaluationStatus;
using store::Transaction;

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
  if (IsLoading(
          campaign, [=, this] { Pause(campaign, also, reply); }, reply)) {
    return;
  }
  CampaignRun* run = LiveRun(campaign, reply);
  if (run == nullptr) {
    return;
  }
  SetState(*run, planning::CampaignEvent::kPause, "asked for", also, reply);
}

void Scheduler::Resume(std::int64_t campaign, const store::Store::Job& also, const Reply& reply) {
  if (IsLoading(
          campaign, [=, this] { Resume(campaign, also, reply); }, reply)) {
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
  if (IsLoading(
          campaign, [=, this] { Cancel(campaign, also, reply); }, reply)) {
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
  if (IsLoading(
          wish.campaign, [=, this] { SetPriority(wish, also, reply); }, reply)) {
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
  if (IsLoading(
          campaign, [=, this] { Delete(campaign, also, reply); }, reply)) {
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

}  // namespace calib::scheduler
