#pragma once
// An input of a service's target: messages, one after the other, each with the method that it is
// for.

#include <google/protobuf/message.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace calib::fuzz {

struct Method {
  const char* name;
  const google::protobuf::Message* prototype;  ///< of what it is called with
};
/// Of the target; defined beside it.
std::span<const Method> Methods();

struct Call {
  std::uint8_t method = 0;  ///< index of Methods(), modulo their number
  std::string bytes;        ///< of the message, on the wire
};

/// Binary: [method, length (2 bytes, low one first), message]..., lengths beyond the end cut to it.
/// As people write it: begins with "call "; "call NAME" and below it the message as protobuf's
/// text, until the next such line; what cannot be read is left out. At most 32 calls.
std::vector<Call> CallsOf(std::string_view input);
/// The binary form.
std::string BytesOf(const std::vector<Call>& calls);

/// The message as a server would get it; nothing where gRPC would refuse it before.
std::unique_ptr<google::protobuf::Message> MessageOf(const Call& call);

}  // namespace calib::fuzz
