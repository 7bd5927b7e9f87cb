#pragma once
// Loops over fixed chunks of work: the chunks, and with them every sum, are the same for any number
// of threads.

namespace calib::dem {

inline constexpr int kPairChunk = 256;   ///< neighbour pairs per chunk
inline constexpr int kGrainChunk = 256;  ///< grains per chunk

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
