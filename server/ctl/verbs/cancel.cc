#include "server/ctl/control.h"
#include "server/ctl/verbs.h"

namespace calib::ctl {

int Cancel(const Arguments& arguments) { return Control(arguments, &client::Client::Cancel); }

}  // namespace calib::ctl
