#include "server/access/ledger.h"

#include <gmock/gmock.h>

#include "tests/unit/access/access_fixture.h"

namespace calib::access {
namespace {

using ::testing::HasSubstr;

class LedgerFile : public AccessFixture {};

TEST_F(LedgerFile, IsReadAsItWasWritten) {
  const std::string path = At("ca/issued.csv");
  const Ledger ledger = {
      {.serial = "0af3", .name = "node7", .role = Role::kWorker, .not_after_unix_s = 1793534400},
      {.serial = "17",
       .name = "anna@example.org",
       .role = Role::kOperator,
       .not_after_unix_s = 4102444800,
       .revoked_unix_s = 1793534401}};
  ASSERT_TRUE(WriteLedger(path, ledger).ok());
  EXPECT_THAT(ReadText(path), HasSubstr("\n0af3,node7,worker,2026-11-01T12:00:00Z,\n"));
  const auto read = ReadLedger(path);
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ((*read)[i].serial, ledger[i].serial);
    EXPECT_EQ((*read)[i].name, ledger[i].name);
    EXPECT_EQ((*read)[i].role, ledger[i].role);
    EXPECT_EQ((*read)[i].not_after_unix_s, ledger[i].not_after_unix_s);
    EXPECT_EQ((*read)[i].revoked_unix_s, ledger[i].revoked_unix_s);
  }
  EXPECT_TRUE(ledger[0].IsInForce(1793534399));
  EXPECT_FALSE(ledger[0].IsInForce(1793534400));
  EXPECT_FALSE(ledger[1].IsInForce(0));
}

TEST_F(LedgerFile, ThatIsDamagedIssuesNothing) {
  const std::string path = At("ca/issued.csv");
  const std::string head = ReadText(path);
  for (const char* const row :
       {"xyz,node7,worker,2026-11-01T12:00:00Z,", "0a,no de,worker,2026-11-01T12:00:00Z,",
        "0a,node7,king,2026-11-01T12:00:00Z,", "0a,node7,worker,soon,", "0a,node7,worker", ""}) {
    WriteText(path, head + row + "\n");
    const auto read = ReadLedger(path);
    EXPECT_EQ(read.status().code(), absl::StatusCode::kFailedPrecondition) << row;
    EXPECT_THAT(std::string(read.status().message()), HasSubstr("issued.csv:2: ")) << row;
    EXPECT_EQ(Issue(ca(), {.name = "n", .role = Role::kViewer}, At("n")).status(), read.status());
  }
  WriteText(path, "");
  EXPECT_FALSE(Issue(ca(), {.name = "n", .role = Role::kViewer}, At("n")).ok())
      << "an empty file is no ledger";
  EXPECT_FALSE(std::filesystem::exists(At("n")));
}

}  // namespace
}  // namespace calib::access
