#include "worker/engine/engines.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "calib/v1/engine.pb.h"
#include "worker/program/run_limits.h"

namespace calib::worker {
namespace {

using Clock = std::chrono::steady_clock;

/// How long a stop may wait to be heard. chosen: little beside a load step, and 50 looks a second
constexpr std::chrono::milliseconds kBetweenLooks{20};
/// Of its memory: as of programs (running_program.h).
constexpr std::chrono::milliseconds kBetweenMemoryLooks{50};
/// Share of its limit that an engine may have before a run begins: what runs before it have left
/// there would be taken for its own. Chosen: half of it is left to the run.
constexpr double kLeftByOthers = 0.5;
/// For an engine whose input has ended, which has nothing to do.
constexpr std::chrono::milliseconds kToLeave{1000};

v1::Finished Ended(v1::Finished::Outcome outcome, std::string reason) {
  v1::Finished finished;
  finished.set_outcome(outcome);
  finished.set_reason(std::move(reason));
  return finished;
}

}  // namespace

/// One run in one process.
class Engines::Talk {
 public:
  Talk(Engine& engine, const v1::ProgramLimits& limits, const EnginesOptions& options,
       const std::function<void(v1::State)>& on_state, const std::stop_token& stop,
       const std::stop_token& leave)
      : engine_(*engine.process),
        reader_(engine.reader),
        limits_(limits),
        options_(options),
        on_state_(on_state),
        stop_(stop),
        leave_(leave) {}

  v1::Finished Run(const v1::Lease& lease) {
    v1::EngineOrder order;
    *order.mutable_run()->mutable_spec() = lease.spec();
    order.mutable_run()->set_run(lease.run());
    if (lease.has_rest_after()) order.mutable_run()->set_rest_after(lease.rest_after());
    engine_.Look();
    cpu_before_ = engine_.cpu_seconds();
    engine_.Send(Framed(order));
    while (!finished_.has_value() && !engine_.end().has_value() && !reader_.broken()) {
      if ((IsUnwanted() && Stop()) || IsAtLimit()) break;
      engine_.Turn(kBetweenLooks, [this](std::string_view bytes) { reader_.Add(bytes); });
      for (v1::EngineWord word; !finished_.has_value() && reader_.Next(word); word.Clear()) {
        Hear(word);
      }
    }
    return finished_.has_value() ? *std::move(finished_) : WithoutItsEnd();
  }

 private:
  bool IsUnwanted() const { return stop_.stop_requested() || leave_.stop_requested(); }

  bool IsAtLimit() {
    const auto now = Clock::now();
    limit_ = limits_.AtTime(now);
    if (limit_.empty() && now >= next_look_) {
      next_look_ = now + kBetweenMemoryLooks;
      limit_ = limits_.AtMemory(engine_.Look().resident_bytes);
    }
    return !limit_.empty();
  }

  /// Whether it has to be killed by now.
  bool Stop() {
    const bool keep = !stop_.stop_requested();
    if (!told_.has_value() || (told_to_keep_ && !keep)) {
      v1::EngineOrder order;
      order.mutable_stop()->set_keep(keep);
      engine_.Send(Framed(order));
      if (!told_.has_value()) told_ = Clock::now();
      told_to_keep_ = keep;
    }
    return Clock::now() - *told_ >= options_.grace;
  }

  void Hear(v1::EngineWord& word) {
    switch (word.word_case()) {
      case v1::EngineWord::kState:
        ++states_;
        limits_.Progressed(Clock::now());
        on_state_(std::move(*word.mutable_state()));
        break;
      case v1::EngineWord::kWants: {
        const auto asked = Clock::now();
        v1::EngineOrder order;
        order.mutable_content()->set_digest(word.wants());
        if (auto content = options_.fetch(word.wants(), stop_); content.ok()) {
          order.mutable_content()->set_content(*std::move(content));
        } else {
          order.mutable_content()->set_error(content.status().raw_code());
          order.mutable_content()->set_message(std::string(content.status().message()));
        }
        engine_.Send(Framed(order));
        limits_.Waited(Clock::now() - asked);
        break;
      }
      case v1::EngineWord::kFinished:
        finished_ = std::move(*word.mutable_finished());
        // A stop that nobody asked for would be taken for a node that goes down.
        if (finished_->outcome() == v1::Finished::OUTCOME_STOPPED && !IsUnwanted()) {
          finished_->set_outcome(v1::Finished::OUTCOME_FAILED);
        }
        break;
      case v1::EngineWord::WORD_NOT_SET:
        break;
    }
  }

