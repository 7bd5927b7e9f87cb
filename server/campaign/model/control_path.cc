#include "server/campaign/model/control_path.h"

#include <algorithm>
#include <cmath>

namespace calib::campaign {
namespace {

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

constexpr double kMostNoise = 2e-2;  // of the range of the control, as the header says

double Threshold(const std::vector<double>& readings, double start, std::optional<double> noise) {
  if (noise) return kNoiseThatTurns * *noise;
  const auto [low, high] = std::minmax_element(readings.begin(), readings.end());
  const double range = std::max(*high, start) - std::min(*low, start);
  std::vector<double> second;
  for (std::size_t i = 2; i < readings.size(); ++i) {
    second.push_back(std::abs(readings[i] - 2 * readings[i - 1] + readings[i - 2]));
  }
  // A second difference of independent errors has the variance 6 sd^2; 1.4826 median|.| is the sd
  // of a Gaussian.
  const double sd = 1.4826 * Median(second) / std::sqrt(6.0);
  return std::clamp(6 * sd, 1e-3 * range, kMostNoise * range);
}

// Whether the first turning point is a first reading that is merely off.
bool BeginsWithOffset(const std::vector<double>& readings, double start,
                      const std::vector<std::size_t>& turning) {
  if (turning.empty() || turning.front() != 0) return false;
  const auto [low, high] = std::minmax_element(readings.begin(), readings.end());
  const double range = std::max(*high, start) - std::min(*low, start);
  const double sign = readings.front() >= start ? 1 : -1;
  const bool alone = std::none_of(readings.begin() + 1, readings.end(),
                                  [&](double value) { return sign * (value - start) > 0; });
  return alone && std::abs(readings.front() - start) <= kMostNoise * range;
}

// Zigzag: an extreme becomes a turning point once the control has come back from it by more than
// the threshold.
std::vector<std::size_t> TurningPoints(const std::vector<double>& readings, double start,
                                       double threshold) {
  std::vector<std::size_t> turning;
  int direction = 0;   // of the running branch; 0: not known yet
  double low = start;  // extremes since the start of loading
  double high = start;
  std::size_t extreme = 0;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const double value = readings[i];
    if (direction == 0) {
      low = std::min(low, value);
      high = std::max(high, value);
      if (value - low > threshold) direction = 1;
      if (high - value > threshold) direction = -1;
      extreme = i;
      continue;
    }
    const double ahead = direction * (value - readings[extreme]);
    if (ahead >= 0) {
      extreme = i;
    } else if (-ahead > threshold) {
      turning.push_back(extreme);
      direction = -direction;
      extreme = i;
    }
  }
  return turning;
}

// Pool adjacent violators: the closest non-decreasing sequence in the least-squares sense.
void MakeNonDecreasing(std::vector<double>& values) {
  struct Block {
    double mean;
    std::size_t count;
  };
  std::vector<Block> blocks;
  for (const double value : values) {
    blocks.push_back({value, 1});
    while (blocks.size() > 1 && blocks[blocks.size() - 2].mean > blocks.back().mean) {
      const Block last = blocks.back();
      blocks.pop_back();
      Block& merged = blocks.back();
      const auto total = static_cast<double>(merged.count + last.count);
      merged.mean = (merged.mean * static_cast<double>(merged.count) +
                     last.mean * static_cast<double>(last.count)) /
                    total;
      merged.count += last.count;
    }
  }
  std::size_t at = 0;
  for (const Block& block : blocks) {
    std::fill_n(values.begin() + static_cast<std::ptrdiff_t>(at), block.count, block.mean);
    at += block.count;
  }
}

// Values first..last made monotone. The begin stays as it is, and so does the end when it is a
// turning point.
void CleanBranch(std::vector<double>& values, std::size_t first, std::size_t last, bool keep_end) {
  const double begin = values[first];
  const double end = values[last];
  const double sign = end >= begin ? 1 : -1;
  std::vector<double> inner;
  for (std::size_t i = first + 1; i <= last; ++i) inner.push_back(sign * values[i]);
  if (keep_end) inner.pop_back();
  MakeNonDecreasing(inner);
  for (std::size_t k = 0; k < inner.size(); ++k) {
    double cleaned = std::max(inner[k], sign * begin);
    if (keep_end) cleaned = std::min(cleaned, sign * end);
    values[first + 1 + k] = sign * cleaned;
  }
}

constexpr double kClearDrop = 0.03;  // of the rise: less is a plateau with noise on it

// The readings that go beyond all before them in the direction of the first loading: the curve that
// unloading and reloading interrupt, and come back to.
struct PrimaryLoading {
  std::vector<std::size_t> reading;
  std::vector<double> control, strength;
  std::vector<double> volume;  // empty: not measured

