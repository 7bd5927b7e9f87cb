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

HeldAttempt::HeldAttempt(const v1::Lease& lease) : HeldAttempt(lease.attempt(), lease.spec()) {
  if (!lease.run().empty()) {
    resting_ =
        RestingRun{.run = lease.run(),
                   .rest_after = lease.has_rest_after() ? std::optional<int>(lease.rest_after())
                                                        : std::nullopt};
  }
}

void HeldAttempt::Run(Specimens& specimens, const Checkpoints* checkpoints,
                      std::function<void(const dem::State&)> on_state,
                      std::function<void(v1::Finished)> on_end) {
  thread_ = std::jthread([this, &specimens, checkpoints, on_state = std::move(on_state),
                          on_end = std::move(on_end)](std::stop_token stop) {
    v1::Finished finished = resting_.has_value() ? EvaluateToRung(spec_, *resting_, checkpoints,
                                                                  specimens, on_state, stop)
                                                 : Evaluate(spec_, specimens, on_state, stop);
    finished.set_attempt(id_);
    on_end(std::move(finished));
  });
}

void HeldAttempt::AddState(const dem::State& state) {
  v1::State& message = kept_.emplace_back();
  message.set_load_step(state.load_step);
  message.mutable_values()->Add(state.values.begin(), state.values.end());
}

void HeldAttempt::AddEnd(v1::Finished finished) {
  rpc::FitTexts(finished);  // a reason may be what a model has printed
  end_ = std::move(finished);
}

std::vector<v1::WorkerMessage> HeldAttempt::TakeUnsent() {
  std::vector<v1::WorkerMessage> messages;
  const std::int64_t end = first_ + static_cast<std::int64_t>(kept_.size());
  while (next_ < end) {
    v1::StateBatch& batch = *messages.emplace_back().mutable_states();
    batch.set_attempt(id_);
    batch.set_first(next_);
    const std::int64_t stop = std::min(end, next_ + kStatesPerBatch);
    for (; next_ < stop; ++next_) {
      *batch.add_states() = kept_[static_cast<std::size_t>(next_ - first_)];
    }
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
