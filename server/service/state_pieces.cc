#include "server/service/state_pieces.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"
#include "server/messages/others.h"
#include "server/methods/registry.h"
#include "server/planning/definition.h"
#include "server/service/queries.h"

namespace calib::service {
namespace {

/// States that are read together at least, where there are as many. Chosen: some hundred KB.
constexpr std::size_t kStates = 2000;
/// Campaigns that are known at a time; then all are forgotten.
constexpr std::size_t kMostKnown = 1000;

absl::StatusOr<std::vector<ToldExperiment>> ReadExperiments(store::Reader& reader,
                                                            std::int64_t campaign) {
  ASSIGN_OR_RETURN(const auto record, reader.Campaign(campaign));
  ASSIGN_OR_RETURN(const auto definition,
                   planning::LoadDefinition(methods::All(), reader, record.submitted));
  const campaign::Campaign& read = definition->campaign;
  std::vector<ToldExperiment> experiments;
  for (const campaign::Experiment& experiment : read.experiments) {
    ToldExperiment& told = experiments.emplace_back();
    told.experiment = experiment.name;
    if (read.precomputed.has_value() || read.program.has_value()) {
      for (const campaign::MeasuredObservable& observable : experiment.observables) {
        told.observables.push_back(observable.name);
      }
    } else {
      told.observables = dem::FindTest(experiment.test)->observables;
    }
  }
  return experiments;
}

}  // namespace

absl::StatusOr<ToldExperiments::Experiments> ToldExperiments::Of(store::Reader& reader,
                                                                 std::int64_t campaign) {
  {
    absl::MutexLock lock(&mutex_);
    if (const auto known = known_.find(campaign); known != known_.end()) {
      return known->second;
    }
  }
  ASSIGN_OR_RETURN(auto read, ReadExperiments(reader, campaign));
  auto experiments = std::make_shared<const std::vector<ToldExperiment>>(std::move(read));
  absl::MutexLock lock(&mutex_);
  if (known_.size() >= kMostKnown) {
    known_.clear();
  }
  known_[campaign] = experiments;
  return experiments;
}

absl::Status StatePieces::Begin(store::Reader& reader) {
  ASSIGN_OR_RETURN(id_, ParseCampaign(campaign_));
  RETURN_IF_ERROR(reader.Campaign(id_).status());  // it may be known and gone
  ASSIGN_OR_RETURN(experiments_, told_.Of(reader, id_));
  ASSIGN_OR_RETURN(core_seconds_, reader.CoreSeconds(id_, sample_));
  ASSIGN_OR_RETURN(const auto samples, reader.Samples(id_));
  for (const store::SampleRecord& one : samples) {
    if (!sample_.has_value() || *sample_ == one.sample) {
      samples_.push_back(one.sample);
    }
  }
  if (sample_.has_value() && samples_.empty()) {
    return absl::NotFoundError(absl::StrCat("campaign c", id_, " has no sample ", *sample_,
                                            "; see samples for the numbers there are"));
  }
  return absl::OkStatus();
}

absl::Status StatePieces::CheckAreThere(store::Reader& reader) const {
  ASSIGN_OR_RETURN(const auto record, reader.Campaign(id_));
  if (record.kept_states.has_value() && sample_.has_value()) {
    ASSIGN_OR_RETURN(const bool keeps, reader.KeepsStates(id_, *sample_));
    if (keeps) return absl::OkStatus();
  }
  return CheckHasStates(record);
}

absl::StatusOr<std::vector<v1::SampleStates>> StatePieces::Next(store::Reader& reader) {
  if (!std::exchange(begun_, true)) {
    RETURN_IF_ERROR(Begin(reader));
  }
  RETURN_IF_ERROR(CheckAreThere(reader));  // it may have gone since the piece before
  std::vector<v1::SampleStates> messages;
  for (std::size_t read = 0; read < kStates && next_ < samples_.size(); ++next_) {
    ASSIGN_OR_RETURN(const auto states, reader.States(id_, samples_[next_]));
    read += states.size();
    const store::EvaluationKey* last = nullptr;
    for (const store::StateRecord& state : states) {
      if (last == nullptr || *last != state.key) {
        const ToldExperiment& told =
            (*experiments_)[static_cast<std::size_t>(state.key.experiment)];
        v1::SampleStates& message = messages.emplace_back();
        message.set_sample(state.key.sample);
        message.set_experiment(told.experiment);
        message.mutable_observables()->Add(told.observables.begin(), told.observables.end());
        const auto spent = core_seconds_.find(state.key);
        message.set_core_seconds(spent == core_seconds_.end() ? 0 : spent->second);
      }
      last = &state.key;
      v1::State& message = *messages.back().add_states();
      message.set_load_step(state.load_step);
      message.mutable_values()->Add(state.observables.begin(), state.observables.end());
      for (const auto& [name, value] : messages::OthersFromText(state.others)) {
        (*message.mutable_others())[name] = value;
      }
    }
  }
  return messages;
}

}  // namespace calib::service
