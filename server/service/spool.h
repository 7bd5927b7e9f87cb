#pragma once
// A content on its way into the store: in a file without a name beside the database, so that memory
// holds one piece of it at a time and nothing is left behind.

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "calib/v1/common.pb.h"
#include "proto/rpc/digest.h"

namespace calib::service {

/// Not thread-safe.
class Spool {
 public:
  /// RESOURCE_EXHAUSTED: no file can be made in the folder.
  static absl::StatusOr<std::unique_ptr<Spool>> Open(const std::string& folder, std::int64_t most);
  ~Spool();
  Spool(const Spool&) = delete;
  Spool& operator=(const Spool&) = delete;

  /// INVALID_ARGUMENT: no digest in the first chunk. RESOURCE_EXHAUSTED: it has grown larger than
  /// `most` bytes, or the disk is full.
  absl::Status Add(const v1::BlobChunk& chunk);
  /// Once, after the last chunk. INVALID_ARGUMENT: not the content whose digest it came with.
  absl::Status Finish();

  const std::string& digest() const { return digest_; }
  std::int64_t bytes() const { return bytes_; }
  /// All of the span, from this byte on; false: it cannot be read.
  bool Read(std::int64_t from, std::span<char> to) const;

 private:
  Spool(int file, std::int64_t most) : file_(file), most_(most) {}

  const int file_;
  const std::int64_t most_;
  std::string digest_;
  std::int64_t bytes_ = 0;
  rpc::Sha256 found_;
};

}  // namespace calib::service
