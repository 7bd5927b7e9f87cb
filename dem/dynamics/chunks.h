#pragma once
// Loops over fixed chunks of work: the chunks, and with them every sum, are the same for any number
// of threads.

namespace calib::dem {

/// Neighbour pairs of a chunk [-], a multiple of kBlock. Chosen: the loads of a chunk's grains stay
/// in the first-level cache (dem/DECISIONS.md, loads are added up chunk by chunk). Changing it
/// changes bits.
inline constexpr int kPairChunk = 256;
/// Grains of a chunk [-]. Chosen: enough work for a thread at a time. Changing it may change bits.
inline constexpr int kGrainChunk = 256;

/// Number of chunks of `chunk` > 0 items that hold `items` >= 0 items.
inline constexpr int ChunkCount(int items, int chunk) { return (items + chunk - 1) / chunk; }

/// Calls body(c) for c in [0, count), on `threads` threads; one thread means a plain loop.
template <class Body>
void ForEachChunk(int count, int threads, const Body& body) {
  if (threads <= 1 || count < 2) {
    for (int c = 0; c < count; ++c) {
      body(c);
    }
    return;
  }
#pragma omp parallel for schedule(static) num_threads(threads)
  for (int c = 0; c < count; ++c) {
    body(c);
  }
}

}  // namespace calib::dem
