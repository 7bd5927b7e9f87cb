#include "server/page/http_server.h"

#include <gtest/gtest.h>

#include <thread>

#include "tests/support/http_client.h"

namespace calib::page {
namespace {

using std::chrono::milliseconds;
using testing::Fetch;
using testing::HttpConnection;
using testing::HttpReply;

constexpr std::chrono::seconds kSoon{5};
const std::string kRequest = "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n";

class Counting final : public Feed {
 public:
  std::string Take() override { return std::exchange(text_, ""); }
  void Say(const std::string& text) {
    text_ += text;
    wake();
  }

 private:
  std::string text_ = "data: first\n\n";
};

class HttpServerTest : public ::testing::Test {
 protected:
  /// "/echo" tells the request, "/feed" never ends, "/later" is answered by Release(); others ok.
  void Start(const HttpLimits& limits = {}) {
    auto server = HttpServer::Open(
        {.listen = "127.0.0.1:0", .limits = limits},
        [this](const HttpRequest& request, const HttpServer::Finish& finish) {
          if (request.target == "/feed") {
            feed_ = std::make_shared<Counting>();
            finish({.feed = feed_});
          } else if (request.target == "/later") {
            later_.push_back(finish);
          } else if (request.target == "/large") {
            finish({.body = std::make_shared<const std::string>(kLarge, 'x')});
          } else {
            finish({.headers = {{"Content-Type", "text/plain"}},
                    .body = std::make_shared<const std::string>(request.method + request.target +
                                                                request.host)});
          }
        },
        [](int status, const std::string& why) {
          return HttpAnswer{.status = status, .body = std::make_shared<const std::string>(why)};
        });
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    server_->Begin();
  }
  /// On the server's thread.
  void Do(std::function<void()> what) { server_->Post(std::move(what)); }
  int port() const { return server_->port(); }

