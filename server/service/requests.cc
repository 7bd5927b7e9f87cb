#include "server/service/requests.h"

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"

namespace calib::service {
namespace {

constexpr std::size_t kLongestId = 128 + 65;  // the id and whose it is

}  // namespace

absl::StatusOr<std::optional<std::string>> Requests::Begin(const std::string& id,
                                                           const std::string& digest,
                                                           store::Reader& reader) {
  if (id.empty()) {
    return std::optional<std::string>();
  }
  if (id.size() > kLongestId) {
    return absl::InvalidArgumentError(
        absl::StrCat("request_id has ", id.size(), " characters, at most ", kLongestId));
  }
  ASSIGN_OR_RETURN(const auto stored, reader.Request(id));
  if (stored.has_value()) {
    if (stored->digest != digest) {
      return absl::AlreadyExistsError(
          absl::StrCat("request ", id, " was made before with another content"));
    }
    return std::optional<std::string>(stored->answer);
  }
  if (!in_progress_.insert(id).second) {
    return absl::UnavailableError(absl::StrCat("request ", id, " is in progress"));
  }
  return std::optional<std::string>();
}

}  // namespace calib::service
