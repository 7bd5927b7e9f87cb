#pragma once
// One axis of a plot: the range it shows, where its ticks stand and how they are written.

#include <string>
#include <vector>

namespace calib::report {

struct Tick {
  double value = 0;
  std::string label;
};

class Axis {
 public:
  enum class Scale { kLinear, kLog };

  /// Shows at least [min, max] (equal or non-finite ends are widened), with about `ticks` round
  /// numbers. A log axis needs min > 0. With `tight` the range is exactly [min, max].
  Axis(std::string label, double min, double max, int ticks = 6, Scale scale = Scale::kLinear,
       bool tight = false);

  /// Range that covers all finite values with a little room.
  static Axis Covering(std::string label, const std::vector<double>& values, int ticks = 6);

  const std::string& label() const { return label_; }
  double min() const { return min_; }
  double max() const { return max_; }
  const std::vector<Tick>& ticks() const { return ticks_; }
  /// Position in [0, 1] between the ends; values outside are not cut off.
  double Fraction(double value) const;

 private:
  void PlaceLinearTicks(int wanted, bool tight);
  void PlaceLogTicks();

  std::string label_;
  double min_;
  double max_;
  Scale scale_;
  std::vector<Tick> ticks_;
};

}  // namespace calib::report
