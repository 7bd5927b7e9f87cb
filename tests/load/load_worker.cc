#include "tests/load/load_worker.h"

#include <grpcpp/grpcpp.h>

#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <utility>

#include "calib/v1/worker.grpc.pb.h"
#include "dem/registry/catalog.h"
#include "proto/rpc/client_options.h"
#include "tests/support/client.h"

namespace calib::load {
namespace {

double Milliseconds(Clock::duration d) {
  return std::chrono::duration<double, std::milli>(d).count();
}

}  // namespace

class LoadWorker::Stream : public grpc::ClientBidiReactor<v1::WorkerMessage, v1::ServerMessage> {
 public:
  Stream(const std::string& name, const Load& load)
      : channel_(rpc::OpenChannel(load.address, load.access)),
        stub_(v1::WorkerLink::NewStub(channel_)),
        interval_(std::chrono::duration_cast<Clock::duration>(
            std::chrono::duration<double>(1 / load.states_per_second))) {
    context_.set_wait_for_ready(true);
    stub_->async()->Connect(&context_, this);
    v1::WorkerMessage hello;
    *hello.mutable_hello() = testing::MatchingHello(name, load.slots);
    const std::lock_guard lock(mutex_);
    Send(std::move(hello));
    StartRead(&incoming_);
    StartCall();
  }

  void Tick(Clock::time_point now) {
    const std::lock_guard lock(mutex_);
    if (!seen_.ended.empty()) return;
    for (auto& [attempt, run] : runs_) SendStates(attempt, run, now);
    if (gathered_.batches_size() > 0 && now >= gathered_since_ + gather_) SendGathered();
    if (now >= next_heartbeat_) {
      v1::WorkerMessage beat;
      beat.mutable_heartbeat();
      for (const auto& [attempt, run] : runs_) beat.mutable_heartbeat()->add_attempts(attempt);
      Send(std::move(beat));
      next_heartbeat_ = now + heartbeat_;
    }
  }

  void Count() {
    const std::lock_guard lock(mutex_);
    counts_ = true;
  }

  Seen Take() {
    const std::lock_guard lock(mutex_);
    return seen_;
  }

  void CutAndWait() {
    context_.TryCancel();
    std::unique_lock lock(mutex_);
    done_.wait(lock, [this] { return is_done_; });
  }

  void OnReadDone(bool ok) override {
    if (!ok) return;
    {
      const std::lock_guard lock(mutex_);
      Hear(incoming_);
    }
    StartRead(&incoming_);
  }

  void OnWriteDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    outgoing_.pop_front();
    if (ok && !outgoing_.empty()) StartWrite(&outgoing_.front());
  }

  void OnDone(const grpc::Status& status) override {
    const std::lock_guard lock(mutex_);
    seen_.ended = status.error_message().empty() ? "closed" : status.error_message();
    is_done_ = true;
    done_.notify_all();
  }

 private:
  struct Run {
    std::vector<int> load_steps;  // of its states
    std::size_t width = 0;        // values of a state
    Clock::time_point due;        // of the next state
    std::vector<Clock::time_point> births;
    std::size_t acknowledged = 0;
  };

  void Send(v1::WorkerMessage message) {
    outgoing_.push_back(std::move(message));
    if (outgoing_.size() == 1) StartWrite(&outgoing_.front());
  }

  void SendStates(std::int64_t attempt, Run& run, Clock::time_point now) {
    if (run.due > now || run.births.size() == run.load_steps.size()) return;
    if (gathered_.batches_size() == 0) gathered_since_ = run.due;
    v1::StateBatch& batch = BatchOf(attempt, run);
    while (run.due <= now && run.births.size() < run.load_steps.size()) {
      v1::State& state = *batch.add_states();
      state.set_load_step(run.load_steps[run.births.size()]);
      for (std::size_t k = 0; k < run.width; ++k) {
        state.add_values(0.5 + 0.1 * static_cast<double>((attempt + state.load_step()) % 5));
      }
      run.births.push_back(run.due);
      run.due += interval_;
    }
    if (run.births.size() < run.load_steps.size()) return;
    SendGathered();  // the end comes last
    v1::WorkerMessage end;
    v1::Finished& finished = *end.mutable_finished();
    finished.set_attempt(attempt);
    finished.set_outcome(v1::Finished::OUTCOME_COMPLETED);
    finished.set_states(static_cast<std::int64_t>(run.births.size()));
    finished.set_core_seconds(0.1);
    Send(std::move(end));
  }

