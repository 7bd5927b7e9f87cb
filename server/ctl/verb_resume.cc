#include "server/ctl/control.h"
#include "server/ctl/verbs.h"

namespace calib::ctl {

int Resume(const Arguments& arguments) { return Control(arguments, &Client::Resume); }

}  // namespace calib::ctl
