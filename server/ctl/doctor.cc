#include "server/ctl/doctor.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "dem/registry/catalog.h"
#include "proto/rpc/address.h"
#include "server/campaign/model/sha256.h"
#include "server/ctl/trial_runs.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

constexpr double kMebibyte = 1024.0 * 1024.0;
constexpr double kGibibyte = 1024.0 * kMebibyte;
constexpr double kMuchEmpty = kGibibyte;  // [bytes]
constexpr double kLargeLog = 512 * kMebibyte;
constexpr double kOldBackup = 30.0 * 86400.0;                     // [s]
constexpr double kSlowSync = 0.25;                                // [s]
constexpr double kLargestOffset = 1.0;                            // [s]
constexpr std::int64_t kWarnedBefore = std::int64_t{30} * 86400;  // [s] the end of a certificate
constexpr double kTrialTolerance = 2e-3;                          // of closed forms
constexpr double kStressTolerance = 1e-2;                         // within which a stage is settled

std::string Size(double bytes) {
  return bytes >= kGibibyte ? absl::StrCat(report::Number(bytes / kGibibyte, 3), " GiB")
                            : absl::StrCat(report::Number(bytes / kMebibyte, 3), " MiB");
}

std::string Short(const std::string& digest) { return digest.substr(0, 12); }

std::string InWords(const Build& build) {
  return absl::StrCat("mechanics ", build.engine_version, ", catalogue ",
                      Short(build.catalog_digest));
}

std::string Of(FolderUse use) {
  switch (use) {
    case FolderUse::kState:
      return "state folder";
    case FolderUse::kCheckpoints:
      return "checkpoint folder";
    case FolderUse::kTemporary:
      return "temporary folder";
  }
  return "";
}

struct Space {
  double enough, least;  // [bytes]
};

Space SpaceFor(FolderUse use) {
  switch (use) {
    case FolderUse::kState:
      return {2 * kGibibyte, 100 * kMebibyte};
    case FolderUse::kCheckpoints:
      return {4 * kGibibyte, 100 * kMebibyte};
    case FolderUse::kTemporary:
      return {100 * kMebibyte, 10 * kMebibyte};
  }
  return {};
}

/// The graver of the two, and what is to be done about it.
void Worsen(Check& check, Health health, const std::string& advice) {
  if (health > check.health) {
    check.health = health;
    check.advice = advice;
  }
}

bool IsNear(double value, double expected, double tolerance) {
  return std::abs(value - expected) <= tolerance * std::abs(expected);
}

}  // namespace

std::string ToString(Health health) {
  switch (health) {
    case Health::kOk:
      return "ok";
    case Health::kUnknown:
      return "unknown";
    case Health::kWarning:
      return "warning";
    case Health::kProblem:
      return "problem";
  }
  return "";
}

Build OwnBuild() { return {dem::EngineVersion(), campaign::Sha256Hex(dem::CatalogText())}; }

Check JudgeBuild(const std::string& subject, const Build& own, const Build& other) {
  Check check{.name = "build", .subject = subject};
  if (other.engine_version == own.engine_version && other.catalog_digest == own.catalog_digest) {
    check.found = absl::StrCat(InWords(other), ", the same as calibctl.");
    return check;
  }
  check.health = Health::kProblem;
  check.found = absl::StrCat(InWords(other), "; this calibctl has ", InWords(own), ".");
  check.advice =
      "Install one build on server and nodes: others would compute other bits, and a server gives "
      "such workers no runs of the DEM.";
  return check;
}

Check JudgeClock(const NodeClock& clock) {
  Check check{.name = "clock", .subject = "this node"};
  if (!clock.known) {
    check.health = Health::kUnknown;
    check.found = "The kernel does not say whether the clock is synchronised (a container?).";
  } else if (!clock.synchronised) {
    check.health = Health::kWarning;
    check.found = "The clock is not synchronised.";
    check.advice =
        "Run chrony or systemd-timesyncd: results do not depend on the clock, times in logs and "
        "reports do.";
  } else {
    check.found = absl::StrCat("Synchronised, to within ", report::Number(clock.largest_error, 2),
                               " s by the kernel's estimate.");
  }
  return check;
}

