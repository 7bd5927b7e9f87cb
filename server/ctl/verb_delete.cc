#include <iostream>

#include "server/ctl/exit_codes.h"
#include "server/ctl/session.h"
#include "server/ctl/verbs.h"

namespace calib::ctl {

int Delete(const Arguments& arguments) {
  const auto session = Session::Open(arguments);
  if (!session.ok()) return Fail(session.status());
  if (auto deleted = (*session)->client().Delete(arguments.campaign); !deleted.ok()) {
    return Fail(deleted);
  }
  if (arguments.json) {
    std::cout << "{\"deleted\": true}\n";
  } else {
    std::cout << arguments.campaign << " is deleted.\n";
  }
  return kDone;
}

}  // namespace calib::ctl
