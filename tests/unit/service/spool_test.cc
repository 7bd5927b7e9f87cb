#include "server/service/spool.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "proto/rpc/chunking.h"
#include "tests/support/process.h"

namespace calib::service {
namespace {

constexpr std::int64_t kMiB = std::int64_t{1} << 20;

TEST(Spool, GivesBackWhatItWasGivenAndLeavesNothingBehind) {
  const std::string folder = testing::FreshFolder("spool");
  std::string content(1'200'000, 'a');
  for (std::size_t k = 0; k < content.size(); ++k) content[k] = static_cast<char>(k % 253);
  {
    auto spool = Spool::Open(folder, 2 * kMiB);
    ASSERT_TRUE(spool.ok()) << spool.status();
    for (const v1::BlobChunk& chunk : rpc::ToChunks(content)) {
      ASSERT_TRUE((*spool)->Add(chunk).ok());
    }
    ASSERT_TRUE((*spool)->Finish().ok());
    EXPECT_EQ((*spool)->digest(), rpc::Sha256Hex(content));
    ASSERT_EQ((*spool)->bytes(), 1'200'000);
    std::string piece(1000, '\0');
    ASSERT_TRUE((*spool)->Read(1'199'000, piece));
    EXPECT_EQ(piece, content.substr(1'199'000));
    EXPECT_FALSE((*spool)->Read(1'199'001, piece)) << "there is no more";
    EXPECT_TRUE(std::filesystem::is_empty(folder)) << "a kill leaves nothing";
  }
}

TEST(Spool, RefusesAnotherContentOneThatIsTooLargeAndOneWithoutADigest) {
  const std::string folder = testing::FreshFolder("spool-refuses");
  v1::BlobChunk chunk;
  chunk.set_data("grains");
  auto nameless = Spool::Open(folder, kMiB);
  ASSERT_TRUE(nameless.ok());
  EXPECT_EQ((*nameless)->Add(chunk).code(), absl::StatusCode::kInvalidArgument);
  chunk.set_digest(rpc::Sha256Hex("sand"));
  auto other = Spool::Open(folder, kMiB);
  ASSERT_TRUE((*other)->Add(chunk).ok());
  EXPECT_EQ((*other)->Finish().code(), absl::StatusCode::kInvalidArgument);
  auto small = Spool::Open(folder, 5);
  const absl::Status large = (*small)->Add(chunk);
  EXPECT_EQ(large.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_NE(large.message().find("--max-blob-mib"), std::string::npos);
  EXPECT_EQ(Spool::Open(folder + "/none", 5).status().code(), absl::StatusCode::kResourceExhausted);
}

}  // namespace
}  // namespace calib::service
