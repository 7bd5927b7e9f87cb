#include "inference/numerics/special_functions.h"

#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <boost/math/special_functions/digamma.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <limits>

namespace calib::inference {
namespace {

namespace policies = boost::math::policies;
using InDouble = policies::policy<policies::promote_double<false>>;

// The probability beyond each end of the interval that StudentRatio(freedom) speaks of.
constexpr double kTail = 0.05;
// Normal quantiles below this one (in standard deviations) are as good as the median: the ratio of
// two of them would be one of rounding errors.
constexpr double kMedian = 1e-6;

}  // namespace

double GammaQ(double shape, double x) { return boost::math::gamma_q(shape, x); }

double GammaQInDouble(double shape, double x) { return boost::math::gamma_q(shape, x, InDouble()); }

double GammaQInverse(double shape, double q) { return boost::math::gamma_q_inv(shape, q); }

double GammaPInverse(double shape, double p) { return boost::math::gamma_p_inv(shape, p); }

double GammaRatio(double a, double delta) { return boost::math::tgamma_delta_ratio(a, delta); }

double LogGamma(double x) { return boost::math::lgamma(x, InDouble()); }

double Digamma(double x) { return boost::math::digamma(x, InDouble()); }

double NormalTailQuantile(double chance) {
  return boost::math::quantile(boost::math::complement(boost::math::normal(), chance));
}

double FisherLaw::Tail(double ratio) const {
  return boost::math::cdf(
      boost::math::complement(boost::math::fisher_f(numerator, denominator), ratio));
}

double FisherLaw::TailQuantile(double chance) const {
  return boost::math::quantile(
      boost::math::complement(boost::math::fisher_f(numerator, denominator), chance));
}

double StudentLaw::Tail(double t) const {
  return boost::math::cdf(boost::math::complement(boost::math::students_t(freedom), t));
}

double StudentLaw::TailQuantile(double chance) const {
  return boost::math::quantile(boost::math::complement(boost::math::students_t(freedom), chance));
}

double StudentRatio(double freedom) { return StudentRatio(freedom, kTail); }

double StudentRatio(double freedom, double tail) {
  // With few degrees of freedom the quantiles of tiny tails are larger than any number.
  using Infinite = policies::policy<policies::overflow_error<policies::ignore_error>>;
  const boost::math::students_t_distribution<double, Infinite> student(freedom);
  if (tail <= 0) return std::numeric_limits<double>::infinity();
  const double quantile = NormalTailQuantile(tail);
  if (quantile < kMedian)
    return boost::math::pdf(boost::math::normal(), 0.0) / boost::math::pdf(student, 0.0);
  return boost::math::quantile(boost::math::complement(student, tail)) / quantile;
}

}  // namespace calib::inference
