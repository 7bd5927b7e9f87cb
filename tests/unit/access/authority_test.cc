#include "server/access/authority.h"

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <set>
#include <thread>
#include <vector>

#include "server/access/files.h"
#include "server/access/ledger.h"
#include "server/access/signing.h"
#include "server/access/x509.h"
#include "tests/unit/access/access_fixture.h"

namespace calib::access {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

class Authority : public AccessFixture {
 protected:
  std::string Refused(const Request& request, const std::string& out, absl::StatusCode code) const {
    const auto issued = Issue(ca(), request, At(out));
    EXPECT_EQ(issued.status().code(), code) << issued.status();
    return std::string(issued.status().message());
  }
  std::int64_t CrlNumber() const {
    const CrlPtr crl = ParseRevocations(ReadText(At("ca/crl.pem")));
    return crl ? NumberOf(crl.get()) : -1;
  }
};

TEST_F(Authority, BelongsToItsOwnerAndIsMadeOnce) {
  EXPECT_EQ(ModeOf(ca()), 0700U);
  EXPECT_EQ(ModeOf(At("ca/ca-key.pem")), 0600U);
  EXPECT_EQ(ModeOf(At("ca/issued.csv")), 0600U);
  const std::string key = ReadText(At("ca/ca-key.pem"));
  const absl::Status again = InitAuthority(ca() + "/");
  EXPECT_EQ(again.code(), absl::StatusCode::kAlreadyExists);
  EXPECT_THAT(std::string(again.message()), HasSubstr("holds an authority already"));
  EXPECT_EQ(ReadText(At("ca/ca-key.pem")), key);
  const auto end = EndOfAuthority(ca());
  ASSERT_TRUE(end.ok()) << end.status();
  EXPECT_NEAR(static_cast<double>(*end - Now()), 3653.0 * kOneDay, 60);

  std::filesystem::create_directories(At("full"));
  WriteText(At("full/letter"), "dear");
  EXPECT_EQ(InitAuthority(At("full")).code(), absl::StatusCode::kAlreadyExists);
  std::filesystem::create_directories(At("empty"));
  EXPECT_TRUE(InitAuthority(At("empty")).ok());
  EXPECT_EQ(ModeOf(At("empty")), 0700U);
  EXPECT_TRUE(InitAuthority(At("far/away/ca")).ok());
  for (const auto& entry : std::filesystem::directory_iterator(At(""))) {
    EXPECT_THAT(entry.path().filename().string(), Not(HasSubstr(".")))
        << "a draft of an authority stays";
  }
}

TEST_F(Authority, IssuesWhatIsAskedFor) {
  const std::int64_t before = Now();
  const auto server = Issue(ca(),
                            {.name = "head",
                             .role = Role::kServer,
                             .hosts = {"Node1.example.org", "10.0.0.7", "FD00:0::7", "::1"},
                             .days = 30},
                            At("deep/head"));
  ASSERT_TRUE(server.ok()) << server.status();
  EXPECT_THAT(server->hosts, ElementsAre("node1.example.org", "10.0.0.7", "fd00::7", "::1",
                                         "localhost", "127.0.0.1"));
  EXPECT_NEAR(static_cast<double>(server->not_before_unix_s - before), -300, 60);
  EXPECT_NEAR(static_cast<double>(server->not_after_unix_s - before), 30.0 * kOneDay, 60);
  EXPECT_LE(server->serial.size(), 32U);
  EXPECT_GE(server->serial.size(), 26U) << "128 random bits";
  EXPECT_EQ(ModeOf(At("deep/head")), 0700U);
  EXPECT_EQ(ModeOf(At("deep/head/key.pem")), 0600U);
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(At("deep/head"))) {
    names.insert(entry.path().filename().string());
  }
  EXPECT_THAT(names, ElementsAre("ca.pem", "cert.pem", "crl.pem", "key.pem"));
  ASSERT_TRUE(Issue(ca() + "/", {.name = "n", .role = Role::kViewer}, At("slash/")).ok());
  EXPECT_EQ(ModeOf(At("slash")), 0700U);
  EXPECT_EQ(ReadText(At("deep/head/ca.pem")), ReadText(At("ca/ca.pem")));
  EXPECT_TRUE(Given("node7", Role::kWorker).hosts.empty());
  const auto ledger = ReadLedger(At("ca/issued.csv"));
  ASSERT_TRUE(ledger.ok());
  ASSERT_EQ(ledger->size(), 3U);
  EXPECT_EQ((*ledger)[0].serial, server->serial);
  EXPECT_EQ((*ledger)[0].not_after_unix_s, server->not_after_unix_s);
}