  /// What is to be sent of a run, after what is there of it already.
  v1::StateBatch& BatchOf(std::int64_t attempt, const Run& run) {
    for (v1::StateBatch& batch : *gathered_.mutable_batches()) {
      if (batch.attempt() == attempt) return batch;
    }
    v1::StateBatch& batch = *gathered_.add_batches();
    batch.set_attempt(attempt);
    batch.set_first(static_cast<std::int64_t>(run.births.size()));
    return batch;
  }

  void SendGathered() {
    v1::WorkerMessage message;
    if (gather_.count() > 0) {
      message.mutable_gathered()->Swap(&gathered_);
      Send(std::move(message));
    } else {
      for (v1::StateBatch& batch : *gathered_.mutable_batches()) {
        message.mutable_states()->Swap(&batch);
        Send(std::exchange(message, {}));
      }
    }
    gathered_.Clear();
  }

  void Hear(const v1::ServerMessage& message) {
    if (message.has_welcome()) {
      heartbeat_ = std::chrono::milliseconds(message.welcome().heartbeat_ms());
      gather_ = std::chrono::milliseconds(message.welcome().gather_ms());
    } else if (message.has_lease()) {
      Take(message.lease());
    } else if (message.has_ack()) {
      Hear(message.ack());
    } else if (message.has_acks()) {
      for (const v1::Ack& ack : message.acks().acks()) Hear(ack);
    } else if (message.has_stop()) {
      runs_.erase(message.stop().attempt());
    }
  }

  void Take(const v1::Lease& lease) {
    Run run;
    for (const v1::ControlPoint& point : lease.spec().path()) {
      if (point.load_step() >= 0) run.load_steps.push_back(point.load_step());
    }
    const dem::TestInfo* test = dem::FindTest(lease.spec().test());
    run.width = test == nullptr ? 1 : test->observables.size();
    // Runs of one moment do not speak at one moment.
    run.due = Clock::now() + interval_ * (lease.attempt() % 97) / 97;
    runs_[lease.attempt()] = std::move(run);
  }

  void Hear(const v1::Ack& ack) {
    const auto found = runs_.find(ack.attempt());
    if (found == runs_.end()) return;
    Run& run = found->second;
    const auto now = Clock::now();
    const auto up_to = std::min(static_cast<std::size_t>(ack.up_to()), run.births.size());
    for (; run.acknowledged < up_to; ++run.acknowledged) {
      if (counts_) {
        seen_.waits_ms.push_back(
            static_cast<float>(Milliseconds(now - run.births[run.acknowledged])));
      }
    }
    if (ack.refused() || ack.finished()) {
      if (counts_) ++(ack.refused() ? seen_.refused : seen_.finished);
      runs_.erase(found);
    }
  }

  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::WorkerLink::Stub> stub_;
  grpc::ClientContext context_;
  v1::ServerMessage incoming_;
  const Clock::duration interval_;

  std::mutex mutex_;
  std::condition_variable done_;
  std::deque<v1::WorkerMessage> outgoing_;  // the first is being written
  std::map<std::int64_t, Run> runs_;        // by attempt
  v1::StateBatches gathered_;               // not sent yet
  Clock::time_point gathered_since_;
  std::chrono::milliseconds gather_{0};
  Clock::duration heartbeat_ = std::chrono::seconds(1);
  Clock::time_point next_heartbeat_ = Clock::now() + std::chrono::seconds(1);
  Seen seen_;
  bool counts_ = false;
  bool is_done_ = false;
};

LoadWorker::LoadWorker(const std::string& name, const Load& load)
    : stream_(std::make_unique<Stream>(name, load)) {}
LoadWorker::~LoadWorker() { stream_->CutAndWait(); }
void LoadWorker::Tick(Clock::time_point now) { stream_->Tick(now); }
void LoadWorker::Count() { stream_->Count(); }
Seen LoadWorker::Take() { return stream_->Take(); }

}  // namespace calib::load
