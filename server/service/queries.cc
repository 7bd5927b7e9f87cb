#include "server/service/queries.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/file/text/origin.h"
#include "server/campaign/model/sample_counts.h"
#include "server/messages/read_words.h"
#include "server/methods/registry.h"
#include "server/planning/definition.h"
#include "server/planning/growth.h"
#include "server/planning/history.h"
#include "server/planning/posterior_record.h"
#include "server/service/calls.h"

namespace calib::service {

using campaign::CampaignState;
using campaign::Phase;
using campaign::SampleCounts;
using campaign::SamplePurpose;
using campaign::SampleStatus;
using store::EvaluationRecord;
using store::EvaluationStatus;

namespace {

// False for a method that this build does not know.
bool RunsAreAdded(const campaign::Method* method) {
  return method != nullptr && method->chosen_by() == campaign::ChosenBy::kRequest;
}

/// Samples of the last iteration, or rows of the last batch of a design, as the store has them.
absl::StatusOr<SampleCounts> CountSamples(store::Reader& reader,
                                          const store::CampaignRecord& record) {
  const int first = record.progress.iteration * record.submitted.samples;
  SampleCounts counts;
  int last = first - 1;
  SampleStatus of_last;
  RETURN_IF_ERROR(reader.EachStatus(record.submitted.id, first,
                                    first + record.submitted.samples - 1,
                                    [&](int sample, EvaluationStatus evaluation, bool rests) {
                                      if (sample != last) {
                                        if (last >= first) counts.Add(of_last);
                                        last = sample;
                                        of_last = {};
                                      }
                                      of_last.Add(evaluation, rests);
                                    }));
  if (last >= first) counts.Add(of_last);
  return counts;
}

void SetCounts(const store::CampaignRecord& record, const SampleCounts& counts,
               v1::CampaignStatus& status) {
  // Whether what rests goes on is known when its iteration ends.
  const bool open = record.progress.phase == Phase::kCalibrating &&
                    (record.progress.state == CampaignState::kRunning ||
                     record.progress.state == CampaignState::kPaused);
  const int stopped = counts.stopped + (open ? 0 : counts.at_rung);
  status.set_samples_running(counts.running);
  status.set_samples_diverged(counts.diverged);
  status.set_samples_unknown(counts.unknown);
  status.set_samples_stopped_early(stopped);
  status.set_samples_resting(open ? counts.at_rung : 0);
  status.set_samples_done(counts.finished + counts.diverged + counts.unknown + stopped);
}

struct Concluded {
  std::optional<v1::Posterior> last;  ///< nothing before the first
  double best_misfit = 0;             ///< the smallest of all iterations, 0: none has one
  std::string problem;                ///< of a posterior that cannot be read
};

absl::StatusOr<Concluded> ConcludedIterations(store::Reader& reader, std::int64_t campaign) {
  ASSIGN_OR_RETURN(const auto iterations, reader.Iterations(campaign));
  Concluded concluded;
  for (const store::IterationRecord& iteration : iterations) {
    if (!iteration.posterior.has_value()) {
      continue;
    }
    auto posterior = planning::PosteriorFromJson(*iteration.posterior);
    if (!posterior.ok()) {
      concluded.problem = absl::StrCat("the posterior of iteration ", iteration.number,
                                       " cannot be read: ", posterior.status().message());
      continue;
    }
    const double misfit = posterior->best_misfit();
    if (misfit > 0 && (concluded.best_misfit == 0 || misfit < concluded.best_misfit)) {
      concluded.best_misfit = misfit;
    }
    concluded.last = *std::move(posterior);
  }
  return concluded;
}

/// What is known of a campaign without looking at what it has computed.
v1::CampaignStatus StatusWithout(const store::CampaignRecord& record, std::string problem) {
  v1::CampaignStatus status;
  status.set_campaign(absl::StrCat("c", record.submitted.id));
  status.set_name(record.submitted.name);
  status.set_owner(record.submitted.owner);
  status.set_priority(record.priority);
  status.set_state(ToString(record.progress.state));
  status.set_eta_seconds(-1);
  status.set_problem(std::move(problem));
  return status;
}

}  // namespace

absl::StatusOr<std::int64_t> ParseCampaign(const std::string& id) {
  std::int64_t number = 0;
  const char* end = id.data() + id.size();
  if (id.size() > 1 && id.front() == 'c') {
    if (const auto [at, error] = std::from_chars(id.data() + 1, end, number);
        error == std::errc() && at == end && number > 0) {
      return number;
    }
  }
  return absl::NotFoundError(
      absl::StrCat("there is no campaign \"", id, "\" (ids are like c1; see list)"));
}

absl::Status CheckHasStates(const store::CampaignRecord& record) {
  if (!record.kept_states.has_value()) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("c", record.submitted.id, " was pruned: the states of ", *record.kept_states,
                   " samples are kept, and this needs those of all; posterior, samples and "
                   "kept findings are there"));
}

