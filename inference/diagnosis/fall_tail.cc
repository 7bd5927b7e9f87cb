#include "inference/diagnosis/fall_tail.h"

#include <algorithm>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <cstddef>
#include <functional>
#include <limits>
#include <numeric>

namespace calib::inference {
namespace {

constexpr std::size_t kCounted = 10;  // largest simulations that a chance is counted from

}  // namespace

double ChanceOfFall(double fall, Falls falls) {
  std::vector<double>& simulated = falls.simulated;
  const auto n = static_cast<double>(simulated.size());
  const auto above =
      std::count_if(simulated.begin(), simulated.end(), [&](double s) { return s >= fall; });
  const double counted = (1 + static_cast<double>(above)) / (1 + n);
  const double mean = std::accumulate(simulated.begin(), simulated.end(), 0.0) / n;
  const bool few = falls.packings > 1;
  if (few && !falls.left_out && mean > 0) {
    const boost::math::fisher_f law(falls.freedom, falls.packings - 1);
    return std::max(counted, boost::math::cdf(boost::math::complement(law, fall / mean)));
  }
  if (static_cast<std::size_t>(above) >= kCounted || simulated.size() < 2 * kCounted)
    return counted;
  std::nth_element(simulated.begin(), simulated.begin() + (kCounted - 1), simulated.end(),
                   std::greater<>());
  const double anchor = simulated[kCounted - 1];
  if (!(anchor > 0)) return counted;
  const double share = (1.0 + kCounted) / (1 + n);
  double tail = 0;
  if (few) {
    const boost::math::fisher_f law(falls.freedom, falls.packings - 1);
    const double width = anchor / boost::math::quantile(boost::math::complement(law, share));
    tail = boost::math::cdf(boost::math::complement(law, fall / width));
  } else {
    const double shape = 0.5 * falls.freedom;
    const double width = anchor / (2 * boost::math::gamma_q_inv(shape, share));
    tail = boost::math::gamma_q(shape, 0.5 * fall / width);
  }
  return std::max(tail, std::numeric_limits<double>::min());
}

double SdAsked(double chance, const FittedModel& model) {
  const auto two_sided = [](const auto& law, double of) {
    return boost::math::quantile(boost::math::complement(law, 0.5 * of));
  };
  const boost::math::normal normal;
  const double known = two_sided(normal, chance);
  if (model.packings < 2) return known;
  const boost::math::students_t law(model.packings - 1);
  if (model.without.empty()) return two_sided(law, chance);
  const double share = (1.0 + kCounted) / (1 + static_cast<double>(model.draws.rows()));
  return std::max(known, two_sided(normal, share) * two_sided(law, chance) / two_sided(law, share));
}

}  // namespace calib::inference
