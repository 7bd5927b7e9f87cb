#include "inference/diagnosis/histories.h"

#include <cassert>
#include <cmath>
#include <utility>

namespace calib::inference {

using Eigen::Index;

void Histories::SetValues(const Eigen::MatrixXd& values) {
  const Index points = values.rows();
  const Index readings = values.cols();
  if (points < readings) {
    shapes_ = values.transpose();
    coefficients_.setIdentity(points, points);
  } else {
    shapes_.setIdentity(readings, readings);
    coefficients_ = values.transpose();
  }
}

Histories::Histories(Eigen::MatrixXd shapes, Eigen::MatrixXd coefficients)
    : shapes_(std::move(shapes)), coefficients_(std::move(coefficients)) {
  assert(shapes_.cols() == coefficients_.rows());
}

Eigen::VectorXd Histories::operator[](Index point) const {
  return shapes_ * coefficients_.col(point);
}

double Histories::Rms(Index point) const {
  return std::sqrt((*this)[point].squaredNorm() / static_cast<double>(readings()));
}

Eigen::MatrixXd Histories::Values() const { return (shapes_ * coefficients_).transpose(); }

Histories Histories::At(const std::vector<Index>& readings) const {
  return {shapes_(readings, Eigen::all), coefficients_};
}

bool Histories::AllFinite() const { return shapes_.allFinite() && coefficients_.allFinite(); }

}  // namespace calib::inference
