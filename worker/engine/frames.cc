#include "worker/engine/frames.h"

#include <cstdint>

namespace calib::worker {
namespace {

constexpr std::size_t kHead = 4;  // bytes

}  // namespace

std::string Framed(const google::protobuf::MessageLite& message) {
  const std::string body = message.SerializeAsString();
  std::string frame;
  frame.reserve(kHead + body.size());
  for (std::size_t i = 0; i < kHead; ++i) {
    frame.push_back(static_cast<char>((body.size() >> (8 * i)) & 0xffU));
  }
  return frame + body;
}

bool FrameReader::Next(google::protobuf::MessageLite& message) {
  const std::size_t there = buffer_.size() - begin_;
  if (broken_ || there < kHead) return false;
  std::size_t length = 0;
  for (std::size_t i = 0; i < kHead; ++i) {
    length |= std::size_t{static_cast<std::uint8_t>(buffer_[begin_ + i])} << (8 * i);
  }
  broken_ = length > kMostFrameBytes;
  if (broken_ || there < kHead + length) return false;
  broken_ = !message.ParseFromArray(buffer_.data() + begin_ + kHead, static_cast<int>(length));
  begin_ += kHead + length;
  if (begin_ == buffer_.size()) {
    buffer_.clear();
    begin_ = 0;
  }
  return !broken_;
}

}  // namespace calib::worker
