#include "server/access/role.h"

#include <gtest/gtest.h>

namespace calib::access {
namespace {

TEST(Role, NamesAreReadBack) {
  for (const Role role :
       {Role::kServer, Role::kWorker, Role::kViewer, Role::kSubmitter, Role::kOperator}) {
    EXPECT_EQ(RoleOf(NameOf(role)), role);
  }
  EXPECT_EQ(RoleNames(), "server, worker, viewer, submitter, operator");
  for (const char* const none : {"", "root", "Worker", "worker ", "work"}) {
    EXPECT_EQ(RoleOf(none), std::nullopt) << none;
  }
}

}  // namespace
}  // namespace calib::access
