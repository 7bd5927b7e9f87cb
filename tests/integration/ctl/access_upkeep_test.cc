// Who is let in over time: servers that come later, certificates that are renewed or revoked, what
// each caller has asked for, and what logs say of it.
#include <gmock/gmock.h>

#include <csignal>
#include <memory>
#include <thread>

#include "tests/integration/ctl/access_fixture.h"

namespace calib::ctl {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class AccessUpkeep : public Access {
 protected:
  static int Count(const std::string& text, const std::string& words) {
    int count = 0;
    for (std::size_t at = text.find(words); at != std::string::npos;
         at = text.find(words, at + words.size())) {
      ++count;
    }
    return count;
  }

  std::unique_ptr<Process> StartWorker(const std::string& server, const std::string& tls,
                                       const std::string& log) const {
    std::vector<std::string> command{Program("calib-worker"), "--server", server, "--slots", "1"};
    if (!tls.empty()) command.insert(command.end(), {"--tls", At(tls)});
    return std::make_unique<Process>(command, At(log));
  }

  /// calibctl with words that do not end soon; what it prints goes to `log`.
  std::unique_ptr<Process> Begin(const std::vector<std::string>& words, const std::string& with,
                                 const std::string& log) const {
    std::vector<std::string> command{CALIBCTL};
    command.insert(command.end(), words.begin(), words.end());
    command.insert(command.end(), {"--server", address_, "--tls", At(with)});
    return std::make_unique<Process>(command, At(log));
  }

