#pragma once
// A worker's stream as both ends have it: what was said and has not arrived, in order.

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "calib/v1/worker.pb.h"

namespace calib::simulation {

using Time = std::chrono::steady_clock::time_point;
using std::chrono::milliseconds;

/// What time it is, everywhere.
struct Clocks {
  Time now{};
  std::int64_t unix_ms = 1'700'000'000'000;
};

template <typename Message>
struct OnTheWay {
  Time due{};
  Message message{};
};

struct Stream {
  int number = 0;  ///< of the simulation, from 1
  int worker = 0;
  std::int64_t session = 0;  ///< as the server names it
  std::deque<OnTheWay<v1::WorkerMessage>> up{};
  std::deque<OnTheWay<v1::ServerMessage>> down{};
  std::string name{};                   ///< said by Hello, as the server has it
  bool takes = false;                   ///< a message from it is on its way to the strand
  bool has_said_all = false;            ///< the worker says nothing more
  bool cut = false;                     ///< nothing more is carried
  std::optional<absl::Status> ended{};  ///< by the server, with this
  bool server_left = false;             ///< the server has forgotten it
  bool worker_left = false;             ///< and so has the worker
};

}  // namespace calib::simulation
