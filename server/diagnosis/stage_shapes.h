#pragma once
// Shapes along the path that the misfit of a missing effect may have: it lasts for a stage of
// loading, while chi-squared over all readings spreads its power over everything that scatters.

#include <Eigen/Dense>
#include <vector>

#include "inference/data/data_set.h"
#include "server/campaign/model/campaign.h"

namespace calib::diagnosis {

/// Sets of shapes over the T readings of `data`: a constant in each stage of each observable of
/// each experiment; and a constant and, in stages of at least four readings, a trend [Neyman's
/// smooth test, Skandinavisk Aktuarietidskrift 20 (1937) 149, by stage]. T x q each; sets with q
/// above T / 2 are left out.
std::vector<Eigen::MatrixXd> StageShapes(const campaign::Campaign& campaign,
                                         const inference::DataSet& data);

}  // namespace calib::diagnosis
