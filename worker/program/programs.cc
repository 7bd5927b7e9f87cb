#include "worker/program/programs.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "calib/return_if_error.h"
#include "proto/rpc/digest.h"
#include "worker/program/request.h"

namespace calib::worker {
namespace {

namespace files = std::filesystem;

constexpr const char* kAny = "*";
constexpr const char* kScratchName = "{scratch}";

// What an earlier run in this folder has left of files that stay with theirs, but for those that
// are brought along.
void RemoveKept(const v1::ProgramRun& program, const std::string& folder) {
  for (const std::string& name : program.keep()) {
    const auto is_brought = [&name](const v1::ProgramFile& file) { return file.name() == name; };
    if (!CheckFileName(name).ok() ||
        std::any_of(program.files().begin(), program.files().end(), is_brought))
      continue;
    std::error_code ignored;
    files::remove(absl::StrCat(folder, "/", name), ignored);
  }
}

bool IsExecutableFile(const std::string& path) {
  std::error_code error;
  return files::is_regular_file(path, error) && access(path.c_str(), X_OK) == 0;
}

bool IsBelow(const std::string& path, const std::string& folder) {
  std::error_code error;
  const files::path whole = files::weakly_canonical(path, error);
  const files::path root = files::weakly_canonical(folder, error);
  const auto [differs, unused] =
      std::mismatch(root.begin(), root.end(), whole.begin(), whole.end());
  return !folder.empty() && differs == root.end();
}

v1::Finished EndedAs(v1::Finished::Outcome outcome, const absl::Status& status) {
  v1::Finished finished;
  finished.set_outcome(outcome);
  finished.set_reason(std::string(status.message()));
  return finished;
}

/// What is to blame for a run that has not begun: who wrote the campaign, or this machine.
v1::Finished NotBegun(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kCancelled:
      return EndedAs(v1::Finished::OUTCOME_STOPPED, status);
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kFailedPrecondition:
      return EndedAs(v1::Finished::OUTCOME_MODEL_FAILED, status);
    default:
      return EndedAs(v1::Finished::OUTCOME_FAILED, status);
  }
}

/// The command with everything replaced but the folder, which differs from process to process.
absl::StatusOr<std::vector<std::string>> CommandOf(const v1::ProgramRun& program,
                                                   const std::string& scratch) {
  if (program.command().empty() || program.command(0).empty()) {
    return absl::InvalidArgumentError("the command of the model is empty");
  }
  ASSIGN_OR_RETURN(const auto replacements, Replacements(program, scratch));
  std::vector<std::string> command;
  for (const std::string& argument : program.command()) {
    command.push_back(Replaced(argument, replacements));
    if (command.back().find('\0') != std::string::npos) {
      return absl::InvalidArgumentError(
          absl::StrCat("an argument of the command has a zero byte: ", argument));
    }
  }
  return command;
}

/// A run may be told to any process that was started alike.
std::string IdentityOf(const v1::ProgramRun& program, const std::vector<std::string>& command) {
  v1::ProgramRun alike;
  alike.mutable_command()->Add(command.begin(), command.end());
  *alike.mutable_files() = program.files();
  *alike.mutable_limits() = program.limits();
  alike.set_version(program.version());
  alike.set_checkpoint(program.checkpoint());
  alike.set_threads(program.threads());
  return rpc::Sha256Hex(rpc::BytesOf(alike));
}

absl::Status CheckProgram(const v1::ProgramRun& program) {
  if (program.has_states() && program.persistent()) {
    return absl::InvalidArgumentError(
        "`states` and `persistent` exclude each other: a table has one run");
  }
  if (program.has_states()) {
    RETURN_IF_ERROR(CheckFileName(program.states().file()));
    for (const std::string& observable : program.observables()) {
      const auto& columns = program.states().columns();
      if (std::none_of(columns.begin(), columns.end(), [&](const v1::ProgramColumn& column) {
            return column.name() == observable;
          })) {
        return absl::InvalidArgumentError(
            absl::StrCat("`states` names no column for ", observable));
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace

Programs::Programs(ProgramsOptions options) : options_(std::move(options)) {
  const char* const path = std::getenv("PATH");
  path_ = options_.path.value_or(path != nullptr ? path : "");
  for (const std::string& name : options_.allowed) {
    if (name == kAny) {
      any_ = true;
    } else if (const std::string resolved = Resolved(name); resolved.empty()) {
      not_found_.insert(name);
    } else {
      allowed_[name] = resolved;
      allowed_[resolved] = resolved;
    }
  }
  if (!options_.allowed.empty()) {
    // Removes what dead workers have left. What is wrong is told to the runs.
    [[maybe_unused]] const absl::Status opened = OpenScratch().status();
  }
  janitor_ = std::jthread([this](const std::stop_token& stop) { EndUnused(stop); });
}

Programs::~Programs() {
  janitor_.request_stop();
  {
    const absl::MutexLock lock(&mutex_);
    changed_.SignalAll();
  }
  janitor_.join();
  std::list<Idle> idle;
  {
    const absl::MutexLock lock(&mutex_);
    idle.swap(idle_);
  }
  std::vector<std::jthread> endings;  // at the same time: each may need its grace
  endings.reserve(idle.size());
  for (Idle& unused : idle) endings.emplace_back([&unused] { unused.program->End(); });
}

std::vector<std::string> Programs::AllowedNames() const {
  std::vector<std::string> names;
  if (any_) names.emplace_back(kAny);
  for (const auto& [name, path] : allowed_) names.push_back(name);
  return names;
}

// Absolute path of an executable file; empty: there is none.
std::string Programs::Resolved(const std::string& name) const {
  const auto is_good = [this](const std::string& path) {
    return IsExecutableFile(path) && !IsBelow(path, options_.scratch);
  };
  if (name.find('/') != std::string::npos) {
    std::error_code error;
    const std::string path = files::absolute(name, error).lexically_normal().string();
    return is_good(path) ? path : "";
  }
  const std::vector<std::string> folders = absl::StrSplit(path_, ':');
  for (const std::string& folder : folders) {
    // Relative ones mean another place in every working directory.
    const std::string path = absl::StrCat(folder, "/", name);
    if (folder.starts_with('/') && !name.empty() && is_good(path)) {
      return files::path(path).lexically_normal().string();
    }
  }
  return "";
}

// PERMISSION_DENIED: not on this worker; FAILED_PRECONDITION: there is no such program.
absl::StatusOr<Programs::Executable> Programs::Choose(const v1::ProgramRun& program,
                                                      const std::string& name) const {
  if (const auto known = allowed_.find(name); known != allowed_.end()) {
    return Executable{.path = known->second, .brought = {}};
  }
  const auto nowhere = [&name] {
    return absl::FailedPreconditionError(absl::StrCat(name, ": not found on this node"));
  };
  if (!any_ && not_found_.contains(name)) return nowhere();
  std::string brought = name;
  for (const std::string& prefix : {absl::StrCat(kScratchName, "/"), std::string("./")}) {
    if (brought.starts_with(prefix)) brought.erase(0, prefix.size());
  }
  const auto file = std::find_if(program.files().begin(), program.files().end(),
                                 [&](const v1::ProgramFile& one) { return one.name() == brought; });
  const bool is_brought =
      file != program.files().end() && (file->executable() || brought.size() < name.size());
  if (!any_) {
    if (is_brought) {
      return absl::PermissionDeniedError(absl::StrCat(
          name, " is brought along: this worker runs such programs with --allow-command '*' only"));
    }
    return absl::PermissionDeniedError(absl::StrCat(
        name, " is not among the programs that this worker may run (--allow-command): ",
        allowed_.empty() ? "none" : absl::StrJoin(AllowedNames(), ", ")));
  }
  if (is_brought) {
    if (!file->executable()) {
      return absl::FailedPreconditionError(
          absl::StrCat(name, ": brought along without the right to be executed"));
    }
    return Executable{.path = {}, .brought = brought};
  }
  if (name.find('/') != std::string::npos && !name.starts_with('/')) {
    return absl::FailedPreconditionError(absl::StrCat(
        name, ": a program is a name, an absolute path, or a file that is brought along"));
  }
  const std::string path = Resolved(name);
  if (path.empty()) return nowhere();
  return Executable{.path = path, .brought = {}};
}

absl::StatusOr<Scratch*> Programs::OpenScratch() {
  const absl::MutexLock lock(&mutex_);
  if (scratch_ == nullptr) {
    auto opened = Scratch::Open(options_.scratch, options_.fetch);
    if (!opened.ok()) return opened.status();
    scratch_ = *std::move(opened);
  }
  return scratch_.get();
}

v1::Finished Programs::Evaluate(const v1::ProgramRun& program, std::int64_t attempt,
                                const ProgramStateSink& on_state, std::stop_token stop,
                                ProgramReport* report) {
  {
    const absl::MutexLock lock(&mutex_);
    ++runs_;
  }
  ProgramReport own;
  if (report != nullptr) *report = {};
  const auto finished = Run(program, attempt, on_state, stop, report != nullptr ? *report : own);
  {
    const absl::MutexLock lock(&mutex_);
    --runs_;
  }
  if (finished.ok()) {
    v1::Finished ended = *finished;
    if (options_.put) Keep(report != nullptr ? *report : own, stop, ended);
    return ended;
  }
  return NotBegun(stop.stop_requested() ? absl::CancelledError("stopped") : finished.status());
}

// A file that is not taken is no failure of the run.
void Programs::Keep(const ProgramReport& report, const std::stop_token& stop,
                    v1::Finished& finished) const {
  for (const KeptContent& file : report.kept) {
    v1::KeptFile& kept = *finished.add_kept();
    kept.set_name(file.name);
    if (const absl::Status put = options_.put(file.content, stop); put.ok()) {
      kept.set_digest(rpc::Sha256Hex(file.content));
    } else {
      kept.set_reason(absl::StrCat("the server does not take it: ", put.message()));
    }
  }
  for (const auto& [name, why] : report.not_kept) {
    v1::KeptFile& missing = *finished.add_kept();
    missing.set_name(name);
    missing.set_reason(why);
  }
}

// Errors: why it has not begun (NotBegun).
absl::StatusOr<v1::Finished> Programs::Run(const v1::ProgramRun& program, std::int64_t attempt,
                                           const ProgramStateSink& on_state,
                                           const std::stop_token& stop, ProgramReport& report) {
  RETURN_IF_ERROR(CheckProgram(program));
  ASSIGN_OR_RETURN(const auto command, CommandOf(program, kScratchName));
  ASSIGN_OR_RETURN(const Executable executable, Choose(program, command.front()));
  const std::string run = absl::StrCat(attempt);
  ASSIGN_OR_RETURN(report.request, RequestText(program, run));
  const std::string request = report.request;
  ASSIGN_OR_RETURN(Scratch* const scratch, OpenScratch());
  const std::string identity = program.persistent() ? IdentityOf(program, command) : "";
  std::unique_ptr<RunningProgram> running = TakeIdle(identity);
  const bool is_new = running == nullptr;
  RunFolder folder;
  if (is_new) {
    ASSIGN_OR_RETURN(folder, scratch->MakeRunFolder());
    RETURN_IF_ERROR(scratch->CopyFiles(program.files(), folder.path(), stop));
  }
  const std::string path = is_new ? folder.path() : running->folder();
  if (!is_new) RemoveKept(program, path);
  ASSIGN_OR_RETURN(const auto replacements, Replacements(program, path));
  RETURN_IF_ERROR(scratch->WriteTemplates(program.files(), replacements, path, stop));
  RETURN_IF_ERROR(WriteFileBelow(absl::StrCat(path, "/request.json"), absl::StrCat(request, "\n")));
  if (stop.stop_requested()) return absl::CancelledError("stopped");
  if (is_new) {
    ASSIGN_OR_RETURN(running, Start(program, executable, std::move(folder)));
  }
  const v1::Finished finished = running->Run(program, run, request, on_state, stop, report);
  if (program.persistent()) GiveBack(identity, std::move(running));
  return finished;
}

absl::StatusOr<std::unique_ptr<RunningProgram>> Programs::Start(const v1::ProgramRun& program,
                                                                const Executable& executable,
                                                                RunFolder folder) {
  ASSIGN_OR_RETURN(auto command, CommandOf(program, folder.path()));
  const std::string path = executable.brought.empty()
                               ? executable.path
                               : absl::StrCat(folder.path(), "/", executable.brought);
  ChildOptions options{
      .program = path,
      .arguments = std::move(command),
      .folder = folder.path(),
      .environment = {"PYTHONUNBUFFERED=1",
                      absl::StrCat("OMP_NUM_THREADS=", std::max(1, program.threads())),
                      absl::StrCat("PWD=", folder.path()),
                      // What lets this worker in at the server is not the program's.
                      "CALIB_TOKEN", "CALIB_TLS"},
      .most_file_bytes = {}};
  if (program.limits().has_disk()) options.most_file_bytes = program.limits().disk();
  ASSIGN_OR_RETURN(auto child, launcher_.Start(options));
  return std::make_unique<RunningProgram>(std::move(child), std::move(folder), options_.times);
}

// nullptr: none that waits. Of those that nobody asks for so many are ended that not more programs
// are there than slots.
std::unique_ptr<RunningProgram> Programs::TakeIdle(const std::string& identity) {
  std::unique_ptr<RunningProgram> taken;
  const absl::MutexLock lock(&mutex_);
  for (auto idle = idle_.begin(); idle != idle_.end() && taken == nullptr && !identity.empty();) {
    if (idle->identity != identity) {
      ++idle;
      continue;
    }
    if (idle->program->IsWaiting()) taken = std::move(idle->program);
    idle = idle_.erase(idle);  // one that died meanwhile goes
  }
  int too_many = runs_ + static_cast<int>(idle_.size()) - options_.slots;
  for (Idle& idle : idle_) {
    if (too_many-- <= 0) break;
    idle.gives_way = true;
  }
  changed_.SignalAll();
  return taken;
}

void Programs::GiveBack(const std::string& identity, std::unique_ptr<RunningProgram> program) {
  if (!program->IsWaiting()) return;
  const absl::MutexLock lock(&mutex_);
  idle_.push_back({.identity = identity,
                   .since = std::chrono::steady_clock::now(),
                   .program = std::move(program)});
  changed_.SignalAll();
}

void Programs::EndUnused(const std::stop_token& stop) {
  // No timed wait of absl::CondVar: it goes by the wall clock, which may be set back.
  constexpr absl::Duration kNap = absl::Milliseconds(50);
  while (!stop.stop_requested()) {
    std::list<Idle> unused;
    {
      const absl::MutexLock lock(&mutex_);
      if (stop.stop_requested()) return;
      if (idle_.empty()) changed_.Wait(&mutex_);
      const auto now = std::chrono::steady_clock::now();
      for (auto idle = idle_.begin(); idle != idle_.end();) {
        const auto next = std::next(idle);
        if (idle->gives_way || now - idle->since >= options_.times.longest_idle) {
          unused.splice(unused.end(), idle_, idle);
        }
        idle = next;
      }
    }
    for (Idle& idle : unused) idle.program->End();
    absl::SleepFor(kNap);
  }
}

}  // namespace calib::worker
