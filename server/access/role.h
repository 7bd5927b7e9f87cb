#pragma once
// What the holder of a certificate may do.

#include <optional>
#include <string>
#include <string_view>

namespace calib::access {

/// kServer is who listens, all others are who asks.
enum class Role { kServer, kWorker, kViewer, kSubmitter, kOperator };

std::string NameOf(Role role);  ///< "server", "worker", "viewer", "submitter", "operator"
/// The role of that name; none where it names none. Names are in lower case.
std::optional<Role> RoleOf(std::string_view name);
std::string RoleNames();  ///< all of them, for messages: "server, worker, ..."

}  // namespace calib::access
