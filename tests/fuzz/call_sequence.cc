#include "tests/fuzz/call_sequence.h"

#include <google/protobuf/io/tokenizer.h>
#include <google/protobuf/text_format.h>

#include <algorithm>

namespace calib::fuzz {
namespace {

constexpr std::size_t kMostCalls = 32;
constexpr std::string_view kWord = "call ";

/// Says nothing of texts that cannot be read: inputs are full of them.
class Silent final : public google::protobuf::io::ErrorCollector {
 public:
  void AddError(int /*line*/, google::protobuf::io::ColumnNumber /*column*/,
                const std::string& /*message*/) override {}
};

std::vector<Call> FromText(std::string_view text) {
  std::vector<Call> calls;
  Silent silent;
  google::protobuf::TextFormat::Parser parser;
  parser.RecordErrorsTo(&silent);
  parser.SetRecursionLimit(20);
  while (text.starts_with(kWord) && calls.size() < kMostCalls) {
    const std::size_t line = std::min(text.find('\n'), text.size());
    const std::string_view name = text.substr(kWord.size(), line - kWord.size());
    std::size_t next = text.find("\ncall ", line);
    next = next == std::string_view::npos ? text.size() : next + 1;
    const auto methods = Methods();
    const auto found = std::find_if(methods.begin(), methods.end(),
                                    [&](const Method& method) { return name == method.name; });
    if (found != methods.end()) {
      const std::unique_ptr<google::protobuf::Message> message(found->prototype->New());
      if (parser.ParseFromString(std::string(text.substr(line, next - line)), message.get())) {
        calls.push_back({.method = static_cast<std::uint8_t>(found - methods.begin()),
                         .bytes = message->SerializeAsString()});
      }
    }
    text.remove_prefix(next);
  }
  return calls;
}

}  // namespace

std::vector<Call> CallsOf(std::string_view input) {
  if (input.starts_with(kWord)) {
    return FromText(input);
  }
  std::vector<Call> calls;
  while (input.size() >= 3 && calls.size() < kMostCalls) {
    const auto byte = [&](std::size_t k) { return static_cast<std::uint8_t>(input[k]); };
    const std::size_t length = byte(1) + 256U * byte(2);
    const auto method = byte(0);
    input.remove_prefix(3);
    const std::size_t there = std::min(length, input.size());
    calls.push_back({.method = method, .bytes = std::string(input.substr(0, there))});
    input.remove_prefix(there);
  }
  return calls;
}

std::string BytesOf(const std::vector<Call>& calls) {
  std::string bytes;
  for (const Call& call : calls) {
    const std::size_t length = std::min<std::size_t>(call.bytes.size(), 0xFFFF);
    bytes += static_cast<char>(call.method);
    bytes += static_cast<char>(length & 0xFFU);
    bytes += static_cast<char>(length >> 8U);
    bytes.append(call.bytes, 0, length);
  }
  return bytes;
}

std::unique_ptr<google::protobuf::Message> MessageOf(const Call& call) {
  const auto methods = Methods();
  std::unique_ptr<google::protobuf::Message> message(
      methods[call.method % methods.size()].prototype->New());
  if (!message->ParseFromString(call.bytes)) message.reset();
  return message;
}

}  // namespace calib::fuzz
