// The documents of the page are those of calibctl, and are told of when they change.
#include <gmock/gmock.h>

#include <csignal>

#include "tests/integration/page/page_fixture.h"

namespace calib::ctl {
namespace {

using ::testing::HasSubstr;

/// Without what differs from one look to the next.
Json Still(Json json) {
  if (json.is_array()) {
    for (Json& one : json) one = Still(one);
  } else if (json.is_object()) {
    for (const char* name : {"seconds_since_heard", "eta_seconds", "states_per_second"}) {
      json.erase(name);
    }
  }
  return json;
}

TEST_F(LivePageTest, EveryDocumentIsThatOfCalibctl) {
  Write("campaign.yaml", SmallCampaign(30, 1));  // as many as an emulator asks for
  const auto server = ServeWithPage("state", {});
  SubmitAndFinish();
  const std::pair<const char*, const char*> same[] = {
      {"campaigns", "list"},
      {"campaigns/c1", "show c1"},
      {"campaigns/c1/lineage", "lineage c1"},
      {"campaigns/c1/posterior", "posterior c1"},
      {"campaigns/c1/posterior?iteration=0", "posterior c1 --iteration 0"},
      {"campaigns/c1/compare", "compare c1"},
      {"campaigns/c1/samples", "samples c1"},
      {"campaigns/c1/states/2", "states c1 2"},
      {"workers", "workers"},
      {"campaigns?limit=0", "list --limit 0"}};
  for (const auto& [target, words] : same) {
    const Answer answer = Ask(std::string(words) + " --json", "");
    ASSERT_EQ(answer.code, 0) << words << answer.err;
    EXPECT_EQ(Still(Document(target)), Still(answer.json())) << words;
  }
  ASSERT_EQ(Ask("diagnose c1 --gate --json", "").code, 0) << Read("err");
  const Json diagnosis = Json::parse(Read("out"));
  EXPECT_TRUE(Eventually(kPatience, [&] {
    const HttpReply reply = Get("/api/v1/campaigns/c1/diagnosis");
    return reply.status == 200 && Json::parse(reply.body) == diagnosis;
  })) << Get("/api/v1/campaigns/c1/diagnosis").body;

  const HttpReply zipped = Get("/api/v1/campaigns/c1/compare", {"Accept-Encoding: gzip"});
  EXPECT_EQ(zipped.status, 200);
  EXPECT_EQ(zipped.headers.at("content-encoding"), "gzip");
  EXPECT_EQ(zipped.body.substr(0, 2), "\x1f\x8b");

  const Json compared = Document("campaigns/c1/compare");
  const Json& curves = compared["experiments"][0];
  EXPECT_EQ(curves["control_values"].size(), 3U);
  EXPECT_EQ(curves["settings"]["confining_pressure"]["unit"], "Pa");
  EXPECT_EQ(curves["observables"][0]["values"], Json({0.5, 0.8, 1.0}));
  EXPECT_EQ(curves["observables"][0]["bands"]["q50"].size(), 3U);
  EXPECT_EQ(curves["runs"].size(), curves["observables"][0]["runs"].size());
  EXPECT_EQ(curves["runs"][0]["rank"], 1);
  const Json posterior = Document("campaigns/c1/posterior");
  EXPECT_FALSE(posterior["parameters"]["young_modulus"]["prior_density"].empty());

  // A packing that was drawn is kept where that is asked for.
  const std::string sample = std::to_string(curves["runs"][0]["sample"].get<int>());
  const std::string path = "campaigns/c1/grains/" + sample;
  ASSERT_EQ(Ask("vtk c1 " + sample + " -o drawn", "").code, 0) << Read("err");
  EXPECT_EQ(Get("/api/v1/" + path).status, 404);
  ASSERT_EQ(Ask("vtk c1 " + sample + " --keep -o drawn", "").code, 0) << Read("err");
  ASSERT_TRUE(Eventually(kPatience, [&] { return Get("/api/v1/" + path).status == 200; }));
  const Json packing = Document(path);
  EXPECT_EQ(packing["load_steps"], Json({0, 1, 2}));
  EXPECT_EQ(packing["load_step"], 2);
  const std::size_t grains = packing["grains"]["radius"].size();
  EXPECT_GT(grains, 10U);
  for (const char* name : {"x", "y", "z", "speed", "coordination"}) {
    EXPECT_EQ(packing["grains"][name].size(), grains) << name;
  }
  // Every contact counts once for each of its two grains.
  const Json& contacts = packing["contacts"];
  EXPECT_EQ(contacts["normal_force"].size(), contacts["i"].size());
  std::vector<int> counted(grains, 0);
  for (const char* end : {"i", "j"}) {
    for (const Json& grain : contacts[end]) ++counted.at(grain.get<std::size_t>());
  }
  EXPECT_EQ(packing["grains"]["coordination"], Json(counted));
  EXPECT_EQ(Document(path + "?load_step=1")["load_step"], 1);
  EXPECT_EQ(Get("/api/v1/" + path + "?load_step=7").status, 404);
  EXPECT_EQ(Get("/api/v1/" + path + "?experiment=nosuch").status, 404);
}

TEST_F(LivePageTest, WhatIsNotThereIsSaidInASentence) {
  const auto server = ServeWithPage("state", {});
  ASSERT_EQ(Ask("submit campaign.yaml", "").code, 0) << Read("err");
  const std::tuple<const char*, int, const char*> refused[] = {
      {"/api/v1/campaigns/c9", 404, "there is no campaign"},
      {"/api/v1/campaigns/c1/posterior", 409, "no complete iteration"},
      {"/api/v1/campaigns/c1/diagnosis", 404, "calibctl diagnose c1"},
      {"/api/v1/campaigns/c1/improvement", 404, "calibctl improve c1"},
      {"/api/v1/campaigns/c1/grains/0", 404, "no packing of sample 0"},
      {"/api/v1/campaigns/c1/states/999", 404, "999"},
      {"/api/v1/campaigns/c1/states/x", 400, "whole number"},
      {"/api/v1/campaigns?after=c9", 404, "there is no campaign"},
      {"/api/v1/nothing", 404, "nothing at this address"},
      {"/api/v2/campaigns", 404, "nothing at this address"},
      {"/nothing.js", 404, "nothing at this address"}};
  for (const auto& [target, status, words] : refused) {
    const HttpReply reply = Get(target);
    EXPECT_EQ(reply.status, status) << target << reply.body;
    const Json json = Json::parse(reply.body, nullptr, false);
    ASSERT_TRUE(json.is_object()) << target << reply.body;
    EXPECT_THAT(json["error"].get<std::string>(), HasSubstr(words)) << target;
  }
  EXPECT_THAT(Get("/api/v1/campaigns/c1/grains/0").body, HasSubstr("calibctl vtk c1 0"));
  const Json early = Document("campaigns/c1/compare");
  EXPECT_THAT(early["note"].get<std::string>(), HasSubstr("No iteration of c1 is complete yet"));
  EXPECT_EQ(early["experiments"][0]["observables"][0]["bands"], nullptr);
}

TEST_F(LivePageTest, HostileNamesAreTextAndNothingElse) {
  const auto server = ServeWithPage("state", {});
  for (const char* name : {"%3Cscript%3Ealert(1)%3C/script%3E", "c1%27%20OR%201=1", "%ff%fe",
                           "c1%7F", "c99999999999999999999", "c-1", "%F0%9F%92%A5", "\xc3\xa9"}) {
    const HttpReply reply = Get(std::string("/api/v1/campaigns/") + name);
    EXPECT_TRUE(reply.status == 404 || reply.status == 400) << name << reply.status;
    EXPECT_EQ(reply.headers.at("content-type"), "application/json");
    EXPECT_EQ(reply.headers.at("x-content-type-options"), "nosniff");
    EXPECT_TRUE(Json::parse(reply.body, nullptr, false).is_object()) << reply.body;
  }
  for (const char* target : {"/../calib.db", "/%2e%2e/calib.db", "/%00", "/%", "/a%0d%0aX:1"}) {
    EXPECT_EQ(Get(target).status, 400) << target;
  }
  EXPECT_EQ(Get("/" + std::string(3000, 'a')).status, 414);
  EXPECT_EQ(Get("/" + std::string(9000, 'a')).status, 431);
  EXPECT_EQ(Get("/healthz").body, "ok\n");
}

TEST_F(LivePageTest, AnEqualDocumentIsNotSentAgain) {
  const auto server = ServeWithPage("state", {});
  ASSERT_EQ(Ask("submit campaign.yaml", "").code, 0) << Read("err");
  const HttpReply first = Get("/api/v1/campaigns/c1/samples");
  ASSERT_EQ(first.status, 200);
  EXPECT_EQ(first.headers.at("cache-control"), "no-store");
  const HttpReply again =
      Get("/api/v1/campaigns/c1/samples", {"If-None-Match: " + first.headers.at("etag")});
  EXPECT_EQ(again.status, 304);
  EXPECT_EQ(again.body, "");
}

TEST_F(LivePageTest, EventsTellWhatChangesThroughARestart) {
  auto server = ServeWithPage("state", {});
  HttpConnection events(http_);
  ASSERT_TRUE(
      events.Send("GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\n" + Bearer() + "\r\n\r\n"));
  ASSERT_TRUE(events.ReceiveUntil("event: hello", kPatience)) << events.received();
  EXPECT_THAT(events.received(), HasSubstr("text/event-stream"));
  ASSERT_EQ(Ask("submit campaign.yaml", "").code, 0) << Read("err");
  EXPECT_TRUE(events.ReceiveUntil("event: campaigns", kPatience));
  EXPECT_TRUE(events.ReceiveUntil("\"campaign\":\"c1\"", kPatience)) << events.received();
  {
    const Process worker(
        {Program("calib-worker"), "--server", address_, "--slots", "1", "--name", "w1"},
        At("worker.err"));
    EXPECT_TRUE(events.ReceiveUntil("event: workers", kPatience));
    ASSERT_EQ(Ask("watch c1", "").code, 0) << Read("err");
  }
  // What was answered after the last event is what is so.
  EXPECT_TRUE(Eventually(kPatience, [&] {
    return Document("campaigns/c1")["state"] == "finished" &&
           Get("/api/v1/campaigns/c1/compare").status == 200;
  }));
  EXPECT_EQ(Document("campaigns/c1/compare"), Ask("compare c1 --json", "").json());

  const int port = http_;
  server->Signal(SIGTERM);
  ASSERT_EQ(server->Wait(kPatience), 0);
  EXPECT_TRUE(events.IsClosed(kPatience));
  server = ServeWithPage("state", {}, port);
  EXPECT_EQ(http_, port);
  EXPECT_EQ(Document("campaigns/c1")["state"], "finished");
}

TEST_F(LivePageTest, BesideAServerItOutlivesThatOne) {
  auto server = ServeWithPage("state", {});
  const std::string address = address_;
  const std::ofstream emptied(At("page.err"), std::ios::trunc);
  Process page({"/bin/sh", "-c",
                "exec '" CALIBCTL "' page --state '" + At("state") + "' --http 127.0.0.1:0 >'" +
                    At("page.out") + "'"},
               At("page.err"));
  int port = 0;
  ASSERT_TRUE(Eventually(kPatience, [&] { return (port = PortIn(Read("page.out"))) != 0; }))
      << Read("page.err");
  EXPECT_THAT(Read("page.out"), HasSubstr("/?token=" + token_));
  http_ = port;
  EXPECT_EQ(Document("campaigns"), Json::array());
  HttpConnection events(port);
  ASSERT_TRUE(
      events.Send("GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\n" + Bearer() + "\r\n\r\n"));
  ASSERT_TRUE(events.ReceiveUntil("\"up\":true", kPatience));
  server->Signal(SIGTERM);
  ASSERT_EQ(server->Wait(kPatience), 0);
  EXPECT_TRUE(events.ReceiveUntil("\"up\":false", kPatience)) << events.received();
  const HttpReply away = Get("/api/v1/campaigns");
  EXPECT_EQ(away.status, 503) << away.body;
  EXPECT_EQ(away.headers.at("retry-after"), "2");
  EXPECT_EQ(Get("/readyz").status, 503);
  server = Serve("state", {"--listen", address});
  EXPECT_TRUE(events.ReceiveUntil("event: server\ndata: {\"up\":true}", kPatience))
      << events.received();
  EXPECT_TRUE(Eventually(kPatience, [&] { return Get("/api/v1/campaigns").status == 200; }));
  page.Signal(SIGINT);
  EXPECT_EQ(page.Wait(kPatience), 0) << Read("page.err");
}

TEST_F(LivePageTest, OfAFolderThatNobodyServesItServesThatToo) {
  { const auto server = Serve("state", {}); }
  Process page({"/bin/sh", "-c",
                "exec '" CALIBCTL "' page --state '" + At("state") + "' --http 127.0.0.1:0 >'" +
                    At("page.out") + "'"},
               At("page.err"));
  ASSERT_TRUE(Eventually(kPatience, [&] { return (http_ = PortIn(Read("page.out"))) != 0; }))
      << Read("page.err");
  token_ = Read("state/token").substr(0, kTokenDigits);
  EXPECT_EQ(Document("campaigns"), Json::array());
  page.Signal(SIGTERM);
  EXPECT_EQ(page.Wait(kPatience), 0);
}

TEST_F(LivePageTest, RunServesItWhileItRuns) {
  const int port = FreePort();
  const HttpConnection nobody(port);
  const Answer answer =
      Call("run campaign.yaml --state s --workers 1 --http 127.0.0.1:" + std::to_string(port) +
           " --json");
  EXPECT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.err, HasSubstr("page: http://127.0.0.1:" + std::to_string(port) +
                                    "/?token=" + Read("s/token").substr(0, kTokenDigits)));
}

}  // namespace
}  // namespace calib::ctl
