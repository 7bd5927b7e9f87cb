#include "server/campaign/model/scatter_fit.h"

#include <map>
#include <string>
#include <vector>

namespace calib::campaign {

using Eigen::Index;

inference::GroupScatter FitGroupScatter(const Campaign& campaign, const inference::DataSet& data,
                                        const inference::ReadingGroups::value_type& group,
                                        const inference::ScatterMoments& moments) {
  const auto& [key, readings] = group;
  const Experiment& experiment = campaign.experiments[static_cast<std::size_t>(key.first)];
  std::vector<int> stage;
  Eigen::VectorXd control(static_cast<Index>(readings.size()));
  std::map<std::string, int> stages;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const inference::Reading& reading = data.readings[static_cast<std::size_t>(readings[i])];
    const auto step = static_cast<std::size_t>(reading.load_step);
    const std::string name = step < experiment.segment.size() ? experiment.segment[step] : "";
    stage.push_back(stages.try_emplace(name, static_cast<int>(stages.size())).first->second);
    control[static_cast<Index>(i)] = reading.control;
  }
  inference::GroupScatter scatter = inference::FitScatter(moments, stage, control);
  scatter.experiment = key.first;
  scatter.observable = key.second;
  scatter.share = ScatterShare(experiment);
  return scatter;
}

}  // namespace calib::campaign