  [[nodiscard]] std::size_t last() const { return reading.size() - 1; }
};

PrimaryLoading PrimaryOf(const ControlPath& path, const StageCurves& curves) {
  PrimaryLoading primary;
  const std::size_t first_end =
      path.turning.empty() ? path.points.size() - 1 : path.turning.front();
  const double sign = path.points[first_end].target >= path.points.front().target ? 1 : -1;
  const bool has_volume = curves.volume.size() == curves.strength.size();
  double furthest = path.points[first_end].target;
  for (std::size_t i = 0; i < path.points.size(); ++i) {
    const double control = path.points[i].target;
    if (i > first_end && !(sign * (control - furthest) > 0)) continue;
    if (i > first_end) furthest = control;
    primary.reading.push_back(i);
    primary.control.push_back(control);
    primary.strength.push_back(curves.strength[i]);
    if (has_volume) primary.volume.push_back(curves.volume[i]);
  }
  return primary;
}

// Index of the peak of a noisy curve, or the last one when there is none that stands out.
std::size_t ClearPeak(const std::vector<double>& strength) {
  const auto peak_at = std::max_element(strength.begin(), strength.end());
  const auto peak = static_cast<std::size_t>(peak_at - strength.begin());
  const std::size_t last = strength.size() - 1;
  const double start = strength.front();
  const double drop = *peak_at - strength[last];
  constexpr std::size_t kFewest = 2;
  return drop > kClearDrop * (*peak_at - start) && last - peak >= kFewest && peak >= 1 ? peak
                                                                                       : last;
}

// Change from index `first` to the last of the line through y over x.
double TrendFrom(const std::vector<double>& x, const std::vector<double>& y, std::size_t first) {
  const auto n = static_cast<double>(x.size() - first);
  double mean_x = 0;
  double mean_y = 0;
  for (std::size_t i = first; i < x.size(); ++i) {
    mean_x += x[i] / n;
    mean_y += y[i] / n;
  }
  double xx = 0;
  double xy = 0;
  for (std::size_t i = first; i < x.size(); ++i) {
    xx += (x[i] - mean_x) * (x[i] - mean_x);
    xy += (x[i] - mean_x) * (y[i] - mean_y);
  }
  return xx > 0 ? xy / xx * (x.back() - x[first]) : 0;
}

// First index of the steady state from `first` on; one beyond the last: there is none.
std::size_t SteadyFrom(const PrimaryLoading& primary, std::size_t first) {
  constexpr double kShare = 0.2;
  constexpr std::size_t kFewest = 5;
  constexpr double kDilatancy = 0.05;
  const auto [low, high] = std::minmax_element(primary.strength.begin(), primary.strength.end());
  const double rise = *high - *low;
  const std::vector<double>& control = primary.control;
  const double way = control.back() - control.front();
  for (std::size_t i = first; i + kFewest <= control.size(); ++i) {
    const double part = control.back() - control[i];
    if (!(std::abs(part) >= kShare * std::abs(way)) || part == 0) break;
    if (std::abs(TrendFrom(control, primary.strength, i)) > kClearDrop * rise) continue;
    if (!primary.volume.empty() &&
        std::abs(TrendFrom(control, primary.volume, i)) > kDilatancy * std::abs(part)) {
      continue;
    }
    return i;
  }
  return control.size();
}

}  // namespace

ControlPath CleanControl(const std::vector<double>& readings, double start,
                         std::optional<double> noise, bool offset_is_loading) {
  ControlPath path;
  if (readings.empty()) return path;
  path.reversal = Threshold(readings, start, noise);
  path.turning = TurningPoints(readings, start, path.reversal);
  if (!offset_is_loading && BeginsWithOffset(readings, start, path.turning)) {
    path.turning.erase(path.turning.begin());
  }
  std::vector<double> values = {start};  // the start of loading in front
  values.insert(values.end(), readings.begin(), readings.end());
  std::size_t first = 0;
  for (const std::size_t turn : path.turning) {
    CleanBranch(values, first, turn + 1, true);
    first = turn + 1;
  }
  if (first + 1 < values.size()) CleanBranch(values, first, values.size() - 1, false);
  double travelled = 0;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    travelled += std::abs(values[i + 1] - values[i]);
    path.travelled.push_back(travelled);
    path.points.push_back({.target = values[i + 1], .load_step = static_cast<int>(i)});
  }
  return path;
}

ControlPath AsRead(const std::vector<double>& readings) {
  ControlPath path;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    path.points.push_back({.target = readings[i], .load_step = static_cast<int>(i)});
    path.travelled.push_back(static_cast<double>(i + 1));
  }
  return path;
}

std::vector<std::string> NameSegments(const ControlPath& path, const StageCurves& curves) {
  std::vector<std::string> names(path.points.size(), "initial_loading");
  if (names.empty()) return names;
  for (std::size_t k = 0; k < path.turning.size(); ++k) {
    const std::string name = (k % 2 == 0 ? "unload_" : "reload_") + std::to_string(k / 2 + 1);
    std::fill(names.begin() + static_cast<std::ptrdiff_t>(path.turning[k]) + 1, names.end(), name);
  }
  if (curves.strength.size() != names.size()) return names;
  const PrimaryLoading primary = PrimaryOf(path, curves);
  const std::vector<double>& strength = primary.strength;
  const std::size_t last = primary.last();
  const std::size_t peak = ClearPeak(strength);
  const double half = 0.5 * (strength.front() + strength[peak]);
  std::size_t rising = 0;
  while (strength[rising] < half) ++rising;
  std::size_t settled = rising;  // where a steady state may begin
  if (peak != last) {
    const double near = strength[peak] - kClearDrop * (strength[peak] - strength.front());
    std::size_t before = peak;
    while (before > rising && strength[before - 1] >= near) --before;
    std::size_t behind = peak;
    while (behind < last && strength[behind + 1] >= near) ++behind;
    for (std::size_t i = rising; i <= last; ++i) {
      names[primary.reading[i]] = i < before ? "pre_peak" : (i <= behind ? "peak" : "post_peak");
    }
    settled = behind + 1;
  }
  for (std::size_t i = SteadyFrom(primary, settled); i <= last; ++i) {
    names[primary.reading[i]] = "steady_state";
  }
  return names;
}

}  // namespace calib::campaign
