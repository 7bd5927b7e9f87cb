#pragma once
// A finite mixture of multivariate Gaussians: its density and its draws.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "inference/sampling/philox.h"

namespace calib::inference {

/// One Gaussian of a mixture in d dimensions.
struct MixtureComponent {
  double weight = 0;           ///< > 0; the weights of a mixture are normalised on use
  Eigen::VectorXd mean;        ///< d
  Eigen::MatrixXd covariance;  ///< d x d, symmetric positive definite
};

/// The mixture that the first `dimensions` coordinates of a mixture follow by themselves: the other
/// rows and columns of means and covariances left out. Precondition: 0 < dimensions <= d. Pure.
std::vector<MixtureComponent> MarginalOfFirst(std::span<const MixtureComponent> components,
                                              Eigen::Index dimensions);

/// A mixture of Gaussians with its covariances factorised. Immutable; thread safety: const.
class GaussianMixture {
 public:
  /// Precondition: at least one component, equal sizes, positive definite covariances.
  explicit GaussianMixture(std::span<const MixtureComponent> components);

  /// ln of the density at x (d), sum_k w_k N(x; m_k, C_k).                    [Cheng 2019, Eq. 22]
  double LogDensity(const Eigen::VectorXd& x) const;
  /// One draw: a component by its weight, then m + L z. Takes 1 + d numbers from the stream.
  Eigen::VectorXd Draw(PhiloxStream& stream) const;
  /// ln of the mass inside the box low < x < high (d each, +-infinity allowed); its error is that
  /// of BoxProbability (box_probability.h), 5e-5 in two dimensions and 1e-3 in six.
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
