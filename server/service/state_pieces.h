#pragma once
// The states of a campaign, some samples at a time.

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/v1/campaign.pb.h"
#include "server/store/reader.h"

namespace calib::service {

/// Not thread-safe.
class StatePieces {
 public:
  /// Of one sample, or of all.
  StatePieces(std::string campaign, std::optional<int> sample)
      : campaign_(std::move(campaign)), sample_(sample) {}

  /// Of the next samples that have states, one message per evaluation; none: that was all.
  /// NOT_FOUND: no such campaign or sample.
  absl::StatusOr<std::vector<v1::SampleStates>> Next(store::Reader& reader);

 private:
  absl::Status Begin(store::Reader& reader);

  struct Told {
    std::string experiment;
    std::vector<std::string> observables;
  };
  const std::string campaign_;
  const std::optional<int> sample_;
  bool begun_ = false;
  std::int64_t id_ = 0;
  std::vector<Told> experiments_;
  std::vector<int> samples_;
  std::size_t next_ = 0;  // of samples_
  std::map<store::EvaluationKey, double> core_seconds_;
};

}  // namespace calib::service
