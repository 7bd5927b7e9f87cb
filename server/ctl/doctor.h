#pragma once
// What `calibctl doctor` concludes from what it has seen of a node and a server. Nothing here asks:
// the judgements are functions of reports.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/v1/campaign.pb.h"
#include "server/access/certificate.h"

namespace calib::ctl {

enum class Health { kOk, kUnknown, kWarning, kProblem };
std::string ToString(Health health);  ///< "ok", "unknown", "warning", "problem"

/// One thing that was looked at.
struct Check {
  std::string name;  ///< build | clock | file_system | time_step | certificates | server | workers
                     ///< | backup
  std::string subject{};  ///< what the check is about
  Health health = Health::kOk;
  std::string found{};   ///< a sentence or two
  std::string advice{};  ///< what to do; empty when nothing is to be done
};

/// What must be the same wherever runs of one campaign are made: the mechanics, and the contacts,
/// effects and tests on offer (SHA-256).
struct Build {
  std::string engine_version;
  std::string catalog_digest;
};
Build OwnBuild();
Check JudgeBuild(const std::string& subject, const Build& own, const Build& other);

/// What the kernel says of this machine's clock.
struct NodeClock {
  bool known = false;  ///< false: the kernel would not say
  bool synchronised = false;
  double largest_error = 0;  ///< [s], as the kernel estimates it
};
Check JudgeClock(const NodeClock& clock);
/// ahead: of the server's clock over this one [s]; uncertainty: half of the round trip [s].
Check JudgeClockOffset(double ahead, double uncertainty);

enum class FolderUse { kState, kCheckpoints, kTemporary };
Check JudgeFolder(const v1::FolderReport& folder, FolderUse use);
Check JudgeDatabase(const v1::ServerReport& server);
/// How large the state is, what is on its way out of it, and when it was last backed up.
std::vector<Check> JudgeUpkeep(const v1::ServerReport& server);
/// Only of a server that waits.
std::optional<Check> JudgeWaiting(const v1::ServerReport& server);

/// address: by which the server was reached.
Check JudgeConnection(const std::string& address, const v1::ServerReport& server,
                      std::int64_t now_unix_s);
/// A node's own certificate, which is warned of from 30 days before its end. holder: as read from
/// its folder, or why it could not be; FAILED_PRECONDITION: why it is refused (access::CheckOwn).
Check JudgeCertificate(const absl::StatusOr<access::Holder>& holder, std::int64_t now_unix_s);
/// One check for each worker that is silent or was turned away, or one that all is well.
std::vector<Check> JudgeWorkers(const std::vector<v1::WorkerInfo>& workers,
                                const v1::ServerReport& server);

/// A collision and an assembly that a worker has made, beside what is known of them.
struct TrialRuns {
  double restitution = 0;   ///< of an elastic Hertz collision, which has 1
  double peak_overlap = 0;  ///< [m]
  double duration = 0;      ///< [s]
  double mean_stress = 0;   ///< [Pa] of 64 grains compressed to `TrialStress()`
  std::string digest;       ///< SHA-256 of all digits of both tables
  std::string failure{};    ///< why no trial could be made; empty: it was
};
Check JudgeTimeStep(const TrialRuns& runs);

/// Every check stands for itself; a node is healthy without a problem.
bool IsHealthy(const std::vector<Check>& checks);
std::string DoctorText(const std::vector<Check>& checks);
std::string DoctorJson(const std::vector<Check>& checks);

}  // namespace calib::ctl