  /// It has died, or is killed here.
  v1::Finished WithoutItsEnd() {
    const bool died = engine_.end().has_value();
    engine_.End(std::chrono::milliseconds(0), [](std::string_view) {});
    const std::string after = absl::StrCat(" after ", states_, states_ == 1 ? " state" : " states");
    v1::Finished finished =
        IsUnwanted()      ? Ended(v1::Finished::OUTCOME_STOPPED, "stopped")
        : !limit_.empty() ? Ended(v1::Finished::OUTCOME_MODEL_FAILED,
                                  absl::StrCat("the engine ", limit_, ",", after))
        : died            ? Ended(v1::Finished::OUTCOME_MODEL_FAILED,
                                  absl::StrCat("the engine ended by ", InWords(*engine_.end()), after))
                          : Ended(v1::Finished::OUTCOME_MODEL_FAILED,
                                  "what the engine said is no message of ours");
    finished.set_words(engine_.words());
    finished.set_states(states_);
    finished.set_core_seconds(std::max(0.0, engine_.cpu_seconds() - cpu_before_));
    return finished;
  }

  ChildProcess& engine_;
  FrameReader& reader_;
  RunLimits limits_;
  std::string limit_;  // that it came to; empty: none
  Clock::time_point next_look_{};
  const EnginesOptions& options_;
  const std::function<void(v1::State)>& on_state_;
  const std::stop_token& stop_;
  const std::stop_token& leave_;
  std::int64_t states_ = 0;
  double cpu_before_ = 0;  // s
  std::optional<v1::Finished> finished_;
  std::optional<Clock::time_point> told_;
  bool told_to_keep_ = false;
};

Engines::Engines(EnginesOptions options) : options_(std::move(options)) {}

Engines::~Engines() {
  const absl::MutexLock lock(&mutex_);
  for (const Engine& engine : idle_) engine.process->CloseInput();
  for (const Engine& engine : idle_) {
    for (const auto until = Clock::now() + kToLeave;
         !engine.process->end().has_value() && Clock::now() < until;) {
      engine.process->Turn(kBetweenLooks, [](std::string_view) {});
    }
  }
  idle_.clear();
}

v1::Finished Engines::Evaluate(const v1::Lease& lease,
                               const std::function<void(v1::State)>& on_state,
                               const std::stop_token& stop, const std::stop_token& leave) {
  auto engine = Take(lease.limits());
  if (!engine.ok()) {
    return Ended(v1::Finished::OUTCOME_FAILED,
                 absl::StrCat("no engine could be started: ", engine.status().message()));
  }
  v1::Finished finished = Talk(*engine, lease.limits(), options_, on_state, stop, leave).Run(lease);
  if (const std::string words = engine->process->words(); !words.empty()) {
    spdlog::warn("engine attempt={} words=\"{}\"", lease.attempt(), words);
  }
  GiveBack(*std::move(engine));
  return finished;
}

absl::StatusOr<Engines::Engine> Engines::Take(const v1::ProgramLimits& limits) {
  while (true) {
    Engine engine;
    {
      const absl::MutexLock lock(&mutex_);
      if (idle_.empty()) break;
      engine = std::move(idle_.back());
      idle_.pop_back();
    }
    engine.process->Turn(std::chrono::milliseconds(0),
                         [&engine](std::string_view bytes) { engine.reader.Add(bytes); });
    const bool is_full = limits.has_memory() &&
                         engine.process->Look().resident_bytes > kLeftByOthers * limits.memory();
    if (!engine.process->end().has_value() && !is_full) return engine;
  }
  return Start();
}

absl::StatusOr<Engines::Engine> Engines::Start() {
  std::string shared;
  {
    const absl::MutexLock lock(&mutex_);
    if (scratch_ == nullptr) {
      ASSIGN_OR_RETURN(scratch_, Scratch::Open(options_.scratch, options_.fetch));
      ASSIGN_OR_RETURN(shared_, scratch_->MakeRunFolder());
    }
    shared = shared_.path();
  }
  // What lets this worker in at the server is not the engine's.
  ChildOptions options{.program = options_.program,
                       .arguments = {"calib-worker", "--engine", shared},
                       .folder = shared,
                       .environment = {"CALIB_TOKEN", "CALIB_TLS"},
                       .most_file_bytes = {}};
  if (!options_.checkpoints.empty()) {
    for (const std::string& word :
         {std::string("--checkpoints"), options_.checkpoints, std::string("--checkpoint-bytes"),
          absl::StrCat(options_.most_checkpoint_bytes)}) {
      options.arguments.push_back(word);
    }
  }
  ASSIGN_OR_RETURN(auto process, launcher_.Start(options));
  return Engine{.process = std::move(process)};
}

void Engines::GiveBack(Engine engine) {
  if (engine.process->end().has_value()) return;
  engine.process->ForgetWords();
  const absl::MutexLock lock(&mutex_);
  idle_.push_back(std::move(engine));
}

}  // namespace calib::worker
