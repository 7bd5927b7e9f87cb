#include "inference/mixture/softmax_moments.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>

// One copy of the kernel per instruction set; the loader picks the widest that the CPU has. It
// keeps to + - * / and comparisons, and nothing is contracted to fused multiply-adds
// (-ffp-contract=off), so every copy gives the same bits.
#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define CALIB_INFERENCE_CLONES \
  __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))
#else
#define CALIB_INFERENCE_CLONES
#endif

namespace calib::inference {
namespace {

constexpr int kTogether = 4;  // components whose sums run in registers at once
using Lanes = double __attribute__((vector_size(64)));
using Bits = std::int64_t __attribute__((vector_size(64)));

// 1 / k!, the Taylor coefficients of the exponential.
constexpr std::array<double, 14> kReciprocalFactorials = [] {
  std::array<double, 14> result{};
  double factorial = 1;
  for (int k = 0; k < 14; ++k) {
    result[k] = 1 / factorial;
    factorial *= k + 1;
  }
  return result;
}();

// x <- e^x for x <= 0, -700 for what lies below it: x = n ln 2 + r, |r| <= ln 2 / 2, whose first
// neglected term r^14 / 14! is below 1e-17.
[[gnu::always_inline]] inline void Exponential(Lanes& x) {
  constexpr double kLog2E = 0x1.71547652b82fep+0;
  constexpr double kLn2High = 0x1.62e42fee00000p-1;  // with n of ten bits the product is exact
  constexpr double kLn2Low = 0x1.a39ef35793c76p-33;
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

}  // namespace

struct SoftmaxMoments::Job {
  const Group* values;
  const Group* counts;
  const double* coefficients;
  int groups, features, components, padded;
  Group* rho;
  Group* sums;
  Group* partial;
  Group* weighted;  // sum_n c_n sum_k r_nk ln (rho_nk / largest)
};

CALIB_INFERENCE_CLONES void SoftmaxMoments::Run(const Job& job) {
  Lanes weighted{};
  for (int g = 0; g < job.groups; ++g) {
    const Group* f = job.values + static_cast<std::ptrdiff_t>(g) * job.features;
    for (int k = 0; k < job.padded; k += kTogether) {
      Lanes s0{};
      Lanes s1{};
      Lanes s2{};
      Lanes s3{};
      const double* a = job.coefficients + k;
      for (int j = 0; j < job.features; ++j, a += job.padded) {
        s0 += f[j].of * a[0];
        s1 += f[j].of * a[1];
        s2 += f[j].of * a[2];
        s3 += f[j].of * a[3];
      }
      job.rho[k].of = s0;
      job.rho[k + 1].of = s1;
      job.rho[k + 2].of = s2;
      job.rho[k + 3].of = s3;
    }
    Lanes largest = job.rho[0].of;
    for (int k = 1; k < job.components; ++k)
      largest = job.rho[k].of > largest ? job.rho[k].of : largest;
    Lanes sum{};
    Lanes logs{};
    for (int k = 0; k < job.components; ++k) {
      const Lanes relative = job.rho[k].of - largest;
      Lanes share = relative;
      Exponential(share);
      sum += share;
      logs += share * relative;
      job.rho[k].of = share;
    }
    job.sums[g].of = sum;
    const Lanes scale = job.counts[g].of / sum;
    weighted += scale * logs;
    for (int k = 0; k < job.components; ++k) {
      const Lanes share = job.rho[k].of * scale;
      Group* moments = job.partial + static_cast<std::ptrdiff_t>(k) * job.features;
      for (int j = 0; j < job.features; ++j) moments[j].of += share * f[j].of;
    }
  }
  job.weighted->of = weighted;
}

double SoftmaxMoments::SumOfLanes(const Group& group) {
  double sum = 0;
  for (int lane = 0; lane < kLanes; ++lane) sum += group.of[lane];
  return sum;
}

SoftmaxMoments::SoftmaxMoments(const Eigen::MatrixXd& features, const Eigen::VectorXd& counts,
                               int components)
    : groups_(static_cast<int>((features.rows() + kLanes - 1) / kLanes)),
      features_(static_cast<int>(features.cols())),
      components_(components),
      values_(static_cast<std::size_t>(groups_) * static_cast<std::size_t>(features_)),
      counts_(static_cast<std::size_t>(groups_)),
      sums_(static_cast<std::size_t>(groups_)),
      partial_(static_cast<std::size_t>(components) * static_cast<std::size_t>(features_)),
      moments_(features_, components) {
  assert(features.rows() == counts.size() && features.size() > 0 && components >= 1);
  const auto padded =
      static_cast<std::size_t>((components + kTogether - 1) / kTogether * kTogether);
  coefficients_.assign(padded * static_cast<std::size_t>(features_), 0.0);
  rho_.resize(padded);
  for (Eigen::Index i = 0; i < features.rows(); ++i) {
    const auto group = static_cast<std::size_t>(i / kLanes);
    const auto lane = static_cast<int>(i % kLanes);
    counts_[group].of[lane] = counts[i];
    for (int j = 0; j < features_; ++j) {
      values_[group * static_cast<std::size_t>(features_) + static_cast<std::size_t>(j)].of[lane] =
          features(i, j);
    }
  }
}

void SoftmaxMoments::Pass(const Eigen::MatrixXd& coefficients) {
  assert(coefficients.rows() == features_ && coefficients.cols() == components_);
  const auto padded = static_cast<int>(rho_.size());
  for (int j = 0; j < features_; ++j) {
    for (int k = 0; k < components_; ++k)
      coefficients_[static_cast<std::size_t>(j * padded + k)] = coefficients(j, k);
  }
  std::fill(partial_.begin(), partial_.end(), Group{});
  Group weighted{};
  Run({.values = values_.data(),
       .counts = counts_.data(),
       .coefficients = coefficients_.data(),
       .groups = groups_,
       .features = features_,
       .components = components_,
       .padded = padded,
       .rho = rho_.data(),
       .sums = sums_.data(),
       .partial = partial_.data(),
       .weighted = &weighted});
  for (int k = 0; k < components_; ++k) {
    for (int j = 0; j < features_; ++j)
      moments_(j, k) = SumOfLanes(partial_[static_cast<std::size_t>(k * features_ + j)]);
  }
  entropy_ = -SumOfLanes(weighted);
  for (std::size_t g = 0; g < counts_.size(); ++g) {
    for (int lane = 0; lane < kLanes; ++lane)
      entropy_ += counts_[g].of[lane] * std::log(sums_[g].of[lane]);
  }
}

}  // namespace calib::inference
