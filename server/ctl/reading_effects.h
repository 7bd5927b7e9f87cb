#pragma once
// Effects of the measurement's side and of the initial state on curves that exist already: for
// campaigns whose runs were made elsewhere, where nothing can be run with and without an effect but
// what an instrument does to a curve can be calculated.

#include <Eigen/Dense>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "inference/diagnosis/screen.h"
#include "server/campaign/campaign.h"

namespace calib::ctl {

/// One effect at unit strength, as it acts on every history of a model.
struct ReadingEffect {
  std::string effect;      ///< as in the catalogue
  std::string parameter;   ///< dotted name of its strength
  double unit = 1;         ///< strength that `change` is for, SI
  Eigen::MatrixXd change;  ///< G x T, with minus without, over the noise sd
};

/// histories: G x T, (prediction - reading) / sd in the order of MakeDataSet. load_cell_error (gain
/// and offset), apparatus_compliance, strain_offset and initial_density, each where the observables
/// of a calibrated experiment let it be calculated: axial and lateral stress from p and q, from q/p
/// or a stress ratio with a confining pressure, or given themselves; strains where axial strain is
/// the control. `impossible` tells which cannot be, and why.
std::vector<ReadingEffect> EffectsOnReadings(
    const campaign::Campaign& campaign, const Eigen::MatrixXd& histories,
    std::vector<std::pair<std::string, std::string>>& impossible);

/// The model joined by the effect: at every point the strength in [lowest, highest] units that
/// brings it closest to the readings. `strengths`: that of each point, in units.
inference::FittedModel Join(const inference::FittedModel& model, const ReadingEffect& effect,
                            double lowest, double highest, Eigen::VectorXd& strengths);

}  // namespace calib::ctl