TEST_F(Authority, RenewsForTheSameHolderOnly) {
  const Request first = {.name = "head", .role = Role::kServer, .hosts = {"node1"}};
  ASSERT_TRUE(Issue(ca(), first, At("head")).ok());
  const std::string key = ReadText(At("head/key.pem"));
  const Holder renewed = Given("head", Role::kServer);
  EXPECT_THAT(renewed.hosts, ElementsAre("node1", "localhost", "127.0.0.1", "::1"));
  EXPECT_NE(ReadText(At("head/key.pem")), key);
  const auto moved =
      Issue(ca(), {.name = "head", .role = Role::kServer, .hosts = {"node2"}}, At("head"));
  ASSERT_TRUE(moved.ok()) << moved.status();
  EXPECT_THAT(moved->hosts, ElementsAre("node2", "localhost", "127.0.0.1", "::1"));

  const std::string cert = ReadText(At("head/cert.pem"));
  EXPECT_THAT(Refused({.name = "other", .role = Role::kServer}, "head",
                      absl::StatusCode::kFailedPrecondition),
              HasSubstr("holds the certificate of head (server)"));
  Refused({.name = "head", .role = Role::kWorker}, "head", absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(
      Refused({.name = "n", .role = Role::kWorker}, "ca", absl::StatusCode::kFailedPrecondition),
      HasSubstr("holds an authority"));
  ASSERT_TRUE(InitAuthority(At("other")).ok());
  const auto foreign = Issue(At("other"), {.name = "head", .role = Role::kServer}, At("head"));
  EXPECT_EQ(foreign.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(foreign.status().message()), HasSubstr("another authority"));
  EXPECT_EQ(ReadText(At("head/cert.pem")), cert);
}

TEST_F(Authority, GivesANameOneRole) {
  Given("anna", Role::kViewer);
  EXPECT_THAT(Refused({.name = "anna", .role = Role::kOperator}, "anna2",
                      absl::StatusCode::kFailedPrecondition),
              AllOf(HasSubstr("role viewer until"), HasSubstr("certs revoke")));
  EXPECT_FALSE(std::filesystem::exists(At("anna2")));
  EXPECT_TRUE(Issue(ca(), {.name = "anna", .role = Role::kViewer}, At("anna2")).ok())
      << "the same role may be held twice";
  EXPECT_EQ(Revoke(ca(), "anna").value_or(-1), 2);
  EXPECT_TRUE(Issue(ca(), {.name = "anna", .role = Role::kOperator}, At("anna3")).ok());
}

TEST_F(Authority, SaysEveryProblemOfARequest) {
  for (const std::string& name :
       {std::string(), std::string(65, 'a'), std::string("a b"), std::string("a,b"),
        std::string("a/b"), std::string("a\nb"), std::string("\xc3\xa4")}) {
    EXPECT_THAT(
        Refused({.name = name, .role = Role::kViewer}, "x", absl::StatusCode::kInvalidArgument),
        HasSubstr("NAME is 1 to 64"));
  }
  EXPECT_TRUE(Issue(ca(), {.name = std::string(64, 'Z'), .role = Role::kViewer}, At("z")).ok());
  EXPECT_TRUE(Issue(ca(), {.name = "a.b_c@d-9", .role = Role::kViewer}, At("y")).ok());
  for (const int days : {-1, 0, 3651}) {
    EXPECT_THAT(Refused({.name = "n", .role = Role::kViewer, .days = days}, "x",
                        absl::StatusCode::kInvalidArgument),
                HasSubstr("is not from 1 to 3650"));
  }
  for (const char* const host : {"", "node1:7443", "no de", "10.0.0.300", "-a.b", "a..b", "*.a",
                                 "a,DNS:evil", "https://node1"}) {
    EXPECT_THAT(Refused({.name = "n", .role = Role::kServer, .hosts = {host}}, "x",
                        absl::StatusCode::kInvalidArgument),
                HasSubstr("is neither a host's name"))
        << host;
  }
  const std::string all = Refused({.name = "", .role = Role::kWorker, .hosts = {"h"}, .days = 0},
                                  "x", absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(std::count(all.begin(), all.end(), '\n'), 2) << all;
  EXPECT_FALSE(std::filesystem::exists(At("x")));
  const auto nowhere = Issue(At("nowhere"), {.name = "n", .role = Role::kViewer}, At("x"));
  EXPECT_EQ(nowhere.status().code(), absl::StatusCode::kNotFound);
  EXPECT_FALSE(std::filesystem::exists(At("nowhere")));
}

TEST_F(Authority, IssuesNothingBeyondItsEnd) {
  ASSERT_TRUE(Issue(ca(), {.name = "n", .role = Role::kViewer, .days = 3650}, At("n")).ok());
  const auto key = MakeKey();
  ASSERT_TRUE(key.ok());
  const auto ends_soon = SignAuthority(
      key->get(), {.not_before_unix_s = Now() - 60, .not_after_unix_s = Now() + 10 * kOneDay + 60});
  ASSERT_TRUE(ends_soon.ok());
  WriteText(At("ca/ca.pem"), *PemOf(ends_soon->get()));
  WriteText(At("ca/ca-key.pem"), *PemOf(key->get()));
  EXPECT_THAT(Refused({.name = "m", .role = Role::kViewer, .days = 11}, "m",
                      absl::StatusCode::kInvalidArgument),
              HasSubstr(": at most 10"));
  const auto last = Issue(ca(), {.name = "m", .role = Role::kViewer, .days = 10}, At("m"));
  ASSERT_TRUE(last.ok()) << last.status();
  EXPECT_LE(last->not_after_unix_s, *EndOfAuthority(ca()));
}

TEST_F(Authority, FoldersThatOthersMayChangeAreNotUsed) {
  for (const char* const folder : {"ca", "n"}) {
    std::filesystem::create_directory(At("n"));
    ASSERT_EQ(chmod(At(folder).c_str(), 0770), 0);
    EXPECT_THAT(
        Refused({.name = "n", .role = Role::kViewer}, "n", absl::StatusCode::kFailedPrecondition),
        HasSubstr("chmod 700 " + At(folder)));
    ASSERT_EQ(chmod(At(folder).c_str(), 0755), 0);
  }
  EXPECT_TRUE(Issue(ca(), {.name = "n", .role = Role::kViewer}, At("n")).ok());
}

TEST_F(Authority, KeyThatOthersMayReadIsNotUsed) {
  ASSERT_EQ(chmod(At("ca/ca-key.pem").c_str(), 0640), 0);
  EXPECT_THAT(
      Refused({.name = "n", .role = Role::kViewer}, "n", absl::StatusCode::kPermissionDenied),
      HasSubstr("chmod 600"));
}

TEST_F(Authority, RevokesWhatANameHoldsAndNumbersRise) {
  const Holder one = Given("node7", Role::kWorker);
  const Holder other = Given("node7", Role::kWorker);
  const Holder kept = Given("node8", Role::kWorker);
  const std::int64_t first = CrlNumber();
  EXPECT_GT(first, 0);
  EXPECT_EQ(Revoke(ca(), "node7").value_or(-1), 2);
  EXPECT_GT(CrlNumber(), first);
  const CrlPtr crl = ParseRevocations(ReadText(At("ca/crl.pem")));
  ASSERT_TRUE(crl);
  std::vector<std::string> serials = {one.serial, other.serial};
  std::sort(serials.begin(), serials.end());
  EXPECT_EQ(RevokedSerials(crl.get()), serials);
  EXPECT_EQ(UnixSeconds(X509_CRL_get0_nextUpdate(crl.get())), *EndOfAuthority(ca()));
  const std::int64_t second = CrlNumber();
  EXPECT_EQ(Revoke(ca(), "node7").value_or(-1), 0);
  EXPECT_EQ(CrlNumber(), second);
  EXPECT_EQ(Revoke(ca(), "nobody").status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(Revoke(ca(), "node8").value_or(-1), 1);
  EXPECT_GT(CrlNumber(), second);
  EXPECT_EQ(ReadText(At("node8/crl.pem")).find(kept.serial), std::string::npos);
}

TEST_F(Authority, RevocationThatWasKilledBeforeItsListIsMadeUpFor) {
  Given("node7", Role::kWorker);
  const std::string before = ReadText(At("ca/crl.pem"));
  ASSERT_EQ(Revoke(ca(), "node7").value_or(-1), 1);
  for (const std::string& list : {before, std::string("half a li"), std::string()}) {
    const std::int64_t number = CrlNumber();
    WriteText(At("ca/crl.pem"), list);
    Given("node8", Role::kWorker);
    for (const char* const path : {"ca/crl.pem", "node8/crl.pem"}) {
      const CrlPtr crl = ParseRevocations(ReadText(At(path)));
      ASSERT_TRUE(crl) << path;
      EXPECT_EQ(RevokedSerials(crl.get()).size(), 1U) << path;
      EXPECT_GE(NumberOf(crl.get()), number) << path;
    }
  }
}

TEST_F(Authority, TwoIssuersLoseNothing) {
  constexpr int kEach = 12;
  const auto issue = [this](const std::string& name) {
    for (int i = 0; i < kEach; ++i) Given(name + std::to_string(i), Role::kWorker);
  };
  std::thread one(issue, "a");
  std::thread other(issue, "b");
  one.join();
  other.join();
  const auto ledger = ReadLedger(At("ca/issued.csv"));
  ASSERT_TRUE(ledger.ok()) << ledger.status();
  std::set<std::string> serials;
  for (const IssuedCertificate& row : *ledger) serials.insert(row.serial);
  EXPECT_EQ(ledger->size(), 2U * kEach);
  EXPECT_EQ(serials.size(), 2U * kEach);
}

/// Renews again and again, and writes a byte to `acknowledged` after each.
[[noreturn]] void IssueForEver(const std::string& authority, const std::string& out,
                               int acknowledged) {
  while (Issue(authority, {.name = "node7", .role = Role::kWorker}, out).ok()) {
    if (write(acknowledged, "x", 1) != 1) break;
  }
  _exit(1);
}

TEST_F(Authority, KillsAtAnyMomentLeaveAWholePairThatCanBeRevoked) {
  constexpr int kKills = 40;
  std::size_t acknowledged = 1;
  const absl::Time begin = absl::Now();
  Given("node7", Role::kWorker);
  const absl::Duration once = absl::Now() - begin;
  for (int i = 0; i < kKills; ++i) {
    int ends[2] = {-1, -1};
    ASSERT_EQ(pipe(ends), 0);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) IssueForEver(ca(), At("node7"), ends[1]);
    close(ends[1]);
    char byte = 0;
    ASSERT_EQ(read(ends[0], &byte, 1), 1);
    absl::SleepFor(once * i / kKills);  // no wait for anything: another place to die
    kill(child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status)) << "the child gave up";
    for (++acknowledged; read(ends[0], &byte, 1) == 1;) ++acknowledged;
    close(ends[0]);

    const auto held = ReadCredentials(At("node7"));
    ASSERT_TRUE(held.ok()) << held.status();
    const auto ledger = ReadLedger(At("ca/issued.csv"));
    ASSERT_TRUE(ledger.ok()) << ledger.status();
    EXPECT_GE(ledger->size(), acknowledged);
    EXPECT_TRUE(std::any_of(ledger->begin(), ledger->end(), [&](const IssuedCertificate& row) {
      return row.serial == held->holder.serial;
    }));
  }
  EXPECT_GE(Revoke(ca(), "node7").value_or(-1), kKills);
}

}  // namespace
}  // namespace calib::access
