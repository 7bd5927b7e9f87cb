// Who is let in, as users of a server meet it: certificates, tokens, sockets, roles.
#include "proto/rpc/access.h"

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <memory>
#include <optional>

#include "tests/integration/ctl/access_fixture.h"

namespace calib::ctl {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(Access, WithoutCertificatesWantsTheTokenOfTheFolder) {
  const auto server = Serve("state", {});
  EXPECT_EQ(Ask("list --json", "").json(), Json::array()) << "it is found by who started it";
  // Another account finds none, since it has another home.
  const Variable home("HOME", "/nonexistent");
  const Variable runtime("XDG_RUNTIME_DIR", "/nonexistent");
  EXPECT_THAT(Refused("list", ""), HasSubstr("no token was shown"));
  EXPECT_THAT(Refused("submit campaign.yaml", ""), HasSubstr("no token was shown"));
  Write("wrong", std::string(64, 'a'));
  EXPECT_THAT(Refused("list", "--token wrong"), HasSubstr("the token is not this server's"));
  const Answer none = Ask("list", "--token data.csv");
  EXPECT_EQ(none.code, 2) << none.err;
  EXPECT_THAT(none.err, HasSubstr("data.csv holds no token"));
  EXPECT_EQ(Ask("list --json", "--token state/token").json(), Json::array()) << "nothing changed";
  {
    const Variable token("CALIB_TOKEN", Read("state/token").substr(0, 64));
    EXPECT_EQ(Ask("list --json", "").json(), Json::array());
  }

  Process worker({Program("calib-worker"), "--server", address_, "--slots", "1"}, At("worker.err"));
  EXPECT_EQ(worker.Wait(kPatience), 1);
  EXPECT_THAT(Read("worker.err"), HasSubstr("no token was shown"));
  EXPECT_THAT(Read("state.log"), AllOf(HasSubstr("refused peer=ipv4:127.0.0.1"),
                                       Not(HasSubstr(Read("state/token").substr(0, 64)))));

