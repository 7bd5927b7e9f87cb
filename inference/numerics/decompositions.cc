#include "inference/numerics/decompositions.h"

namespace Eigen {

template LLT<MatrixXd>& LLT<MatrixXd>::compute<MatrixXd>(const EigenBase<MatrixXd>&);
template SelfAdjointEigenSolver<MatrixXd>& SelfAdjointEigenSolver<MatrixXd>::compute<MatrixXd>(
    const EigenBase<MatrixXd>&, int);
template class HouseholderQR<MatrixXd>;
template class ColPivHouseholderQR<MatrixXd>;

}  // namespace Eigen

namespace calib::inference {

Eigen::MatrixXd Solved(const Eigen::LLT<Eigen::MatrixXd>& factor, const Eigen::MatrixXd& right) {
  return factor.solve(right);
}

Eigen::MatrixXd LowerSolved(const Eigen::LLT<Eigen::MatrixXd>& factor,
                            const Eigen::MatrixXd& right) {
  return factor.matrixL().solve(right);
}

Eigen::MatrixXd Solved(const Eigen::ColPivHouseholderQR<Eigen::MatrixXd>& factor,
                       const Eigen::MatrixXd& right) {
  return factor.solve(right);
}

Eigen::MatrixXd OrthonormalColumns(const Eigen::HouseholderQR<Eigen::MatrixXd>& factor) {
  return factor.householderQ() * Eigen::MatrixXd::Identity(factor.rows(), factor.cols());
}

}  // namespace calib::inference
