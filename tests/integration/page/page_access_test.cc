// Who sees the page, and that nobody who may not, or is slow, stands in the way of others.
#include <gmock/gmock.h>

#include <csignal>
#include <cstdlib>

#include "tests/integration/page/page_fixture.h"

namespace calib::ctl {
namespace {

using calib::testing::Fetch;
using ::testing::HasSubstr;
using ::testing::Not;

TEST_F(LivePageTest, WantsTheTokenOnceAndThenItsCookie) {
  const auto server = ServeWithPage("state", {});
  for (const char* target :
       {"/", "/api/v1/campaigns", "/api/v1/events", "/page.js", "/?token=wrong", "/nothing"}) {
    const HttpReply reply = Fetch(http_, target);
    EXPECT_EQ(reply.status, 401) << target;
    EXPECT_THAT(reply.body, HasSubstr("token"));
    EXPECT_FALSE(reply.headers.contains("set-cookie"));
  }
  EXPECT_EQ(Fetch(http_, "/", {"Authorization: Bearer " + std::string(64, '0')}).status, 401);
  const HttpReply entered = Fetch(http_, "/?token=" + token_);
  EXPECT_EQ(entered.status, 303);
  EXPECT_EQ(entered.headers.at("location"), "/");
  const std::string set = entered.headers.at("set-cookie");
  EXPECT_THAT(set, HasSubstr("HttpOnly; SameSite=Strict"));
  EXPECT_THAT(set, Not(HasSubstr(token_)));
  const std::string cookie = "Cookie: " + set.substr(0, set.find(';'));
  EXPECT_EQ(Fetch(http_, "/", {cookie}).status, 200);
  EXPECT_EQ(Fetch(http_, "/api/v1/campaigns", {cookie}).body, "[]");
  // It opens the page, not the server.
  Write("cookie", set.substr(set.find('=') + 1, kTokenDigits) + "\n");
  EXPECT_THAT(Refused("list", "--token cookie"), HasSubstr("the token is not this server's"));
  for (const char* open : {"/healthz", "/readyz", "/metrics"}) {
    EXPECT_EQ(Fetch(http_, open).status, 200) << open;
  }
  EXPECT_THAT(Read("state.log") + Read("state.err"), Not(HasSubstr(token_)));
}

TEST_F(LivePageTest, EveryAnswerCarriesItsPolicy) {
  const auto server = ServeWithPage("state", {});
  for (const char* target : {"/", "/api/v1/campaigns", "/api/v1/campaigns/c9", "/healthz", "/%"}) {
    for (const char* method : {"GET", "HEAD", "POST"}) {
      const HttpReply reply = Fetch(http_, target, {Bearer()}, method);
      EXPECT_THAT(reply.headers.at("content-security-policy"), HasSubstr("default-src 'none'"));
      EXPECT_EQ(reply.headers.at("x-content-type-options"), "nosniff");
      EXPECT_EQ(reply.headers.at("referrer-policy"), "no-referrer");
      EXPECT_EQ(reply.status == 405, std::string(method) == "POST") << target;
    }
  }
}

TEST_F(LivePageTest, MetricsAreOpenAndCountWhatTheServerDoes) {
  const auto server = ServeWithPage("state", {});
  SubmitAndFinish();
  const HttpReply reply = Fetch(http_, "/metrics");
  ASSERT_EQ(reply.status, 200) << reply.body;
  EXPECT_EQ(reply.headers.at("content-type"), "text/plain; version=0.0.4; charset=utf-8");
  EXPECT_THAT(reply.headers.at("content-security-policy"), HasSubstr("default-src 'none'"));
  for (const char* line :
       {"calib_campaigns 0\n", "calib_campaigns_being_read 0\n", "calib_queue_evaluations 0\n",
        "calib_store_waits 0\n", "calib_lease_expiries_total 0\n",
        "calib_workers{state=\"connected\"} ", "# TYPE calib_ack_seconds histogram\n",
        "calib_commit_seconds_bucket{le=\"+Inf\"} ", "calib_strand_lag_seconds_count ",
        "calib_wal_bytes "}) {
    EXPECT_THAT(reply.body, HasSubstr(line));
  }
  EXPECT_THAT(reply.body, Not(HasSubstr("calib_runs_total{end=\"completed\"} 0\n")));
  EXPECT_THAT(reply.body, Not(HasSubstr("calib_states_total 0\n")));
  EXPECT_EQ(Fetch(http_, "/metrics", {}, "HEAD").status, 200);
  EXPECT_EQ(Fetch(http_, "/metrics", {}, "POST").status, 405);
  EXPECT_EQ(Fetch(http_, "/metrics", {"Host: evil.example"}).status, 403);
}

TEST_F(LivePageTest, AnotherNameThatLeadsHereIsRefused) {
  const auto server = ServeWithPage("state", {});
  EXPECT_EQ(Get("/api/v1/campaigns", {"Host: evil.example"}).status, 403);
  EXPECT_EQ(Get("/healthz", {"Host: evil.example:80"}).status, 403);
  EXPECT_EQ(Get("/api/v1/campaigns", {"Host: localhost:1"}).status, 200);
}

TEST_F(LivePageTest, SlowAndIdlePeersHoldNobodyUp) {
  const auto server = ServeWithPage("state", {});
  std::vector<HttpConnection> idle;
  for (int k = 0; k < 200; ++k) idle.emplace_back(http_);
  HttpConnection slow(http_);
  slow.Send("GET / HTTP/1.1\r\nHost: loc");
  for (int k = 0; k < 5; ++k) {
    const auto begin = std::chrono::steady_clock::now();
    EXPECT_EQ(Get("/api/v1/campaigns").status, 200);
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(2));
  }
  EXPECT_EQ(Ask("list --json", "").json(), Json::array());
}

TEST_F(LivePageTest, ATakenPortIsWarnedOfAndTheServerServes) {
  const auto first = ServeWithPage("state", {});
  const auto second = Serve("other", {"--http", "127.0.0.1:" + std::to_string(http_)});
  EXPECT_EQ(Ask("list --json", "--token other/token").json(), Json::array());
  EXPECT_TRUE(Eventually(kPatience, [&] {
    return Read("other.err").find("no page: cannot listen on 127.0.0.1:") != std::string::npos;
  })) << Read("other.err");
}

TEST_F(LivePageTest, PlainTextForOtherMachinesIsRefused) {
  const Answer answer = Call("page --state state --http 0.0.0.0:0");
  EXPECT_EQ(answer.code, 2) << answer.err;
  { const auto server = Serve("state", {}); }
  const Answer refused = Call("page --state state --http 0.0.0.0:0");
  EXPECT_EQ(refused.code, 2) << refused.err;
  EXPECT_THAT(refused.err, HasSubstr("can be read there"));
}

TEST_F(LivePageTest, WithCertificatesARoleThatMayReadIsEnough) {
  IssueAll();
  const auto server = ServeWithPage("state", {"--tls", At("head")});
  const auto curl = [&](const std::string& options, const std::string& target) {
    const std::string command = "curl --silent --output '" + At("curl.out") +
                                "' --write-out '%{http_code}' --cacert '" + At("head/ca.pem") +
                                "' " + options + " https://127.0.0.1:" + std::to_string(http_) +
                                target + " > '" + At("curl.code") + "'";
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
    return std::atoi(Read("curl.code").c_str());
  };
  const auto shows = [&](const std::string& name) {
    return "--cert '" + At(name + "/cert.pem") + "' --key '" + At(name + "/key.pem") + "'";
  };
  for (const char* role : {"viewer", "submitter", "operator"}) {
    EXPECT_EQ(curl(shows(role), "/api/v1/campaigns"), 200) << role << Read("curl.out");
    EXPECT_EQ(Read("curl.out"), "[]");
  }
  EXPECT_EQ(curl(shows("worker"), "/api/v1/campaigns"), 403);
  EXPECT_THAT(Read("curl.out"), HasSubstr("role worker"));
  EXPECT_EQ(curl("", "/api/v1/campaigns"), 401);
  EXPECT_THAT(Read("curl.out"), HasSubstr("certificate"));
  EXPECT_EQ(curl("", "/healthz"), 200);
  EXPECT_EQ(curl("-H 'Authorization: Bearer " + token_ + "'", "/api/v1/campaigns"), 200);
  // One that was revoked is out at once.
  ASSERT_EQ(Call("certs revoke ca viewer").code, 0);
  std::filesystem::copy_file(At("ca/crl.pem"), At("head/crl.pem"),
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_TRUE(Eventually(kPatience, [&] { return curl(shows("viewer"), "/") == 401; }))
      << Read("curl.out");
  EXPECT_EQ(Fetch(http_, "/healthz").status, 0) << "plain text";
}

}  // namespace
}  // namespace calib::ctl
