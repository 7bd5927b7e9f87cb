#pragma once
// Four doubles as one value, for data that lie grain by grain or contact by contact in memory and
// are needed quantity by quantity: loads, stores and the transposition of four by four. Compilers
// turn them into the instructions of the function they are inlined into (CALIB_DEM_CLONES), every
// element gets the same + - * whatever these are, so bits do not depend on them.

#include <cstdint>

/// Before a function that kernels call lane by lane: it becomes part of each copy of the kernel.
#define CALIB_DEM_INLINE inline __attribute__((always_inline))

namespace calib::dem {

/// Four doubles; + - * / act on each of them alone.
using Quad = double __attribute__((vector_size(32)));
/// Result of comparing two Quads: all bits of an element are set where the comparison holds, none
/// where it does not.
using QuadMask = std::int64_t __attribute__((vector_size(32)));

/// Reads four doubles in a row from any address, aligned or not.
CALIB_DEM_INLINE void LoadQuad(const double* from, Quad& to) {
  using Loose = double __attribute__((vector_size(32), aligned(8), may_alias));
  to = *reinterpret_cast<const Loose*>(from);
}

/// Writes four doubles in a row to any address, aligned or not.
CALIB_DEM_INLINE void StoreQuad(const Quad& from, double* to) {
  using Loose = double __attribute__((vector_size(32), aligned(8), may_alias));
  *reinterpret_cast<Loose*>(to) = from;
}

/// Transposes four rows of four: element l of row q and element q of row l change places.
CALIB_DEM_INLINE void Transpose(Quad (&row)[4]) {
  const Quad low01 = __builtin_shufflevector(row[0], row[1], 0, 4, 2, 6);
  const Quad high01 = __builtin_shufflevector(row[0], row[1], 1, 5, 3, 7);
  const Quad low23 = __builtin_shufflevector(row[2], row[3], 0, 4, 2, 6);
  const Quad high23 = __builtin_shufflevector(row[2], row[3], 1, 5, 3, 7);
  row[0] = __builtin_shufflevector(low01, low23, 0, 1, 4, 5);
  row[1] = __builtin_shufflevector(high01, high23, 0, 1, 4, 5);
  row[2] = __builtin_shufflevector(low01, low23, 2, 3, 6, 7);
  row[3] = __builtin_shufflevector(high01, high23, 2, 3, 6, 7);
}

}  // namespace calib::dem
