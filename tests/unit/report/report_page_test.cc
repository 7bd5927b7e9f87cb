#include "server/report/documents/report_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <regex>

namespace calib::report {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

const PageFiles kFiles = {.style = "p{}", .script = "draw();", .script_hash = "abc="};

std::string DocumentsIn(const std::string& html) {
  std::smatch found;
  const std::regex held("id=\"documents\">([^<]*)</script>");
  return std::regex_search(html, found, held) ? found[1].str() : "";
}

TEST(ReportPage, HoldsItsDocumentsStyleAndScript) {
  const std::string html = ReportPage(
      "c1", "sand", {{"campaigns/c1", R"({"x": 0.1})"}, {"campaigns/c1/compare", "[]"}}, kFiles);
  const Json held = Json::parse(DocumentsIn(html));
  EXPECT_EQ(held["campaign"], "c1");
  EXPECT_EQ(held["documents"]["campaigns/c1"]["x"], 0.1);
  EXPECT_TRUE(held["documents"]["campaigns/c1/compare"].is_array());
  EXPECT_THAT(html, HasSubstr("<style>p{}</style>"));
  EXPECT_THAT(html, HasSubstr("<script type=\"module\">draw();</script>"));
}

TEST(ReportPage, FetchesNothingAndRunsNothingElse) {
  const std::string html = ReportPage("c1", "sand", {}, kFiles);
  EXPECT_FALSE(std::regex_search(html, std::regex("(src|href)=")));
  EXPECT_THAT(html, HasSubstr("default-src 'none'"));
  EXPECT_THAT(html, HasSubstr("script-src 'sha256-abc='"));
}

TEST(ReportPage, HostileTextStaysText) {
  const std::string hostile = "</script></title><script>alert(1)</script><!--\"&";
  const std::string html = ReportPage(
      hostile, hostile, {{"campaigns/" + hostile, Json({{"name", hostile}}).dump()}}, kFiles);
  EXPECT_THAT(html, Not(HasSubstr("alert(1)</script>")));
  EXPECT_THAT(html, Not(HasSubstr("<!--")));
  const Json held = Json::parse(DocumentsIn(html));
  EXPECT_EQ(held["documents"]["campaigns/" + hostile]["name"], hostile);
}

}  // namespace
}  // namespace calib::report