std::optional<v1::CampaignStatus> FinishedStatuses::Find(
    const store::CampaignRecord& record) const {
  if (record.progress.state != CampaignState::kFinished) return std::nullopt;
  const absl::MutexLock lock(&mutex_);
  const auto found = kept_.find(record.submitted.id);
  if (found == kept_.end() || found->second.iteration != record.progress.iteration) {
    return std::nullopt;
  }
  return found->second.status;
}

void FinishedStatuses::Keep(const store::CampaignRecord& record, const v1::CampaignStatus& status) {
  if (record.progress.state != CampaignState::kFinished) return;
  const absl::MutexLock lock(&mutex_);
  kept_[record.submitted.id] = {.iteration = record.progress.iteration, .status = status};
}

absl::StatusOr<v1::CampaignStatus> StatusOf(store::Reader& reader, std::int64_t campaign,
                                            const std::optional<scheduler::LiveStatus>& live,
                                            const std::string& waits, FinishedStatuses* finished) {
  ASSIGN_OR_RETURN(const auto record, reader.Campaign(campaign));
  const bool may_keep = finished != nullptr && !live.has_value();
  if (may_keep) {
    if (auto kept = finished->Find(record)) {
      kept->set_server_waits(waits);
      kept->set_priority(record.priority);
      if (record.kept_states.has_value()) kept->set_kept_states(*record.kept_states);
      return *std::move(kept);
    }
  }
  ASSIGN_OR_RETURN(const auto effort, reader.EffortOf(campaign));
  ASSIGN_OR_RETURN(const auto concluded, ConcludedIterations(reader, campaign));
  v1::CampaignStatus status = StatusWithout(record, concluded.problem);
  status.set_reason(record.progress.reason);
  status.set_server_waits(waits);
  status.set_iteration(record.progress.iteration);
  status.set_max_iterations(record.submitted.max_iterations);
  status.set_samples(record.submitted.samples);
  const auto method = methods::All().Find(record.submitted.method);
  SampleCounts counts;
  if (live.has_value() && live->iteration == record.progress.iteration) {
    counts = live->counts;
  } else {
    ASSIGN_OR_RETURN(counts, CountSamples(reader, record));
  }
  SetCounts(record, counts, status);
  if (RunsAreAdded(method.get())) {  // what may be added nobody knows
    status.set_max_iterations(record.progress.iteration + 1);
    status.set_samples(counts.samples);
  }
  // The first iteration may have given runs besides.
  if (method != nullptr && method->batches_vary() && counts.samples > 0) {
    status.set_samples(counts.samples);
  }
  if (concluded.last.has_value()) {
    status.set_effective_sample_size(concluded.last->ess());
    status.set_best_misfit(concluded.best_misfit);
  }
  // Nothing is known of it before all its samples have a reading in common.
  if (live.has_value() && record.progress.phase == Phase::kCalibrating &&
      live->view.best_misfit > 0) {
    status.set_effective_sample_size(live->view.effective_samples);
    if (concluded.best_misfit == 0) {  // that of whole curves, where there is one
      status.set_best_misfit(live->view.best_misfit);
    }
  }
  if (live.has_value()) {
    status.set_eta_seconds(live->eta_seconds);
    status.set_nobody_may(live->nobody_may);
    status.set_states_per_second(live->states_per_second);
  }
  status.set_model_evaluations(effort.model_evaluations);
  status.set_core_hours(effort.core_seconds / 3600);
  status.set_converged(record.progress.converged);
  status.set_method(record.submitted.method);
  status.set_infers_nothing(method != nullptr && campaign::RunsRowsOnly(*method));
  status.set_created_unix_ms(record.submitted.created_unix_ms);
  status.set_phase(ToString(record.progress.phase));
  campaign::Origin origin = campaign::OriginOf(record.submitted.yaml);
  status.set_parent(std::move(origin.parent));
  status.set_purpose(std::move(origin.purpose));
  status.mutable_effects()->Add(origin.effects.begin(), origin.effects.end());
  if (record.kept_states.has_value()) status.set_kept_states(*record.kept_states);
  if (may_keep) finished->Keep(record, status);
  return status;
}