  std::string Submit(const std::string& with) const {
    const Answer answer = Ask("submit campaign.yaml --json", "--tls " + with);
    EXPECT_EQ(answer.code, 0) << answer.err;
    return answer.json().value("campaign", "");
  }
};

TEST_F(AccessUpkeep, WorkerStartedBeforeItsServerIsLetIn) {
  const Variable home("HOME", At("home"));
  const Variable runtime("XDG_RUNTIME_DIR", At("runtime"));
  const std::string address = "127.0.0.1:" + std::to_string(FreePort());
  const auto worker = StartWorker(address, "", "worker.err");
  ASSERT_TRUE(Eventually(kPatience, [&] { return Count(Read("worker.err"), "disconnected") > 1; }))
      << Read("worker.err");
  const auto server = Serve("state", {"--listen", address});
  EXPECT_TRUE(Eventually(kPatience, [&] {
    return Count(Read("worker.err"), " connected server=") == 1 || !worker->Running();
  }));
  EXPECT_TRUE(worker->Running()) << Read("worker.err");
  EXPECT_EQ(Count(Read("worker.err"), "no_connection"), 0) << "it was only away";
}

TEST_F(AccessUpkeep, WorkerSaysOnceWhyNoConnectionComesAbout) {
  ASSERT_NO_FATAL_FAILURE(IssueAll());
  const auto plain = Serve("plain", {});
  const auto encrypts = StartWorker(address_, "worker", "encrypts.err");
  const auto secure = Serve("secure", {"--tls", At("head")});
  ASSERT_EQ(Call("certs init other").code, 0);
  ASSERT_EQ(Call("certs issue other --role worker eve -o eve").code, 0);
  const auto speaks_plainly = StartWorker(address_, "", "plainly.err");
  const auto foreign = StartWorker(address_, "eve", "foreign.err");
  const auto told = [this](const std::string& log, const std::string& why) {
    EXPECT_TRUE(Eventually(kPatience, [&] {
      const std::string text = Read(log);
      const std::size_t at = text.find("no_connection");
      return at != std::string::npos && Count(text.substr(at), "disconnected") > 2;
    })) << Read(log);
    EXPECT_EQ(Count(Read(log), "no_connection"), 1) << Read(log);
    EXPECT_THAT(Read(log), HasSubstr(why));
  };
  told("encrypts.err", "speaks plain text");
  told("plainly.err", "does not answer as calibd does in plain text");
  told("foreign.err", "was not issued by the authority of");
}

TEST_F(AccessUpkeep, NobodyIsAnsweredWithWhatAnotherHasAskedFor) {
  ASSERT_NO_FATAL_FAILURE(IssueAll());
  ASSERT_NO_FATAL_FAILURE(Issue("submitter", "ann"));
  ASSERT_NO_FATAL_FAILURE(Issue("submitter", "eve"));
  const auto server = Serve("state", {"--tls", At("head")});
  EXPECT_EQ(Submit("ann"), "c1");
  EXPECT_EQ(Submit("eve"), "c2");
  EXPECT_EQ(Submit("ann"), "c1") << "her own is taken up";
  EXPECT_EQ(Submit("operator"), "c3");
  EXPECT_THAT(Refused("cancel c1", "--tls eve"), HasSubstr("c1 belongs to ann"));
  EXPECT_EQ(Ask("cancel c2", "--tls eve").code, 0) << Read("err");
  EXPECT_THAT(Read("state.log"), HasSubstr("reason=\"c1 belongs to ann"));
}

TEST_F(AccessUpkeep, LogSaysWhoDidWhatOnceItIsDone) {
  ASSERT_NO_FATAL_FAILURE(IssueAll());
  const auto server = Serve("state", {"--tls", At("head")});
  EXPECT_EQ(Submit("submitter"), "c1");
  EXPECT_NE(Ask("drain nosuch", "--tls operator").code, 0);
  EXPECT_EQ(Ask("cancel c1", "--tls operator").code, 0) << Read("err");
  const std::string log = Read("state.log");
  EXPECT_THAT(log, AllOf(HasSubstr("change what=put of="),
                         HasSubstr("change what=submit of=c1 by=submitter role=submitter"),
                         HasSubstr("change what=cancel of=c1 by=operator role=operator"),
                         Not(HasSubstr("what=drain"))));
}

TEST_F(AccessUpkeep, RevokedViewerWatchesNoMore) {
  ASSERT_NO_FATAL_FAILURE(IssueAll());
  const auto server = Serve("state", {"--tls", At("head")});
  EXPECT_EQ(Submit("submitter"), "c1");  // and nothing changes: there is no worker
  const auto revoked = Begin({"watch", "c1"}, "viewer", "viewer.err");
  const auto other = Begin({"watch", "c1"}, "operator", "operator.err");
  std::this_thread::sleep_for(std::chrono::seconds(1));
  ASSERT_TRUE(revoked->Running()) << Read("viewer.err");
  ASSERT_EQ(Call("certs revoke ca viewer").code, 0) << Read("err");
  std::filesystem::copy_file(work_ / "ca/crl.pem", work_ / "head/crl.pem.next");
  std::filesystem::rename(work_ / "head/crl.pem.next", work_ / "head/crl.pem");
  EXPECT_EQ(revoked->Wait(kPatience), 1);
  EXPECT_THAT(Read("viewer.err"), HasSubstr("the certificate of viewer was revoked"));
  EXPECT_TRUE(other->Running()) << Read("operator.err");
  EXPECT_TRUE(Eventually(kPatience, [&] {
    return Count(Read("operator.err"),
                 "start `calib-worker --server " + address_ + " --tls DIR`") == 1;
  })) << Read("operator.err");
}

TEST_F(AccessUpkeep, GuestOfAFolderShowsItsTokenToTheServerThatFollowsItsHost) {
  const Variable home("HOME", "/nonexistent");  // where no token is found
  const Variable runtime("XDG_RUNTIME_DIR", "/nonexistent");
  Process host({CALIBCTL, "run", At("campaign.yaml"), "--state", At("s"), "--workers", "0"},
               At("host.err"));
  ASSERT_TRUE(Eventually(kPatience, [&] {
    const Json listed = Call("list --state s --json").json();  // no folder yet: no JSON
    return (listed.is_array() && listed.size() == 1) || !host.Running();
  })) << Read("host.err");
  Process guest({CALIBCTL, "watch", "c1", "--state", At("s")}, At("guest.err"));
  std::this_thread::sleep_for(std::chrono::seconds(1));
  ASSERT_TRUE(guest.Running()) << Read("guest.err");
  guest.Signal(SIGSTOP);  // it would serve the folder itself
  host.Kill();
  std::filesystem::remove(work_ / "s/server.json");
  const auto server = Serve("s", {});
  guest.Signal(SIGCONT);
  EXPECT_EQ(guest.Wait(std::chrono::seconds(4)), -1000) << Read("guest.err");
  EXPECT_EQ(Ask("cancel c1", "--token s/token").code, 0) << Read("err");
  EXPECT_NE(guest.Wait(kPatience), -1000);
  EXPECT_EQ(Read("guest.err").find("token"), std::string::npos) << Read("guest.err");
  EXPECT_EQ(Read("s.log").find("refused"), std::string::npos) << Read("s.log");
}

TEST_F(AccessUpkeep, WatchOutlivesTheCertificateThatItBeganWith) {
  ASSERT_NO_FATAL_FAILURE(IssueAll());
  const auto server = Serve("state", {"--tls", At("head")});
  EXPECT_EQ(Submit("submitter"), "c1");
  const std::int64_t now = std::time(nullptr);
  ASSERT_NO_FATAL_FAILURE(SignAnew("viewer", {now - 60, now + 5}));
  const auto watch = Begin({"watch", "c1"}, "viewer", "viewer.err");
  std::this_thread::sleep_for(std::chrono::seconds(2));
  ASSERT_TRUE(watch->Running()) << Read("viewer.err");
  ASSERT_NO_FATAL_FAILURE(SignAnew("viewer", {now - 60, now + 3600}));
  EXPECT_TRUE(Eventually(kPatience, [&] {
    return Read("state.log").find("the certificate of viewer has expired") != std::string::npos;
  })) << Read("state.log");
  EXPECT_EQ(watch->Wait(std::chrono::seconds(3)), -1000) << Read("viewer.err");
}

TEST_F(AccessUpkeep, ServerWhoseCertificateIsRevokedIsNotAsked) {
  ASSERT_NO_FATAL_FAILURE(IssueAll());
  const auto server = Serve("state", {"--tls", At("head")});
  ASSERT_EQ(Call("certs revoke ca head").code, 0) << Read("err");
  EXPECT_EQ(Ask("list", "--tls viewer").code, 0) << "it does not know yet";
  const auto learns = [this](const std::string& who) {
    std::filesystem::copy_file(work_ / "ca/crl.pem", work_ / who / "crl.pem",
                               std::filesystem::copy_options::overwrite_existing);
  };
  learns("viewer");
  EXPECT_THAT(Refused("list", "--tls viewer"), HasSubstr("viewer/crl.pem revokes"));
  learns("worker");
  const auto worker = StartWorker(address_, "worker", "worker.err");
  EXPECT_TRUE(Eventually(kPatience, [&] {
    return Count(Read("worker.err"), "worker/crl.pem revokes") == 1;
  })) << Read("worker.err");
  Write("viewer/crl.pem", "");
  EXPECT_THAT(Refused("list", "--tls viewer"), HasSubstr("no list of revocations"));
  EXPECT_EQ(Ask("list", "--tls operator").code, 0) << Read("err");
}

TEST_F(AccessUpkeep, DoctorJudgesBothCertificates) {
  ASSERT_NO_FATAL_FAILURE(IssueAll());
  const auto server = Serve("state", {"--tls", At("head")});
  const Variable variable("CALIB_TLS", At("viewer"));
  EXPECT_THAT(Ask("doctor --json", "").out, HasSubstr("That of viewer (viewer) is valid until"));
  // A renewal that was killed before its key was put in place is finished.
  std::filesystem::rename(work_ / "viewer/key.pem", work_ / "viewer/key.pem.new");
  EXPECT_THAT(Ask("doctor --json", "").out, HasSubstr("That of viewer (viewer) is valid until"));
  EXPECT_TRUE(std::filesystem::exists(work_ / "viewer/key.pem"));

  ASSERT_EQ(Call("certs revoke ca viewer").code, 0) << Read("err");
  std::filesystem::copy_file(work_ / "ca/crl.pem", work_ / "viewer/crl.pem",
                             std::filesystem::copy_options::overwrite_existing);
  const Answer own = Ask("doctor --json", "");
  EXPECT_EQ(own.code, 1);
  EXPECT_THAT(own.out, HasSubstr("the certificate of viewer was revoked"));

  std::filesystem::permissions(work_ / "head/key.pem", std::filesystem::perms(0644));
  const Answer its = Ask("doctor --json", "");
  EXPECT_EQ(its.code, 1);
  EXPECT_THAT(its.out, AllOf(HasSubstr("The server's certificate: "), Not(HasSubstr("1970")),
                             Not(HasSubstr("certs issue CA --role server"))));
}

}  // namespace
}  // namespace calib::ctl
