#include "worker/program/running_program.h"

#include <signal.h>
#include <string.h>  // sigabbrev_np, which std has not

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "worker/program/request.h"
#include "worker/program/run_files.h"
#include "worker/program/run_limits.h"
#include "worker/program/table_reader.h"

namespace calib::worker {
namespace {

using TalkClock = std::chrono::steady_clock;

constexpr int kModelCannotGoOn = 3;  // exit code
constexpr std::chrono::milliseconds kStep{20};

/// Shorter runs tell nothing of when their states came.
constexpr double kShortRun = 1;  // s
constexpr double kLastShare = 0.05;
constexpr std::int64_t kFewStates = 3;

double SecondsSince(TalkClock::time_point begin) {
  return std::chrono::duration<double>(TalkClock::now() - begin).count();
}

std::string LastLine(const std::string& words) {
  const std::string trimmed(absl::StripAsciiWhitespace(words));
  const std::size_t newline = trimmed.rfind('\n');
  return newline == std::string::npos ? trimmed : trimmed.substr(newline + 1);
}

}  // namespace

/// One run of a program.
class RunningProgram::Talk {
 public:
  Talk(RunningProgram& running, const v1::ProgramRun& program, const std::string& run,
       const ProgramStateSink& on_state, ProgramReport& report)
      : running_(running),
        child_(*running.child_),
        reader_(running.reader_),
        times_(running.times_),
        program_(program),
        run_(run),
        on_state_(on_state),
        report_(report) {
    reader_.BeginRun({.observables = {program.observables().begin(), program.observables().end()},
                      .load_steps = program.control_values_size(),
                      .run = run,
                      .persistent = program.persistent(),
                      .checkpoint = program.checkpoint(),
                      .elsewhere = program.has_states()});
    if (program.has_states()) {
      table_.emplace(
          program.states(),
          std::vector<std::string>(program.observables().begin(), program.observables().end()),
          program.control_values_size());
      table_file_.emplace(running.folder(), program.states().file(), *table_);
    }
  }

  v1::Finished Hold(const std::string& request, const std::stop_token& stop) {
    child_.ForgetWords();
    cpu_before_ = program_.persistent() ? child_.Look().cpu_seconds : 0;
    child_.Send(absl::StrCat(request, "\n"));
    if (!program_.persistent() && !program_.checkpoint()) child_.CloseInput();
    Look(TalkClock::now());
    while (!IsOver(stop)) {
      child_.Turn(kStep, sink_);
      GiveStates();
    }
    report_.wall_seconds = SecondsSince(begin_);  // what follows is not the run
    completed_ = IsComplete();
    if (program_.persistent() && !child_.end().has_value()) LeaveRun();
    // What has too much already gets no time to take more.
    if (takes_too_much_) running_.times_.grace = std::chrono::milliseconds(0);
    if (!program_.persistent() || !running_.in_step_) running_.End();
    return Tell();
  }

 private:
  const AnswerStates& States() const {
    return table_.has_value() ? table_->states() : reader_.states();
  }
  const std::optional<AnswerEnd>& End() const {
    return table_.has_value() ? table_->end() : reader_.end();
  }
  bool HasFailed() const { return End().has_value() && End()->kind == AnswerEnd::Kind::kFailed; }
  bool IsComplete() const { return States().complete() && !HasFailed(); }

  std::string SoMany() const {
    return absl::StrCat("with ", States().reached(), " of ", States().load_steps(), " states");
  }

  bool IsOver(const std::stop_token& stop) {
    if (child_.end().has_value()) {
      ReadToTheEnd();
      return true;
    }
    const auto now = TalkClock::now();
    if (now >= next_look_) Look(now);
    if (HasFailed() || reader_.said_end()) return true;
    if (IsComplete()) {
      if (!completed_at_.has_value()) {
        completed_at_ = now;
        // It may be listening for what else is asked of this run.
        if (!program_.persistent()) child_.CloseInput();
      }
      return stop.stop_requested() || !limit_.empty() || now - *completed_at_ >= times_.to_end;
    }
    if (End().has_value()) return true;
    stopped_ = stop.stop_requested();
    return stopped_ || IsAtLimit(now);
  }