absl::StatusOr<std::vector<store::CampaignRecord>> Descent::ChildrenOf(store::Reader& reader,
                                                                       std::int64_t parent) {
  std::vector<std::int64_t> ids;
  {
    const absl::MutexLock lock(&mutex_);
    ASSIGN_OR_RETURN(const auto last, reader.LastCampaign());
    ASSIGN_OR_RETURN(const auto texts, reader.TextsWith("lineage", read_to_));
    for (const auto& [id, text] : texts) {
      if (id > last) continue;  // it has come meanwhile, and is read the next time
      if (const auto from = ParseCampaign(campaign::OriginOf(text).parent); from.ok()) {
        children_.emplace(*from, id);
      }
    }
    read_to_ = std::max(read_to_, last);
    const auto [begin, end] = children_.equal_range(parent);
    for (auto child = begin; child != end; ++child) ids.push_back(child->second);
  }
  std::vector<store::CampaignRecord> children;
  for (const std::int64_t id : ids) {
    auto child = reader.Campaign(id);
    if (absl::IsNotFound(child.status())) continue;
    RETURN_IF_ERROR(child.status());
    children.push_back(*std::move(child));
  }
  return children;
}

absl::StatusOr<std::vector<store::CampaignRecord>> Asked(store::Reader& reader,
                                                         const v1::ListRequest& request,
                                                         Descent& descent) {
  ASSIGN_OR_RETURN(const auto last, reader.LastCampaign());
  const auto id_of = [last](const std::string& name) -> absl::StatusOr<std::int64_t> {
    if (name.empty()) return std::int64_t{0};
    auto id = ParseCampaign(name);
    if (id.ok() && *id > last) {
      return absl::NotFoundError(absl::StrCat("there is no campaign \"", name, "\""));
    }
    return id;
  };
  ASSIGN_OR_RETURN(const auto after, id_of(request.after()));
  ASSIGN_OR_RETURN(const auto parent, id_of(request.parent()));
  if (parent == 0) return reader.Campaigns(after, request.limit());
  ASSIGN_OR_RETURN(auto children, descent.ChildrenOf(reader, parent));
  std::erase_if(children, [after](const auto& child) { return child.submitted.id <= after; });
  const auto limit = static_cast<std::size_t>(request.limit());
  if (limit > 0 && children.size() > limit) children.resize(limit);
  return children;
}

absl::StatusOr<v1::ListReply> ListOf(store::Reader& reader,
                                     const std::vector<store::CampaignRecord>& campaigns,
                                     const std::map<std::int64_t, scheduler::LiveStatus>& live,
                                     const std::string& waits, FinishedStatuses* finished) {
  v1::ListReply list;
  for (const store::CampaignRecord& record : campaigns) {
    const std::int64_t id = record.submitted.id;
    const auto known = live.find(id);
    auto status = Outgoing(
        StatusOf(reader, id, known == live.end() ? std::nullopt : std::make_optional(known->second),
                 waits, finished));
    *list.add_campaigns() = status.ok()
                                ? *std::move(status)
                                : StatusWithout(record, std::string(status.status().message()));
  }
  return list;
}

absl::StatusOr<v1::Posterior> PosteriorOf(store::Reader& reader, std::int64_t campaign,
                                          std::optional<int> iteration) {
  ASSIGN_OR_RETURN(const auto record, reader.Campaign(campaign));
  ASSIGN_OR_RETURN(const auto iterations, reader.Iterations(campaign));
  ASSIGN_OR_RETURN(const auto effort, reader.EffortOf(campaign));
  const std::string* found = nullptr;
  int complete = 0;
  for (const store::IterationRecord& candidate : iterations) {
    if (candidate.posterior.has_value()) {
      ++complete;
      if (!iteration.has_value() || candidate.number == *iteration) {
        found = &*candidate.posterior;
      }
    }
  }
  const auto method = methods::All().Find(record.submitted.method);
  if (found == nullptr && method != nullptr && campaign::RunsRowsOnly(*method)) {
    return absl::FailedPreconditionError(
        messages::InfersNothing(absl::StrCat("c", campaign), record.submitted.method));
  }
  if (found == nullptr) {
    return absl::FailedPreconditionError(
        complete == 0 ? absl::StrCat("campaign c", campaign, " has no complete iteration yet")
                      : absl::StrCat("campaign c", campaign, " has ", complete,
                                     " complete iterations, counted from 0"));
  }
  auto posterior = planning::PosteriorFromJson(*found);
  if (posterior.ok()) {
    posterior->set_iterations(complete);
    posterior->set_core_hours(effort.core_seconds / 3600);
    // Held-out runs come after the last posterior and are part of what it has cost.
    if (record.progress.phase != Phase::kCalibrating && posterior->iteration() + 1 == complete) {
      posterior->set_model_evaluations(effort.model_evaluations);
    }
  }
  return posterior;
}

