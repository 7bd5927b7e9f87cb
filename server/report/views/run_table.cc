#include "server/report/views/run_table.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <map>
#include <utility>

#include "inference/scatter/refit_spread.h"
#include "inference/scatter/scatter.h"
#include "server/messages/read_words.h"
#include "server/report/views/scatter_record.h"

namespace calib::report {
namespace {

using Eigen::Index;

// Readings by (experiment, load step).
using Places = std::map<std::pair<int, int>, std::vector<Index>>;

Places PlacesOf(const inference::DataSet& data) {
  Places places;
  for (std::size_t k = 0; k < data.readings.size(); ++k) {
    const inference::Reading& reading = data.readings[k];
    places[{reading.experiment, reading.load_step}].push_back(static_cast<Index>(k));
  }
  return places;
}

void PlaceStates(const campaign::Experiment& experiment, int e, const StateHistory& history,
                 const inference::DataSet& data, const Places& places, Eigen::RowVectorXd& row) {
  std::vector<int> column;  // of each measured observable in a state; -1: not there
  for (const campaign::MeasuredObservable& observable : experiment.observables) {
    const auto at =
        std::find(history.observables.begin(), history.observables.end(), observable.name);
    column.push_back(
        at == history.observables.end() ? -1 : static_cast<int>(at - history.observables.begin()));
  }
  for (const v1::State& state : history.states) {
    const auto found = places.find({e, state.load_step()});
    if (found == places.end()) continue;
    for (const Index k : found->second) {
      const int at =
          column[static_cast<std::size_t>(data.readings[static_cast<std::size_t>(k)].observable)];
      if (at >= 0 && at < state.values_size()) row[k] = state.values(at);
    }
  }
}

// Predictions of a sample, NaN where it did not come.
Eigen::RowVectorXd HistoryOf(const CampaignView& view, int sample, const inference::DataSet& data,
                             const Places& places) {
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Constant(static_cast<Index>(data.readings.size()),
                                                        std::numeric_limits<double>::quiet_NaN());
  for (std::size_t e = 0; e < view.campaign.experiments.size(); ++e) {
    const auto found = view.states.find({view.campaign.experiments[e].name, sample});
    if (found == view.states.end()) continue;
    PlaceStates(view.campaign.experiments[e], static_cast<int>(e), found->second, data, places,
                row);
  }
  return row;
}

int StreamOf(const CampaignView& view, const v1::Sample& sample) {
  return sample.has_stream() ? sample.stream() : campaign::StreamOf(view.campaign, sample.index());
}

// Finished ones of the first `most` replicates, R x T, and the stream of each.
struct FinishedReplicates {
  Eigen::MatrixXd runs;
  std::vector<int> streams;
};

FinishedReplicates ReplicatesOf(const CampaignView& view, const inference::DataSet& data,
                                std::size_t most) {
  const Places places = PlacesOf(data);
  std::size_t replicates = 0;
  std::vector<Eigen::RowVectorXd> rows;  // of those that came to their ends
  FinishedReplicates result;
  for (const v1::Sample& sample : view.samples) {
    if (messages::PurposeOf(sample) != campaign::SamplePurpose::kReplicate || replicates == most)
      continue;
    ++replicates;
    Eigen::RowVectorXd row = HistoryOf(view, sample.index(), data, places);
    if (!row.allFinite()) continue;
    rows.push_back(std::move(row));
    result.streams.push_back(StreamOf(view, sample));
  }
  result.runs.resize(static_cast<Index>(rows.size()), static_cast<Index>(data.readings.size()));
  for (std::size_t r = 0; r < rows.size(); ++r) result.runs.row(static_cast<Index>(r)) = rows[r];
  return result;
}

// Of as many replicates as every experiment has packings.
void AddDepartures(const CampaignView& view, const inference::DataSet& data,
                   ScatteredReadings& readings) {
  FinishedReplicates finished = ReplicatesOf(view, data, campaign::PackingsOfAll(view.campaign));
  readings.departures =
      inference::ScaledDepartures(finished.runs, campaign::ScatterShares(view.campaign, data));
  if (readings.departures.rows() > 0) readings.departure_stream = std::move(finished.streams);
}

// parted: readings of the observables whose scatter twins have shown.
void AddTwins(const CampaignView& view, const inference::DataSet& data,
              const std::vector<int>& parted, ScatteredReadings& readings) {
  const FinishedReplicates all = ReplicatesOf(view, data, view.samples.size());
  if (all.runs.rows() < 2) return;
  readings.twins = Eigen::MatrixXd::Zero(all.runs.rows(), all.runs.cols());
  for (const int k : parted) {
    readings.twins.col(k) = all.runs.col(k).array() - all.runs.col(k).mean();
  }
}

}  // namespace

ScatteredReadings ReadingsWithScatter(const CampaignView& view) {
  const inference::DataSet data = campaign::MakeDataSet(view.campaign);
  std::vector<inference::GroupScatter> of_mean;
  std::vector<inference::GroupScatter> of_run;
  std::vector<int> parted;
  for (const auto& [key, readings] : inference::GroupsOf(data)) {
    const campaign::Experiment& experiment =
        view.campaign.experiments[static_cast<std::size_t>(key.first)];
    const std::string& observable =
        experiment.observables[static_cast<std::size_t>(key.second)].name;
    const v1::Posterior::Scatter* record = FindScatter(view.posterior, experiment.name, observable);
    if (record == nullptr || messages::SourceOf(*record) == campaign::ScatterSource::kEmulator ||
        record->sd_size() != static_cast<int>(readings.size())) {
      continue;
    }
    Eigen::VectorXd travelled(static_cast<Index>(readings.size()));
    for (Index i = 0; i < travelled.size(); ++i) {
      travelled[i] =
          data.readings[static_cast<std::size_t>(readings[static_cast<std::size_t>(i)])].control;
    }
    of_run.push_back(GroupScatterOf(*record, travelled));
    of_run.back().experiment = key.first;
    of_run.back().observable = key.second;
    of_mean.push_back(of_run.back());
    if (messages::SourceOf(*record) == campaign::ScatterSource::kRealizations) {
      of_mean.back().share += 1.0 / record->runs();
    } else {
      parted.insert(parted.end(), readings.begin(), readings.end());
    }
  }
  ScatteredReadings readings{.of_mean = inference::WithScatter(data, of_mean, 0),
                             .of_run = inference::WithScatter(data, of_run, 1),
                             .measured = !of_run.empty()};
  AddDepartures(view, data, readings);
  if (!parted.empty()) AddTwins(view, data, parted, readings);
  return readings;
}

RunTable RunsOf(const CampaignView& view) {
  return RunsOf(view, campaign::MakeDataSet(view.campaign));
}

RunTable RunsOf(const CampaignView& view, const inference::DataSet& units) {
  const inference::DataSet data = campaign::MakeDataSet(view.campaign);
  assert(units.readings.size() == data.readings.size());
  const Places places = PlacesOf(data);
  const auto t = static_cast<Index>(data.readings.size());
  const auto d = static_cast<Index>(view.campaign.parameters.size());
  Eigen::RowVectorXd value(t);
  Eigen::RowVectorXd sd(t);
  for (Index k = 0; k < t; ++k) {
    value[k] = data.readings[static_cast<std::size_t>(k)].value;
    sd[k] = units.readings[static_cast<std::size_t>(k)].sd;
  }
  RunTable table;
  std::vector<Eigen::RowVectorXd> parameters;
  std::vector<Eigen::RowVectorXd> histories;
  for (const v1::Sample& sample : view.samples) {
    if (sample.parameters_size() != d) continue;
    const Eigen::RowVectorXd row = HistoryOf(view, sample.index(), data, places);
    if (!row.allFinite()) continue;
    table.sample.push_back(sample.index());
    table.stream.push_back(StreamOf(view, sample));
    histories.emplace_back((row - value).cwiseQuotient(sd));
    Eigen::RowVectorXd& own = parameters.emplace_back(d);
    for (Index j = 0; j < d; ++j) own[j] = sample.parameters(static_cast<int>(j));
  }
  const auto n = static_cast<Index>(histories.size());
  table.parameters.resize(n, d);
  table.histories.resize(n, t);
  for (Index i = 0; i < n; ++i) {
    table.parameters.row(i) = parameters[static_cast<std::size_t>(i)];
    table.histories.row(i) = histories[static_cast<std::size_t>(i)];
  }
  return table;
}

}  // namespace calib::report
