#include "proto/rpc/chunking.h"

#include <gtest/gtest.h>

#include <string>

#include "calib/v1/common.pb.h"
#include "proto/rpc/digest.h"

namespace calib::rpc {
namespace {

TEST(Digest, MatchesPublishedVectors) {  // FIPS 180-2, appendix B
  EXPECT_EQ(Sha256Hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(Sha256Hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

// The order of a map's entries in memory differs from map to map.
TEST(BytesOf, EqualMessagesHaveEqualBytes) {
  constexpr int kEntries = 64;
  v1::State rising;
  for (int i = 0; i < kEntries; ++i) (*rising.mutable_others())[std::to_string(i)] = i;
  for (int trial = 0; trial < 16; ++trial) {
    v1::State falling;
    for (int i = kEntries - 1; i >= 0; --i) (*falling.mutable_others())[std::to_string(i)] = i;
    EXPECT_EQ(BytesOf(falling), BytesOf(rising));
  }
  v1::State other = rising;
  other.mutable_others()->at("7") = 8;
  EXPECT_NE(BytesOf(other), BytesOf(rising));
}

absl::StatusOr<std::string> RoundTrip(const std::string& content) {
  BlobAssembler assembler;
  for (const auto& chunk : ToChunks(content)) {
    EXPECT_LE(chunk.data().size(), kChunkBytes);
    if (auto status = assembler.Add(chunk); !status.ok()) {
      return status;
    }
  }
  return assembler.Finish();
}

TEST(Chunking, ContentOfEverySizeComesBack) {
  for (const std::size_t size : {std::size_t{0}, std::size_t{1}, kChunkBytes - 1, kChunkBytes,
                                 kChunkBytes + 1, 3 * kChunkBytes}) {
    const std::string content(size, 'x');
    const auto back = RoundTrip(content);
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_EQ(*back, content) << size;
  }
}

TEST(Chunking, DamagedContentIsRefused) {
  auto chunks = ToChunks("grains");
  chunks.front().set_data("groins");
  BlobAssembler assembler;
  ASSERT_TRUE(assembler.Add(chunks.front()).ok());
  EXPECT_EQ(assembler.Finish().status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(Chunking, FirstChunkNeedsADigest) {
  BlobAssembler assembler;
  EXPECT_EQ(assembler.Add(v1::BlobChunk()).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(BlobAssembler().Finish().status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace calib::rpc
