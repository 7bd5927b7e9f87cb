#pragma once
// A posterior as figures draw it: equally weighted draws, and the density of each parameter beside
// that of its prior.

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "calib/v1/campaign.pb.h"
#include "server/campaign/model/campaign.h"

namespace calib::report {

/// A density at points x, ascending, per unit of x. Empty: there is none.
using DensityCurve = std::vector<std::pair<double, double>>;

struct PosteriorShape {
  std::vector<std::string> parameters{};     ///< names in the order of the campaign
  std::vector<std::vector<double>> draws{};  ///< SI, one value per parameter; none: no posterior
  std::vector<DensityCurve> prior{}, density{};  ///< one per parameter
};

/// Draws: those of the posterior's record, or of samples by systematic resampling of their weights
/// [Douc, Cappe & Moulines 2005], at most 500. Density of the posterior: Gaussian kernels in the
/// standardised coordinate of the prior, their width 0.9 min(sd, IQR / 1.34) n^(-1/5)
/// [Silverman 1986, Eq. 3.31], n the effective number of samples, mirrored at finite bounds.
/// samples: with the weights of this posterior; none: not known. Pure.
PosteriorShape ShapeOf(const v1::Posterior& posterior,
                       std::span<const campaign::CalibratedParameter> parameters,
                       const std::vector<v1::Sample>& samples);

}  // namespace calib::report