  for (const char* name : {"state/token", "state/lock", "state/server.json", "state/calib.db",
                           "state/calib.db-wal", "state.log"}) {
    struct stat status = {};
    ASSERT_EQ(stat(At(name).c_str(), &status), 0) << name;
    EXPECT_EQ(status.st_mode & 0777, 0600) << name;
  }
  struct stat folder = {};
  ASSERT_EQ(stat(At("state").c_str(), &folder), 0);
  EXPECT_EQ(folder.st_mode & 0777, 0700);
}

TEST_F(Access, PlainTextAndCertificatesTellEachOtherApart) {
  ASSERT_NO_FATAL_FAILURE(IssueAll());
  const auto plain = Serve("plain", {});
  EXPECT_THAT(Refused("list", "--tls viewer"), HasSubstr("speaks plain text"));
  const auto secure = Serve("secure", {"--tls", At("head")});
  EXPECT_THAT(Refused("list", ""), HasSubstr("does not answer as calibd does in plain text"));
  EXPECT_THAT(Refused("list", "--token secure/token"), HasSubstr("in plain text"));
  Process worker({Program("calib-worker"), "--server", address_, "--slots", "1"}, At("worker.err"));
  EXPECT_TRUE(Eventually(kPatience, [&] {
    return Read("worker.err").find("does not answer as calibd does in plain text") !=
           std::string::npos;
  })) << Read("worker.err");
  const Answer nobody = Call("list --server 127.0.0.1:9 --tls viewer");
  EXPECT_EQ(nobody.code, 3) << nobody.err;
}

TEST_F(Access, PlainTextThatOthersReachHasToBeAskedFor) {
  Process open({Program("calibd"), "--state", At("state"), "--listen", "0.0.0.0:0"}, At("err"));
  EXPECT_EQ(open.Wait(kPatience), 2);
  EXPECT_THAT(Read("err"), AllOf(HasSubstr("0.0.0.0:0 can be reached from other machines"),
                                 HasSubstr("--insecure")));
  EXPECT_FALSE(std::filesystem::exists(work_ / "state"));
  ASSERT_NO_FATAL_FAILURE(IssueAll());
  Process viewer({Program("calibd"), "--state", At("state"), "--tls", At("viewer")}, At("err2"));
  EXPECT_EQ(viewer.Wait(kPatience), 2);
  EXPECT_THAT(Read("err2"), HasSubstr("of the role viewer, and a server wants its own"));
}

TEST_F(Access, CertificatesOfOthersAndOfYesterdayAreRefused) {
  ASSERT_NO_FATAL_FAILURE(IssueAll());
  const auto server = Serve("state", {"--tls", At("head")});
  EXPECT_EQ(Ask("list --json", "--tls viewer").json(), Json::array());

  ASSERT_EQ(Call("certs init other").code, 0);
  ASSERT_EQ(Call("certs issue other --role operator eve -o eve").code, 0);
  EXPECT_THAT(Refused("list", "--tls eve"), HasSubstr("was not issued by the authority of eve"))
      << "she does not trust this server";
  std::filesystem::copy_file(work_ / "ca/ca.pem", work_ / "eve/ca.pem",
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_THAT(Refused("list", "--tls eve"),
              HasSubstr("the certificate of eve was not issued by this server's authority"));
  EXPECT_THAT(Refused("submit campaign.yaml", "--tls eve"), HasSubstr("was not issued by"));

  ASSERT_NO_FATAL_FAILURE(IssueExpired("late"));
  EXPECT_THAT(Refused("list", "--tls late"), HasSubstr("the certificate of late has expired on "));

  EXPECT_THAT(Refused("list", "--tls head"),
              HasSubstr("the certificate of head is not one to ask"));
  EXPECT_EQ(Ask("list --json", "--tls viewer").json(), Json::array()) << "nothing changed";
  const Answer empty = Ask("list", "--tls ca");
  EXPECT_EQ(empty.code, 2) << empty.err;
  EXPECT_THAT(empty.err, HasSubstr("ca/cert.pem cannot be read"));
}

TEST_F(Access, RolesMayWhatTheyAreFor) {
  ASSERT_NO_FATAL_FAILURE(IssueAll());
  ASSERT_NO_FATAL_FAILURE(Issue("submitter", "ann"));
  const auto server = Serve("state", {"--tls", At("head")});
  EXPECT_THAT(Refused("submit campaign.yaml", "--tls viewer"),
              HasSubstr("viewer has the role viewer, whose holders may read; this needs the role "
                        "submitter"));
  EXPECT_EQ(Ask("submit campaign.yaml", "--tls ann").code, 0) << Read("err");
  const Json listed = Ask("list --json", "--tls viewer").json();
  ASSERT_EQ(listed.size(), 1U);
  EXPECT_EQ(listed[0]["owner"], "ann");
  EXPECT_EQ(listed[0]["state"], "queued");

  // Somebody else's campaign; then a submitter's own, and any an operator's.
  for (const char* verb : {"pause c1", "cancel c1", "delete c1"}) {
    EXPECT_THAT(Refused(verb, "--tls submitter"),
                HasSubstr("c1 belongs to ann, and submitter is a submitter"));
    EXPECT_THAT(Refused(verb, "--tls viewer"), HasSubstr("this needs the role submitter"));
    EXPECT_THAT(Refused(verb, "--tls worker"), HasSubstr("may only take runs and report them"));
  }
  for (const char* verb : {"priority c1 5", "priority c1 -100"}) {
    EXPECT_THAT(Refused(verb, "--tls submitter"), HasSubstr("c1 belongs to ann"));
    EXPECT_THAT(Refused(verb, "--tls viewer"), HasSubstr("this needs the role submitter"));
  }
  EXPECT_THAT(Refused("priority c9 5", "--tls operator"), HasSubstr("c9"));
  EXPECT_EQ(Ask("priority c1 101", "--tls ann").code, 2);
  EXPECT_EQ(Ask("priority c1 x", "--tls ann").code, 2);
  EXPECT_EQ(Ask("priority c1 -7 --json", "--tls ann").json()["priority"], -7);
  EXPECT_EQ(Ask("priority c1 8 --json", "--tls operator").json()["priority"], 8);
  EXPECT_EQ(Ask("show c1 --json", "--tls viewer").json()["priority"], 8);
  for (const char* role : {"ann", "viewer"}) {
    EXPECT_THAT(Refused("quota ann --slots 3", std::string("--tls ") + role),
                HasSubstr("this needs the role operator"));
  }
  EXPECT_EQ(Ask("quota --slots 3", "--tls operator").code, 2) << "whose";
  EXPECT_EQ(Ask("quota ann --slots -1", "--tls operator").code, 2);
  EXPECT_EQ(Ask("quota ann --slots many", "--tls operator").code, 2);
  const auto share = [](const Json& slots) {
    return Json{{"owner", "ann"}, {"slots", slots}, {"held", 0}, {"campaigns", 1}};
  };
  EXPECT_EQ(Ask("quota ann --slots 3 --json", "--tls operator").json(), share(3));
  EXPECT_EQ(Ask("quota --json", "--tls viewer").json(), Json::array({share(3)}));
  EXPECT_THAT(Refused("quota eve", "--tls viewer"), HasSubstr("eve has no campaign"));
  EXPECT_EQ(Ask("quota ann --slots none --json", "--tls operator").json(), share(nullptr));
  EXPECT_EQ(Ask("list --json", "--tls viewer").json()[0]["state"], "queued") << "nothing changed";
  EXPECT_EQ(Ask("pause c1", "--tls ann").code, 0) << Read("err");
  EXPECT_EQ(Ask("resume c1", "--tls operator").code, 0) << Read("err");
  EXPECT_THAT(Refused("drain w1", "--tls ann"), HasSubstr("this needs the role operator"));
  EXPECT_THAT(Refused("list", "--tls worker"), HasSubstr("this needs the role viewer"));
  for (const char* role : {"viewer", "submitter"}) {
    Process worker(
        {Program("calib-worker"), "--server", address_, "--slots", "1", "--tls", At(role)},
        At(std::string(role) + ".err"));
    EXPECT_EQ(worker.Wait(kPatience), 1);
    EXPECT_THAT(Read(std::string(role) + ".err"), HasSubstr("this needs the role worker"));
  }
  EXPECT_EQ(Ask("workers --json", "--tls viewer").json(), Json::array());

  Process worker({Program("calib-worker"), "--server", address_, "--slots", "1", "--tls",
                  At("worker"), "--checkpoints", At("checkpoints")},
                 At("worker.err"));
  EXPECT_EQ(Ask("watch c1", "--tls viewer").code, 0) << Read("err");
  EXPECT_EQ(Ask("list --json", "--tls viewer").json()[0]["state"], "finished");
  EXPECT_EQ(Ask("delete c1", "--tls ann").code, 0) << Read("err");
  const std::string log = Read("state.log");
  EXPECT_THAT(log, AllOf(HasSubstr("change what=submit of=c1 by=ann role=submitter"),
                         HasSubstr("change what=pause of=c1 by=ann role=submitter"),
                         HasSubstr("change what=resume of=c1 by=operator role=operator"),
                         HasSubstr("change what=delete of=c1 by=ann role=submitter"),
                         HasSubstr(" by=worker role=worker")));
}

TEST_F(Access, WhatIsRevokedAndRenewedCountsAtOnce) {
  ASSERT_NO_FATAL_FAILURE(IssueAll());
  const auto server = Serve("state", {"--tls", At("head"), "--heartbeat-ms", "200"});
  Process worker(
      {Program("calib-worker"), "--server", address_, "--slots", "1", "--tls", At("worker")},
      At("worker.err"));
  EXPECT_TRUE(Eventually(kPatience, [&] {
    return Ask("workers --json", "--tls viewer").json().size() == 1;
  })) << Read("worker.err");
  ASSERT_NO_FATAL_FAILURE(Issue("worker", "node7"));
  Process renewed({Program("calib-worker"), "--server", address_, "--slots", "1", "--tls",
                   At("node7"), "--name", "node7"},
                  At("node7.err"));
  const auto connections = [this](const std::string& name) {
    const std::string log = Read("state.log");
    int found = 0;
    for (std::size_t at = 0; (at = log.find("worker_connected name=" + name, at)) != log.npos; ++at)
      ++found;
    return found;
  };
  EXPECT_TRUE(Eventually(kPatience, [&] { return connections("node7") == 1; }));
  for (const char* name : {"viewer", "worker", "node7"}) {
    ASSERT_EQ(Call(std::string("certs revoke ca ") + name).code, 0) << Read("err");
  }
  ASSERT_NO_FATAL_FAILURE(Issue("worker", "node7"));
  std::filesystem::copy_file(work_ / "ca/crl.pem", work_ / "head/crl.pem",
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_TRUE(Eventually(kPatience, [&] { return Ask("list", "--tls viewer").code == 1; }));
  EXPECT_THAT(Read("err"), HasSubstr("the certificate of viewer was revoked"));
  // A stream that was open is cut off, and the worker says why.
  EXPECT_EQ(worker.Wait(kPatience), 1);
  EXPECT_THAT(Read("worker.err"), HasSubstr("the certificate of worker was revoked"));
  EXPECT_EQ(Ask("list", "--tls operator").code, 0) << Read("err");
  // One that has a new certificate by then shows that.
  EXPECT_TRUE(Eventually(kPatience, [&] { return connections("node7") == 2; }))
      << Read("node7.err");
  EXPECT_TRUE(renewed.Running());

  // Another authority altogether, without a restart: the server's own certificate is read again.
  ASSERT_EQ(Call("certs init new").code, 0);
  ASSERT_EQ(Call("certs issue new --role server head -o head2").code, 0) << Read("err");
  ASSERT_EQ(Call("certs issue new --role viewer bob -o bob").code, 0) << Read("err");
  EXPECT_THAT(Refused("list", "--tls bob"), HasSubstr("was not issued by the authority of bob"));
  for (const char* name : {"ca.pem", "crl.pem", "key.pem", "cert.pem"}) {
    std::filesystem::rename(work_ / "head2" / name, work_ / "head" / name);
  }
  EXPECT_TRUE(Eventually(kPatience, [&] { return Ask("list", "--tls bob").code == 0; }))
      << Read("err");
  EXPECT_EQ(Ask("list", "--tls operator").code, 1);
  EXPECT_TRUE(server->Running());
}

/// Runs as another account of this machine, which has nothing to do with this test.
constexpr const char* kAsNobody = "setpriv --reuid=65534 --regid=65534 --clear-groups";

TEST_F(Access, EmbeddedServerIsReachedByItsAccountAlone) {
  // Hours of work, so that it serves while others ask; the test ends it.
  Write("long.yaml", SmallCampaign(2000, 3));
  std::filesystem::permissions(work_, std::filesystem::perms(0755));
  Process run({"/bin/sh", "-c",
               "cd '" + work_.string() + "' && exec '" + CALIBCTL +
                   "' run long.yaml --state s --workers 1"},
              At("run.err"));
  ASSERT_TRUE(Eventually(kPatience, [&] {
    return std::filesystem::exists(work_ / "s/server.json");
  })) << Read("run.err");
  address_ = Json::parse(Read("s/server.json"))["address"].get<std::string>();
  EXPECT_EQ(address_, "unix:" + At("s/run/calib.sock")) << "no port of TCP";
  EXPECT_EQ(Call("list --state s").code, 0) << Read("err");
  EXPECT_EQ(Ask("list", "").code, 0) << Read("err");

  if (geteuid() != 0) {
    run.Signal(SIGTERM);
    run.Wait(kPatience);
    GTEST_SKIP() << "only root becomes another account: what that one meets was left out";
  }
  if (CallWith(kAsNobody, "tests").code != 0) {
    run.Signal(SIGTERM);
    run.Wait(kPatience);
    GTEST_SKIP() << "another account cannot read the program here: left out";
  }
  const Answer by_folder = CallWith(kAsNobody, "list --state s");
  EXPECT_EQ(by_folder.code, 1) << by_folder.err;
  EXPECT_THAT(by_folder.err, HasSubstr("may not be entered by this account"));
  const Answer by_socket = CallWith(kAsNobody, "list --server " + address_);
  EXPECT_EQ(by_socket.code, 1) << by_socket.err;
  EXPECT_THAT(by_socket.err, HasSubstr("is the socket of a server of another account"));
  const Answer deletes = CallWith(kAsNobody, "delete c1 --server " + address_);
  EXPECT_EQ(deletes.code, 1) << deletes.err;
  // Even where the folders are open, the socket asks who comes.
  for (const char* name : {"s", "s/run", "s/run/calib.sock"}) {
    std::filesystem::permissions(work_ / name, std::filesystem::perms(0777));
  }
  const Answer open = CallWith(kAsNobody, "list --server " + address_);
  EXPECT_EQ(open.code, 1) << open.err;
  EXPECT_EQ(Call("list --json --state s").json().size(), 1U) << "nothing changed";
  run.Signal(SIGTERM);
  EXPECT_EQ(run.Wait(kPatience), 1);
}

TEST_F(Access, SocketOfALongFolderHasAShortName) {
  const std::string deep = std::string(60, 'a') + "/" + std::string(60, 'b');
  Write("pre.yaml", SmallCampaign(4, 1));
  const Answer run = Call("submit pre.yaml --state " + deep);
  EXPECT_EQ(run.code, 0) << run.err;
  const Answer listed = Call("list --json --state " + deep);
  EXPECT_EQ(listed.code, 0) << listed.err;
  EXPECT_EQ(listed.json().size(), 1U);
}

// What has taken the port of a server that was killed, or listens beside it under the same name,
// gets no token; neither does anybody read one where it was miswritten.
TEST_F(Access, TokenIsShownToItsServerOnlyAndNotRepeated) {
  const auto server = Serve("state", {});
  const std::string token = Read("state/token").substr(0, 64);
  for (const std::string& wrong : {"Bearer " + token, token.substr(0, 60), token + "0"}) {
    const Variable variable("CALIB_TOKEN", wrong);
    const Answer answer = Ask("list", "");
    EXPECT_EQ(answer.code, 2) << answer.err;
    EXPECT_THAT(answer.err, AllOf(HasSubstr("$CALIB_TOKEN is neither a token"),
                                  Not(HasSubstr(token.substr(0, 32)))));
  }
  {
    const Variable blanks("CALIB_TOKEN", " " + token + "\n");
    EXPECT_EQ(Ask("list", "").code, 0) << Read("err");
  }
  const Answer option = Ask("list", "--token " + token);
  EXPECT_EQ(option.code, 2);
  EXPECT_THAT(option.err, Not(HasSubstr(token.substr(0, 32))));

  const int port = std::stoi(address_.substr(address_.rfind(':') + 1));
  EXPECT_FALSE(rpc::AnotherAccountListens(port));
  const auto access = rpc::FindAccess(address_, {});
  ASSERT_TRUE(access.ok()) << access.status();
  EXPECT_EQ(access->token, token);
  EXPECT_EQ(access->own_port, port) << "asked for again at every call";
  if (geteuid() == 0 && std::system("setpriv --version >/dev/null 2>&1") == 0) {
    // Another account beside it, on the other address that "localhost" stands for.
    Process other({"/usr/bin/env", "setpriv", "--reuid=65534", "--regid=65534", "--clear-groups",
                   "/usr/bin/python3", "-c",
                   "import socket, sys, time\n"
                   "s = socket.socket(socket.AF_INET6)\n"
                   "s.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)\n"
                   "s.bind(('::1', int(sys.argv[1])))\ns.listen()\ntime.sleep(30)\n",
                   std::to_string(port)},
                  At("other.err"));
    EXPECT_TRUE(Eventually(kPatience, [&] { return rpc::AnotherAccountListens(port); }))
        << Read("other.err");
    EXPECT_THAT(Refused("list", ""), HasSubstr("no token was shown"));
  }
}

TEST_F(Access, WorkerThatWasThereFirstFindsTheTokenThatIsLeftLater) {
  const std::string address = "127.0.0.1:" + std::to_string(FreePort());
  auto server = Serve("state", {"--listen", address});
  server->Signal(SIGTERM);
  EXPECT_EQ(server->Wait(kPatience), 0);
  server.reset();
  Process worker({Program("calib-worker"), "--server", address_, "--slots", "1"}, At("worker.err"));
  EXPECT_TRUE(Eventually(
      kPatience, [&] { return Read("worker.err").find("disconnected") != std::string::npos; }));
  std::filesystem::remove_all(work_ / "state");
  server = Serve("state", {"--listen", address});
  EXPECT_TRUE(Eventually(kPatience, [&] { return Ask("workers --json", "").json().size() == 1; }))
      << Read("worker.err");
}

TEST_F(Access, FoldersAndSocketsOfOthersAreLeftAlone) {
  Write("thesis", "chapter one");
  Process over({Program("calibd"), "--state", At("state"), "--listen", "unix:" + At("thesis")},
               At("err1"));
  EXPECT_EQ(over.Wait(kPatience), 1);
  EXPECT_EQ(Read("thesis"), "chapter one");
  EXPECT_THAT(Read("err1"), HasSubstr("a file that is no socket"));

  const auto first = Serve("state", {"--listen", "unix:" + At("sock")});
  EXPECT_EQ(Ask("list", "").code, 0) << Read("err");
  Process second({Program("calibd"), "--state", At("other"), "--listen", "unix:" + At("sock")},
                 At("err2"));
  EXPECT_EQ(second.Wait(kPatience), 1);
  EXPECT_THAT(Read("err2"), HasSubstr("another server"));
  EXPECT_EQ(Ask("list", "").code, 0) << Read("err");

  // A folder in which others may write could be given another server.json.
  std::filesystem::create_directory(work_ / "open");
  std::filesystem::permissions(work_ / "open", std::filesystem::perms(0777));
  const Answer answer = Call("submit campaign.yaml --state open");
  EXPECT_EQ(answer.code, 1) << answer.err;
  EXPECT_THAT(answer.err, HasSubstr("other accounts may write in open"));
  // One that is garbled is nobody's address.
  std::filesystem::create_directory(work_ / "garbled");
  Write("garbled/server.json", R"({"address": 7, "pid": "x", "stays": 3})");
  EXPECT_EQ(Call("submit campaign.yaml --state garbled").code, 0) << Read("err");
}

}  // namespace
}  // namespace calib::ctl
