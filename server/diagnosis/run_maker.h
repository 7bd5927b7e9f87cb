#pragma once
// Who makes the runs that a diagnosis asks for: a server here, a simulator in closed form in tests.

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/campaign/model/campaign.h"
#include "server/client/laboratory.h"

namespace calib::diagnosis {

/// A batch as it is asked for.
struct RunBatch {
  int number = 0;  ///< among the batches of the design, from 0
  campaign::SamplePurpose stage = campaign::SamplePurpose::kScout;
  /// 1 .. campaign::kMostRowsOfBatch rows; values in the order of DesignRows::names().
  std::vector<campaign::RunOf> rows{};
};

/// A run that has ended.
struct EndedRun {
  campaign::RunOf run{};
  /// T: what the fitted experiments of the base campaign read of it, SI, in the order of
  /// campaign::MakeDataSet; all finite. Empty: it did not come to the last reading.
  std::optional<Eigen::RowVectorXd> readings{};
  std::string reason{};  ///< why it did not, in a clause; may be empty
};

/// A batch all of whose runs have ended, in the order in which they were asked for.
struct EndedBatch {
  campaign::SamplePurpose stage = campaign::SamplePurpose::kScout;
  std::vector<EndedRun> runs{};
};

/// Makes batches one after the other and keeps them: what is asked again after an interruption is
/// not made again. Not thread-safe.
class RunMaker {
 public:
  virtual ~RunMaker() = default;
  /// The batches that were made, by number; waits for runs that were begun.
  virtual absl::StatusOr<std::vector<EndedBatch>> Batches() = 0;
  /// Makes the next batch: batch.number is Batches().size(). Errors: those of the runs.
  virtual absl::StatusOr<EndedBatch> Make(const RunBatch& batch) = 0;
};

/// The batches of a design. names: DesignRows::names(), which the design's parameters have in an
/// order of their own. FAILED_PRECONDITION where they have others, or a run is still open.
absl::StatusOr<std::vector<EndedBatch>> EndedBatchesOf(const report::CampaignView& design,
                                                       const std::vector<std::string>& names);

/// Adds the batches to a design of a server.
class ServerRunMaker : public RunMaker {
 public:
  /// laboratory outlives it. design: as it is stored, without an open run; names as
  /// EndedBatchesOf(); what: the runs in words, for who waits.
  ServerRunMaker(client::Laboratory& laboratory, report::CampaignView design,
                 std::vector<std::string> names, std::string what);
  absl::StatusOr<std::vector<EndedBatch>> Batches() override;
  absl::StatusOr<EndedBatch> Make(const RunBatch& batch) override;
  const report::CampaignView& design() const { return design_; }  ///< with all batches so far

 private:
  client::Laboratory& laboratory_;
  report::CampaignView design_;
  std::vector<std::string> names_;
  std::string what_;
};

}  // namespace calib::diagnosis