  static constexpr std::size_t kLarge = 64 << 20;
  std::shared_ptr<Counting> feed_;  // the server's thread's, as the next
  std::vector<HttpServer::Finish> later_;
  std::unique_ptr<HttpServer> server_;  // goes first
};

TEST_F(HttpServerTest, AnswersOneRequestAfterTheOtherOnOneConnection) {
  Start();
  HttpConnection connection(port());
  for (const char* target : {"/a", "/b"}) {
    ASSERT_TRUE(connection.Send(std::string("GET ") + target + " HTTP/1.1\r\nHost: h\r\n\r\n"));
    const HttpReply reply = connection.Reply();
    EXPECT_EQ(reply.status, 200);
    EXPECT_EQ(reply.body, std::string("GET") + target + "h");
    EXPECT_EQ(reply.headers.at("content-type"), "text/plain");
    EXPECT_EQ(reply.headers.at("connection"), "keep-alive");
    EXPECT_TRUE(reply.headers.contains("date"));
  }
  ASSERT_TRUE(connection.Send(kRequest + kRequest)) << "both at once";
  EXPECT_EQ(connection.Reply().status, 200);
  EXPECT_EQ(connection.Reply().status, 200);
  ASSERT_TRUE(connection.Send("GET / HTTP/1.1\r\nHost: h\r\nConnection: close\r\n\r\n"));
  EXPECT_EQ(connection.Reply().headers.at("connection"), "close");
  EXPECT_TRUE(connection.IsClosed(kSoon));
}

TEST_F(HttpServerTest, HeadHasNoBody) {
  Start();
  const HttpReply reply = Fetch(port(), "/x", {"Host: h"}, "HEAD");
  EXPECT_EQ(reply.status, 200);
  EXPECT_EQ(reply.headers.at("content-length"), "7") << "HEAD/xh";
}

TEST_F(HttpServerTest, OnlyReads) {
  Start();
  for (const char* method : {"POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "BREW"}) {
    const HttpReply reply = Fetch(port(), "/", {"Content-Length: 3"}, method);
    EXPECT_EQ(reply.status, 405) << method;
    EXPECT_EQ(reply.headers.at("allow"), "GET, HEAD");
  }
  EXPECT_EQ(Fetch(port(), "/", {"Content-Length: 3"}).status, 400);
  EXPECT_EQ(Fetch(port(), "/", {"Transfer-Encoding: chunked"}).status, 400);
}

TEST_F(HttpServerTest, WhatIsNoRequestIsRefusedAndEndsNobodyElse) {
  Start();
  for (const std::string& bytes :
       {std::string("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", 11),  // TLS
        std::string("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"), std::string("GET\r\n\r\n"),
        std::string("GET / HTTP/9.9\r\n\r\n"), std::string("GET / HTTP/1.1\r\nno colon\r\n\r\n"),
        std::string("GET / HTTP/1.1\r\nA: b\x01\r\n\r\n"), std::string(200, '\0')}) {
    HttpConnection connection(port());
    ASSERT_TRUE(connection.Send(bytes));
    const int status = connection.Reply().status;
    EXPECT_TRUE(status == 400 || status == 405) << status << " " << bytes;
    EXPECT_TRUE(connection.IsClosed(kSoon));
  }
  HttpConnection connection(port());
  connection.Send("GET / HTTP/1.1\r\nA: " + std::string(9000, 'a') + "\r\n\r\n");
  EXPECT_EQ(connection.Reply().status, 431);
  EXPECT_EQ(Fetch(port(), "/").status, 200);
}

TEST_F(HttpServerTest, ASlowRequestEndsInTime) {
  Start({.request = std::chrono::seconds(1)});
  HttpConnection slow(port());
  const auto begin = std::chrono::steady_clock::now();
  // A byte now and then does not put it off.
  for (std::size_t k = 0; k < kRequest.size() - 1 && !slow.IsClosed(milliseconds(150)); ++k) {
    slow.Send(kRequest.substr(k, 1));
    EXPECT_EQ(Fetch(port(), "/").status, 200);
  }
  EXPECT_TRUE(slow.IsClosed(kSoon));
  const auto took = std::chrono::steady_clock::now() - begin;
  EXPECT_GT(took, milliseconds(900));
  EXPECT_LT(took, std::chrono::seconds(4));
}

TEST_F(HttpServerTest, IdleConnectionsGiveWayToNewOnes) {
  Start({.connections = 20});
  std::vector<HttpConnection> idle;
  for (int k = 0; k < 200; ++k) idle.emplace_back(port());
  EXPECT_EQ(Fetch(port(), "/").status, 200);
  EXPECT_TRUE(idle.front().IsClosed(kSoon));
  EXPECT_FALSE(idle.back().IsClosed(milliseconds(50)));
  ASSERT_TRUE(idle.back().Send(kRequest));
  EXPECT_EQ(idle.back().Reply().status, 200);
}

TEST_F(HttpServerTest, ConnectionsThatAreAnsweredStayAndThoseBeyondAreClosed) {
  Start({.connections = 2});
  HttpConnection first(port());
  HttpConnection second(port());
  ASSERT_TRUE(first.Send("GET /later HTTP/1.1\r\nHost: h\r\n\r\n"));
  ASSERT_TRUE(second.Send("GET /feed HTTP/1.1\r\nHost: h\r\n\r\n"));
  ASSERT_TRUE(second.ReceiveUntil("first", kSoon));
  EXPECT_EQ(Fetch(port(), "/").status, 0);
  Do([this] {
    for (const auto& finish : later_) finish({.status = 200});
    later_.clear();
  });
  EXPECT_EQ(first.Reply().status, 200);
}

TEST_F(HttpServerTest, APeerThatDoesNotReadHoldsNobodyUp) {
  Start();
  HttpConnection lazy(port());
  ASSERT_TRUE(lazy.Send("GET /large HTTP/1.1\r\nHost: h\r\n\r\n"));
  for (int k = 0; k < 20; ++k) EXPECT_EQ(Fetch(port(), "/").status, 200);
}

TEST_F(HttpServerTest, AFeedSaysWhatComesAndThatItLives) {
  Start({.heartbeat = std::chrono::seconds(1)});
  HttpConnection connection(port());
  ASSERT_TRUE(connection.Send("GET /feed HTTP/1.1\r\nHost: h\r\n\r\n"));
  EXPECT_TRUE(connection.ReceiveUntil("data: first\n\n", kSoon));
  Do([this] { feed_->Say("data: second\n\n"); });
  EXPECT_TRUE(connection.ReceiveUntil("data: second\n\n", kSoon));
  EXPECT_TRUE(connection.ReceiveUntil("\n: ", kSoon)) << connection.received();
  EXPECT_EQ(connection.received().find("Content-Length"), std::string::npos);
}

TEST_F(HttpServerTest, TakesSoManyFeedsAndAsManyAgainWhenTheyHaveEnded) {
  Start({.feeds = 2});
  std::vector<HttpConnection> connections;
  for (int k = 0; k < 2; ++k) {
    connections.emplace_back(port());
    ASSERT_TRUE(connections.back().Send("GET /feed HTTP/1.1\r\nHost: h\r\n\r\n"));
    ASSERT_TRUE(connections.back().ReceiveUntil("first", kSoon));
  }
  EXPECT_EQ(Fetch(port(), "/feed").status, 503);
  connections.clear();
  const auto end = std::chrono::steady_clock::now() + kSoon;
  bool taken = false;
  while (!taken && std::chrono::steady_clock::now() < end) {
    HttpConnection connection(port());
    connection.Send("GET /feed HTTP/1.1\r\nHost: h\r\n\r\n");
    taken = connection.ReceiveUntil("first", milliseconds(300));
  }
  EXPECT_TRUE(taken);
}

TEST_F(HttpServerTest, EndsWithWhateverIsUnderWay) {
  Start();
  HttpConnection later(port());
  HttpConnection feed(port());
  HttpConnection half(port());
  later.Send("GET /later HTTP/1.1\r\nHost: h\r\n\r\n");
  feed.Send("GET /feed HTTP/1.1\r\nHost: h\r\n\r\n");
  half.Send("GET /");
  ASSERT_TRUE(feed.ReceiveUntil("first", kSoon));
  server_->Stop();
  for (HttpConnection* connection : {&later, &feed, &half}) {
    EXPECT_TRUE(connection->IsClosed(kSoon));
  }
  later_.clear();
}

TEST_F(HttpServerTest, ATakenAddressIsUnavailable) {
  Start();
  const auto other = HttpServer::Open({.listen = "127.0.0.1:" + std::to_string(port())}, {}, {});
  EXPECT_TRUE(absl::IsUnavailable(other.status())) << other.status();
}

}  // namespace
}  // namespace calib::page
