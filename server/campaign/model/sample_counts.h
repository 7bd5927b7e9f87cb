#pragma once
// How the samples of an iteration are, from how their evaluations are.

#include <optional>

#include "server/campaign/model/words.h"

namespace calib::campaign {

/// One sample, from its evaluations in the order of its experiments: the first that has ended
/// without a result, else how far it has come. Not thread-safe.
class SampleStatus {
 public:
  /// rests: it is to stop before its end. Whether it is now what the sample has ended by.
  bool Add(EvaluationStatus status, bool rests);
  EvaluationStatus worst() const;
  /// Stopped there, which it may not be for ever.
  bool at_rung() const { return at_rung_; }

 private:
  std::optional<EvaluationStatus> failed_;
  bool at_rung_ = false;
  bool begun_ = false;
  int evaluations_ = 0;
  int finished_ = 0;
};

/// Numbers of samples.
struct SampleCounts {
  int samples = 0;
  int running = 0;
  int finished = 0;
  int diverged = 0;
  int unknown = 0;
  int stopped = 0;  ///< early, but for the next
  int at_rung = 0;  ///< stopped at one
  /// One more of this, or by = -1 one less.
  void Add(const SampleStatus& sample, int by = 1);
  friend bool operator==(const SampleCounts&, const SampleCounts&) = default;
};

}  // namespace calib::campaign
