#include "server/scheduler/campaign_run.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "server/scheduler/early_stopping.h"

namespace calib::scheduler {

using store::EvaluationKey;
using store::EvaluationStatus;

absl::StatusOr<std::unique_ptr<CampaignRun>> CampaignRun::Load(store::Reader& reader,
                                                               std::int64_t id) {
  const auto record = reader.Campaign(id);
  if (!record.ok()) {
    return record.status();
  }
  auto definition = LoadDefinition(reader, record->submitted);
  if (!definition.ok()) {
    return definition.status();
  }
  std::unique_ptr<CampaignRun> run(new CampaignRun(id, *std::move(definition)));
  const auto state = ToCampaignState(record->progress.state);
  if (!state.has_value()) {
    return absl::DataLossError(
        absl::StrCat("campaign c", id, " is in the unknown state ", record->progress.state));
  }
  run->record_ = *record;
  run->state_ = *state;
  if (absl::Status status = run->Reload(reader); !status.ok()) {
    return status;
  }
  return run;
}

absl::Status CampaignRun::Reload(store::Reader& reader) {
  const auto samples = reader.Samples(id_);
  const auto evaluations = reader.Evaluations(id_);
  const auto states = reader.States(id_);
  for (const absl::Status& status : {samples.status(), evaluations.status(), states.status()}) {
    if (!status.ok()) {
      return status;
    }
  }
  parameters_.clear();
  stop_below_.clear();
  Eigen::Index rows = 0;
  for (const store::SampleRecord& sample : *samples) {
    parameters_[sample.sample] = sample.parameters;
    if (!std::isnan(sample.stop_below)) {
      stop_below_[sample.sample] = sample.stop_below;
    }
    rows += sample.iteration == record_.progress.iteration ? 1 : 0;
  }
  predictions_.setConstant(rows, static_cast<Eigen::Index>(definition_->data.readings.size()),
                           std::numeric_limits<double>::quiet_NaN());
  diverged_.assign(static_cast<std::size_t>(rows), 0);
  evaluations_.clear();
  for (const store::EvaluationRecord& evaluation : *evaluations) {
    const auto steps = definition_->LoadSteps(evaluation.key.experiment);
    evaluations_[evaluation.key] = {.missing = {steps.begin(), steps.end()},
                                    .rest_after = evaluation.rest_after,
                                    .held_in = evaluation.held_in,
                                    .digest = evaluation.digest};
    SetStatus(evaluation.key, evaluation.status, evaluation.failures);
  }
  for (const store::StateRecord& stored : *states) {
    AddState(stored.key, stored.load_step, stored.observables);
  }
  return absl::OkStatus();
}

absl::Status CampaignRun::Apply(CampaignEvent event, const std::string& reason) {
  const auto next = Next(state_, event);
  if (!next.ok()) {
    return next.status();
  }
  state_ = *next;
  record_.progress.state = ToString(state_);
  record_.progress.reason = reason;
  return absl::OkStatus();
}

CampaignRun::Evaluation* CampaignRun::Find(const EvaluationKey& key) {
  const auto found = evaluations_.find(key);
  return found == evaluations_.end() ? nullptr : &found->second;
}

std::vector<EvaluationKey> CampaignRun::With(EvaluationStatus status) const {
  std::vector<EvaluationKey> keys;
  for (const auto& [key, evaluation] : evaluations_) {
    if (evaluation.status == status) {
      keys.push_back(key);
    }
  }
  return keys;
}

bool CampaignRun::AllTerminal() const {
  return std::all_of(evaluations_.begin(), evaluations_.end(),
                     [](const auto& item) { return store::IsTerminal(item.second.status); });
}

std::string CampaignRun::Refusal(const EvaluationKey& key, int load_step,
                                 std::span<const double> observables) const {
  const auto steps = definition_->LoadSteps(key.experiment);
  const auto found = std::find(steps.begin(), steps.end(), load_step);
  if (found == steps.end()) {
    return absl::StrCat("load step ", load_step, " is not on the path");
  }
  if (const auto& rest = evaluations_.at(key).rest_after;
      rest.has_value() && found > std::find(steps.begin(), steps.end(), *rest)) {
    return absl::StrCat("load step ", load_step, " is behind load step ", *rest,
                        ", where the run was to rest");
  }
  if (observables.size() != definition_->StateSize(key.experiment)) {
    return absl::StrCat("a state of ", observables.size(), " values, expected ",
                        definition_->StateSize(key.experiment));
  }
  if (!std::all_of(observables.begin(), observables.end(),
                   [](double value) { return std::isfinite(value); })) {
    return absl::StrCat("a value that is not finite at load step ", load_step);
  }
  return "";
}

bool CampaignRun::HasArrived(const EvaluationKey& key) const {
  const Evaluation& evaluation = evaluations_.at(key);
  if (!evaluation.rest_after.has_value()) {
    return evaluation.missing.empty();
  }
  for (const int step : definition_->LoadSteps(key.experiment)) {
    if (evaluation.missing.count(step) > 0) {
      return false;
    }
    if (step == *evaluation.rest_after) {
      break;
    }
  }
  return true;
}

Eigen::Index CampaignRun::Position(int sample) const {
  const int position = sample - record_.progress.iteration * record_.submitted.samples;
  return position >= 0 && position < predictions_.rows() ? position : -1;
}

void CampaignRun::AddState(const EvaluationKey& key, int load_step,
                           std::span<const double> observables) {
  evaluations_[key].missing.erase(load_step);
  if (const Eigen::Index position = Position(key.sample); position >= 0) {
    Eigen::RowVectorXd row = predictions_.row(position);
    definition_->readings.Place(key.experiment, load_step, observables, row);
    predictions_.row(position) = row;
  }
}

void CampaignRun::SetStatus(const EvaluationKey& key, EvaluationStatus status, int failures) {
  Evaluation& evaluation = evaluations_[key];
  evaluation.status = status;
  evaluation.failures = failures;
  const Eigen::Index position = Position(key.sample);
  if (position >= 0 &&
      (status == EvaluationStatus::kDiverged || status == EvaluationStatus::kStoppedEarly)) {
    diverged_[static_cast<std::size_t>(position)] = 1;
  }
}

bool CampaignRun::ShouldStop(const EvaluationKey& key) const {
  const auto threshold = stop_below_.find(key.sample);
  const Eigen::Index position = Position(key.sample);
  if (threshold == stop_below_.end() || position < 0) {
    return false;
  }
  Eigen::RowVectorXd own = predictions_.row(position);
  for (std::size_t t = 0; t < definition_->data.readings.size(); ++t) {
    if (definition_->data.readings[t].experiment != key.experiment) {
      own(static_cast<Eigen::Index>(t)) = std::numeric_limits<double>::quiet_NaN();
    }
  }
  return BestPossible(*definition_, own) < threshold->second;
}

int CampaignRun::Diverged() const {
  std::set<int> samples;
  for (const EvaluationKey& key : With(EvaluationStatus::kDiverged)) {
    if (Position(key.sample) >= 0) {
      samples.insert(key.sample);
    }
  }
  return static_cast<int>(samples.size());
}

int CampaignRun::Done() const {
  std::set<int> open;
  for (const auto& [key, evaluation] : evaluations_) {
    if (Position(key.sample) >= 0 && !store::IsTerminal(evaluation.status)) {
      open.insert(key.sample);
    }
  }
  return static_cast<int>(predictions_.rows()) - static_cast<int>(open.size());
}

LiveView CampaignRun::View() const {
  if (predictions_.rows() == 0) {
    return {};
  }
  const auto view = inference::ViewOnline(definition_->data, definition_->campaign.filter,
                                          predictions_, diverged_);
  return {.effective_samples = view.ess, .best_misfit = view.best_rms};
}

}  // namespace calib::scheduler
