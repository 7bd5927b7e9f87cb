#include "server/ctl/control.h"
#include "server/ctl/verbs.h"

namespace calib::ctl {

int Pause(const Arguments& arguments) { return Control(arguments, &client::Client::Pause); }

}  // namespace calib::ctl
