// From a laboratory's file to a campaign, as a user types it.
#include <gmock/gmock.h>

#include "tests/integration/ctl/calibctl_fixture.h"

namespace calib::ctl {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class Inspect : public CalibctlFixture {};

constexpr const char* kDrained =
    "eps1 (%);epsv (%);q (kPa);p (kPa)\n0;0;0;200\n0,2;0,05;80;226,667\n0,5;0,08;150;250\n"
    "1;0,06;210;270\n2;-0,1;270;290\n4;-0,5;300;300\n";

TEST_F(Inspect, SaysWhatColumnsAreAndDrawsThem) {
  Write("tx.csv", kDrained);
  const Answer json = Call("inspect tx.csv --json");
  ASSERT_EQ(json.code, 0) << json.err;
  EXPECT_EQ(json.json()["decimal_mark"], "comma");
  EXPECT_EQ(json.json()["delimiter"], "semicolon");
  EXPECT_EQ(json.json()["columns"][3]["meaning"], "mean_stress");
  EXPECT_EQ(json.json()["columns"][0]["unit"], "percent");
  const Answer text = CallWith("env LC_ALL=C COLUMNS=60", "inspect tx.csv");
  EXPECT_THAT(text.out, HasSubstr("deviatoric_stress [kPa]\n"));
  EXPECT_THAT(text.out, Not(HasSubstr("\033")));
  EXPECT_EQ(Call("inspect tx.csv tx.csv --json").json().size(), 2U);
}

TEST_F(Inspect, WritesACampaignThatIsValid) {
  Write("tx.csv", kDrained);
  const Answer written = Call("inspect tx.csv --campaign out.yaml --test triaxial_drained");
  ASSERT_EQ(written.code, 0) << written.err;
  EXPECT_EQ(Call("validate out.yaml").code, 0);
}

TEST_F(Inspect, WhatIsAmbiguousIsAskedAndNothingIsWritten) {
  Write("tx.csv", "axial_strain,q\n0,0\n0.2,20\n0.4,35\n0.8,50\n");
  EXPECT_EQ(Call("inspect tx.csv").code, 0);
  const std::string command = "inspect tx.csv --campaign out.yaml --test triaxial_drained";
  const Answer asked = Call(command);
  EXPECT_EQ(asked.code, 2);
  EXPECT_THAT(asked.err, HasSubstr("ambiguous"));
  EXPECT_FALSE(std::filesystem::exists(work_ / "out.yaml"));
  const Answer told = Call(command +
                           " --meaning 'axial_strain=axial_strain[percent]'"
                           " --meaning 'q=deviatoric_stress[kPa]'");
  EXPECT_EQ(told.code, 0) << told.err;
  EXPECT_EQ(Call("validate out.yaml").code, 0);
}

TEST_F(Inspect, BadInputIsASentenceEach) {
  Write("empty.csv", "");
  Write("tx.csv", kDrained);
  EXPECT_EQ(Call("inspect empty.csv").code, 2);
  EXPECT_THAT(Call("inspect empty.csv").err, HasSubstr("empty.csv: is empty"));
  EXPECT_THAT(Call("inspect none.csv").err, HasSubstr("no such file"));
  EXPECT_EQ(Call("inspect tx.csv --meaning qq=deviatoric_stress").code, 2);
  EXPECT_EQ(Call("inspect tx.csv --meaning q=deviator").code, 2);
  EXPECT_EQ(Call("inspect tx.csv --campaign out.yaml").code, 2);
  EXPECT_EQ(Call("inspect tx.csv --campaign out.yaml --test drained").code, 2);
  EXPECT_FALSE(std::filesystem::exists(work_ / "out.yaml"));
}

}  // namespace
}  // namespace calib::ctl
