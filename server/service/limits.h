#pragma once
// How much a server takes. Chosen: some times what the largest campaigns of `deploy/bench` and a
// cluster of some hundred nodes need, and little enough for a machine of a few GB.

#include <cstdint>

namespace calib::service {

struct Limits {
  // ---- of a peer, which is one connection ----
  int streams_per_peer = 64;  ///< calls open at a time, streams among them
  int blobs_per_peer = 8;     ///< contents on their way in or out at a time
  // ---- of all peers ----
  int connections = 1000;  ///< fewer where the process may not open as many files
  int blobs = 32;          ///< contents on their way at a time
  // ---- of a worker ----
  int slots = 1024;
  // ---- of what is stored and computed ----
  int campaigns = 1000;                  ///< that are not over
  std::int64_t blob_mib = 256;           ///< of one content
  std::int64_t campaign_mib = 512;       ///< of all files of one campaign
  std::int64_t samples = 100'000;        ///< of one iteration
  std::int64_t readings = 50'000;        ///< of one campaign
  std::int64_t predictions = 5'000'000;  ///< samples times readings, each 8 bytes in memory
  std::int64_t covariance = 1000;   ///< readings of one observable whose covariance is a matrix
  std::int64_t packings = 1000;     ///< of one campaign, recipes among them
  std::int64_t grains = 5'000'000;  ///< of its packing files together
};

}  // namespace calib::service
