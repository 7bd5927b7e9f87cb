#pragma once
// Effects of the measurement's side and of the initial state on curves that exist already: for
// campaigns whose runs were made elsewhere, where nothing can be run with and without an effect but
// what an instrument does to a curve can be calculated; and of load cells for all campaigns.

#include <Eigen/Dense>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "inference/diagnosis/screen.h"
#include "server/campaign/model/campaign.h"

namespace calib::diagnosis {

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

/// Histories as load cells with these errors read them, one gain [-] and offset [Pa] for each:
/// exact, the specimen does not feel them. histories: N x T, (prediction - reading) / sd in the
/// order of `data`. Empty where a calibrated experiment does not let it be calculated: its control
/// is a stress, or a stress is read where the readings do not tell axial and lateral stress apart;
/// and where the model has a formula on readings. Tests without a load cell stay as they are.
std::optional<Eigen::MatrixXd> MisreadLoads(const campaign::Campaign& campaign,
                                            const inference::DataSet& data,
                                            const Eigen::MatrixXd& histories,
                                            const Eigen::VectorXd& gain,
                                            const Eigen::VectorXd& offset);

/// The model joined by the effect: at every point the strength in [lowest, highest] units that
/// brings it closest to the readings. `strengths`: that of each point, in units.
inference::FittedModel Join(const inference::FittedModel& model, const ReadingEffect& effect,
                            double lowest, double highest, Eigen::VectorXd& strengths);

}  // namespace calib::diagnosis