absl::StatusOr<std::vector<v1::Sample>> SamplesOf(store::Reader& reader, std::int64_t campaign) {
  ASSIGN_OR_RETURN(const auto record, reader.Campaign(campaign));
  ASSIGN_OR_RETURN(const auto samples, reader.Samples(campaign));
  ASSIGN_OR_RETURN(const auto evaluations, reader.Evaluations(campaign));
  ASSIGN_OR_RETURN(const auto attempts, reader.AttemptsBySample(campaign));
  ASSIGN_OR_RETURN(const auto words, reader.WordsBySample(campaign));
  ASSIGN_OR_RETURN(const auto kept, reader.KeptBySample(campaign));
  ASSIGN_OR_RETURN(const auto iterations, reader.Iterations(campaign));
  const bool is_design = RunsAreAdded(methods::All().Find(record.submitted.method).get());
  std::map<int, SamplePurpose> purposes;  // by iteration
  for (const store::IterationRecord& iteration : iterations) {
    if (iteration.proposal == planning::kReplicates) {
      purposes[iteration.number] = SamplePurpose::kReplicate;
    }
    if (iteration.proposal == planning::kHeldOutDraws) {
      purposes[iteration.number] = SamplePurpose::kDraw;
    }
    if (is_design) {
      purposes[iteration.number] = planning::StageIn(iteration.proposal);
    }
  }
  std::map<int, SampleStatus> statuses;
  std::map<int, std::string> reasons;
  for (const EvaluationRecord& evaluation : evaluations) {
    const int sample = evaluation.key.sample;
    if (statuses[sample].Add(evaluation.status, evaluation.rest_after.has_value())) {
      reasons[sample] = evaluation.reason;
    }
  }
  std::vector<v1::Sample> messages;
  for (const store::SampleRecord& sample : samples) {
    v1::Sample& message = messages.emplace_back();
    message.set_index(sample.sample);
    message.set_iteration(sample.iteration);
    message.mutable_parameters()->Add(sample.parameters.begin(), sample.parameters.end());
    message.set_status(ToString(statuses[sample.sample].worst()));
    message.set_reason(reasons[sample.sample]);
    message.set_weight(std::exp(sample.log_weight));
    message.set_log_likelihood(sample.log_likelihood);
    const auto made = attempts.find(sample.sample);
    message.set_purpose(ToString(purposes[sample.iteration]));
    message.set_attempts(made == attempts.end() ? 0 : made->second);
    if (const auto said = words.find(sample.sample); said != words.end()) {
      message.set_words(said->second);
    }
    if (const auto files = kept.find(sample.sample); files != kept.end()) {
      for (const auto& [experiment, file] : files->second) {
        v1::KeptFile& added = *message.add_kept();
        added.set_name(file.name);
        added.set_digest(file.digest);
        added.set_reason(file.reason);
        added.set_experiment(experiment);
      }
    }
    if (sample.stream.has_value()) {
      message.set_stream(*sample.stream);
    }
  }
  return messages;
}

absl::StatusOr<v1::CampaignSource> SourceOf(store::Reader& reader, std::int64_t campaign) {
  ASSIGN_OR_RETURN(const auto record, reader.Campaign(campaign));
  ASSIGN_OR_RETURN(const auto files, reader.Files(campaign));
  v1::CampaignSource source;
  source.set_campaign_file(record.submitted.yaml);
  source.set_file_name(record.submitted.file_name);
  source.mutable_files()->insert(files.begin(), files.end());
  source.set_reading_rules(record.submitted.reading_rules);
  if (record.submitted.seed.has_value()) {
    source.set_seed(*record.submitted.seed);
  }
  return source;
}

absl::StatusOr<v1::FindingList> FindingsOf(store::Reader& reader, std::int64_t campaign) {
  ASSIGN_OR_RETURN(const auto record, reader.Campaign(campaign));
  ASSIGN_OR_RETURN(const auto findings, reader.Findings(campaign));
  v1::FindingList list;
  for (const store::FindingRecord& finding : findings) {
    v1::Finding& message = *list.add_findings();
    message.set_kind(finding.kind);
    message.set_digest(finding.digest);
    message.set_created_unix_ms(finding.created_unix_ms);
  }
  return list;
}

absl::StatusOr<std::vector<v1::LogEntry>> LogOf(store::Reader& reader, std::int64_t campaign) {
  ASSIGN_OR_RETURN(const auto record, reader.Campaign(campaign));
  ASSIGN_OR_RETURN(const auto events, reader.Events(campaign));
  std::vector<v1::LogEntry> entries;
  for (const store::EventRecord& event : events) {
    v1::LogEntry& entry = entries.emplace_back();
    entry.set_unix_ms(event.unix_ms);
    entry.set_what(event.what);
  }
  return entries;
}

}  // namespace calib::service
