#pragma once
// A posterior that comes from weights, widened by what refits of the packings say.

#include <span>

#include "inference/data/data_set.h"
#include "inference/filter/iterative_filter.h"
#include "inference/prior/joint_prior.h"
#include "inference/scatter/refit_spread.h"

namespace calib::inference {

/// Widens sd and quantiles of the posterior's parameters (means stay) until it covers refits of the
/// replicates (SpreadOfRefits in scatter/refit_spread.h), by 2000 equally weighted draws of its
/// samples. Returns the largest factor on an sd, 1 where refits scatter as the covariance says.
/// Deterministic in seed. data: with errors about a run; iterations: those the posterior is of.
/// Precondition: the weights carry the posterior (Posterior::degeneracy is empty).
double WidenByRefits(const JointPrior& priors, const DataSet& data, const Replicates& replicates,
                     std::span<const Iteration> iterations, std::uint64_t seed,
                     Posterior& posterior);

}  // namespace calib::inference
