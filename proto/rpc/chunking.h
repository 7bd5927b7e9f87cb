#pragma once
// Files travel as streams of BlobChunk, each well below the message limit, named by the digest of
// the whole.

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/v1/common.pb.h"
#include "proto/rpc/digest.h"

namespace calib::rpc {

/// Content of one chunk at most [bytes]: far below the 4 MiB of a gRPC message.
inline constexpr std::size_t kChunkBytes = std::size_t{512} * 1024;
/// Content of a file at most [bytes]; it is put together in memory.
inline constexpr std::size_t kLargestBlob = std::size_t{256} * 1024 * 1024;

/// Content as chunks in order; the first carries the digest. Empty content is one chunk without
/// data.
std::vector<v1::BlobChunk> ToChunks(const std::string& content);

/// Puts chunks together again. Not thread-safe.
class BlobAssembler {
 public:
  /// INVALID_ARGUMENT: no digest in the first chunk; RESOURCE_EXHAUSTED: larger than kLargestBlob.
  absl::Status Add(const v1::BlobChunk& chunk);
  /// The content, or INVALID_ARGUMENT when it does not have the digest it came with.
  absl::StatusOr<std::string> Finish();
  const std::string& digest() const { return digest_; }

 private:
  std::string digest_;
  std::string content_;
};

}  // namespace calib::rpc
