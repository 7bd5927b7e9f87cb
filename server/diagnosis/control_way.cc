#include "server/diagnosis/control_way.h"

#include <algorithm>
#include <cmath>

namespace calib::diagnosis {
namespace {

constexpr int kReadings = 40;
constexpr double kUnloading = 0.1;  // of the way, once

void Branch(std::vector<double>& way, double from, double to, int count) {
  for (int i = 1; i <= count; ++i) way.push_back(from + (to - from) * i / count);
}

}  // namespace

std::vector<double> Monotonic(double start, double last) {
  std::vector<double> way;
  Branch(way, start, last, kReadings);
  return way;
}

std::vector<double> WithUnloading(double start, double last, double share) {
  const auto at = [start, last](double of_way) { return start + of_way * (last - start); };
  constexpr int kEach = kReadings / 8;  // of the unloading and of the reloading
  const int before = static_cast<int>(std::lround(kReadings * share));
  std::vector<double> way;
  Branch(way, start, at(share), before);
  Branch(way, at(share), at(share - kUnloading), kEach);
  Branch(way, at(share - kUnloading), at(share), kEach);
  Branch(way, at(share), last, kReadings - before - 2 * kEach);
  return way;
}

std::vector<double> Spread(double low, double high, std::size_t count) {
  std::vector<double> way;
  for (std::size_t i = 0; i < count; ++i) {
    const double share = count > 1 ? static_cast<double>(i) / static_cast<double>(count - 1) : 0;
    const double value = low > 0 ? low * std::pow(high / low, share) : low + share * (high - low);
    way.push_back(std::clamp(value, low, high));
  }
  return way;
}

}  // namespace calib::diagnosis
