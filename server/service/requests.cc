#include "server/service/requests.h"

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"

namespace calib::service {

std::string RequestKey(const Caller& caller, const std::string& id) {
  // No name has a colon (access::IsName).
  return id.empty() || caller.role == access::Role::kOperator ? id
                                                              : absl::StrCat(caller.name, ":", id);
}

absl::StatusOr<std::optional<std::string>> Requests::Begin(const std::string& key,
                                                           const std::string& digest,
                                                           store::Reader& reader) {
  if (key.empty()) {
    return std::optional<std::string>();
  }
  ASSIGN_OR_RETURN(const auto stored, reader.Request(key));
  if (stored.has_value()) {
    if (stored->digest != digest) {
      return absl::AlreadyExistsError(
          absl::StrCat("request ", key, " was made before with another content"));
    }
    return std::optional<std::string>(stored->answer);
  }
  if (!in_progress_.insert(key).second) {
    return absl::UnavailableError(absl::StrCat("request ", key, " is in progress"));
  }
  return std::optional<std::string>();
}

}  // namespace calib::service
