#include "inference/scatter/student_ratio.h"

#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>

namespace calib::inference {

double StudentRatio(double freedom) {
  constexpr double kQuantile = 0.95;
  return boost::math::quantile(boost::math::students_t(freedom), kQuantile) /
         boost::math::quantile(boost::math::normal(), kQuantile);
}

}  // namespace calib::inference
