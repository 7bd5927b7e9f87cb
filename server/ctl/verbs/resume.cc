#include "server/ctl/control.h"

namespace calib::ctl {

Verb ResumeVerb() {
  return ControlVerb("resume", "Go on with a paused campaign", &client::Client::Resume);
}

}  // namespace calib::ctl
