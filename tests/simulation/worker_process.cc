#include "tests/simulation/worker_process.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "proto/rpc/digest.h"
#include "tests/simulation/campaigns.h"

namespace calib::simulation {
namespace {

constexpr milliseconds kFarewell{500};
constexpr milliseconds kEndingTakes{20};  // a thread that is on its way out
constexpr milliseconds kFirstWait{50};
constexpr milliseconds kLongestWait{1600};
constexpr Time kNever = Time::max();

const std::string& CatalogDigest() {
  static const std::string digest = rpc::Sha256Hex(dem::CatalogText());
  return digest;
}

}  // namespace

void WorkerProcess::Start() {
  process_ = std::make_unique<Process>();
  process_->instance = absl::StrCat(options_.name, "-", ++instances_);
  quits_ = false;
  Connect();
}

void WorkerProcess::Kill() {
  if (process_ != nullptr && process_->stream != nullptr) {
    process_->stream->cut = true;
    process_->stream->worker_left = true;
  }
  process_.reset();
}

void WorkerProcess::EndIfQuit() {
  if (quits_) Kill();
}

const std::shared_ptr<Stream>& WorkerProcess::stream() const {
  static const std::shared_ptr<Stream> kNone;
  return process_ == nullptr ? kNone : process_->stream;
}

std::size_t WorkerProcess::holds() const { return process_ == nullptr ? 0 : process_->held.size(); }

void WorkerProcess::Connect() {
  Process& p = *process_;
  v1::WorkerMessage message;
  v1::Hello& hello = *message.mutable_hello();
  hello.set_name(options_.name);
  hello.set_instance(p.instance);
  hello.set_slots(options_.slots);
  hello.set_threads_per_slot(1);
  hello.set_engine_version(dem::EngineVersion());
  hello.set_catalog_digest(CatalogDigest());
  hello.set_checkpoints(options_.folder_name);
  for (auto& [id, run] : p.held) {
    hello.add_attempts(id);
    run.held.StreamLost();
  }
  p.open = true;
  p.reconnect.reset();
  p.stream = surroundings_.Open(options_.number);
  Say(std::move(message));
}

void WorkerProcess::Say(v1::WorkerMessage message) {
  Stream& stream = *process_->stream;
  if (stream.cut || stream.has_said_all || stream.worker_left) return;
  Time due = clocks_.now + surroundings_.Delay();
  if (!stream.up.empty()) due = std::max(due, stream.up.back().due);
  stream.up.push_back({due, std::move(message)});
}

void WorkerProcess::Closed(const absl::Status& status) {
  Process& p = *process_;
  p.stream->worker_left = true;
  p.open = false;
  p.welcome = false;
  p.heartbeat.reset();
  if (p.stopping || p.leaving || absl::IsAlreadyExists(status) ||
      absl::IsFailedPrecondition(status) || absl::IsInvalidArgument(status)) {
    Quit();
  } else {
    const milliseconds wait = std::min(kLongestWait, kFirstWait * (1 << std::min(p.tries, 5)));
    ++p.tries;
    p.reconnect = clocks_.now + wait;
  }
  EndIfQuit();
}

void WorkerProcess::Receive(const v1::ServerMessage& message) {
  switch (message.message_case()) {
    case v1::ServerMessage::kWelcome:
      Welcome(message.welcome());
      break;
    case v1::ServerMessage::kLease:
      Take(message.lease());
      break;
    case v1::ServerMessage::kAck:
      Acknowledged(message.ack());
      break;
    case v1::ServerMessage::kAcks:
      for (const v1::Ack& ack : message.acks().acks()) Acknowledged(ack);
      break;
    case v1::ServerMessage::kStop:
      Drop(message.stop().attempt());
      break;
    case v1::ServerMessage::kDrain:
      if (message.drain().within_ms() > 0) {
        DrainWithin(milliseconds(message.drain().within_ms()));
      } else {
        process_->draining = true;
        LeaveIfDrained();
      }
      break;
    default:
      break;
  }
  EndIfQuit();
}

void WorkerProcess::Welcome(const v1::Welcome& welcome) {
  Process& p = *process_;
  p.welcome = true;
  p.tries = 0;
  p.heartbeat_every = milliseconds(welcome.heartbeat_ms());
  p.gather_for = milliseconds(welcome.gather_ms());
  for (auto& [id, run] : p.held) Send(run);
  Beat();
}

void WorkerProcess::Beat() {
  v1::WorkerMessage message;
  message.mutable_heartbeat();
  for (const auto& [id, run] : process_->held) message.mutable_heartbeat()->add_attempts(id);
  Say(std::move(message));
  process_->heartbeat = clocks_.now + process_->heartbeat_every;
}

void WorkerProcess::Send(Run& run) {
  if (!process_->welcome) return;
  for (v1::WorkerMessage& message : run.held.TakeUnsent()) Say(std::move(message));
}

void WorkerProcess::SendGathered() {
  process_->gather.reset();
  if (!process_->welcome) return;
  v1::WorkerMessage message;
  for (auto& [id, run] : process_->held) {
    for (v1::StateBatch& batch : run.held.TakeUnsentStates()) {
      *message.mutable_gathered()->add_batches() = std::move(batch);
    }
  }
  if (message.gathered().batches_size() > 0) Say(std::move(message));
}

void WorkerProcess::Take(const v1::Lease& lease) {
  Process& p = *process_;
  auto [it, added] = p.held.try_emplace(lease.attempt(), lease);
  if (!added) return;
  if (p.stopping || p.draining) {
    EndWithout(it->second, v1::Finished::OUTCOME_STOPPED, "the worker is leaving");
    return;
  }
  StartWaiting();
}

void WorkerProcess::EndWithout(Run& run, v1::Finished::Outcome outcome, const std::string& reason) {
  v1::Finished finished;
  finished.set_attempt(run.lease.attempt());
  finished.set_outcome(outcome);
  finished.set_reason(reason);
  run.ended = true;
  run.held.AddEnd(std::move(finished));
  Send(run);
}

void WorkerProcess::StartWaiting() {
  Process& p = *process_;
  int running = static_cast<int>(p.ending.size());
  for (const auto& [id, run] : p.held) running += run.running() ? 1 : 0;
  for (auto& [id, run] : p.held) {
    if (running >= options_.slots || p.stopping) return;
    if (run.started || run.ended) continue;
    ++running;
    run.started = true;
    const auto& path = run.lease.spec().path();
    run.until = run.lease.has_rest_after()
                    ? run.lease.rest_after() + 1
                    : static_cast<int>(std::count_if(path.begin(), path.end(), [](const auto& p2) {
                        return p2.load_step() >= 0;
                      }));
    run.due = clocks_.now + surroundings_.Pace();
  }
}

/// A run comes to its next state, or to its end.
void WorkerProcess::Advance(std::int64_t id, Run& run) {
  Process& p = *process_;
  const std::string& name = run.lease.run();
  std::map<std::string, int>& folder = *options_.folder;
  if (run.leaves) {
    if (!name.empty()) folder[name] = std::max(folder[name], run.reached);
    End(run, v1::Finished::OUTCOME_STOPPED, "told to leave");
    return;
  }
  if (run.reached > 0 && surroundings_.NodeFails()) {
    End(run, v1::Finished::OUTCOME_FAILED, "the node has failed");
    return;
  }
  if (run.reached > 0 && run.reached < run.until && surroundings_.IsHasty()) {
    End(run, v1::Finished::OUTCOME_COMPLETED, "");
    return;
  }
  if (run.reached < run.until) {
    const RunEnd of = EndOf(run.lease.spec());
    if (of.outcome != v1::Finished::OUTCOME_COMPLETED && run.reached == of.after) {
      End(run, of.outcome, of.reason);
      return;
    }
    run.held.AddState(StateOf(run.lease.spec(), run.reached++));
    surroundings_.Reached(id, run.reached);
    const auto known = folder.find(name);
    const bool is_known = known != folder.end() && !name.empty() && run.reached < known->second;
    run.due = clocks_.now + (is_known ? milliseconds(0) : surroundings_.Pace());
    if (p.gather_for.count() == 0) {
      Send(run);
    } else if (!p.gather.has_value()) {
      p.gather = clocks_.now + p.gather_for;
    }
    return;
  }
  if (run.lease.has_rest_after()) {
    folder[name] = run.until;
    End(run, v1::Finished::OUTCOME_RESTING, "");
  } else {
    End(run, v1::Finished::OUTCOME_COMPLETED, "");
  }
}

void WorkerProcess::End(Run& run, v1::Finished::Outcome outcome, const std::string& reason) {
  v1::Finished finished;
  finished.set_attempt(run.lease.attempt());
  finished.set_outcome(outcome);
  finished.set_reason(reason);
  finished.set_states(run.reached);
  run.ended = true;
  run.held.AddEnd(std::move(finished));
  if (process_->gather.has_value()) SendGathered();  // the end comes last
  Send(run);
  StartWaiting();
  FarewellIfStopped();
}

void WorkerProcess::Acknowledged(const v1::Ack& ack) {
  Process& p = *process_;
  const auto found = p.held.find(ack.attempt());
  if (found == p.held.end()) return;
  if (ack.refused()) {
    Drop(ack.attempt());
  } else if (ack.finished()) {
    p.held.erase(found);
  } else {
    found->second.held.Acknowledge(ack.up_to());
  }
  StartWaiting();
  LeaveIfDrained();
  FarewellIfStopped();
}

void WorkerProcess::Drop(std::int64_t id) {
  Process& p = *process_;
  const auto found = p.held.find(id);
  if (found == p.held.end()) return;
  if (found->second.running()) p.ending[id] = clocks_.now + kEndingTakes;
  p.held.erase(found);
  LeaveIfDrained();
}

void WorkerProcess::LeaveIfDrained() {
  const Process& p = *process_;
  if (p.draining && !p.stopping && !p.leaving && p.held.empty() && p.ending.empty()) Leave();
}

void WorkerProcess::Signal(std::optional<milliseconds> within) {
  if (within.has_value()) {
    DrainWithin(*within);
  } else {
    Stop();
  }
  EndIfQuit();
}

void WorkerProcess::DrainWithin(milliseconds within) {
  Process& p = *process_;
  if (p.stopping || p.leaving) return;
  p.draining = true;
  for (auto& [id, run] : p.held) {
    if (!run.started && !run.ended) {
      EndWithout(run, v1::Finished::OUTCOME_STOPPED, "the worker is leaving");
    }
  }
  p.farewell = clocks_.now + within;
  if (p.open) {
    LeaveIfDrained();
  } else if (p.held.empty()) {
    Quit();
  }
}

void WorkerProcess::Stop() {
  Process& p = *process_;
  p.stopping = true;
  p.reconnect.reset();
  std::erase_if(p.held, [](const auto& item) { return !item.second.started; });
  for (auto& [id, run] : p.held) {
    run.leaves = run.running();
    run.due = clocks_.now;
  }
  p.farewell = clocks_.now + kFarewell;
  FarewellIfStopped();
}

void WorkerProcess::FarewellIfStopped() {
  const Process& p = *process_;
  if (!p.stopping || !p.ending.empty()) return;
  for (const auto& [id, run] : p.held) {
    if (run.running()) return;
  }
  if (!p.open) {
    Quit();
  } else if (p.held.empty() && !p.leaving) {
    Leave();
  }
}

void WorkerProcess::Leave() {
  process_->leaving = true;
  v1::WorkerMessage message;
  message.mutable_leaving();
  Say(std::move(message));
  process_->stream->has_said_all = true;
}

Time WorkerProcess::next() const {
  if (process_ == nullptr) return kNever;
  const Process& p = *process_;
  Time first = kNever;
  for (const auto& timer : {p.heartbeat, p.gather, p.reconnect, p.farewell}) {
    if (timer.has_value()) first = std::min(first, *timer);
  }
  for (const auto& [id, due] : p.ending) first = std::min(first, due);
  for (const auto& [id, run] : p.held) {
    if (run.running()) first = std::min(first, run.due);
  }
  return first == kNever ? kNever : std::max(first, frozen_until);
}

void WorkerProcess::Go() {
  Process& p = *process_;
  const Time now = clocks_.now;
  const auto is_due = [now](std::optional<Time>& timer) {
    if (!timer.has_value() || *timer > now) return false;
    timer.reset();
    return true;
  };
  if (is_due(p.heartbeat)) {
    if (p.welcome) Beat();
  } else if (is_due(p.gather)) {
    SendGathered();
  } else if (is_due(p.reconnect)) {
    if (!p.stopping) Connect();
  } else if (is_due(p.farewell)) {
    if (p.stopping) {
      Quit();
    } else {
      Stop();
    }
  } else if (std::erase_if(p.ending, [now](const auto& item) { return item.second <= now; }) > 0) {
    StartWaiting();
    LeaveIfDrained();
    FarewellIfStopped();
  } else {
    for (auto& [id, run] : p.held) {
      if (run.running() && run.due <= now) {
        Advance(id, run);
        break;
      }
    }
  }
  EndIfQuit();
}

}  // namespace calib::simulation
