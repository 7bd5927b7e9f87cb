#pragma once
// Ctrl-C and SIGTERM as a flag to look at, so that a verb can end in order.

namespace calib::client {

/// From now on the signals only set the flag; a second one ends the process at once.
void CatchInterrupts();
bool Interrupted();

}  // namespace calib::client
