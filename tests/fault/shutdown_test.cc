// A server is told to end while peers neither read nor go: it ends within ten seconds all the same.
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <string>
#include <thread>
#include <vector>

#include "proto/rpc/digest.h"
#include "tests/support/attacker.h"
#include "tests/support/deployment.h"
#include "tests/support/http_client.h"

namespace calib::testing {
namespace {

constexpr std::chrono::seconds kWithin{10};
constexpr int kBlobBytes = 20'000'000;  // more than what lies between two programs

/// The port in "page: http://127.0.0.1:PORT/"; 0: it has not been said.
int PagePort(const std::string& logs) {
  const std::size_t at = logs.find("page: http://127.0.0.1:");
  return at == std::string::npos ? 0 : std::atoi(logs.c_str() + at + 23);
}

class Shutdown : public ::testing::Test {
 protected:
  Shutdown() : deployment_({.name = "shutdown", .server_options = {"--http", "127.0.0.1:0"}}) {}

  /// Exit code, or what Process::Wait() says of one that still runs.
  int Terminate() {
    deployment_.server().Signal(SIGTERM);
    return deployment_.server().Wait(kWithin);
  }

  Deployment deployment_;
};

TEST_F(Shutdown, OfPeersThatNeitherReadNorGo) {
  ASSERT_TRUE(deployment_.StartServer()) << deployment_.Logs();
  const std::string content(kBlobBytes, 'x');
  ASSERT_TRUE(deployment_.client().PutBlob(content).ok());
  const SilentConnections silent(deployment_.address(), 20);
  std::vector<HttpConnection> pages;
  ASSERT_TRUE(Eventually(kWithin, [this] { return PagePort(deployment_.Logs()) != 0; }));
  for (int k = 0; k < 5; ++k) {
    pages.emplace_back(PagePort(deployment_.Logs()));
    pages.back().Send("GET /metrics HTTP/1.1\r\nHost: loc");
  }
  std::jthread downloads([this, digest = rpc::Sha256Hex(content)] {
    Attacker(deployment_.address()).DownloadWithoutReading(digest, 4, 2 * kWithin);
  });
  std::jthread uploads(
      [this] { Attacker(deployment_.address()).UploadWithoutEnd(1000, 2 * kWithin); });
  // A moment for the streams to be opened; those that come later find a server that ends.
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  EXPECT_EQ(Terminate(), 0) << deployment_.Logs();
}

}  // namespace
}  // namespace calib::testing
