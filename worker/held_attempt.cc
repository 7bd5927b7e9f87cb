#include "worker/held_attempt.h"

#include <algorithm>

#include "proto/rpc/fit_message.h"

namespace calib::worker {
namespace {

/// A state has some ten numbers: a batch stays far below the message limit.
constexpr std::int64_t kStatesPerBatch = 1000;

}  // namespace

HeldAttempt::HeldAttempt(v1::Lease lease) : lease_(std::move(lease)) {}

void HeldAttempt::Run(Engines& engines, Programs& programs, std::function<void(v1::State)> on_state,
                      std::function<void(v1::Finished)> on_end) {
  thread_ = std::jthread([this, &engines, &programs, on_state = std::move(on_state),
                          on_end = std::move(on_end)](std::stop_token stop) {
    v1::Finished finished =
        lease_.has_program() ? programs.Evaluate(lease_.program(), lease_.attempt(), on_state, stop)
                             : engines.Evaluate(lease_, on_state, stop, leave_.get_token());
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
