#pragma once
// The states of a campaign, some samples at a time.

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"
#include "absl/synchronization/mutex.h"
#include "calib/v1/campaign.pb.h"
#include "server/store/reader.h"

namespace calib::service {

/// What the states of an experiment are called.
struct ToldExperiment {
  std::string experiment;
  std::vector<std::string> observables;
};

/// That of the experiments of each campaign, read once: a campaign's text stays what it is, and its
/// id is never given again. Thread-safe.
class ToldExperiments {
 public:
  using Experiments = std::shared_ptr<const std::vector<ToldExperiment>>;
  absl::StatusOr<Experiments> Of(store::Reader& reader, std::int64_t campaign);

 private:
  absl::Mutex mutex_;
  std::map<std::int64_t, Experiments> known_ ABSL_GUARDED_BY(mutex_);
};

/// Not thread-safe.
class StatePieces {
 public:
  /// Of one sample, or of all. told: outlives this.
  StatePieces(ToldExperiments& told, std::string campaign, std::optional<int> sample)
      : told_(told), campaign_(std::move(campaign)), sample_(sample) {}

  /// Of the next samples that have states, one message per evaluation; none: that was all.
  /// NOT_FOUND: no such campaign or sample. FAILED_PRECONDITION: they were pruned.
  absl::StatusOr<std::vector<v1::SampleStates>> Next(store::Reader& reader);

 private:
  absl::Status Begin(store::Reader& reader);
  absl::Status CheckAreThere(store::Reader& reader) const;

  ToldExperiments& told_;
  const std::string campaign_;
  const std::optional<int> sample_;
  bool begun_ = false;
  std::int64_t id_ = 0;
  ToldExperiments::Experiments experiments_;
  std::vector<int> samples_;
  std::size_t next_ = 0;  // of samples_
  std::map<store::EvaluationKey, double> core_seconds_;
};

}  // namespace calib::service
