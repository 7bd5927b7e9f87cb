#pragma once
// Messages one after the other over a pipe: four bytes of length, the least first, then the
// message.

#include <google/protobuf/message_lite.h>

#include <cstddef>
#include <string>
#include <string_view>

namespace calib::worker {

/// Larger is no message of ours. chosen: content comes in one piece, and a mesh may have hundreds
/// of megabytes
constexpr std::size_t kMostFrameBytes = std::size_t{1} << 30;

/// A message as it goes over the pipe.
std::string Framed(const google::protobuf::MessageLite& message);

/// Takes bytes as they come and gives messages as they are whole. One thread.
class FrameReader {
 public:
  void Add(std::string_view bytes) { buffer_.append(bytes); }
  /// Whether a message was whole and has been parsed into `message`. broken() afterwards: what came
  /// is none, and nothing more is read.
  bool Next(google::protobuf::MessageLite& message);
  bool broken() const { return broken_; }

 private:
  std::string buffer_;
  std::size_t begin_ = 0;  // of what is not read yet
  bool broken_ = false;
};

}  // namespace calib::worker
