#pragma once
// CALIB_DEM_CLONES before a kernel function: the compiler makes one copy per instruction set and
// the loader picks the widest that the CPU has. Kernels keep to + - * / sqrt and comparisons and
// nothing is contracted to fused multiply-adds (-ffp-contract=off), so every copy gives the same
// bits (tests/verification/dem/clone_bits.cc holds the copies against a build without them, which
// CALIB_DEM_NO_CLONES gives).

#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(_GLIBCXX_TSAN) && !defined(CALIB_DEM_NO_CLONES)
#define CALIB_DEM_CLONES \
  __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))
#else
#define CALIB_DEM_CLONES
#endif
