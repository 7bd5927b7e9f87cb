#include "worker/held_attempt.h"

#include <algorithm>

#include "dem/model/state.h"
#include "proto/rpc/fit_message.h"
#include "worker/evaluate.h"

namespace calib::worker {
namespace {

/// A state has some ten numbers: a batch stays far below the message limit.
constexpr std::int64_t kStatesPerBatch = 1000;

}  // namespace

HeldAttempt::HeldAttempt(v1::Lease lease) : lease_(std::move(lease)) {
  if (!lease_.run().empty()) {
    resting_ =
        RestingRun{.run = lease_.run(),
                   .rest_after = lease_.has_rest_after() ? std::optional<int>(lease_.rest_after())
                                                         : std::nullopt};
  }
}

v1::Finished HeldAttempt::RunDem(Specimens& specimens, const Checkpoints* checkpoints,
                                 const std::function<void(v1::State)>& on_state,
                                 std::stop_token stop) const {
  const dem::StateSink sink = [&on_state](const dem::State& state) {
    v1::State message;
    message.set_load_step(state.load_step);
    message.mutable_values()->Add(state.values.begin(), state.values.end());
    on_state(std::move(message));
  };
  return resting_.has_value()
             ? EvaluateToRung(lease_.spec(), *resting_, checkpoints, specimens, sink, stop)
             : Evaluate(lease_.spec(), specimens, sink, stop);
}

void HeldAttempt::Run(Specimens& specimens, Programs& programs, const Checkpoints* checkpoints,
                      std::function<void(v1::State)> on_state,
                      std::function<void(v1::Finished)> on_end) {
  thread_ = std::jthread([this, &specimens, &programs, checkpoints, on_state = std::move(on_state),
                          on_end = std::move(on_end)](std::stop_token stop) {
    v1::Finished finished =
        lease_.has_program() ? programs.Evaluate(lease_.program(), lease_.attempt(), on_state, stop)
                             : RunDem(specimens, checkpoints, on_state, stop);
    finished.set_attempt(lease_.attempt());
    on_end(std::move(finished));
  });
}

void HeldAttempt::AddState(v1::State state) {
  rpc::FitTexts(state);  // the names may be a program's
  kept_.push_back(std::move(state));
}

void HeldAttempt::AddEnd(v1::Finished finished) {
  rpc::FitTexts(finished);  // a reason may be what a model has printed
  end_ = std::move(finished);
}

std::vector<v1::StateBatch> HeldAttempt::TakeUnsentStates() {
  std::vector<v1::StateBatch> batches;
  const std::int64_t end = first_ + static_cast<std::int64_t>(kept_.size());
  while (next_ < end) {
    v1::StateBatch& batch = batches.emplace_back();
    batch.set_attempt(lease_.attempt());
    batch.set_first(next_);
    const std::int64_t stop = std::min(end, next_ + kStatesPerBatch);
    for (; next_ < stop; ++next_) {
      *batch.add_states() = kept_[static_cast<std::size_t>(next_ - first_)];
    }
  }
  return batches;
}

std::vector<v1::WorkerMessage> HeldAttempt::TakeUnsent() {
  std::vector<v1::WorkerMessage> messages;
  for (v1::StateBatch& batch : TakeUnsentStates()) {
    *messages.emplace_back().mutable_states() = std::move(batch);
  }
  if (end_.has_value() && !end_sent_) {
    *messages.emplace_back().mutable_finished() = *end_;
    end_sent_ = true;
  }
  return messages;
}

void HeldAttempt::StreamLost() {
  next_ = first_;
  end_sent_ = false;
}

void HeldAttempt::Acknowledge(std::int64_t up_to) {
  while (first_ < up_to && !kept_.empty()) {
    kept_.pop_front();
    ++first_;
  }
  next_ = std::max(next_, first_);
}

}  // namespace calib::worker
