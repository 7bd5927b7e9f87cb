#include "server/client/interrupt.h"

#include <csignal>

namespace calib::client {
namespace {

volatile std::sig_atomic_t interrupted = 0;

extern "C" void OnSignal(int signal) {
  interrupted = 1;
  std::signal(signal, SIG_DFL);
}

}  // namespace

void CatchInterrupts() {
  std::signal(SIGINT, &OnSignal);
  std::signal(SIGTERM, &OnSignal);
}

bool Interrupted() { return interrupted != 0; }

}  // namespace calib::client
