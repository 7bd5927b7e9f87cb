#pragma once
// The engine as a program: runs what comes in on standard input (proto: engine.proto), one after
// the other, and says on standard output what comes of it.

#include <cstdint>
#include <string>

namespace calib::worker {

struct EngineChildOptions {
  std::string shared{};       ///< folder for what the engines of one worker share; empty: nothing
  std::string checkpoints{};  ///< folder for runs that rest; empty: none are kept
  std::int64_t most_checkpoint_bytes = std::int64_t{4} << 30;
};

/// Works until its input ends: 0; 1 where what came was no message. Called once, by a process that
/// does nothing else: what is printed on standard output goes to standard error from here on.
int RunEngineChild(const EngineChildOptions& options);

}  // namespace calib::worker
