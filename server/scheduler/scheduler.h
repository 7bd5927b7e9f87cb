#pragma once
// The heart of the service: which worker runs what, what its messages mean, and what a campaign
// does next.

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/v1/campaign.pb.h"
#include "calib/v1/worker.pb.h"
#include "server/methods/registry.h"
#include "server/planning/growth.h"
#include "server/planning/plan.h"
#include "server/scheduler/campaign_run.h"
#include "server/scheduler/leases/arrival_rate.h"
#include "server/scheduler/leases/fair_share.h"
#include "server/scheduler/leases/lease_table.h"
#include "server/scheduler/leases/waiting_runs.h"
#include "server/scheduler/leases/worker_table.h"
#include "server/scheduler/ports.h"

namespace calib::scheduler {

struct SchedulerOptions {
  std::chrono::milliseconds lease{
      15'000};  ///< an attempt is lost when nothing was heard of its worker for this long
  std::chrono::milliseconds heartbeat{2'000};  ///< workers are told to speak at least this often
  /// Workers may let states wait this long for others to go with them, at most a heartbeat. At
  /// thousands of states a second a message then has several, each of which costs a fraction of its
  /// own message; chosen: an acknowledgement within 250 ms of its state still leaves 100 ms to the
  /// disk.
  std::chrono::milliseconds gather{150};
  int most_slots = 1024;                                  ///< of one worker, >= 1
  int most_campaigns = 1000;                              ///< that are not over, >= 1
  const campaign::MethodList* methods = &methods::All();  ///< that campaigns may have
};

/// What is known of a live campaign beyond the store.
struct LiveStatus {
  LiveView view{};    ///< as it was computed last, aside
  int iteration = 0;  ///< that the next are of
  campaign::SampleCounts counts{};
  double eta_seconds = -1;  ///< of what is planned; negative: unknown
  double states_per_second = 0;
  std::string nobody_may{};  ///< why nobody may run what waits of it; empty: somebody may
};

/// When something of a campaign changed last, as versions of the scheduler; 0: not since it
/// started.
struct ChangedAt {
  std::uint64_t any = 0;
  std::uint64_t concluded = 0;  ///< posterior, findings, what they are compared with, or its end
};

/// A single-threaded state machine: every call comes on one strand, where its Ports run its
/// continuations. Memory is ahead of the disk; what leaves the program (leases, acks, answers)
/// waits for the commit of all that led to it.
class Scheduler {
 public:
  using Reply = std::function<void(const absl::Status&)>;

  Scheduler(Ports& ports, SchedulerOptions options)
      : ports_(ports), options_(options), leases_(options.lease) {}

  /// Begins to read every campaign that is not over, aside. When all are read, attempts that were
  /// running get a fresh lease: their workers may come back and go on. Workers that come before
  /// that are let in then, and what is wished of such a campaign is done then.
  absl::Status Load();
  /// The process ends: what Load() has begun is left, and who waits for it gets UNAVAILABLE.
  void StopReading();
  /// Campaigns that were there at the start and are still being read.
  std::size_t being_read() const { return started_with_.size() - read_.size(); }

  // ---- workers (scheduler_links.cc, scheduler_runs.cc) ----
  /// FAILED_PRECONDITION when the worker's mechanics or catalogue are not the server's, or it has
  /// more slots than the server takes; INVALID_ARGUMENT for more attempts than its slots can hold;
  /// ALREADY_EXISTS when another process is connected under its name (WorkerTable::IsAnother).
  /// hello keeps its rules.
  absl::Status Connected(std::int64_t session, const v1::Hello& hello);
  void Disconnected(std::int64_t session);
  void Receive(std::int64_t session, const v1::StateBatch& batch);
  /// Of several attempts, which are acknowledged together.
  void Receive(std::int64_t session, const v1::StateBatches& gathered);
  void Receive(std::int64_t session, const v1::Finished& finished);
  /// INVALID_ARGUMENT for more attempts than its slots can hold.
  absl::Status Receive(std::int64_t session, const v1::Heartbeat& heartbeat);
  void Receive(std::int64_t session, const v1::Leaving& leaving);
  /// A message about an attempt broke a rule: the attempt has failed for this reason.
  void Reject(std::int64_t session, std::int64_t attempt, const std::string& why);
  /// NOT_FOUND: no such worker.
  absl::StatusOr<v1::WorkerInfo> Drain(const std::string& worker, std::chrono::milliseconds within);
  std::vector<v1::WorkerInfo> Workers() const;
  /// Workers that were turned away by Connected() and have not come back since; the last time of
  /// each name, of the sixteen names that came last.
  std::vector<v1::RefusedWorker> Refused() const { return refused_; }
  /// Gives up leases that have run out. Call at least four times per lease: where one call is late
  /// by half a lease the server has stood still, and nothing ends for a lease time from then.
  void Tick();

  // ---- campaigns (scheduler_commands.cc, scheduler_plans.cc) ----
  /// Stores and starts a campaign that was read without problems. Its id is chosen here ("c1"),
  /// given to `reply` and remembered as the answer to the request (request.answer is ignored; an
  /// empty request_id is not remembered). RESOURCE_EXHAUSTED: as many campaigns are not over as the
  /// server takes.
  void Submit(store::NewCampaign submitted, std::map<std::string, std::string> files,
              const std::string& request_id, const store::RequestRecord& request,
              std::function<void(absl::StatusOr<std::string>)> reply);
  /// Adds runs to a design (growth.cc): true once they are on the disk, false where the
  /// same are there already. Errors: those of PlanGrowth(), RESOURCE_EXHAUSTED as for Submit().
  using GrowthReply = std::function<void(absl::StatusOr<bool>)>;
  void AddRuns(const planning::NewRuns& runs, const GrowthReply& reply);
  /// FAILED_PRECONDITION when the campaign's state does not allow it. `also` is written with the
  /// change (the request that asked for it); may be empty. A paused campaign's running evaluations
  /// go on to their ends.
  void Pause(std::int64_t campaign, const store::Store::Job& also, const Reply& reply);
  void Resume(std::int64_t campaign, const store::Store::Job& also, const Reply& reply);
  void Cancel(std::int64_t campaign, const store::Store::Job& also, const Reply& reply);
  /// Of the campaign among its owner's: who is leased first, see fair_share.h. In any state.
  struct Priority {
    std::int64_t campaign = 0;
    int priority = 0;
  };
  void SetPriority(const Priority& wish, const store::Store::Job& also, const Reply& reply);
  /// Slots that an owner's runs hold at most, see Shares::SetQuota.
  void SetQuota(const std::string& owner, std::optional<int> slots, const Reply& reply);
  /// Who has campaigns that are not over, holds slots or has a quota, in order of names.
  std::vector<v1::OwnerShare> OwnerShares() const;
  /// Only campaigns that are over.
  void Delete(std::int64_t campaign, const store::Store::Job& also, const Reply& reply);
  /// Empty when the campaign is not live.
  std::optional<LiveStatus> Live(std::int64_t campaign);
  /// Of every campaign that is not over.
  std::map<std::int64_t, LiveStatus> AllLive();
  /// Grows whenever something changed that a status shows.
  std::uint64_t version() const { return version_; }
  /// By campaign, deleted ones included.
  const std::map<std::int64_t, ChangedAt>& changed() const { return changed_; }
  /// When a campaign came, went or changed its state, and when what workers do changed.
  std::uint64_t list_changed() const { return list_changed_; }
  std::uint64_t workers_changed() const { return workers_changed_; }
  /// That came in of late; 0 of a campaign that is not live.
  double StatesPerSecond(std::int64_t campaign);
  /// What is concluded of a campaign has changed, as by a finding that was kept.
  void Concluded(std::int64_t campaign);
  /// Campaigns that are not over.
  std::size_t live() const { return runs_.size() + started_with_.size(); }
  /// Evaluations that wait for a slot, and campaigns with a plan in the making.
  std::size_t queued() const { return waiting_.size(); }
  std::size_t planning() const { return computing_.size(); }

 private:
  /// Writes what follows for a campaign. Where the store refuses it, memory is ahead of what is on
  /// disk and will stay so: the campaign is paused and read again, the others go on.
  void Write(std::int64_t campaign, store::Store::Job job, Reply then);
  void ReadAgain(std::int64_t campaign, const absl::Status& why);
  CampaignRun* FindRun(std::int64_t campaign);
  /// FindRun(), or replies that the campaign is over.
  CampaignRun* LiveRun(std::int64_t campaign, const Reply& reply);

  // Workers (scheduler_links.cc)
  /// Why a worker may not join; OK when it may.
  absl::Status Admit(const v1::Hello& hello) const;

  // Work (scheduler_runs.cc, scheduler_leasing.cc)
  /// Leases what waits, in the order of FairLine, each to the worker with the most free slots that
  /// may run it; one that rests where a worker, which is there, can go on with it, waits for that.
  /// Not all in one turn where they are many: what workers say meanwhile is heard in between.
  void Dispatch();
  /// Enters the first of a group that does not wait for another campaign's run, if there is one.
  void Enter(FairLine& line, const WaitingRuns::Group& group);
  /// The worker that should take runs of this group now, or has too few free slots for one.
  WorkerTable::Choice WorkerFor(const WaitingRuns::Group& group,
                                const WorkerTable::Others& without);
  void Grant(const WorkerTable::Choice& choice, const store::EvaluationKey& key);
  /// The worker that has spoken, or nullptr when its stream has been replaced.
  const WorkerEntry* Heard(std::int64_t session);
  /// An end that the server itself writes.
  static v1::Finished Because(std::int64_t attempt, const std::string& reason);
  static Shares::Holding HoldingOf(const LeaseEntry& lease);
  /// Enters a lease; takes one out of all that knows of it, empty if there is none.
  void Hold(const LeaseEntry& lease);
  std::optional<LeaseEntry> Release(std::int64_t attempt);
  void SetStatus(CampaignRun& run, const store::EvaluationKey& key, store::EvaluationStatus status,
                 int failures);
  /// Enters what waits of a sample into waiting_, or takes it out, as campaign and turn demand.
  void Offer(CampaignRun& run, int sample);
  void SendDrain(const WorkerEntry& worker);
  void Refuse(std::int64_t session, std::int64_t attempt);
  /// The attempt is over without a result: back to the queue, or the campaign is paused when it
  /// failed too often.
  void GiveBack(const LeaseEntry& lease, const v1::Finished& how, store::AttemptOutcome outcome,
                bool counts_as_failure);
  /// held_in: see store::EvaluationRecord.
  void End(std::int64_t session, const LeaseEntry& lease, store::EvaluationStatus status,
           const v1::Finished& finished, const std::string& held_in = "");
  /// It has come to its rung.
  void Rest(std::int64_t session, const LeaseEntry& lease, const v1::Finished& finished,
            const std::string& held_in);
  /// The sample cannot count any more: stores what decided it and lets the worker stop.
  /// A program failed: done again, or set aside as unknown.
  void ModelFailed(std::int64_t session, const LeaseEntry& lease, const v1::Finished& finished);
  /// Why no worker that is connected may run it, or its owner none of its runs; empty: one may.
  std::string WhyNobodyMay(const CampaignRun& run) const;
  /// What a lease of this worker holds by now.
  void FitSlots(const v1::Hello& hello);
  void StopEarly(std::int64_t session, const LeaseEntry& lease,
                 std::vector<store::StateRecord> records);
  /// What is to be written of a batch, and acknowledged then.
  struct TakenStates {
    std::int64_t campaign = 0;
    v1::Ack ack{};
    std::vector<store::StateRecord> records{};
  };
  /// Empty: nothing of it is, or what is to be done has been done.
  std::optional<TakenStates> TakeStates(std::int64_t session, const WorkerEntry& worker,
                                        const v1::StateBatch& batch);
  /// The answer is sent once they are on disk.
  void WriteStates(std::int64_t session, std::int64_t campaign,
                   std::vector<store::StateRecord> records, v1::ServerMessage answer);
  store::AttemptEnd ToRecord(const v1::Finished& finished, store::AttemptOutcome outcome);

  // Runs that another campaign makes as well (scheduler_reuse.cc)
  /// Whether it is computed for every campaign that waits for the same.
  bool IsShared(const store::EvaluationKey& key);
  /// What others may take of it, see LeaseEntry.
  std::string SharedDigest(const store::EvaluationKey& key);
  /// Whether it is computed for another campaign now: it then waits for that, off the index.
  bool WaitsForAnother(const store::EvaluationKey& key);
  /// An attempt more, or one less, computes what has this digest, or is on its way to the disk with
  /// it.
  void UnderWay(const std::string& digest);
  void NoLongerUnderWay(const std::string& digest);
  /// The shared ones that wait in a campaign; of this digest only unless it is empty.
  std::vector<store::EvaluationKey> SharedWaiting(CampaignRun& run, const std::string& digest);
  /// Takes what waits here and has ended in another campaign from there.
  void TakeFromOthers(CampaignRun& run, const std::string& digest = "");
  /// What TakeFromOthers has written is taken into memory.
  void Taken(std::int64_t campaign, const std::vector<store::EvaluationKey>& keys);

  // Runs that are added (growth.cc)
  void Grow(const planning::NewRuns& runs, const GrowthReply& reply);
  void WriteGrowth(std::int64_t campaign, const planning::Growth& growth, const GrowthReply& reply);

  // Campaigns (scheduler.cc, scheduler_plans.cc)
  /// What Load() has begun is read: campaigns and their leases are taken up, workers let in.
  void TakeUpAll();
  /// RESOURCE_EXHAUSTED when as many campaigns are not over as the server takes.
  absl::Status WhyNoMore() const;
  /// On any thread; shared, since what is posted is copied.
  std::shared_ptr<absl::StatusOr<std::unique_ptr<CampaignRun>>> ReadCampaign(std::int64_t campaign);
  void TakeUp(std::int64_t campaign, absl::StatusOr<std::unique_ptr<CampaignRun>> loaded);
  /// Forgets what other mechanics have begun, leases included; the job does so in the store.
  store::Store::Job BeginAnew(CampaignRun& run,
                              const std::map<store::EvaluationKey, std::string>& others);
  /// What other mechanics have begun waits for a word; what nobody has begun is planned anew.
  void PauseIfOfOtherMechanics(CampaignRun& run);
  /// What runs by the store, but by no lease, waits again.
  void ReturnUnleased(CampaignRun& run);
  /// Loads it aside, then TakeUp and what follows from it; again with the next Tick when the store
  /// cannot be read now.
  void TakeUpNow(std::int64_t campaign);
  /// The same of one that is among those that are loading.
  void LoadAside(std::int64_t campaign);
  /// Whether the campaign is being loaded; `then` is done once that has ended, or `refuse` where it
  /// will not.
  bool IsLoading(std::int64_t campaign, std::function<void()> then, Reply refuse);
  /// Has the view of what has arrived since computed aside.
  void RefreshView(CampaignRun& run);
  /// What a plan has changed in the store.
  struct PlanWritten {
    std::int64_t campaign = 0;
    bool resumed = false;                              ///< something that had ended goes on
    std::vector<std::pair<int, double>> stop_below{};  ///< see planning::Plan
  };
  /// Takes that into memory, then what follows from it; again with the next Tick when the store
  /// cannot be read now.
  void TakeIn(const PlanWritten& written);
  /// Reads aside what memory has not. Until it is taken in, the campaign is planned no further.
  void ExtendAside(const CampaignRun& run, const PlanWritten& written);
  /// Reads aside what is stored of a campaign that nobody works on, then what follows from it.
  void ReloadAside(const CampaignRun& run);
  /// Hands out what memory has learnt of the store.
  void GoOn(CampaignRun& run);
  /// What waits for a campaign to be loaded.
  void DoneLoading(std::int64_t campaign);
  /// Offer() of every sample.
  void Enqueue(CampaignRun& run);
  /// Why a campaign must pause that has too many diverged samples; empty: it need not. last: why
  /// the run that ended now did.
  static std::string TooManyDiverged(CampaignRun& run, const std::string& last);
  /// Changes the state, writes it after `also`, then replies.
  /// Whether it is worth trying again in a moment.
  static bool MayPass(const absl::Status& error);
  /// Of a campaign that this program cannot read: its state in the store alone.
  void SetUnreadable(std::int64_t campaign, CampaignState state, const std::string& reason,
                     const store::Store::Job& also, const Reply& reply);
  void SetState(CampaignRun& run, planning::CampaignEvent event, const std::string& reason,
                const store::Store::Job& also, const Reply& reply);
  /// Computes the next plan when everything planned so far has ended. Only after a commit.
  void Advance(std::int64_t campaign);
  void ComputePlan(CampaignRun& run);
  void Adopt(std::int64_t campaign, const absl::StatusOr<planning::Plan>& plan);

  // What changed, for version() and changed()
  void Changed(std::int64_t campaign) { changed_[campaign].any = ++version_; }
  void StateChanged(std::int64_t campaign);
  void WorkersChanged() { workers_changed_ = ++version_; }

  Ports& ports_;
  SchedulerOptions options_;
  LeaseTable leases_;
  /// Attempts whose end is on its way to the disk: neither held nor refused. With the digest of
  /// what others may take then; empty: nothing.
  std::map<std::int64_t, std::string> ending_;
  Shares shares_;  // of leases_
  WorkerTable workers_;
  std::vector<v1::RefusedWorker> refused_;                     // oldest first
  std::map<std::int64_t, std::unique_ptr<CampaignRun>> runs_;  // those that are not over
  WaitingRuns waiting_;                   // of leasable campaigns, each in its turn
  std::map<std::string, int> under_way_;  // attempts by the digest that others may take from them
  std::map<std::string, std::set<store::EvaluationKey>> parked_;  // WaitsForAnother, by digest
  std::set<std::int64_t> computing_;  // campaigns with a plan in the making
  std::set<std::int64_t> viewing_;    // and with a view in the making
  struct Waiting {
    std::function<void()> then;
    Reply refuse;
  };
  std::map<std::int64_t, std::vector<Waiting>> loading_;  // with what waits for that
  std::atomic<bool> stops_reading_ = false;               // read where campaigns are
  std::set<std::int64_t> started_with_;  // campaigns of Load(), empty once TakeUpAll() was called
  std::map<std::int64_t, absl::StatusOr<std::unique_ptr<CampaignRun>>> read_;  // of these so far
  std::vector<store::ActiveAttempt> attempts_at_start_;                        // until then
  std::map<std::int64_t, v1::Hello> early_;              // workers that wait for that, by session
  std::map<std::int64_t, std::function<void()>> again_;  // by campaign: what the next Tick retries
  std::map<std::int64_t, std::string> unreadable_;       // why, of those that are not over
  std::map<std::int64_t, std::pair<double, int>>
      durations_;  // seconds and number of ended attempts
  bool dispatches_later_ = false;
  Clock::time_point ticked_{};  // or loaded
  std::int64_t last_attempt_ = 0;
  std::int64_t last_campaign_ = 0;
  std::uint64_t version_ = 0;
  std::map<std::int64_t, ChangedAt> changed_;
  std::uint64_t list_changed_ = 0;
  std::uint64_t workers_changed_ = 0;
  std::map<std::int64_t, ArrivalRate> arrivals_;  // of states, by campaign that is not over
};

}  // namespace calib::scheduler
