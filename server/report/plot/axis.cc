#include "server/report/plot/axis.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "server/report/text/people_units.h"

namespace calib::report {
namespace {

// 1, 2, 2.5 or 5 times a power of ten, near range / wanted.
double NiceStep(double range, int wanted) {
  const double raw = range / std::max(1, wanted);
  const double power = std::pow(10, std::floor(std::log10(raw)));
  for (const double step : {1.0, 2.0, 2.5, 5.0}) {
    if (raw <= step * power * 1.0001) return step * power;
  }
  return 10 * power;
}

std::string TickLabel(double value) {
  const std::string text = Number(value, 6);
  return text.starts_with('-') ? "−" + text.substr(1) : text;
}

}  // namespace

Axis::Axis(std::string label, double min, double max, int ticks, Scale scale, bool tight)
    : label_(std::move(label)), min_(min), max_(max), scale_(scale) {
  if (!std::isfinite(min_) || !std::isfinite(max_)) std::tie(min_, max_) = std::pair(0.0, 1.0);
  if (min_ == max_) {
    const double room = min_ == 0 ? 1 : 0.1 * std::abs(min_);
    min_ -= room;
    max_ += room;
  }
  if (scale_ == Scale::kLog && min_ <= 0) scale_ = Scale::kLinear;
  if (scale_ == Scale::kLog) {
    PlaceLogTicks();
  } else {
    PlaceLinearTicks(ticks, tight);
  }
}

Axis Axis::Covering(std::string label, const std::vector<double>& values, int ticks) {
  double min = HUGE_VAL;
  double max = -HUGE_VAL;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    min = std::min(min, value);
    max = std::max(max, value);
  }
  return {std::move(label), min, max, ticks};
}

double Axis::Fraction(double value) const {
  if (scale_ == Scale::kLog) return std::log(value / min_) / std::log(max_ / min_);
  return (value - min_) / (max_ - min_);
}

void Axis::PlaceLinearTicks(int wanted, bool tight) {
  const double step = NiceStep(max_ - min_, wanted);
  // What reaches beyond a tick by less than this is drawn in the margin: no further tick for it.
  constexpr double kOverhang = 0.03;
  const double first = tight ? std::ceil(min_ / step - 1e-9) : std::floor(min_ / step + kOverhang);
  const double last = tight ? std::floor(max_ / step + 1e-9) : std::ceil(max_ / step - kOverhang);
  const auto ticks = static_cast<int>(std::round(last - first)) + 1;
  for (int k = 0; k < ticks; ++k) {
    const double value = (first + k) * step;
    ticks_.push_back({value, TickLabel(std::abs(value) < 1e-9 * step ? 0 : value)});
  }
  if (!tight) {
    min_ = first * step;
    max_ = last * step;
  }
}

void Axis::PlaceLogTicks() {
  const bool many_decades = std::log10(max_ / min_) > 2.5;
  const auto last = static_cast<int>(std::ceil(std::log10(max_)));
  for (auto decade = static_cast<int>(std::floor(std::log10(min_))); decade <= last; ++decade) {
    for (const double digit : {1.0, 2.0, 5.0}) {
      if (many_decades && digit > 1) continue;
      const double value = digit * std::pow(10, decade);
      if (value >= min_ * (1 - 1e-9) && value <= max_ * (1 + 1e-9)) {
        ticks_.push_back({value, TickLabel(value)});
      }
    }
  }
}

}  // namespace calib::report
