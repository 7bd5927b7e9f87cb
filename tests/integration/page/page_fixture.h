#pragma once
// Servers with a page, and who opens it.

#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "tests/integration/ctl/access_fixture.h"
#include "tests/support/http_client.h"

namespace calib::ctl {

using calib::testing::HttpConnection;
using calib::testing::HttpReply;

class LivePageTest : public Access {
 protected:
  /// calibd over the folder `state` with a page; http_ is then its port.
  std::unique_ptr<Process> ServeWithPage(const std::string& state, std::vector<std::string> options,
                                         int http = 0) {
    const std::ofstream emptied(At(state + ".err"), std::ios::trunc);
    options.insert(options.end(), {"--http", "127.0.0.1:" + std::to_string(http)});
    auto server = Serve(state, options);
    EXPECT_TRUE(Eventually(kPatience, [&] {
      http_ = PortIn(Read(state + ".err"));
      return http_ != 0;
    })) << Read(state + ".err");
    token_ = Read(state + "/token").substr(0, kTokenDigits);
    return server;
  }

  /// The port of the address in "page: http://127.0.0.1:PORT/..."; 0: there is none yet.
  static int PortIn(const std::string& text) {
    const std::size_t at = text.find("://");
    const std::size_t colon = at == std::string::npos ? at : text.find(':', at + 3);
    if (colon == std::string::npos || text.find('/', colon) == std::string::npos) return 0;
    return std::atoi(text.c_str() + colon + 1);
  }

  std::string Bearer() const { return "Authorization: Bearer " + token_; }
  HttpReply Get(const std::string& target, std::vector<std::string> headers = {}) const {
    headers.push_back(Bearer());
    return calib::testing::Fetch(http_, target, headers);
  }
  Json Document(const std::string& words) const {
    const HttpReply reply = Get("/api/v1/" + words);
    EXPECT_EQ(reply.status, 200) << words << ": " << reply.body;
    return Json::parse(reply.body, nullptr, false);
  }
  void SubmitAndFinish() {
    ASSERT_EQ(Ask("submit campaign.yaml", "").code, 0) << Read("err");
    const Process worker(
        {Program("calib-worker"), "--server", address_, "--slots", "1", "--name", "w1"},
        At("worker.err"));
    ASSERT_EQ(Ask("watch c1", "").code, 0) << Read("err");
  }

  static constexpr std::size_t kTokenDigits = 64;
  int http_ = 0;
  std::string token_;
};

}  // namespace calib::ctl
