#include "server/report/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>

#include "server/report/html.h"
#include "tests/unit/report/example_view.h"

namespace calib::report {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(Report, IsOneSelfContainedFile) {
  const std::string html = RenderReport(testing::ExampleView("sand"));
  EXPECT_FALSE(std::regex_search(html, std::regex("(src|href)=")));
  EXPECT_THAT(html, Not(HasSubstr("http")));
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, Not(HasSubstr("nan")));
  EXPECT_GT(html.size(), 20000U);
}

TEST(Report, EveryPictureHasATitleForScreenReaders) {
  const std::string html = RenderReport(testing::ExampleView("sand"));
  const auto count = [&html](const std::string& what) {
    int n = 0;
    for (std::size_t at = html.find(what); at != std::string::npos; at = html.find(what, at + 1)) {
      ++n;
    }
    return n;
  };
  EXPECT_GT(count("<svg "), 15);
  EXPECT_EQ(count("<svg "), count("role=\"img\""));
  EXPECT_EQ(count("<svg "), count("<title") - 1);  // the page has one too
}

TEST(Report, AHostileNameStaysText) {
  const std::string name = "</title><script>alert(1)</script><img src=x onerror='alert(2)'>\"&";
  CampaignView view = testing::ExampleView(name);
  view.status.set_reason(name);
  view.campaign.experiments[0].name = name;
  view.posterior.mutable_parameters(0)->set_name(name);
  view.posterior.add_warnings(name);
  const std::string html = RenderReport(view);
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, Not(HasSubstr("<img")));
  EXPECT_THAT(html, HasSubstr("&lt;script&gt;"));
}

TEST(Report, ACampaignWithoutAnIterationSaysSo) {
  CampaignView view = testing::ExampleView("young");
  view.posterior = v1::Posterior();
  view.iterations.clear();
  for (v1::Sample& sample : view.samples) sample.set_weight(std::nan(""));
  EXPECT_THAT(RenderReport(view), HasSubstr("No iteration is complete yet"));
}

TEST(Html, EscapesMarkupAndRepairsText) {
  EXPECT_EQ(Escape("a<b>&\"'"), "a&lt;b&gt;&amp;&quot;&#39;");
  EXPECT_EQ(Escape("\x01\x7f"), "");
  EXPECT_EQ(Escape("µ \xff"), "µ \xEF\xBF\xBD");
}

}  // namespace
}  // namespace calib::report
