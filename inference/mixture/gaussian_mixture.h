#pragma once
// A finite mixture of multivariate Gaussians: its density and its draws.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "inference/sampling/philox.h"

namespace calib::inference {

struct MixtureComponent {
  double weight = 0;           ///< > 0; the weights of a mixture are normalised on use
  Eigen::VectorXd mean;        ///< d
  Eigen::MatrixXd covariance;  ///< d x d, symmetric positive definite
};

/// The density that the first `dimensions` coordinates have by themselves: the other rows and
/// columns of means and covariances left out. Precondition: 0 < dimensions <= d.
std::vector<MixtureComponent> MarginalOfFirst(std::span<const MixtureComponent> components,
                                              Eigen::Index dimensions);

/// Factorised mixture; const and thread safe once made. Precondition: at least one component, equal
/// sizes, positive definite covariances.
class GaussianMixture {
 public:
  explicit GaussianMixture(std::span<const MixtureComponent> components);

  /// ln sum_k w_k N(x; m_k, C_k)                                              [Cheng 2019, Eq. 22]
  double LogDensity(const Eigen::VectorXd& x) const;
  /// One draw: a component by its weight, then m + L z. Takes 1 + d numbers from the stream.
  Eigen::VectorXd Draw(PhiloxStream& stream) const;
  /// ln of the mass inside the box low < x < high; its error is that of BoxProbability
  /// (box_probability.h), 5e-5 in two dimensions and 1e-3 in six.
  double LogBoxMass(const Eigen::VectorXd& low, const Eigen::VectorXd& high) const;

 private:
  struct Factorised {
    double log_weight, log_normaliser;
    Eigen::VectorXd mean;
    Eigen::MatrixXd cholesky;  // lower
  };
  std::vector<Factorised> components_;
};

}  // namespace calib::inference
