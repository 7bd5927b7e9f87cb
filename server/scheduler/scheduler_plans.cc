// What campaigns do next, and how they are seen meanwhile.
#include <algorithm>
#include <new>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "server/messages/attempt_spec.h"
#include "server/planning/phases/plan_next.h"
#include "server/scheduler/scheduler.h"

namespace calib::scheduler {

using store::AttemptOutcome;
using store::EvaluationStatus;
using store::Transaction;

namespace {

/// Too few samples say nothing about the share that fails.
constexpr int kFewestDoneToPause = 4;

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
  LiveStatus live{.view = run->view(),
                  .iteration = run->progress().iteration,
                  .counts = run->Counts(),
                  .states_per_second = StatesPerSecond(campaign)};
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
  int connected = 0;
  int allowed = 0;  // to run its program
  int alike = 0;    // with the server's DEM
  int fewest = 0;   // slots of a run; 0: no worker has as many
  for (const auto& [name, worker] : workers_.all()) {
    if (worker.session == 0) continue;
    ++connected;
    const WorkerTable::Kind kind = WorkerTable::KindOf(worker.hello);
    allowed += run.MayBeRunBy(kind.programs) ? 1 : 0;
    alike += kind.mechanics == OwnMechanics() ? 1 : 0;
    const int slots = run.SlotsOf(kind);
    if (slots > 0 && (fewest == 0 || slots < fewest)) fewest = slots;
    if (fewest == 1) break;  // none may be had for less
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
  if (!campaign.program && alike == 0) {
    return absl::StrCat(
        "none of ", connected, connected == 1 ? " connected worker" : " connected workers",
        " has the server's mechanics: `calibctl workers --json` says why each waits");
  }
  if (run.NeedsLimits() && !needs.threads && !needs.memory) {
    return absl::StrCat("none of ", connected,
                        " connected workers is of a build that holds a run "
                        "to wall and silence of resources: update the nodes");
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
        TakeIn({.campaign = campaign, .resumed = resumed, .stop_below = stop_below});
      });
}

}  // namespace calib::scheduler
