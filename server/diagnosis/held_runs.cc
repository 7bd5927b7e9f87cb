#include "server/diagnosis/held_runs.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "dem/registry/declared_effects.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

// Whether a row has an effect that is not in the race. parameters: of the effects, in the order of
// the names.
bool HasAnother(const campaign::Campaign& campaign, const std::vector<std::string>& racing,
                const Eigen::RowVectorXd& parameters) {
  Index column = 0;
  for (const dem::UserEffect& effect : campaign.model.user_effects) {
    const std::vector<std::string>& acting = campaign.model.effects;
    if (std::find(acting.begin(), acting.end(), effect.info.name) != acting.end()) continue;
    const bool takes_part =
        std::find(racing.begin(), racing.end(), effect.info.name) != racing.end();
    for (const dem::ParameterInfo& own : effect.info.parameters) {
      const double value = parameters[column++];
      if (!takes_part && own.null_value && value != *own.null_value) return true;
    }
  }
  return false;
}

}  // namespace

EndedBatch HeldRuns(const campaign::Campaign& campaign, const DesignRows& rows, int first_stream) {
  EndedBatch batch{.stage = campaign::SamplePurpose::kMain};
  if (!campaign.precomputed) return batch;
  const campaign::RunsWithEffects& held = campaign.precomputed->with_effects;
  const inference::DataSet data = campaign::MakeDataSet(campaign);
  const auto d = static_cast<Index>(campaign.parameters.size());
  std::map<std::string, Index> column_of;
  for (Index j = 0; j < d; ++j)
    column_of[campaign.parameters[static_cast<std::size_t>(j)].name] = j;
  for (std::size_t k = 0; k < held.names.size(); ++k)
    column_of[held.names[k]] = d + static_cast<Index>(k);
  const std::vector<double> without = rows.WithoutEffects();
  const std::vector<std::string> racing = rows.race().Names();
  for (Index i = 0; i < held.parameters.rows(); ++i) {
    const auto effects = static_cast<Index>(held.names.size());
    if (HasAnother(campaign, racing, held.parameters.row(i).tail(effects))) continue;
    EndedRun& ended = batch.runs.emplace_back();
    ended.run = {.values = without, .stream = first_stream + static_cast<int>(i)};
    for (std::size_t j = 0; j < rows.names().size(); ++j) {
      const auto found = column_of.find(rows.names()[j]);
      if (found != column_of.end()) ended.run.values[j] = held.parameters(i, found->second);
    }
    Eigen::RowVectorXd readings(static_cast<Index>(data.readings.size()));
    for (Index t = 0; t < readings.size(); ++t) {
      const inference::Reading& at = data.readings[static_cast<std::size_t>(t)];
      const auto experiment = static_cast<std::size_t>(at.experiment);
      const std::size_t width = campaign.experiments[experiment].observables.size();
      readings[t] = held.values[experiment][static_cast<std::size_t>(i)]
                               [static_cast<std::size_t>(at.load_step) * width +
                                static_cast<std::size_t>(at.observable)];
    }
    if (readings.allFinite()) {
      ended.readings = std::move(readings);
    } else {
      ended.reason = "the table of states lacks some of it";
    }
  }
  return batch;
}

}  // namespace calib::diagnosis
