#include "server/report/views/next_command.h"

#include <gtest/gtest.h>

namespace calib::report {
namespace {

v1::CampaignStatus In(const std::string& state, const std::string& method = "tmcmc") {
  v1::CampaignStatus status;
  status.set_campaign("c1");
  status.set_state(state);
  status.set_method(method);
  status.set_infers_nothing(std::string(method) == "design");
  return status;
}

StoredDiagnosis Of(const std::string& verdict, bool only_adequacy = false) {
  return {.verdict = verdict, .only_adequacy = only_adequacy};
}

std::string After(const StoredDiagnosis& diagnosis, bool improved = false) {
  return NextCommand(In("finished"), &diagnosis, improved);
}

TEST(NextCommand, FollowsFromTheStateAndWhatWasConcluded) {
  EXPECT_EQ(NextCommand(In("queued"), nullptr, false), "calibctl watch c1");
  EXPECT_EQ(NextCommand(In("running"), nullptr, false), "calibctl watch c1");
  EXPECT_EQ(NextCommand(In("paused"), nullptr, false), "calibctl resume c1");
  EXPECT_EQ(NextCommand(In("cancelled"), nullptr, false), "");
  EXPECT_EQ(NextCommand(In("failed"), nullptr, false), "");
  EXPECT_EQ(NextCommand(In("finished", "design"), nullptr, false), "calibctl export c1 -o c1");
  EXPECT_EQ(NextCommand(In("finished"), nullptr, false), "calibctl diagnose c1");
  EXPECT_EQ(After(Of("unexplained", /*only_adequacy=*/true)), "calibctl diagnose c1");
  EXPECT_EQ(After(Of("adequate", /*only_adequacy=*/true)), "calibctl report c1 -o c1.html");
  EXPECT_EQ(After(Of("unexplained")), "calibctl compare c1");
  EXPECT_EQ(After(Of("missing_effect")), "calibctl improve c1");
  EXPECT_EQ(After(Of("ambiguous")), "calibctl improve c1");
  EXPECT_EQ(After(Of("missing_effect"), /*improved=*/true), "calibctl report c1 -o c1.html");
}

}  // namespace
}  // namespace calib::report
