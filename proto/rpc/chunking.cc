#include "proto/rpc/chunking.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

namespace calib::rpc {

std::vector<v1::BlobChunk> ToChunks(const std::string& content) {
  std::vector<v1::BlobChunk> chunks(1);
  chunks.front().set_digest(Sha256Hex(content));
  for (std::size_t at = 0; at < content.size(); at += kChunkBytes) {
    if (at > 0) {
      chunks.emplace_back();
    }
    chunks.back().set_data(content.substr(at, kChunkBytes));
  }
  return chunks;
}

absl::Status BlobAssembler::Add(const v1::BlobChunk& chunk) {
  if (digest_.empty()) {
    digest_ = chunk.digest();
  }
  if (digest_.empty()) {
    return absl::InvalidArgumentError("the first chunk of a blob must carry its digest");
  }
  if (content_.size() + chunk.data().size() > kLargestBlob) {
    return absl::ResourceExhaustedError(
        absl::StrCat("blob ", digest_, " is larger than the ", kLargestBlob, " bytes allowed"));
  }
  content_ += chunk.data();
  return absl::OkStatus();
}

absl::StatusOr<std::string> BlobAssembler::Finish() {
  if (digest_.empty()) {
    return absl::InvalidArgumentError("an empty stream is no blob");
  }
  if (const std::string found = Sha256Hex(content_); found != digest_) {
    return absl::InvalidArgumentError(
        absl::StrCat("content has SHA-256 ", found, " but was sent as ", digest_));
  }
  return std::move(content_);
}

}  // namespace calib::rpc
