#include "worker/message_file.h"

#include <google/protobuf/util/json_util.h>

#include <fstream>
#include <iterator>

#include "absl/strings/str_cat.h"

namespace calib::worker {

std::optional<std::string> ContentOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return std::nullopt;
  return std::string(std::istreambuf_iterator<char>(file), {});
}

absl::Status ReadMessageFile(const std::string& path, google::protobuf::Message& message) {
  const auto content = ContentOf(path);
  if (!content.has_value()) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": cannot be read"));
  }
  const std::size_t first = content->find_first_not_of(" \t\r\n");
  if (first != std::string::npos && (*content)[first] == '{') {
    const auto status = google::protobuf::util::JsonStringToMessage(*content, &message);
    return status.ok() ? absl::OkStatus()
                       : absl::InvalidArgumentError(
                             absl::StrCat(path, ": ", std::string(status.message())));
  }
  if (!message.ParseFromString(*content)) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": not an ", std::string(message.GetDescriptor()->name())));
  }
  return absl::OkStatus();
}

}  // namespace calib::worker
