#include "server/scheduler/campaign_run.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"
#include "server/campaign/model/sha256.h"
#include "server/messages/attempt_spec.h"
#include "server/planning/decisions.h"
#include "server/planning/early_stopping.h"

namespace calib::scheduler {

using store::EvaluationKey;
using store::EvaluationStatus;

namespace {

/// Ended by itself: nothing lets it go on.
bool IsForGood(EvaluationStatus status) {
  return status == EvaluationStatus::kFinished || status == EvaluationStatus::kDiverged ||
         status == EvaluationStatus::kUnknown;
}

}  // namespace

const std::string& OwnMechanics() {
  static const std::string own =
      WorkerTable::Mechanics(dem::EngineVersion(), campaign::Sha256Hex(dem::CatalogText()));
  return own;
}

CampaignRun::CampaignRun(std::int64_t id, std::shared_ptr<const planning::Definition> definition)
    : id_(id), definition_(std::move(definition)) {
  for (std::size_t e = 0; e < definition_->campaign.experiments.size(); ++e) {
    auto& positions = positions_.emplace_back();
    for (const int step : definition_->LoadSteps(static_cast<int>(e))) {
      positions.emplace(step, positions.size());
    }
  }
}

void CampaignRun::FactoriseErrors() {
  const inference::NoiseMode noise = definition_->campaign.filter.noise;
  if (noise == inference::NoiseMode::kEssTarget) {
    return;
  }
  if (auto made = inference::GaussianLikelihood::Create(definition_->data, noise); made.ok()) {
    likelihood_ = *std::move(made);
  }
}

absl::StatusOr<std::unique_ptr<CampaignRun>> CampaignRun::Load(const campaign::MethodList& methods,
                                                               store::Reader& reader,
                                                               std::int64_t id) {
  ASSIGN_OR_RETURN(const auto record, reader.Campaign(id));
  ASSIGN_OR_RETURN(auto definition, planning::LoadDefinition(methods, reader, record.submitted));
  std::unique_ptr<CampaignRun> run(new CampaignRun(id, std::move(definition)));
  run->FactoriseErrors();
  run->record_ = record;
  run->state_ = record.progress.state;
  RETURN_IF_ERROR(run->Reload(reader));
  run->FindOtherMechanics();
  return run;
}

absl::Status CampaignRun::Reload(store::Reader& reader) {
  samples_.clear();
  stop_below_.clear();
  arrived_.clear();
  evaluations_.clear();
  by_status_.clear();
  by_digest_.clear();
  ASSIGN_OR_RETURN(const auto samples, reader.Samples(id_));
  ASSIGN_OR_RETURN(const auto evaluations, reader.Evaluations(id_));
  Take(samples, evaluations);
  // What ended in earlier iterations is asked by plans alone.
  return arrived_.empty() ? absl::OkStatus()
                          : AddStates(reader, arrived_.begin()->first, arrived_.rbegin()->first);
}

std::unique_ptr<CampaignRun> CampaignRun::Unfilled() const {
  std::unique_ptr<CampaignRun> run(new CampaignRun(id_, definition_));
  run->record_ = record_;
  run->state_ = state_;
  return run;
}

void CampaignRun::Fill(CampaignRun&& reloaded) {
  ++changes_;
  counted_.reset();
  evaluations_ = std::move(reloaded.evaluations_);
  by_status_ = std::move(reloaded.by_status_);
  by_digest_ = std::move(reloaded.by_digest_);
  samples_ = std::move(reloaded.samples_);
  stop_below_ = std::move(reloaded.stop_below_);
  arrived_ = std::move(reloaded.arrived_);
}

std::function<absl::StatusOr<CampaignRun::More>(store::Reader&)> CampaignRun::LookForMore() const {
  std::vector<EvaluationKey> known;
  known.reserve(evaluations_.size());
  for (const auto& [key, evaluation] : evaluations_) known.push_back(key);
  return [id = id_, known = std::move(known)](store::Reader& reader) -> absl::StatusOr<More> {
    More more;
    ASSIGN_OR_RETURN(more.samples, reader.Samples(id));
    ASSIGN_OR_RETURN(more.evaluations, reader.Evaluations(id));
    std::erase_if(more.evaluations, [&known](const store::EvaluationRecord& evaluation) {
      return std::binary_search(known.begin(), known.end(), evaluation.key);
    });
    std::set<int> came_with_states;
    for (const store::EvaluationRecord& evaluation : more.evaluations) {
      if (evaluation.status != EvaluationStatus::kWaiting) {  // else nobody has been leased it yet
        came_with_states.insert(evaluation.key.sample);
      }
    }
    for (const int sample : came_with_states) {
      RETURN_IF_ERROR(reader.EachState(
          id, sample, sample,
          [&more](const EvaluationKey& key, int load_step, std::span<const double> observables) {
            more.states.push_back({.key = key,
                                   .load_step = load_step,
                                   .observables = {observables.begin(), observables.end()}});
          }));
    }
    return more;
  };
}

void CampaignRun::Take(const More& more) {
  const std::set<EvaluationKey> taken = Take(more.samples, more.evaluations);
  for (const More::State& state : more.states) {
    if (taken.count(state.key) > 0) AddState(state.key, state.load_step, state.observables);
  }
}

std::set<EvaluationKey> CampaignRun::Take(const std::vector<store::SampleRecord>& samples,
                                          const std::vector<store::EvaluationRecord>& evaluations) {
  counted_.reset();
  std::set<EvaluationKey> taken;
  std::set<int> open = OpenSamples();
  for (const store::EvaluationRecord& evaluation : evaluations) {
    if (evaluations_.count(evaluation.key) > 0) {
      continue;
    }
    taken.insert(taken.end(), evaluation.key);
    if (!campaign::IsTerminal(evaluation.status)) {
      open.insert(evaluation.key.sample);
    }
  }
  const Eigen::RowVectorXd nothing =
      Eigen::RowVectorXd::Constant(static_cast<Eigen::Index>(definition_->data.readings.size()),
                                   std::numeric_limits<double>::quiet_NaN());
  ++changes_;
  std::erase_if(arrived_, [this, &open](const auto& entry) {
    return !IsOfRunningIteration(entry.first) && open.count(entry.first) == 0;
  });
  for (const store::SampleRecord& sample : samples) {
    if (!samples_.emplace(sample.sample, planning::ToRun(definition_->campaign, sample)).second) {
      continue;
    }
    if (!std::isnan(sample.stop_below)) {
      stop_below_[sample.sample] = sample.stop_below;
    }
    if (IsOfRunningIteration(sample.sample) || open.count(sample.sample) > 0) {
      arrived_[sample.sample] = {.predictions = nothing};
    }
  }
  for (const store::EvaluationRecord& evaluation : evaluations) {
    if (taken.count(evaluation.key) == 0) continue;
    evaluations_[evaluation.key] = {.losses = evaluation.losses,
                                    .missing = MissingSteps(PathLength(evaluation.key.experiment)),
                                    .rest_after = evaluation.rest_after,
                                    .held_in = evaluation.held_in,
                                    .digest = evaluation.digest};
    if (!evaluation.digest.empty()) {
      by_digest_.emplace(evaluation.digest, evaluation.key);
    }
    SetStatus(evaluation.key, evaluation.status, evaluation.failures);
  }
  return taken;
}

absl::Status CampaignRun::Refresh(store::Reader& reader, const std::vector<EvaluationKey>& keys) {
  std::set<int> samples;
  for (const EvaluationKey& key : keys) samples.insert(key.sample);
  if (samples.empty()) return absl::OkStatus();
  ASSIGN_OR_RETURN(const auto evaluations, reader.Evaluations(id_, *samples.begin()));
  for (const int sample : samples) {
    RETURN_IF_ERROR(AddStates(reader, sample, sample));
  }
  const std::set<EvaluationKey> wanted(keys.begin(), keys.end());
  for (const store::EvaluationRecord& evaluation : evaluations) {
    if (wanted.count(evaluation.key) > 0) {
      SetStatus(evaluation.key, evaluation.status, evaluation.failures);
    }
  }
  return absl::OkStatus();
}

absl::Status CampaignRun::AddStates(store::Reader& reader, int first, int last) {
  EvaluationKey of;  // those of one evaluation come one after the other
  Evaluation* evaluation = nullptr;
  Arrived* arrived = nullptr;
  return reader.EachState(
      id_, first, last,
      [&](const EvaluationKey& key, int load_step, std::span<const double> observables) {
        if (evaluation == nullptr || key != of) {
          of = key;
          evaluation = &evaluations_[key];
          const auto found = arrived_.find(key.sample);
          arrived = found == arrived_.end() ? nullptr : &found->second;
        }
        AddState(key, load_step, observables, *evaluation, arrived);
      });
}

absl::Status CampaignRun::Apply(planning::CampaignEvent event, const std::string& reason) {
  ASSIGN_OR_RETURN(const auto next, Next(state_, event));
  state_ = next;
  record_.progress.state = state_;
  record_.progress.reason = reason;
  return absl::OkStatus();
}

CampaignRun::Evaluation* CampaignRun::Find(const EvaluationKey& key) {
  const auto found = evaluations_.find(key);
  return found == evaluations_.end() ? nullptr : &found->second;
}

void CampaignRun::FindOtherMechanics() {
  for (const auto& [key, evaluation] : evaluations_) {
    if (IsForGood(evaluation.status) || evaluation.digest.empty()) continue;
    std::string digest = messages::RunDigest(
        messages::LeaseOf(definition_->campaign, key.experiment, samples_.at(key.sample)));
    if (digest != evaluation.digest) of_other_mechanics_[key] = std::move(digest);
  }
}

std::map<EvaluationKey, std::string> CampaignRun::OfOtherMechanics() const {
  std::map<EvaluationKey, std::string> open = of_other_mechanics_;
  std::erase_if(open, [this](const auto& entry) {
    const EvaluationStatus status = evaluations_.at(entry.first).status;
    // What rests or was stopped may be asked to go on while its iteration is not concluded.
    return IsForGood(status) || (status == EvaluationStatus::kStoppedEarly &&
                                 record_.progress.phase != campaign::Phase::kCalibrating);
  });
  return open;
}

bool CampaignRun::HasBegun() const {
  return std::any_of(evaluations_.begin(), evaluations_.end(), [this](const auto& entry) {
    const auto& [key, evaluation] = entry;
    return campaign::IsTerminal(evaluation.status) ||
           evaluation.missing.size() < PathLength(key.experiment);
  });
}

void CampaignRun::BeginAnew(const EvaluationKey& key, const std::string& digest) {
  Evaluation& evaluation = evaluations_[key];
  evaluation.missing = MissingSteps(PathLength(key.experiment));
  evaluation.held_in.clear();
  const auto [first, last] = by_digest_.equal_range(evaluation.digest);
  if (const auto before =
          std::find_if(first, last, [&key](const auto& item) { return item.second == key; });
      before != last) {
    by_digest_.erase(before);
  }
  by_digest_.emplace(digest, key);
  evaluation.digest = digest;
  of_other_mechanics_.erase(key);
  evaluation.losses = 0;
  SetStatus(key, EvaluationStatus::kWaiting, 0);
  const auto arrived = arrived_.find(key.sample);
  if (arrived == arrived_.end()) return;
  arrived->second.out = false;
  for (std::size_t t = 0; t < definition_->data.readings.size(); ++t) {
    if (definition_->data.readings[t].experiment == key.experiment) {
      arrived->second.predictions(static_cast<Eigen::Index>(t)) =
          std::numeric_limits<double>::quiet_NaN();
    }
  }
}

std::vector<EvaluationKey> CampaignRun::With(EvaluationStatus status) const {
  const auto found = by_status_.find(status);
  return found == by_status_.end()
             ? std::vector<EvaluationKey>{}
             : std::vector<EvaluationKey>(found->second.begin(), found->second.end());
}

std::size_t CampaignRun::Count(EvaluationStatus status) const {
  const auto found = by_status_.find(status);
  return found == by_status_.end() ? 0 : found->second.size();
}

std::vector<EvaluationKey> CampaignRun::OfSample(int sample) const {
  std::vector<EvaluationKey> keys;
  for (auto it = evaluations_.lower_bound({id_, sample, 0});
       it != evaluations_.end() && it->first.sample == sample; ++it) {
    keys.push_back(it->first);
  }
  return keys;
}

std::vector<EvaluationKey> CampaignRun::WaitingFor(const std::string& digest) const {
  std::vector<EvaluationKey> waiting;
  const auto [first, last] = by_digest_.equal_range(digest);
  for (auto it = first; it != last; ++it) {
    if (evaluations_.at(it->second).status == EvaluationStatus::kWaiting) {
      waiting.push_back(it->second);
    }
  }
  std::sort(waiting.begin(), waiting.end());
  return waiting;
}

std::vector<EvaluationKey> CampaignRun::UnknownOfRunningIteration() const {
  std::vector<EvaluationKey> unknown = With(EvaluationStatus::kUnknown);
  std::erase_if(unknown,
                [this](const EvaluationKey& key) { return !IsOfRunningIteration(key.sample); });
  return unknown;
}

bool CampaignRun::AllTerminal() const {
  return std::all_of(by_status_.begin(), by_status_.end(), [](const auto& item) {
    return item.second.empty() || campaign::IsTerminal(item.first);
  });
}

std::vector<EvaluationKey> CampaignRun::Open() const {
  std::vector<EvaluationKey> open;
  for (const auto& [status, keys] : by_status_) {
    if (!campaign::IsTerminal(status)) open.insert(open.end(), keys.begin(), keys.end());
  }
  return open;
}

std::size_t CampaignRun::Results() const {
  const std::vector<EvaluationKey> open = Open();
  if (open.empty() || definition_->campaign.decisions == campaign::Decisions::kImmediate) {
    return evaluations_.size() - open.size();
  }
  const auto first_open = evaluations_.find(*std::min_element(open.begin(), open.end()));
  return static_cast<std::size_t>(std::distance(evaluations_.begin(), first_open));
}

bool CampaignRun::WantsPlan() const {
  return AllTerminal() ||
         (planning::DecidesWhileRunning(*definition_) &&
          record_.progress.phase == campaign::Phase::kCalibrating && planned_ != Results());
}

void CampaignRun::Planned(bool again) {
  planned_ = again ? std::nullopt : std::optional<std::size_t>(Results());
}

bool CampaignRun::NeedsLimits() const {
  const campaign::Resources& needs = definition_->campaign.resources;
  return !definition_->campaign.program && (needs.memory || needs.wall || needs.silence);
}

int CampaignRun::SlotsOf(const WorkerTable::Kind& kind) const {
  const campaign::Resources& needs = definition_->campaign.resources;
  if (!MayBeRunBy(kind.programs) ||
      (!definition_->campaign.program && kind.mechanics != OwnMechanics()) ||
      (NeedsLimits() && !kind.limits_runs)) {
    return 0;
  }
  const double threads = needs.threads.value_or(1);
  double slots = std::max(1.0, std::ceil(threads * kind.slots / kind.threads));
  if (needs.memory.has_value() && kind.memory > 0) {
    slots = std::max(slots, std::ceil(*needs.memory * kind.slots / kind.memory));
  }
  return slots <= kind.slots ? static_cast<int>(slots) : 0;
}

std::string CampaignRun::Refusal(const EvaluationKey& key, int load_step,
                                 std::span<const double> observables) const {
  const auto& positions = positions_[static_cast<std::size_t>(key.experiment)];
  const auto found = positions.find(load_step);
  if (found == positions.end()) {
    return absl::StrCat("load step ", load_step, " is not on the path");
  }
  const auto& rest = evaluations_.at(key).rest_after;
  const auto rests_at = rest.has_value() ? positions.find(*rest) : positions.end();
  if (rests_at != positions.end() && found->second > rests_at->second) {
    return absl::StrCat("load step ", load_step, " is behind load step ", *rest,
                        ", where the run was to rest");
  }
  const bool only_others = observables.empty() && definition_->campaign.program.has_value();
  if (!only_others && observables.size() != definition_->StateSize(key.experiment)) {
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
  const auto& positions = positions_[static_cast<std::size_t>(key.experiment)];
  const auto rests_at =
      evaluation.rest_after.has_value() ? positions.find(*evaluation.rest_after) : positions.end();
  return rests_at == positions.end() ? evaluation.missing.empty()
                                     : !evaluation.missing.AnyUpTo(rests_at->second);
}

bool CampaignRun::IsOfRunningIteration(int sample) const {
  return sample / record_.submitted.samples == record_.progress.iteration;
}

void CampaignRun::AddState(const EvaluationKey& key, int load_step,
                           std::span<const double> observables) {
  const auto arrived = arrived_.find(key.sample);
  AddState(key, load_step, observables, evaluations_[key],
           arrived == arrived_.end() ? nullptr : &arrived->second);
}

void CampaignRun::AddState(const EvaluationKey& key, int load_step,
                           std::span<const double> observables, Evaluation& evaluation,
                           Arrived* arrived) {
  if (observables.empty()) return;  // what a program told besides
  ++changes_;
  const auto& positions = positions_[static_cast<std::size_t>(key.experiment)];
  if (const auto position = positions.find(load_step); position != positions.end()) {
    evaluation.missing.Erase(position->second);
  }
  if (arrived != nullptr) {
    definition_->readings.Place(key.experiment, load_step, observables, arrived->predictions);
  }
}

void CampaignRun::SetStatus(const EvaluationKey& key, EvaluationStatus status, int failures) {
  ++changes_;
  Evaluation& evaluation = evaluations_[key];
  const bool counts = counted_ == record_.progress.iteration && IsOfRunningIteration(key.sample);
  if (counts) counts_.Add(StatusOf(key.sample), -1);
  by_status_[evaluation.status].erase(key);
  by_status_[status].insert(key);
  evaluation.status = status;
  evaluation.failures = failures;
  if (counts) counts_.Add(StatusOf(key.sample));
  const auto found = arrived_.find(key.sample);
  if (found != arrived_.end() &&
      (status == EvaluationStatus::kDiverged || status == EvaluationStatus::kStoppedEarly ||
       status == EvaluationStatus::kUnknown)) {
    found->second.out = true;
  }
}

campaign::SampleStatus CampaignRun::StatusOf(int sample) const {
  campaign::SampleStatus status;
  for (auto it = evaluations_.lower_bound({id_, sample, 0});
       it != evaluations_.end() && it->first.sample == sample; ++it) {
    status.Add(it->second.status, it->second.rest_after.has_value());
  }
  return status;
}

const campaign::SampleCounts& CampaignRun::Counts() {
  const int iteration = record_.progress.iteration;
  if (counted_ == iteration) return counts_;
  counts_ = {};
  for (auto it = evaluations_.lower_bound({id_, iteration * record_.submitted.samples, 0});
       it != evaluations_.end() && IsOfRunningIteration(it->first.sample);) {
    const int sample = it->first.sample;
    counts_.Add(StatusOf(sample));
    while (it != evaluations_.end() && it->first.sample == sample) ++it;
  }
  counted_ = iteration;
  return counts_;
}

bool CampaignRun::IsCalibrated(int experiment) const {
  return definition_->campaign.experiments[static_cast<std::size_t>(experiment)].role ==
         campaign::Role::kCalibrate;
}

bool CampaignRun::IsItsTurn(const EvaluationKey& key) const {
  if (stop_below_.count(key.sample) == 0 || !IsCalibrated(key.experiment)) {
    return true;
  }
  for (auto before = evaluations_.lower_bound({key.campaign, key.sample, 0});
       before != evaluations_.end() && before->first < key; ++before) {
    if (IsCalibrated(before->first.experiment) && !campaign::IsTerminal(before->second.status)) {
      return false;
    }
  }
  return true;
}

bool CampaignRun::ShouldStop(const EvaluationKey& key) const {
  const auto threshold = stop_below_.find(key.sample);
  const auto arrived = arrived_.find(key.sample);
  if (threshold == stop_below_.end() || arrived == arrived_.end() || !likelihood_.has_value() ||
      !IsCalibrated(key.experiment)) {
    return false;
  }
  Eigen::RowVectorXd known = arrived->second.predictions;
  for (std::size_t t = 0; t < definition_->data.readings.size(); ++t) {
    if (definition_->data.readings[t].experiment > key.experiment) {
      known(static_cast<Eigen::Index>(t)) = std::numeric_limits<double>::quiet_NaN();
    }
  }
  return planning::BestPossible(*likelihood_, known) < threshold->second;
}

std::vector<EvaluationKey> CampaignRun::WaitingBeside(const EvaluationKey& key) const {
  std::vector<EvaluationKey> waiting;
  for (auto other = evaluations_.lower_bound({key.campaign, key.sample, 0});
       other != evaluations_.end() && other->first.sample == key.sample; ++other) {
    if (other->second.status == EvaluationStatus::kWaiting &&
        IsCalibrated(other->first.experiment)) {
      waiting.push_back(other->first);
    }
  }
  return waiting;
}

std::set<int> CampaignRun::OpenSamples() const {
  std::set<int> open;
  for (const EvaluationKey& key : Open()) open.insert(key.sample);
  return open;
}

// Where points are chosen while others run, those that end are of iterations before the newest: the
// last that have ended, as many as the first iteration has samples, stand for the running one.
std::set<int> CampaignRun::EndedForPause() const {
  const std::set<int> open = OpenSamples();
  const bool overlaps = definition_->campaign.method->chooses_while_running();
  const auto most = static_cast<std::size_t>(record_.submitted.samples);
  std::set<int> ended;
  for (auto it = samples_.rbegin(); it != samples_.rend(); ++it) {
    if (overlaps ? ended.size() == most : !IsOfRunningIteration(it->first)) break;
    if (open.count(it->first) == 0) ended.insert(it->first);
  }
  return ended;
}

int CampaignRun::Diverged() const {
  const bool overlaps = definition_->campaign.method->chooses_while_running();
  const std::set<int> ended = overlaps ? EndedForPause() : std::set<int>{};
  std::set<int> samples;
  for (const EvaluationStatus status : {EvaluationStatus::kDiverged, EvaluationStatus::kUnknown}) {
    for (const EvaluationKey& key : With(status)) {
      if (overlaps ? ended.count(key.sample) > 0 : IsOfRunningIteration(key.sample)) {
        samples.insert(key.sample);
      }
    }
  }
  return static_cast<int>(samples.size());
}

int CampaignRun::Done() const { return static_cast<int>(EndedForPause().size()); }

std::function<LiveView()> CampaignRun::Look() {
  looked_at_ = changes_;
  struct Seen {
    Eigen::MatrixXd predictions;
    std::vector<char> out;
  };
  const auto seen = std::make_shared<Seen>();
  seen->predictions.resize(static_cast<Eigen::Index>(arrived_.size()),
                           static_cast<Eigen::Index>(definition_->data.readings.size()));
  for (const auto& [sample, arrived] : arrived_) {
    if (IsOfRunningIteration(sample)) {
      seen->predictions.row(static_cast<Eigen::Index>(seen->out.size())) = arrived.predictions;
      seen->out.push_back(arrived.out ? 1 : 0);
    }
  }
  return [definition = definition_, seen]() -> LiveView {
    if (seen->out.empty()) {
      return {};
    }
    const auto rows = static_cast<Eigen::Index>(seen->out.size());
    const auto view = inference::ViewOnline(definition->data, definition->campaign.filter,
                                            seen->predictions.topRows(rows), seen->out);
    return {.effective_samples = view.ess, .best_misfit = view.best_rms};
  };
}

}  // namespace calib::scheduler
