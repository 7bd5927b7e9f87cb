#include "server/diagnosis/run_maker.h"

#include <algorithm>
#include <cstddef>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/data/data_set.h"
#include "server/campaign/model/race.h"
#include "server/diagnosis/reading_effects.h"
#include "server/messages/read_words.h"
#include "server/report/views/run_table.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

// For each of `names` its place among the parameters of the design.
absl::StatusOr<std::vector<int>> PlacesAmong(const campaign::Campaign& design,
                                             const std::vector<std::string>& names) {
  std::vector<int> places;
  for (const std::string& name : names) {
    const auto found =
        std::find_if(design.parameters.begin(), design.parameters.end(),
                     [&name](const auto& parameter) { return parameter.name == name; });
    if (found == design.parameters.end()) break;
    places.push_back(static_cast<int>(found - design.parameters.begin()));
  }
  if (places.size() != names.size() || names.size() != design.parameters.size()) {
    return absl::FailedPreconditionError(
        absl::StrCat("the design ", design.name,
                     " was made for other parameters than this build asks for; delete it and ask "
                     "again"));
  }
  return places;
}

// An effect of the measurement on what a program answers, which knows nothing of it.
struct OwnCurveEffect {
  std::size_t place;  // of its strength among the values of a run
  double null;
  CurveEffect effect;
};

// None where runs are this program's own: those have such effects themselves.
std::vector<OwnCurveEffect> EffectsOnOwnCurves(const campaign::Campaign& campaign,
                                               const std::vector<std::string>& names) {
  std::vector<OwnCurveEffect> effects;
  if (!campaign.program) return effects;
  const EffectsOnCurves known = EffectsOnReadings(campaign);
  for (std::size_t j = 0; j < names.size(); ++j) {
    const auto found = known.by_strength.find(names[j]);
    if (found == known.by_strength.end()) continue;
    effects.push_back({.place = j,
                       .null = campaign::NullOf(campaign, names[j]).value_or(0),
                       .effect = found->second});
  }
  return effects;
}

}  // namespace

absl::StatusOr<std::vector<EndedBatch>> EndedBatchesOf(const report::CampaignView& design,
                                                       const std::vector<std::string>& names) {
  ASSIGN_OR_RETURN(const std::vector<int> places, PlacesAmong(design.campaign, names));
  const inference::DataSet data = campaign::MakeDataSet(design.campaign);
  const report::RunTable table = report::RunsOf(design);
  std::map<int, Index> row_of;  // by sample
  for (std::size_t i = 0; i < table.sample.size(); ++i)
    row_of[table.sample[i]] = static_cast<Index>(i);
  const std::vector<OwnCurveEffect> on_curves = EffectsOnOwnCurves(design.campaign, names);
  std::vector<EndedBatch> batches;
  for (const v1::Sample& sample : design.samples) {  // ascending by index
    const auto stage = messages::PurposeOf(sample);
    if (sample.iteration() < 0 || !stage || !campaign::IsStageOfDesign(*stage)) continue;
    const auto status = messages::StatusOf(sample);
    if (status == campaign::EvaluationStatus::kWaiting ||
        status == campaign::EvaluationStatus::kRunning) {
      return absl::FailedPreconditionError(absl::StrCat("run ", sample.index(), " of the design ",
                                                        design.status.campaign(), " is open"));
    }
    if (sample.iteration() >= static_cast<int>(batches.size()))
      batches.resize(static_cast<std::size_t>(sample.iteration()) + 1);
    EndedBatch& batch = batches[static_cast<std::size_t>(sample.iteration())];
    batch.stage = *stage;
    EndedRun& ended = batch.runs.emplace_back();
    for (const int place : places) ended.run.values.push_back(sample.parameters(place));
    ended.run.stream = sample.has_stream() ? sample.stream() : sample.index();
    ended.reason = sample.reason();
    const auto row = row_of.find(sample.index());
    if (row == row_of.end()) continue;
    Eigen::RowVectorXd& readings = ended.readings.emplace(table.histories.row(row->second));
    for (Index k = 0; k < readings.size(); ++k) {
      const inference::Reading& reading = data.readings[static_cast<std::size_t>(k)];
      readings[k] = reading.value + readings[k] * reading.sd;
    }
    for (const OwnCurveEffect& own : on_curves) {
      const double value = ended.run.values[own.place];
      if (value == own.null) continue;
      readings = own.effect(Eigen::MatrixXd(readings), Eigen::VectorXd::Constant(1, value)).row(0);
    }
  }
  return batches;
}

ServerRunMaker::ServerRunMaker(client::Laboratory& laboratory, report::CampaignView design,
                               std::vector<std::string> names, std::string what)
    : laboratory_(laboratory),
      design_(std::move(design)),
      names_(std::move(names)),
      what_(std::move(what)) {}

absl::StatusOr<std::vector<EndedBatch>> ServerRunMaker::Batches() {
  return EndedBatchesOf(design_, names_);
}

absl::StatusOr<EndedBatch> ServerRunMaker::Make(const RunBatch& batch) {
  ASSIGN_OR_RETURN(const std::vector<int> places, PlacesAmong(design_.campaign, names_));
  v1::AddRunsRequest request;
  request.set_campaign(design_.status.campaign());
  request.set_iteration(batch.number);
  request.set_stage(campaign::ToString(batch.stage));
  for (const campaign::RunOf& run : batch.rows) {
    v1::AddRunsRequest::Row& row = *request.add_rows();
    row.mutable_parameters()->Resize(static_cast<int>(places.size()), 0);
    for (std::size_t j = 0; j < places.size(); ++j) row.set_parameters(places[j], run.values[j]);
    row.set_stream(run.stream);
  }
  ASSIGN_OR_RETURN(
      design_,
      laboratory_.Grow(request, absl::StrCat(what_, ", ", campaign::ToString(batch.stage))));
  ASSIGN_OR_RETURN(std::vector<EndedBatch> batches, Batches());
  if (static_cast<int>(batches.size()) <= batch.number)
    return absl::InternalError(absl::StrCat("batch ", batch.number, " of the design is not there"));
  return std::move(batches[static_cast<std::size_t>(batch.number)]);
}

}  // namespace calib::diagnosis
