#include "proto/rpc/backoff.h"

#include <algorithm>

namespace calib::rpc {

Backoff::Backoff(BackoffOptions options, std::uint64_t seed)
    : options_(options),
      random_(static_cast<std::minstd_rand::result_type>(seed)),
      ceiling_ms_(static_cast<double>(options.first.count())) {}

std::chrono::milliseconds Backoff::Next() {
  std::uniform_real_distribution<double> share(0.0, 1.0);
  const double wait = std::max(1.0, share(random_) * ceiling_ms_);
  ceiling_ms_ =
      std::min(static_cast<double>(options_.longest.count()), ceiling_ms_ * options_.factor);
  return std::chrono::milliseconds(static_cast<std::int64_t>(wait));
}

void Backoff::Reset() { ceiling_ms_ = static_cast<double>(options_.first.count()); }

}  // namespace calib::rpc
