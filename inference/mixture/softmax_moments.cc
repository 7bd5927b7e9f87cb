#include "inference/mixture/softmax_moments.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>

#include "inference/numerics/wide_exponential.h"

namespace calib::inference {
namespace {

constexpr int kTogether = 4;  // components whose sums run in registers at once

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
  const std::size_t padded =
      (static_cast<std::size_t>(components) + kTogether - 1) / kTogether * kTogether;
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
  const std::size_t padded = rho_.size();
  for (int j = 0; j < features_; ++j) {
    for (int k = 0; k < components_; ++k) {
      coefficients_[static_cast<std::size_t>(j) * padded + static_cast<std::size_t>(k)] =
          coefficients(j, k);
    }
  }
  std::fill(partial_.begin(), partial_.end(), Group{});
  Group weighted{};
  Run({.values = values_.data(),
       .counts = counts_.data(),
       .coefficients = coefficients_.data(),
       .groups = groups_,
       .features = features_,
       .components = components_,
       .padded = static_cast<int>(padded),
       .rho = rho_.data(),
       .sums = sums_.data(),
       .partial = partial_.data(),
       .weighted = &weighted});
  for (int k = 0; k < components_; ++k) {
    for (int j = 0; j < features_; ++j) {
      moments_(j, k) =
          SumOfLanes(partial_[static_cast<std::size_t>(k) * static_cast<std::size_t>(features_) +
                              static_cast<std::size_t>(j)]);
    }
  }
  entropy_ = -SumOfLanes(weighted);
  for (std::size_t g = 0; g < counts_.size(); ++g) {
    for (int lane = 0; lane < kLanes; ++lane)
      entropy_ += counts_[g].of[lane] * std::log(sums_[g].of[lane]);
  }
}

}  // namespace calib::inference