  // Memory, table and disk; what is above its limit is told by IsAtLimit.
  void Look(TalkClock::time_point now) {
    next_look_ = now + times_.between_looks;
    if (table_file_.has_value()) {
      table_file_->Poll();
      GiveStates();
    }
    const TreeUse use = child_.Look();
    report_.peak_memory = std::max(report_.peak_memory, use.resident_bytes);
    const v1::ProgramLimits& limits = program_.limits();
    if (std::string memory = limits_.AtMemory(use.resident_bytes); !memory.empty()) {
      takes_too_much_ = true;
      limit_ = std::move(memory);
    }
    if (limits.has_disk() && now >= next_walk_) {
      const double bytes = BytesBelow(running_.folder());
      // Where there are many files a walk takes long: a tenth of the time is enough for it.
      next_walk_ = TalkClock::now() + std::max<TalkClock::duration>(times_.between_walks,
                                                                    9 * (TalkClock::now() - now));
      if (bytes > limits.disk()) DiskLimit(bytes);
    }
  }

  void DiskLimit(double bytes) {
    takes_too_much_ = true;
    limit_ = absl::StrCat("came to its disk limit: ", SizeInWords(bytes), " of ",
                          SizeInWords(program_.limits().disk()));
  }

  bool IsAtLimit(TalkClock::time_point now) {
    if (limit_.empty()) limit_ = limits_.AtTime(now);
    return !limit_.empty();
  }

  void GiveStates() {
    for (v1::State& state : table_.has_value() ? table_->TakeStates() : reader_.TakeStates()) {
      if (!first_state_.has_value()) first_state_ = SecondsSince(begin_);
      limits_.Progressed(TalkClock::now());
      ++states_;
      on_state_(std::move(state));
    }
    for (std::string& file : reader_.TakeCheckpoints()) {
      report_.checkpoints.push_back(std::move(file));
    }
  }

  void ReadToTheEnd() {
    reader_.EndOfInput();
    if (table_file_.has_value()) {
      while (!table_file_->Poll()) {
      }
      // Of a program that was cut off the last number may be cut, too.
      if (child_.end()->exit == 0) table_->EndOfInput();
    }
    GiveStates();
    const v1::ProgramLimits& limits = program_.limits();
    // RLIMIT_FSIZE: it could not write what would have been above.
    if (limits.has_disk() && !IsComplete() && limit_.empty()) {
      const double bytes = BytesBelow(running_.folder());
      if (bytes >= limits.disk() || child_.end()->signal == SIGXFSZ) DiskLimit(bytes);
    }
  }

  // A run of a persistent program is over, as the program has said or is told now.
  void LeaveRun() {
    running_.in_step_ = reader_.said_end() && limit_.empty();
    if (reader_.said_end() || completed_ || HasFailed() || !limit_.empty()) return;
    child_.Send(absl::StrCat(StopText(run_), "\n"));
    const auto until = TalkClock::now() + times_.grace;
    while (!child_.end().has_value() && !reader_.said_end() && TalkClock::now() < until) {
      child_.Turn(kStep, [this](std::string_view bytes) { reader_.Add(bytes); });
    }
    running_.in_step_ = reader_.said_end() && !child_.end().has_value();
  }

  v1::Finished Tell() {
    v1::Finished finished;
    finished.set_states(states_);
    const double cpu =
        program_.persistent() && !child_.end().has_value() ? child_.Look().cpu_seconds : 0;
    finished.set_core_seconds(std::max(0.0, std::max(cpu, child_.cpu_seconds()) - cpu_before_));
    report_.words = child_.words();
    report_.ignored_lines = reader_.ignored_lines();
    report_.ignored = reader_.ignored_samples();
    report_.all_at_once = first_state_.has_value() && states_ > kFewStates &&
                          report_.wall_seconds >= kShortRun &&
                          *first_state_ >= (1 - kLastShare) * report_.wall_seconds;
    SetOutcome(finished);
    if (finished.outcome() == v1::Finished::OUTCOME_MODEL_FAILED ||
        finished.outcome() == v1::Finished::OUTCOME_DIVERGED) {
      finished.set_words(report_.words);
    }
    return finished;
  }

