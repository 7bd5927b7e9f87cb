#include "server/ctl/control.h"

namespace calib::ctl {

Verb PauseVerb() {
  return ControlVerb("pause", "Stop handing out work; nothing is lost", &client::Client::Pause);
}

}  // namespace calib::ctl
