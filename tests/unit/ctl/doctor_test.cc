#include "server/ctl/doctor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "server/ctl/trial_runs.h"

namespace calib::ctl {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr std::int64_t kGiB = std::int64_t{1} << 30;

v1::FolderReport Disk() {
  v1::FolderReport folder;
  folder.set_path("/srv/calib");
  folder.set_file_system("ext");
  folder.set_free_bytes(100 * kGiB);
  folder.set_total_bytes(200 * kGiB);
  folder.set_sync_seconds(0.004);
  return folder;
}

TrialRuns RightRuns() {
  const TrialCollision hertz;
  return {.restitution = 1,
          .peak_overlap = hertz.PeakOverlap(),
          .duration = hertz.Duration(),
          .mean_stress = TrialStress(),
          .digest = "0123456789abcdef"};
}

TEST(Doctor, ALocalDiskIsFit) {
  const Check check = JudgeFolder(Disk(), FolderUse::kState);
  EXPECT_EQ(check.health, Health::kOk);
  EXPECT_EQ(check.found, "/srv/calib (ext): 100 GiB free, a file is safe after 4 ms.");
  EXPECT_EQ(check.advice, "");
}

TEST(Doctor, CampaignsDoNotBelongOnANetworkOrInMemory) {
  v1::FolderReport folder = Disk();
  folder.set_is_remote(true);
  EXPECT_EQ(JudgeFolder(folder, FolderUse::kState).health, Health::kProblem);
  EXPECT_EQ(JudgeFolder(folder, FolderUse::kTemporary).health, Health::kOk);
  folder = Disk();
  folder.set_is_volatile(true);
  EXPECT_EQ(JudgeFolder(folder, FolderUse::kState).health, Health::kWarning);
  EXPECT_EQ(JudgeFolder(folder, FolderUse::kCheckpoints).health, Health::kOk);
}

TEST(Doctor, TheGraverOfTwoFindingsCounts) {
  v1::FolderReport folder = Disk();
  folder.set_free_bytes(kGiB);
  EXPECT_EQ(JudgeFolder(folder, FolderUse::kState).health, Health::kWarning);
  folder.set_is_remote(true);
  EXPECT_THAT(JudgeFolder(folder, FolderUse::kState).advice, HasSubstr("network"));
  folder.set_free_bytes(0);
  EXPECT_THAT(JudgeFolder(folder, FolderUse::kState).advice, HasSubstr("full"));
}

TEST(Doctor, AFolderThatCannotBeWrittenIsAProblemForAnyUse) {
  v1::FolderReport folder = Disk();
  folder.set_problem("no file can be made: Permission denied");
  for (const auto use : {FolderUse::kState, FolderUse::kCheckpoints, FolderUse::kTemporary}) {
    const Check check = JudgeFolder(folder, use);
    EXPECT_EQ(check.health, Health::kProblem);
    EXPECT_EQ(check.found, "/srv/calib: no file can be made: Permission denied.");
  }
}

TEST(Doctor, AServerThatWaitsForRoomIsAProblem) {
  v1::ServerReport server;
  EXPECT_FALSE(JudgeWaiting(server).has_value());
  server.set_waits("the disk of the state folder takes nothing since 2026-01-31 08:05:09 UTC");
  const auto check = JudgeWaiting(server);
  ASSERT_TRUE(check.has_value());
  EXPECT_EQ(check->health, Health::kProblem);
  EXPECT_THAT(check->found,
              HasSubstr("It waits: the disk of the state folder takes nothing since"));
  EXPECT_THAT(check->advice, HasSubstr("Free some space"));
}

TEST(Doctor, ClocksMayDifferByWhatIsNotKnown) {
  EXPECT_EQ(JudgeClockOffset(0.4, 0.01).health, Health::kOk);
  EXPECT_EQ(JudgeClockOffset(1.5, 1.0).health, Health::kOk);
  const Check behind = JudgeClockOffset(-40, 0.01);
  EXPECT_EQ(behind.health, Health::kWarning);
  EXPECT_THAT(behind.found, HasSubstr("40 s behind"));
  EXPECT_THAT(JudgeClockOffset(40, 0.01).found, HasSubstr("40 s ahead of"));
  EXPECT_EQ(JudgeClock({}).health, Health::kUnknown);
  EXPECT_EQ(JudgeClock({.known = true}).health, Health::kWarning);
  EXPECT_EQ(JudgeClock({.known = true, .synchronised = true}).health, Health::kOk);
}

TEST(Doctor, BuildsMustBeTheSameInMechanicsAndCatalogue) {
  const Build own{"7", "abc"};
  EXPECT_EQ(JudgeBuild("server", own, own).health, Health::kOk);
  EXPECT_EQ(JudgeBuild("server", own, {"6", "abc"}).health, Health::kProblem);
  EXPECT_EQ(JudgeBuild("server", own, {"7", "abd"}).health, Health::kProblem);
}

TEST(Doctor, CertificatesAreWarnedOfAMonthBeforeTheirEnd) {
  constexpr std::int64_t kDay = 86400;
  constexpr std::int64_t kEnd = 1793534400;  // 2026-11-01
  const access::Holder holder = {.name = "node7",
                                 .role = access::Role::kWorker,
                                 .not_before_unix_s = kEnd - 365 * kDay,
                                 .not_after_unix_s = kEnd};
  const Check fine = JudgeCertificate(holder, kEnd - 30 * kDay - 1);
  EXPECT_EQ(fine.health, Health::kOk);
  EXPECT_EQ(fine.found, "That of node7 (worker) is valid until 2026-11-01.");
  EXPECT_EQ(fine.advice, "");
  const Check ends = JudgeCertificate(holder, kEnd - 30 * kDay);
  EXPECT_EQ(ends.health, Health::kWarning);
  EXPECT_THAT(ends.found, HasSubstr("ends on 2026-11-01"));
  EXPECT_THAT(ends.advice, HasSubstr("calibctl certs issue CA --role worker node7 -o"));
  EXPECT_EQ(JudgeCertificate(holder, kEnd - 1).health, Health::kWarning);
  const Check over = JudgeCertificate(holder, kEnd);
  EXPECT_EQ(over.health, Health::kProblem);
  EXPECT_THAT(over.found, HasSubstr("has expired on 2026-11-01"));
  EXPECT_EQ(over.advice, ends.advice);
  EXPECT_EQ(JudgeCertificate(holder, holder.not_before_unix_s - 1).health, Health::kProblem);
  const Check none = JudgeCertificate(absl::NotFoundError("tls/key.pem is not there"), kEnd);
  EXPECT_EQ(none.health, Health::kProblem);
  EXPECT_EQ(none.found, "tls/key.pem is not there.");
}

TEST(Doctor, OnlyAnOpenPortIsWarnedOf) {
  const auto judged = [](const std::string& address, const std::string& listen) {
    v1::ServerReport server;
    server.set_listen(listen);
    return JudgeConnection(address, server, 0).health;
  };
  EXPECT_EQ(judged("127.0.0.1:7443", ""), Health::kOk);
  EXPECT_EQ(judged("[::1]:7443", ""), Health::kOk);
  EXPECT_EQ(judged("unix:/s/run/calib.sock", "unix:/s/run/calib.sock"), Health::kOk);
  EXPECT_EQ(judged("127.0.0.1:7443", "0.0.0.0:7443"), Health::kWarning)
      << "reached here, but open to others";
  EXPECT_EQ(judged("node1:7443", "127.0.0.1:7443"), Health::kOk) << "through a tunnel";
}

TEST(Doctor, CertificateOfTheServerIsJudgedByItsEnd) {
  constexpr std::int64_t kDay = 86400;
  v1::ServerReport server;
  server.set_listen("0.0.0.0:7443");
  server.set_certificate("head");
  server.set_certificate_end_unix_s(1000 * kDay);
  EXPECT_EQ(JudgeConnection("node1:7443", server, 900 * kDay).health, Health::kOk);
  EXPECT_EQ(JudgeConnection("node1:7443", server, 990 * kDay).health, Health::kWarning);
  EXPECT_EQ(JudgeConnection("node1:7443", server, 1001 * kDay).health, Health::kProblem);
  server.set_certificate_problem("the certificate of head was revoked");
  EXPECT_EQ(JudgeConnection("node1:7443", server, 900 * kDay).health, Health::kProblem);
}

TEST(Doctor, WorkersThatWereTurnedAwayAreNamed) {
  v1::ServerReport server;
  server.set_unix_ms(1'000'000);
  EXPECT_EQ(JudgeWorkers({}, server).front().health, Health::kWarning) << "nobody works";
  v1::WorkerInfo ready;
  ready.set_name("node1-1");
  ready.set_slots(2);
  ready.set_connected(true);
  v1::WorkerInfo silent;
  silent.set_name("node2-1");
  silent.set_seconds_since_heard(90);
  v1::RefusedWorker& refused = *server.add_refused();
  refused.set_name("node3-1");
  refused.set_reason("worker node3-1 speaks protocol 1, the server from 2 on: update it");
  refused.set_unix_ms(970'000);
  v1::WorkerInfo drained;
  drained.set_name("node4-1");
  drained.set_left(true);
  const auto checks = JudgeWorkers({ready, silent, drained}, server);
  ASSERT_EQ(checks.size(), 3U);
  EXPECT_EQ(checks[0].found, "2 slots of connected workers.");
  EXPECT_EQ(checks[1].health, Health::kWarning);
  EXPECT_EQ(checks[2].health, Health::kProblem);
  EXPECT_THAT(checks[2].found, HasSubstr("30 s ago: worker node3-1 speaks protocol 1"));
}

TEST(Doctor, TrialRunsAreHeldAgainstHertz) {
  // Johnson 1985, sec. 11.4, with m/2 = 0.016336 kg and 4/3 E* sqrt(R*) = 1.08786e10 N/m^1.5.
  const TrialCollision hertz;
  EXPECT_NEAR(hertz.PeakOverlap(), 2.03890e-5, 1e-9);
  EXPECT_NEAR(hertz.Duration(), 6.00105e-5, 1e-9);
  EXPECT_EQ(JudgeTimeStep(RightRuns()).health, Health::kOk);
  TrialRuns lossy = RightRuns();
  lossy.restitution = 0.99;
  TrialRuns slow = RightRuns();
  slow.duration *= 1.01;
  TrialRuns soft = RightRuns();
  soft.mean_stress *= 0.9;
  TrialRuns none = RightRuns();
  none.peak_overlap = std::nan("");
  TrialRuns failed = RightRuns();
  failed.failure = "killed";
  for (const TrialRuns& wrong : {lossy, slow, soft, none, failed}) {
    EXPECT_EQ(JudgeTimeStep(wrong).health, Health::kProblem);
  }
}

TEST(Doctor, ADamagedFileIsAProblem) {
  v1::ServerReport server;
  server.set_database_in_full(true);
  EXPECT_EQ(JudgeDatabase(server).health, Health::kOk);
  server.set_database_in_full(false);
  EXPECT_THAT(JudgeDatabase(server).found, HasSubstr("ten seconds"));
  server.set_database("Page 7 is never used");
  EXPECT_EQ(JudgeDatabase(server).health, Health::kProblem);
}

TEST(Doctor, SizeAndBackupsOfAServer) {
  constexpr std::int64_t kGib = std::int64_t{1} << 30;
  constexpr std::int64_t kDayMs = 86'400'000;
  v1::ServerReport server;
  server.set_unix_ms(1000 * kDayMs);
  server.set_database_bytes(5 * kGib);
  auto checks = JudgeUpkeep(server);
  ASSERT_EQ(checks.size(), 2U);
  EXPECT_EQ(checks[0].health, Health::kOk);
  EXPECT_EQ(checks[1].health, Health::kOk);
  EXPECT_THAT(checks[1].found, HasSubstr("None was taken"));
  server.set_database_free_bytes(4 * kGib);
  EXPECT_EQ(JudgeUpkeep(server)[0].health, Health::kWarning);
  server.set_leaving(2);
  EXPECT_EQ(JudgeUpkeep(server)[0].health, Health::kOk) << "it is being removed";
  EXPECT_THAT(JudgeUpkeep(server)[0].found, HasSubstr("2 campaigns have left behind"));
  server.set_wal_bytes(kGib);
  EXPECT_EQ(JudgeUpkeep(server)[0].health, Health::kWarning);
  server.set_last_backup_unix_ms(998 * kDayMs);
  EXPECT_EQ(JudgeUpkeep(server)[1].health, Health::kOk);
  server.set_last_backup_unix_ms(900 * kDayMs);
  EXPECT_EQ(JudgeUpkeep(server)[1].health, Health::kWarning);
}

TEST(Doctor, TextAndJsonSayTheSame) {
  const std::vector<Check> checks = {
      {.name = "file_system", .subject = "state folder", .found = "Fine."},
      {.name = "clock",
       .subject = "this node",
       .health = Health::kWarning,
       .found = "It is not synchronised.",
       .advice = "Run chrony."}};
  EXPECT_EQ(DoctorText(checks),
            "ok       file system (state folder): Fine.\n"
            "warning  clock (this node): It is not synchronised.\n"
            "         -> Run chrony.\n");
  const auto json = nlohmann::json::parse(DoctorJson(checks));
  EXPECT_TRUE(json["healthy"]) << "a warning is no problem";
  EXPECT_EQ(json["checks"][1]["name"], "clock");
  EXPECT_EQ(json["checks"][1]["health"], "warning");
  EXPECT_EQ(json["checks"][1]["advice"], "Run chrony.");
}

}  // namespace
}  // namespace calib::ctl
