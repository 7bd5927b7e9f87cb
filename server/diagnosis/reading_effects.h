#pragma once
// Effects of the measurement's side and of the initial state on curves that exist already: for
// campaigns whose runs were made elsewhere, where nothing can be run with and without an effect but
// what an instrument does to a curve can be calculated; and of load cells for all campaigns.

#include <Eigen/Dense>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "inference/data/data_set.h"
#include "server/campaign/model/campaign.h"

namespace calib::diagnosis {

/// Readings (n x T, SI, in the order of the data) as they are with an effect whose parameter stands
/// at these values (n, SI): what the grains do does not depend on it. Pure.
using CurveEffect =
    std::function<Eigen::MatrixXd(const Eigen::MatrixXd& readings, const Eigen::VectorXd& values)>;

/// Effects that are calculated on curves.
struct EffectsOnCurves {
  std::map<std::string, CurveEffect> by_strength{};  ///< by dotted name of the strength
  /// Effects none of whose strengths can be calculated, and why, in a clause.
  std::vector<std::pair<std::string, std::string>> impossible{};
};

/// What instruments and a denser start do to the curves of a campaign: load_cell_error (gain and
/// offset), apparatus_compliance, strain_offset and initial_density, each where the observables of
/// a calibrated experiment let it be calculated: axial and lateral stress from p and q, from q/p or
/// a stress ratio with a confining pressure, or given themselves; strains where axial strain is the
/// control. An experiment that names a test without a load on a rig shows none of the first three.
///
/// The load cell is exact (dem/effects/load_cell_error) but for where loads count from: the first
/// reading, which is the start of loading where it is read. The others are the first order of their
/// strength about zero, which is what the limit is: a strain d read too large moves a reading by
/// -d times the slope of its own curve towards the neighbour on its stage, so that d has to stay
/// below what readings are apart; a densification d lowers the porosity by d and the void ratio e
/// by d (1 + e)^2 along the whole curve, and does not alter stresses. strain_offset.stress is held
/// at a tenth of the largest load that was measured. A reading whose stresses a run does not tell,
/// or whose ratio they leave without a value, stays as it is.
EffectsOnCurves EffectsOnReadings(const campaign::Campaign& campaign);

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

}  // namespace calib::diagnosis
