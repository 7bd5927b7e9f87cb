#include "dem/lab_tests/shared/mass_flow.h"

namespace calib::dem {

std::optional<double> SlopeBetween(const std::vector<double>& time, const std::vector<double>& mass,
                                   double low, double high, int fewest) {
  double n = 0;
  double t = 0;
  double m = 0;
  double tt = 0;
  double tm = 0;
  for (std::size_t k = 0; k < time.size(); ++k) {
    if (mass[k] < low || mass[k] > high) {
      continue;
    }
    n += 1;
    t += time[k];
    m += mass[k];
    tt += time[k] * time[k];
    tm += time[k] * mass[k];
  }
  const double spread = n * tt - t * t;
  if (n < fewest || !(spread > 0)) {
    return std::nullopt;
  }
  return (n * tm - t * m) / spread;
}

}  // namespace calib::dem
