#include "inference/scatter/packing_scatter.h"

#include <cassert>
#include <cmath>
#include <cstddef>
#include <map>

#include "inference/scatter/shrunk_covariance.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// What runs depart by from the mean over their packings.
struct Departures {
  Eigen::MatrixXd rows;      // n x T
  std::vector<int> packing;  // n
};

// Departures of the runs on all packings but one from the mean over those.
Departures Without(int left_out, const Eigen::MatrixXd& departures,
                   const std::vector<int>& packing) {
  std::map<int, std::vector<Index>> by_packing;
  std::vector<Index> kept;
  Departures others;
  for (std::size_t i = 0; i < packing.size(); ++i) {
    if (packing[i] == left_out) continue;
    by_packing[packing[i]].push_back(static_cast<Index>(i));
    kept.push_back(static_cast<Index>(i));
    others.packing.push_back(packing[i]);
  }
  const auto count = static_cast<double>(by_packing.size());
  Eigen::RowVectorXd mean = Eigen::RowVectorXd::Zero(departures.cols());
  for (const auto& [number, own] : by_packing) {
    mean += departures(own, Eigen::all).colwise().mean() / count;
  }
  // The variance about the mean over n packings is 1 - 1/n of that about the true one.
  const double scale = std::sqrt((1 - 1 / (count + 1)) / (1 - 1 / count));
  others.rows = scale * (departures(kept, Eigen::all).rowwise() - mean);
  return others;
}

}  // namespace

PackingScatter ScatterBetweenPackings(
    const Eigen::MatrixXd& departures, const std::vector<int>& packing,
    const std::function<Eigen::MatrixXd(std::optional<int> left_out)>& closed_form,
    const Eigen::MatrixXd& rest) {
  assert(static_cast<Index>(packing.size()) == departures.rows());
  const auto covariance_of = [&](const Departures& seen, std::optional<int> left_out) {
    const Eigen::MatrixXd target = closed_form(left_out);
    return Eigen::MatrixXd(
        rest + ShrinkCovariance(seen.rows, seen.packing, target, rest + target).covariance);
  };
  PackingScatter scatter;
  std::map<int, int> place;
  for (const int one : packing) place.emplace(one, 0);
  assert(place.size() > 2);
  for (auto& [one, number] : place) {
    number = static_cast<int>(scatter.without.size());
    scatter.without.push_back(covariance_of(Without(one, departures, packing), one));
  }
  for (const int one : packing) scatter.group.push_back(place.at(one));
  scatter.covariance = covariance_of({.rows = departures, .packing = packing}, std::nullopt);
  return scatter;
}

}  // namespace calib::inference
