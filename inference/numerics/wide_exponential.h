#pragma once
// The exponential of eight numbers at once, for the loops over samples that consist of little else.

#include <array>
#include <cstddef>
#include <cstdint>

// CALIB_INFERENCE_CLONES before a function: one copy of it per instruction set, of which the loader
// picks the widest that the CPU has. Such functions keep to + - * / and comparisons, and nothing is
// contracted to fused multiply-adds (-ffp-contract=off), so every copy gives the same bits.
#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(_GLIBCXX_TSAN)
#define CALIB_INFERENCE_CLONES \
  __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))
#else
#define CALIB_INFERENCE_CLONES
#endif

namespace calib::inference {

/// Numbers that are treated side by side: as many doubles as the widest x86 register holds.
constexpr int kLanes = 8;
/// kLanes doubles, with the arithmetic of GCC's vector extension lane by lane.
using Lanes = double __attribute__((vector_size(64)));
/// kLanes integers, the bits of Lanes.
using Bits = std::int64_t __attribute__((vector_size(64)));

/// 1 / k!, the Taylor coefficients of the exponential.
inline constexpr std::array<double, 14> kReciprocalFactorials = [] {
  std::array<double, 14> result{};
  double factorial = 1;
  for (int k = 0; k < 14; ++k) {
    result[k] = 1 / factorial;
    factorial *= k + 1;
  }
  return result;
}();

/// x <- e^x in each lane, x <= 0; an x below -700 is taken for -700, whose exponential is still a
/// normal number. x = n ln 2 + r with |r| <= ln 2 / 2, e^r by its Taylor polynomial of degree 13,
/// whose first neglected term r^14 / 14! is below 1e-17.
[[gnu::always_inline]] inline void Exponential(Lanes& x) {
  constexpr double kLog2E = 0x1.71547652b82fep+0;    // 1 / ln 2
  constexpr double kLn2High = 0x1.62e42fee00000p-1;  // with n of ten bits the product is exact
  constexpr double kLn2Low = 0x1.a39ef35793c76p-33;  // ln 2 - kLn2High
  constexpr double kRound = 0x1.8p52;  // adding it leaves the nearest integer in the low bits
  const Lanes least = Lanes{} - 700.0;
  x = x > least ? x : least;
  const Lanes shifted = x * kLog2E + kRound;
  const Lanes n = shifted - kRound;
  const Lanes r = (x - n * kLn2High) - n * kLn2Low;
  Lanes sum = Lanes{} + kReciprocalFactorials[13];
  for (int k = 12; k >= 0; --k) sum = sum * r + kReciprocalFactorials[static_cast<std::size_t>(k)];
  const Bits exponent = (reinterpret_cast<Bits>(shifted) + 1023) << 52;
  x = sum * reinterpret_cast<Lanes>(exponent);
}

}  // namespace calib::inference