Check JudgeClockOffset(double ahead, double uncertainty) {
  Check check{.name = "clock", .subject = "server"};
  const double beyond = std::abs(ahead) - uncertainty;
  const std::string much = report::Number(std::abs(ahead), 2);
  if (beyond <= kLargestOffset) {
    check.found = absl::StrCat("Agrees with this node's within ",
                               report::Number(std::max(std::abs(ahead), uncertainty), 2), " s.");
    return check;
  }
  check.health = Health::kWarning;
  check.found = absl::StrCat("It is ", much, ahead > 0 ? " s ahead of" : " s behind",
                             " this node's (to within ", report::Number(uncertainty, 2), " s).");
  check.advice =
      "Synchronise both by NTP: leases are timed by the server alone and hold, but times in logs "
      "and reports do not fit together.";
  return check;
}

Check JudgeFolder(const v1::FolderReport& folder, FolderUse use) {
  Check check{.name = "file_system", .subject = Of(use)};
  if (!folder.problem().empty()) {
    check.health = Health::kProblem;
    check.found = absl::StrCat(folder.path(), ": ", folder.problem(), ".");
    check.advice = "Give a folder that this user may write to, on a disk that is not full.";
    return check;
  }
  const auto free = static_cast<double>(folder.free_bytes());
  check.found = absl::StrCat(folder.path(), " (", folder.file_system(), "): ", Size(free),
                             " free, a file is safe after ",
                             report::Number(1e3 * folder.sync_seconds(), 2), " ms.");
  const bool keeps = use == FolderUse::kState;
  const Space space = SpaceFor(use);
  if (free < space.least) {
    Worsen(check, Health::kProblem, "The disk is all but full: free some space.");
  }
  if (keeps && folder.is_remote()) {
    Worsen(check, Health::kProblem,
           "Campaigns must not lie on a network file system, whose locks and memory maps SQLite "
           "cannot rely on: choose a local disk.");
  }
  if (keeps && folder.is_volatile()) {
    Worsen(check, Health::kWarning,
           "What lies there is gone when the machine or container is started anew: choose a disk "
           "that stays.");
  }
  if (free < space.enough) {
    Worsen(check, Health::kWarning,
           absl::StrCat(
               "Less than ", Size(space.enough), " is little for ",
               keeps ? "campaigns with thousands of runs."
                     : (use == FolderUse::kCheckpoints ? "resting runs." : "files in between.")));
  }
  if (keeps && folder.sync_seconds() > kSlowSync) {
    Worsen(check, Health::kWarning,
           "Every state that is acknowledged waits for the disk: choose a faster one, or expect "
           "workers to wait.");
  }
  return check;
}

Check JudgeDatabase(const v1::ServerReport& server) {
  Check check{.name = "file_system", .subject = "calib.db"};
  if (!server.database().empty()) {
    check.health = Health::kProblem;
    check.found = absl::StrCat("SQLite finds: ", server.database(), ".");
    check.advice =
        "Stop the server, copy its state folder, and restore calib.db from a backup or by "
        "`sqlite3 calib.db .recover`.";
  } else if (!server.database_in_full()) {
    check.found = "No fault in what was looked through in ten seconds; it is large.";
  } else {
    check.found = "SQLite finds no fault.";
  }
  return check;
}

std::vector<Check> JudgeUpkeep(const v1::ServerReport& server) {
  const auto bytes = static_cast<double>(server.database_bytes());
  const auto empty = static_cast<double>(server.database_free_bytes());
  Check size{.name = "file_system", .subject = "size of calib.db"};
  size.found = absl::StrCat(Size(bytes), ", of which ", Size(empty), " hold nothing, and a log of ",
                            Size(static_cast<double>(server.wal_bytes())), ".");
  if (server.leaving() > 0) {
    absl::StrAppend(&size.found, " What ", server.leaving(),
                    server.leaving() == 1 ? " campaign has" : " campaigns have",
                    " left behind is being removed.");
  } else if (empty > kMuchEmpty && empty > bytes / 2) {
    Worsen(size, Health::kWarning,
           "Start the server again once its disk has room for a second calib.db: it then gives "
           "empty room back to the disk.");
  }
  if (static_cast<double>(server.wal_bytes()) > kLargeLog) {
    Worsen(size, Health::kWarning,
           "Something has read calib.db for long, as a shell: end it, so that the log becomes "
           "small.");
  }
  Check backup{.name = "backup", .subject = "server"};
  if (server.last_backup_unix_ms() == 0) {
    backup.found = "None was taken of this server; `calibctl backup -o FILE` takes one.";
    return {size, backup};
  }
  const double age = 1e-3 * static_cast<double>(server.unix_ms() - server.last_backup_unix_ms());
  backup.found = absl::StrCat("The last was taken ", report::Duration(std::max(0.0, age)), " ago.");
  if (age > kOldBackup) {
    Worsen(backup, Health::kWarning, "Take one by `calibctl backup -o FILE`, and do so regularly.");
  }
  return {size, backup};
}

