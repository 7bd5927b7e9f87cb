#include "server/ctl/control.h"
#include "server/ctl/verbs.h"

namespace calib::ctl {

int Resume(const Arguments& arguments) { return Control(arguments, &client::Client::Resume); }

}  // namespace calib::ctl
