#include "worker/engine/engine_child.h"

#include <fcntl.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <map>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include "absl/base/thread_annotations.h"
#include "absl/synchronization/mutex.h"
#include "calib/v1/engine.pb.h"
#include "dem/model/state.h"
#include "worker/engine/checkpoints.h"
#include "worker/engine/frames.h"
#include "worker/engine/resting_run.h"
#include "worker/engine/shared_content.h"
#include "worker/engine/specimens.h"

namespace calib::worker {
namespace {

/// CPU time of all threads of this process so far [s].
double CpuSeconds() {
  rusage use{};
  getrusage(RUSAGE_SELF, &use);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(use.ru_utime) + seconds(use.ru_stime);
}

/// Standard output for messages alone; whatever else prints there goes to standard error.
int TakeOutput() {
  const int output = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
  dup2(STDERR_FILENO, STDOUT_FILENO);
  return output;
}

class EngineChild {
 public:
  explicit EngineChild(const EngineChildOptions& options)
      : output_(TakeOutput()),
        shared_(options.shared),
        specimens_(
            [this](const std::string& digest, std::stop_token stop) {
              return shared_.Get(digest, stop, [&] { return Ask(digest, stop); });
            },
            &shared_) {
    if (options.checkpoints.empty()) return;
    if (auto opened = Checkpoints::Open(options.checkpoints, options.most_checkpoint_bytes);
        opened.ok()) {
      checkpoints_ = *std::move(opened);
    }
  }

  int Run() {
    FrameReader reader;
    std::array<char, 1 << 16> piece{};
    while (!reader.broken()) {
      const ssize_t got = read(STDIN_FILENO, piece.data(), piece.size());
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) break;
      reader.Add({piece.data(), static_cast<std::size_t>(got)});
      for (v1::EngineOrder order; reader.Next(order); order.Clear()) Take(order);
    }
    {
      const absl::MutexLock lock(&mutex_);
      input_ended_ = true;
      changed_.SignalAll();
    }
    return reader.broken() ? 1 : 0;
  }

 private:
  void Take(v1::EngineOrder& order) {
    switch (order.order_case()) {
      case v1::EngineOrder::kRun:
        leave_ = {};
        run_ =
            std::jthread([this, run = std::move(*order.mutable_run()), leave = leave_.get_token()](
                             std::stop_token stop) { Do(run, stop, leave); });
        break;
      case v1::EngineOrder::kStop:
        if (order.stop().keep()) {
          leave_.request_stop();
        } else {
          run_.request_stop();
        }
        break;
      case v1::EngineOrder::kContent: {
        const absl::MutexLock lock(&mutex_);
        std::string digest = order.content().digest();
        contents_.emplace(std::move(digest), std::move(*order.mutable_content()));
        changed_.SignalAll();
        break;
      }
      case v1::EngineOrder::ORDER_NOT_SET:
        break;
    }
  }

  void Do(const v1::EngineRun& run, const std::stop_token& stop, const std::stop_token& leave) {
    const double before = CpuSeconds();
    const dem::StateSink sink = [this](const dem::State& state) {
      v1::EngineWord word;
      word.mutable_state()->set_load_step(state.load_step);
      word.mutable_state()->mutable_values()->Add(state.values.begin(), state.values.end());
      Say(word);
    };
    v1::EngineWord end;
    v1::Finished& finished = *end.mutable_finished();
    const RestingRun resting{
        .run = run.run(),
        .rest_after = run.has_rest_after() ? std::optional<int>(run.rest_after()) : std::nullopt,
        .leave = leave};
    const bool may_be_kept = checkpoints_.has_value() && !run.run().empty();
    finished = EvaluateToRung(run.spec(), resting, may_be_kept ? &*checkpoints_ : nullptr,
                              specimens_, sink, stop);
    finished.set_core_seconds(CpuSeconds() - before);
    Say(end);
  }

  /// Content by the worker, which has it from the server.
  absl::StatusOr<std::string> Ask(const std::string& digest, const std::stop_token& stop) {
    const std::stop_callback wake(stop, [this] {
      const absl::MutexLock lock(&mutex_);
      changed_.SignalAll();
    });
    v1::EngineWord word;
    word.set_wants(digest);
    Say(word);
    const absl::MutexLock lock(&mutex_);
    while (!contents_.contains(digest) && !stop.stop_requested() && !input_ended_) {
      changed_.Wait(&mutex_);
    }
    const auto answer = contents_.extract(digest);
    if (answer.empty()) return absl::CancelledError("stopped");
    v1::EngineContent& content = answer.mapped();
    if (content.error() != 0) {
      return absl::Status(static_cast<absl::StatusCode>(content.error()), content.message());
    }
    return std::move(*content.mutable_content());
  }

  /// A worker that has gone takes this process with it.
  void Say(const v1::EngineWord& word) {
    const std::string frame = Framed(word);
    const absl::MutexLock lock(&output_mutex_);
    for (std::size_t written = 0; written < frame.size();) {
      const ssize_t now = write(output_, frame.data() + written, frame.size() - written);
      if (now < 0 && errno != EINTR) return;
      written += now > 0 ? static_cast<std::size_t>(now) : 0;
    }
  }

  const int output_;
  absl::Mutex output_mutex_;
  const SharedContent shared_;
  absl::Mutex mutex_;
  absl::CondVar changed_;
  /// By digest; each answers one that asked.
  std::multimap<std::string, v1::EngineContent> contents_ ABSL_GUARDED_BY(mutex_);
  bool input_ended_ ABSL_GUARDED_BY(mutex_) = false;
  Specimens specimens_;
  std::optional<Checkpoints> checkpoints_;
  std::stop_source leave_;  // of the run
  std::jthread run_;        // last: joined first
};

}  // namespace

int RunEngineChild(const EngineChildOptions& options) {
  // A batch system signals every process of a job; the worker says what becomes of the run.
  std::signal(SIGTERM, SIG_IGN);
  std::signal(SIGINT, SIG_IGN);
  spdlog::set_default_logger(spdlog::stderr_logger_mt("engine"));
  spdlog::set_pattern("%l %v");
  EngineChild child(options);
  return child.Run();
}

}  // namespace calib::worker
