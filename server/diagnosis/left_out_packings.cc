#include "server/diagnosis/left_out_packings.h"

#include <algorithm>
#include <cstddef>
#include <numeric>

#include "inference/scatter/scatter.h"
#include "server/campaign/model/scatter_fit.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

// Rows of the departures of the replicates on all packings but those of one group.
std::vector<Index> ReplicatesWithout(int left_out, int groups,
                                     const report::ScatteredReadings& readings) {
  std::vector<Index> replicates;
  for (std::size_t r = 0; r < readings.departure_stream.size(); ++r) {
    if (readings.departure_stream[r] % groups == left_out) continue;
    replicates.push_back(static_cast<Index>(r));
  }
  return replicates;
}

std::vector<Index> AllBut(int left_out, int count) {
  std::vector<Index> others;
  for (int i = 0; i < count; ++i) {
    if (i != left_out) others.push_back(i);
  }
  return others;
}

}  // namespace

int PackingsApart(const campaign::Campaign& campaign) {
  int packings = 0;
  for (const campaign::Experiment& experiment : campaign.experiments) {
    if (experiment.role != campaign::Role::kCalibrate || experiment.specimens.size() < 2) continue;
    packings = std::gcd(packings, static_cast<int>(experiment.specimens.size()));
  }
  return std::max(1, packings);
}

std::vector<std::optional<Eigen::MatrixXd>> ClosedFormsWithout(
    const campaign::Campaign& campaign, const report::ScatteredReadings& readings) {
  std::vector<std::optional<Eigen::MatrixXd>> forms;
  const bool twins = readings.twins.rows() > 0;
  const int groups = twins ? static_cast<int>(readings.twins.rows()) : PackingsApart(campaign);
  if (groups < 2 || !readings.measured) return forms;
  const inference::DataSet plain = campaign::MakeDataSet(campaign);
  const auto t = static_cast<Index>(plain.readings.size());
  Eigen::VectorXd inverse(t);
  for (Index k = 0; k < t; ++k) {
    inverse[k] = 1 / readings.of_mean.readings[static_cast<std::size_t>(k)].sd;
  }
  for (int left_out = 0; left_out < groups; ++left_out) {
    std::optional<Eigen::MatrixXd>& form = forms.emplace_back();
    const std::vector<Index> replicates =
        twins ? AllBut(left_out, groups) : ReplicatesWithout(left_out, groups, readings);
    if (replicates.size() < 2) continue;
    form = Eigen::MatrixXd::Zero(t, t);
    const Eigen::MatrixXd& departures = twins ? readings.twins : readings.departures;
    for (const auto& group : inference::GroupsOf(plain)) {
      const std::vector<int>& own = group.second;
      (*form)(own, own) = inference::ScatterCovariance(campaign::FitGroupScatter(
          campaign, plain, group, inference::MomentsOfReplicates(departures(replicates, own))));
    }
    *form = inverse.asDiagonal() * *form * inverse.asDiagonal();
  }
  return forms;
}

}  // namespace calib::diagnosis