std::optional<Check> JudgeWaiting(const v1::ServerReport& server) {
  if (server.waits().empty()) {
    return std::nullopt;
  }
  return Check{.name = "server",
               .subject = "writing",
               .health = Health::kProblem,
               .found = absl::StrCat("It waits: ", server.waits(), "."),
               .advice =
                   "Free some space on that disk, make it larger or let it be written to again; "
                   "nothing that was acknowledged is lost, and the server need not be started "
                   "again."};
}

Check JudgeConnection(const std::string& address, const v1::ServerReport& server,
                      std::int64_t now_unix_s) {
  const std::string where = server.listen().empty() ? address : server.listen();
  if (!server.certificate_problem().empty()) {
    return {.name = "certificates",
            .subject = "connection",
            .health = Health::kProblem,
            .found = absl::StrCat("The server's certificate: ", server.certificate_problem(), "."),
            .advice = "Mend the folder of calibd --tls: it is read again by itself."};
  }
  if (!server.certificate().empty()) {
    access::Holder holder{.name = server.certificate(), .role = access::Role::kServer};
    holder.not_after_unix_s = server.certificate_end_unix_s();
    Check check = JudgeCertificate(holder, now_unix_s);
    check.subject = "connection";
    check.found = absl::StrCat("Encrypted; both sides show certificates. ", check.found);
    return check;
  }
  Check check{.name = "certificates", .subject = "connection"};
  if (!rpc::SocketPathOf(where).empty()) {
    check.found = absl::StrCat(where, " is reached by programs of its account only.");
  } else if (rpc::IsLoopback(where)) {
    check.found = absl::StrCat(where,
                               " is reached from this machine only, by who has its token; no "
                               "certificate is needed.");
  } else {
    check.health = Health::kWarning;
    check.found = absl::StrCat(where,
                               " can be reached from other machines, and speaks plain text "
                               "(--insecure): its token can be read on the way.");
    check.advice = "Start calibd with --tls DIR (`calibctl certs init`, `calibctl certs issue`).";
  }
  return check;
}

Check JudgeCertificate(const absl::StatusOr<access::Holder>& holder, std::int64_t now_unix_s) {
  Check check{.name = "certificates", .subject = "own certificate"};
  if (!holder.ok()) {
    check.health = Health::kProblem;
    check.found = absl::StrCat(std::string(holder.status().message()), ".");
    check.advice = absl::IsFailedPrecondition(holder.status())
                       ? "Those it is shown to refuse it."
                       : "Give --tls a whole folder of `calibctl certs issue`.";
    return check;
  }
  const std::string role = access::NameOf(holder->role);
  const std::string end = access::DateOf(holder->not_after_unix_s);
  const std::int64_t left = holder->not_after_unix_s - now_unix_s;
  const std::string who = absl::StrCat(holder->name, " (", role, ")");
  const std::string renews = absl::StrCat("`calibctl certs issue CA --role ", role, " ",
                                          holder->name, " -o FOLDER` renews it.");
  if (now_unix_s < holder->not_before_unix_s) {
    check.health = Health::kProblem;
    check.found = absl::StrCat("That of ", who, " is not valid before ",
                               access::DateOf(holder->not_before_unix_s), ".");
    check.advice = "Set this node's clock: the certificate is newer than it.";
  } else if (left <= 0) {
    check.health = Health::kProblem;
    check.found = absl::StrCat("That of ", who, " has expired on ", end, ".");
    check.advice = renews;
  } else if (left <= kWarnedBefore) {
    check.health = Health::kWarning;
    check.found = absl::StrCat("That of ", who, " ends on ", end, ", in ",
                               report::Duration(static_cast<double>(left)), ".");
    check.advice = renews;
  } else {
    check.found = absl::StrCat("That of ", who, " is valid until ", end, ".");
  }
  return check;
}

