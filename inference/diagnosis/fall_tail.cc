#include "inference/diagnosis/fall_tail.h"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <limits>
#include <numeric>

#include "inference/numerics/special_functions.h"

namespace calib::inference {
namespace {

// Simulations at least that a chance is counted from; chosen: it is then known to a third of
// itself.
constexpr std::size_t kCounted = 10;
// Of a chi-squared: what rounding leaves of no fall. One in 12 000 of one degree is as small.
constexpr double kNoFall = 1e-8;

}  // namespace

double ChanceOfFall(double fall, Falls falls) {
  std::vector<double>& simulated = falls.simulated;
  const auto n = static_cast<double>(simulated.size());
  const auto above =
      std::count_if(simulated.begin(), simulated.end(), [&](double s) { return s >= fall; });
  const double counted = (1 + static_cast<double>(above)) / (1 + n);
  // What may only be added falls for some measurements and does nothing for the others: the law
  // holds among those that fall.
  const auto fallen =
      std::count_if(simulated.begin(), simulated.end(), [](double s) { return s > kNoFall; });
  const double falls_at_all = (1 + static_cast<double>(fallen)) / (1 + n);
  const double mean = std::accumulate(simulated.begin(), simulated.end(), 0.0) / (n * falls_at_all);
  const bool few = falls.packings > 1;
  const FisherLaw law{.numerator = static_cast<double>(falls.freedom),
                      .denominator = static_cast<double>(falls.packings - 1)};
  if (few && !falls.left_out && mean > 0)
    return std::max(counted, falls_at_all * law.Tail(fall / mean));
  if (static_cast<std::size_t>(above) >= kCounted ||
      static_cast<std::size_t>(fallen) < 2 * kCounted)
    return counted;
  std::nth_element(simulated.begin(), simulated.begin() + (kCounted - 1), simulated.end(),
                   std::greater<>());
  const double anchor = simulated[kCounted - 1];
  const double share = (1.0 + kCounted) / (1 + static_cast<double>(fallen));
  double tail = 0;
  if (few) {
    const double width = anchor / law.TailQuantile(share);
    tail = law.Tail(fall / width);
  } else {
    const double shape = 0.5 * falls.freedom;
    const double width = anchor / (2 * GammaQInverse(shape, share));
    tail = GammaQ(shape, 0.5 * fall / width);
  }
  return std::max(falls_at_all * tail, std::numeric_limits<double>::min());
}

double SdAsked(double chance, const FittedModel& model) {
  const double known = NormalTailQuantile(0.5 * chance);
  if (model.packings < 2) return known;
  const StudentLaw law{.freedom = static_cast<double>(model.packings - 1)};
  const double of_few = law.TailQuantile(0.5 * chance);
  if (model.without.empty()) return of_few;
  const double share = (1.0 + kCounted) / (1 + static_cast<double>(model.draws.rows()));
  return std::max(known, NormalTailQuantile(0.5 * share) * of_few / law.TailQuantile(0.5 * share));
}

}  // namespace calib::inference
