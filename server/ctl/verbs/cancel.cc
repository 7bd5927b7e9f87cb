#include "server/ctl/control.h"

namespace calib::ctl {

Verb CancelVerb() {
  return ControlVerb("cancel", "End a campaign for good, keeping what it has",
                     &client::Client::Cancel);
}

}  // namespace calib::ctl
