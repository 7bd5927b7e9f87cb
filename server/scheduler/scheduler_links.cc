// Workers: who is let in, what is heard of them, what is told of them.
#include <algorithm>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "proto/calib/v1/protocol.h"
#include "server/campaign/model/sha256.h"
#include "server/scheduler/scheduler.h"

namespace calib::scheduler {

using store::AttemptOutcome;

namespace {

/// A worker that left is still shown this long.
constexpr std::chrono::minutes kRemembered{10};
/// Attempts that a worker may name, by slot: those leased, and those of a lease that has expired
/// while it was frozen, twice over.
constexpr int kAttemptsPerSlot = 4;
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

/// Why a worker gets no runs of the DEM; empty: it does.
std::string WhyWaits(const v1::Hello& hello) {
  if (hello.engine_version() != dem::EngineVersion()) {
    return absl::StrCat("mechanics version ", hello.engine_version(), ", the server has ",
                        dem::EngineVersion(), ": waits until both are of one build");
  }
  if (hello.catalog_digest() != campaign::Sha256Hex(dem::CatalogText())) {
    return "other contacts, effects or tests than the server: waits until both are of one build";
  }
  return "";
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
  if (absl::Status status =
          CheckProtocol(absl::StrCat("worker ", hello.name()), hello.protocol(), "the server");
      !status.ok()) {
    return status;
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
  if (!started_with_.empty()) {
    early_[session] = hello;
    return absl::OkStatus();
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
  welcome.mutable_welcome()->set_protocol(kProtocol);
  welcome.mutable_welcome()->set_waits(WhyWaits(hello));
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

// Those that are known from the store alone, or it has come back with other slots, as another
// build, or may no longer run what it has run.
void Scheduler::FitSlots(const v1::Hello& hello) {
  for (const LeaseEntry& lease : leases_.OfWorker(hello.name())) {
    const int slots = FindRun(lease.key.campaign)->SlotsOf(WorkerTable::KindOf(hello));
    if (slots == 0) {
      Release(lease.attempt);
      GiveBack(lease, Because(lease.attempt, "the worker came back as one that may not run it"),
               AttemptOutcome::kLost, true);
    } else if (slots != lease.slots) {
      shares_.Return(HoldingOf(lease));
      leases_.Resize(lease.attempt, slots);
      shares_.Take(HoldingOf(*leases_.Find(lease.attempt, hello.name())));
    }
  }
}

void Scheduler::Disconnected(std::int64_t session) {
  early_.erase(session);
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
    info.set_waits(WhyWaits(entry.hello));
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
