#include "inference/scatter/student_ratio.h"

#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <limits>

namespace calib::inference {

double StudentRatio(double freedom) { return StudentRatio(freedom, 0.05); }

double StudentRatio(double freedom, double tail) {
  using boost::math::policies::ignore_error;
  using boost::math::policies::overflow_error;
  // Of few degrees of freedom the quantiles of tiny tails are beyond all numbers.
  using Policy = boost::math::policies::policy<overflow_error<ignore_error>>;
  const boost::math::students_t_distribution<double, Policy> student(freedom);
  const boost::math::normal normal;
  if (tail <= 0) return std::numeric_limits<double>::infinity();
  const double quantile = boost::math::quantile(boost::math::complement(normal, tail));
  if (quantile < 1e-6) return boost::math::pdf(normal, 0.0) / boost::math::pdf(student, 0.0);
  return boost::math::quantile(boost::math::complement(student, tail)) / quantile;
}

}  // namespace calib::inference