  void SetOutcome(v1::Finished& finished) const {
    const auto set = [&finished](v1::Finished::Outcome outcome, const std::string& reason) {
      finished.set_outcome(outcome);
      finished.set_reason(reason);
    };
    if (completed_) {
      set(v1::Finished::OUTCOME_COMPLETED, "");
    } else if (stopped_) {
      set(v1::Finished::OUTCOME_STOPPED, "stopped");
    } else if (!limit_.empty()) {
      set(program_.limit_diverges() ? v1::Finished::OUTCOME_DIVERGED
                                    : v1::Finished::OUTCOME_MODEL_FAILED,
          absl::StrCat(limit_, ", ", SoMany()));
    } else if (End().has_value()) {
      set(HasFailed() ? v1::Finished::OUTCOME_MODEL_FAILED : v1::Finished::OUTCOME_DIVERGED,
          End()->reason);
    } else if (child_.end().has_value()) {
      SetByExit(*child_.end(), set);
    } else {
      set(v1::Finished::OUTCOME_MODEL_FAILED, absl::StrCat("ended ", SoMany()));
    }
  }

  template <typename Set>
  void SetByExit(const ChildEnd& end, const Set& set) const {
    if (end.exit == kModelCannotGoOn) {
      const std::string why = LastLine(report_.words);
      set(v1::Finished::OUTCOME_DIVERGED, why.empty() ? absl::StrCat("exit 3 ", SoMany()) : why);
    } else if (end.signal.has_value()) {
      set(v1::Finished::OUTCOME_MODEL_FAILED,
          absl::StrCat("ended by ", InWords(end),
                       *end.signal == SIGKILL ? " (the machine may have had no memory left) " : " ",
                       SoMany()));
    } else {
      // What went wrong is mostly what was printed last.
      const std::string last = end.exit == 0 ? "" : LastLine(report_.words);
      set(v1::Finished::OUTCOME_MODEL_FAILED,
          absl::StrCat("exit ", end.exit.value_or(0), " ", SoMany(),
                       last.empty() ? WhyNoState() : absl::StrCat(": ", last)));
    }
  }

  // Why there may be no state at all, in words that help whoever begins.
  std::string WhyNoState() const {
    if (States().reached() > 0) return "";
    if (table_.has_value()) {
      return table_file_->is_there() ? ""
                                     : absl::StrCat("; it wrote no ", program_.states().file());
    }
    if (reader_.ignored_lines() > 0 && !reader_.ignored_samples().empty()) {
      return absl::StrCat("; ", reader_.ignored_lines(),
                          " lines that do not begin with '{' were ignored, the first: ",
                          reader_.ignored_samples().front());
    }
    return "";
  }

  RunningProgram& running_;
  ChildProcess& child_;
  AnswerReader& reader_;
  const ProgramTimes times_;
  const v1::ProgramRun& program_;
  const std::string& run_;
  const ProgramStateSink& on_state_;
  ProgramReport& report_;
  const ChildProcess::Sink sink_ = [this](std::string_view bytes) {
    reader_.Add(bytes);
    GiveStates();
  };
  RunLimits limits_{program_.limits()};
  std::optional<TableReader> table_;
  std::optional<TableFile> table_file_;

  const TalkClock::time_point begin_ = TalkClock::now();
  TalkClock::time_point next_look_ = begin_;
  TalkClock::time_point next_walk_ = begin_;
  std::optional<TalkClock::time_point> completed_at_;
  std::optional<double> first_state_;  // s since begin_
  std::int64_t states_ = 0;
  double cpu_before_ = 0;
  bool stopped_ = false;
  bool takes_too_much_ = false;  // memory or disk
  bool completed_ = false;       // when the run was over, whatever is said after
  std::string limit_;            // that it came to; empty: none
};

v1::Finished RunningProgram::Run(const v1::ProgramRun& program, const std::string& run,
                                 const std::string& request, const ProgramStateSink& on_state,
                                 const std::stop_token& stop, ProgramReport& report) {
  report.request = request;
  v1::Finished finished = Talk(*this, program, run, on_state, report).Hold(request, stop);
  if (finished.outcome() == v1::Finished::OUTCOME_COMPLETED ||
      finished.outcome() == v1::Finished::OUTCOME_DIVERGED) {
    ReadKeptFiles({program.keep().begin(), program.keep().end()}, folder(), report.kept,
                  report.not_kept);
  }
  return finished;
}

bool RunningProgram::IsWaiting() {
  child_->Turn(std::chrono::milliseconds(0),
               [this](std::string_view bytes) { reader_.Add(bytes); });
  return in_step_ && !child_->end().has_value();
}

void RunningProgram::End() {
  child_->CloseInput();
  child_->End(times_.grace, [this](std::string_view bytes) { reader_.Add(bytes); });
}

}  // namespace calib::worker
