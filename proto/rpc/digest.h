#pragma once
// SHA-256, the name under which contents (packings, data files, catalogues, scenarios) are known,
// and the bytes of a message that may be named or compared so.

#include <google/protobuf/message_lite.h>

#include <memory>
#include <string>
#include <string_view>

namespace calib::rpc {

/// Digest of content that arrives in pieces. Not thread-safe.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void Update(std::string_view data);
  /// Lower-case hexadecimal digest of everything given to Update(). Call once.
  std::string Finish();

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

/// Lower-case hexadecimal SHA-256 of content.
std::string Sha256Hex(std::string_view content);

/// The same bytes for equal messages, maps in the order of their keys; SerializeAsString() promises
/// this to no one.
std::string BytesOf(const google::protobuf::MessageLite& message);

}  // namespace calib::rpc
