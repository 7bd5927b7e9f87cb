#include "server/access/role.h"

#include <array>

namespace calib::access {
namespace {

struct RoleName {
  Role role;
  const char* name;
};
constexpr std::array<RoleName, 5> kRoleNames = {{{Role::kServer, "server"},
                                                 {Role::kWorker, "worker"},
                                                 {Role::kViewer, "viewer"},
                                                 {Role::kSubmitter, "submitter"},
                                                 {Role::kOperator, "operator"}}};

}  // namespace

std::string NameOf(Role role) {
  for (const RoleName& row : kRoleNames) {
    if (row.role == role) return row.name;
  }
  return "";
}

std::optional<Role> RoleOf(std::string_view name) {
  for (const RoleName& row : kRoleNames) {
    if (name == row.name) return row.role;
  }
  return std::nullopt;
}

std::string RoleNames() {
  std::string all;
  for (const RoleName& row : kRoleNames) {
    if (!all.empty()) all += ", ";
    all += row.name;
  }
  return all;
}

}  // namespace calib::access
