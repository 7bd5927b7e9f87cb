#pragma once
// How fast this machine runs the mechanics.

#include <chrono>

namespace calib::worker {

/// Contact updates per second of one thread, measured on a short isotropic compression of a small
/// specimen. Takes about `duration`.
double MeasureThroughput(std::chrono::milliseconds duration);

}  // namespace calib::worker