std::vector<Check> JudgeWorkers(const std::vector<v1::WorkerInfo>& workers,
                                const v1::ServerReport& server) {
  std::vector<Check> checks;
  int slots = 0;
  for (const v1::WorkerInfo& worker : workers) {
    if (worker.connected()) {
      slots += worker.slots();
      if (!worker.waits().empty()) {
        checks.push_back({.name = "workers",
                          .subject = worker.name(),
                          .health = Health::kWarning,
                          .found = absl::StrCat("It has ", worker.waits(), "."),
                          .advice = "Install one build on server and nodes."});
      }
      continue;
    }
    if (worker.left()) continue;
    checks.push_back(
        {.name = "workers",
         .subject = worker.name(),
         .health = Health::kWarning,
         .found = absl::StrCat("Silent for ", report::Duration(worker.seconds_since_heard()), "."),
         .advice = "Look at its log; what it ran is given to others when its lease is over."});
  }
  for (const v1::RefusedWorker& worker : server.refused()) {
    const double ago = 1e-3 * static_cast<double>(server.unix_ms() - worker.unix_ms());
    checks.push_back({.name = "workers",
                      .subject = worker.name().empty() ? "a worker" : worker.name(),
                      .health = Health::kProblem,
                      .found = absl::StrCat("Turned away ", report::Duration(std::max(0.0, ago)),
                                            " ago: ", worker.reason(), "."),
                      .advice = "Do so on that node and start it again."});
  }
  const bool any = slots > 0;
  checks.insert(
      checks.begin(),
      {.name = "workers",
       .subject = "server",
       .health = any ? Health::kOk : Health::kWarning,
       .found = any ? absl::StrCat(slots, slots == 1 ? " slot" : " slots", " of connected workers.")
                    : "No worker is connected.",
       .advice = any ? "" : "Start `calib-worker --server HOST:PORT` on a node."});
  return checks;
}

Check JudgeTimeStep(const TrialRuns& runs) {
  Check check{.name = "time_step", .subject = "this node"};
  if (!runs.failure.empty()) {
    check.health = Health::kProblem;
    check.found = absl::StrCat("A trial run has failed: ", runs.failure, ".");
    check.advice = "Install calib-worker anew, of the build of calibctl.";
    return check;
  }
  const TrialCollision hertz;
  const bool right = IsNear(runs.restitution, 1, kTrialTolerance) &&
                     IsNear(runs.peak_overlap, hertz.PeakOverlap(), kTrialTolerance) &&
                     IsNear(runs.duration, hertz.Duration(), kTrialTolerance) &&
                     IsNear(runs.mean_stress, TrialStress(), kStressTolerance);
  const auto off = [](double value, double expected) {
    return absl::StrFormat("%.3f %%", 100.0 * std::abs(value / expected - 1.0));
  };
  check.found =
      absl::StrCat("An elastic collision at the engine's time step: restitution ",
                   report::Number(runs.restitution, 6), " (1), overlap ",
                   off(runs.peak_overlap, hertz.PeakOverlap()), " and duration ",
                   off(runs.duration, hertz.Duration()), " off Hertz; 64 grains compressed to ",
                   report::Number(1e-3 * runs.mean_stress, 4), " kPa (",
                   report::Number(1e-3 * TrialStress(), 4), "). Digits ", Short(runs.digest),
                   ": the same on every node of this build, or one of them is faulty.");
  if (!right) {
    check.health = Health::kProblem;
    check.advice =
        "Do not calibrate on this node: its build, its processor or its memory is faulty.";
  }
  return check;
}

bool IsHealthy(const std::vector<Check>& checks) {
  return std::none_of(checks.begin(), checks.end(),
                      [](const Check& check) { return check.health == Health::kProblem; });
}

std::string DoctorText(const std::vector<Check>& checks) {
  std::string text;
  for (const Check& check : checks) {
    const std::string head =
        absl::StrCat(ToString(check.health), std::string(9 - ToString(check.health).size(), ' '),
                     report::NameForPeople(check.name), " (", check.subject, "): ");
    const std::string indent(9, ' ');
    absl::StrAppend(&text, report::Wrapped(check.found, head, indent));
    if (!check.advice.empty()) {
      absl::StrAppend(&text, report::Wrapped(check.advice, indent + "-> ", indent + "   "));
    }
  }
  return text;
}

std::string DoctorJson(const std::vector<Check>& checks) {
  nlohmann::json list = nlohmann::json::array();
  for (const Check& check : checks) {
    list.push_back({{"name", check.name},
                    {"subject", check.subject},
                    {"health", ToString(check.health)},
                    {"found", check.found},
                    {"advice", check.advice}});
  }
  return nlohmann::json{{"healthy", IsHealthy(checks)}, {"checks", list}}.dump(2) + "\n";
}

}  // namespace calib::ctl
