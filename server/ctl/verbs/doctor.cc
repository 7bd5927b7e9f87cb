// What a node and a server stand on: every check is made, then all are printed.
#include "server/ctl/doctor.h"

#include <sys/timex.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/access/certificate.h"
#include "server/client/child_process.h"
#include "server/client/session.h"
#include "server/client/temporary_folder.h"
#include "server/ctl/exit_codes.h"
#include "server/ctl/trial_runs.h"
#include "server/ctl/verb.h"
#include "server/messages/folder_report.h"

namespace calib::ctl {
namespace {

NodeClock ReadClock() {
  timex reading{};
  const int state = adjtimex(&reading);  // reads only: no mode is set
  if (state < 0) return {};
  return {.known = true,
          .synchronised = state != TIME_ERROR && (reading.status & STA_UNSYNC) == 0,
          .largest_error = 1e-6 * static_cast<double>(reading.maxerror)};
}

std::string TemporaryPlace() {
  const char* const named = std::getenv("TMPDIR");
  return named != nullptr && *named != '\0' ? named : "/tmp";
}

/// What `calib-worker --version` prints: a name and a value on each line.
struct Worker {
  Build build{"unknown", "unknown"};
  std::string checkpoints{};  ///< folder of this user's; empty: none
};
Worker AskWorker(const std::string& program) {
  Worker worker;
  const auto folder = client::TemporaryFolder::Make();
  if (!folder.ok()) return worker;
  const std::string log = folder->path() + "/version";
  auto process = client::ChildProcess::Start(program, {"--version"}, log);
  if (!process.ok() || process->Wait() != 0) return worker;
  std::ifstream file(log);
  for (std::string line; std::getline(file, line);) {
    const std::size_t blank = std::min(line.find(' '), line.size());
    const std::string name = line.substr(0, blank);
    const std::string value = blank < line.size() ? line.substr(blank + 1) : "";
    if (name == "mechanics") worker.build.engine_version = value;
    if (name == "catalogue") worker.build.catalog_digest = value;
    if (name == "checkpoints") worker.checkpoints = value;
  }
  return worker;
}

void ExamineNode(std::vector<Check>& checks) {
  const auto program = client::FindWorkerProgram();
  Worker worker;
  if (program.ok()) {
    worker = AskWorker(*program);
    checks.push_back(JudgeBuild(*program, OwnBuild(), worker.build));
    checks.push_back(JudgeTimeStep(MakeTrialRuns(*program)));
  } else {
    checks.push_back({.name = "build",
                      .subject = "calib-worker",
                      .health = Health::kProblem,
                      .found = absl::StrCat(program.status().message(), "."),
                      .advice = "Put calib-worker beside calibctl or on PATH."});
  }
  checks.push_back(JudgeClock(ReadClock()));
  checks.push_back(JudgeFolder(messages::ExamineFolder(TemporaryPlace()), FolderUse::kTemporary));
  if (!worker.checkpoints.empty()) {
    checks.push_back(
        JudgeFolder(messages::ExamineFolder(worker.checkpoints), FolderUse::kCheckpoints));
  }
}

double UnixSeconds() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration<double>(now).count();
}

absl::Status ExamineServer(client::Session& session, bool is_own, std::vector<Check>& checks) {
  // The first call opens the connection; the second one tells the time.
  ASSIGN_OR_RETURN(const auto workers, session.client().ListWorkers());
  const double asked = UnixSeconds();
  ASSIGN_OR_RETURN(const auto server, session.client().Examine());
  checks.push_back(
      JudgeBuild("server", OwnBuild(), {server.engine_version(), server.catalog_digest()}));
  if (!is_own) {
    // The server reads its clock as the call comes in: half of what a short call takes is unknown.
    const double before = UnixSeconds();
    const auto again = session.client().ListWorkers();
    const double trip = UnixSeconds() - before;
    if (!again.ok()) return again.status();
    const double its = 1e-3 * static_cast<double>(server.unix_ms());
    checks.push_back(JudgeClockOffset(its - asked - 0.5 * trip, 0.5 * trip + 1e-3));
  }
  checks.push_back(JudgeFolder(server.state_folder(), FolderUse::kState));
  checks.push_back(JudgeDatabase(server));
  for (Check& check : JudgeUpkeep(server)) checks.push_back(std::move(check));
  if (auto waiting = JudgeWaiting(server); waiting.has_value()) {
    checks.push_back(*std::move(waiting));
  }
  checks.push_back(
      JudgeConnection(session.address(), server, static_cast<std::int64_t>(UnixSeconds())));
  if (!is_own) {
    for (Check& check : JudgeWorkers(workers, server)) checks.push_back(std::move(check));
  }
  return absl::OkStatus();
}

/// Where this node's certificate is: --tls, else $CALIB_TLS; empty: it has none.
std::string OwnFolder(const client::ServerChoice& choice) {
  const char* const variable = std::getenv("CALIB_TLS");
  return !choice.tls.empty() || variable == nullptr ? choice.tls : variable;
}

/// Whose certificate is in a folder; why it could not be read, or is refused.
absl::StatusOr<access::Holder> OwnCertificate(const std::string& folder, std::int64_t now_unix_s) {
  RETURN_IF_ERROR(access::FinishRenewal(folder));  // which no connection could use
  ASSIGN_OR_RETURN(const auto credentials, access::ReadCredentials(folder));
  RETURN_IF_ERROR(access::CheckOwn(credentials, now_unix_s));
  return credentials.holder;
}

absl::StatusOr<int> Doctor(const CommonOptions& common) {
  std::vector<Check> checks;
  ExamineNode(checks);
  if (const std::string tls = OwnFolder(common.server); !tls.empty()) {
    const auto now = static_cast<std::int64_t>(UnixSeconds());
    checks.push_back(JudgeCertificate(OwnCertificate(tls, now), now));
  }
  const bool named = !common.server.state.empty() || common.server.given ||
                     common.server.address != client::ServerChoice().address;
  std::error_code error;
  const bool is_new =
      !common.server.state.empty() &&
      !std::filesystem::exists(std::filesystem::path(common.server.state) / "calib.db", error);
  absl::Status reached;
  if (is_new) {
    checks.push_back(JudgeFolder(messages::ExamineFolder(common.server.state), FolderUse::kState));
    checks.back().found += " It holds no campaigns yet.";
  } else {
    auto session = client::Session::Open(common.server);
    reached = session.ok()
                  ? ExamineServer(**session,
                                  !common.server.state.empty() && !(*session)->is_guest(), checks)
                  : session.status();
  }
  if (!reached.ok()) {
    checks.push_back(
        {.name = "server",
         .subject = common.server.state.empty() ? common.server.address : common.server.state,
         .health = named ? Health::kProblem : Health::kUnknown,
         .found = absl::StrCat(reached.message(), "."),
         .advice = named ? "Look whether calibd runs there and what its log says." : ""});
  }
  std::cout << (common.json ? DoctorJson(checks) : DoctorText(checks));
  if (named && absl::IsUnavailable(reached)) return kUnreachable;
  return IsHealthy(checks) ? kDone : kFailed;
}

}  // namespace

Verb DoctorVerb() {
  return {.help = {.name = "doctor",
                   .description = "Checks this node, and a server: build, clock, file systems, "
                                  "time step, certificates",
                   .example = "doctor --server node1:7443"},
          .run = &Doctor};
}

}  // namespace calib::ctl
