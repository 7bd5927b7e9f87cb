#pragma once
// A stored campaign as it is worked on: read again from what was submitted, with what follows from
// it.

#include <Eigen/Core>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/scatter/chi_squared_law.h"
#include "inference/scatter/refit_spread.h"
#include "server/campaign/file/campaign_file.h"
#include "server/campaign/model/campaign.h"
#include "server/store/reader.h"

namespace calib::planning {

/// Where the numbers of a state stand in a row of predictions (the order of
/// inference::DataSet::readings).
class ReadingIndex {
 public:
  ReadingIndex(const campaign::Campaign& campaign, const inference::DataSet& data);

  /// Copies what was measured at this load step out of a state's observables.
  void Place(int experiment, int load_step, std::span<const double> observables,
             Eigen::Ref<Eigen::RowVectorXd, 0, Eigen::InnerStride<>> predictions) const;

 private:
  struct Column {
    Eigen::Index reading;
    std::size_t observable;  ///< position in the state
  };
  std::map<std::pair<int, int>, std::vector<Column>> columns_;  // by (experiment, load step)
};

struct PlanMemory;

struct Definition {
  campaign::Campaign campaign;
  inference::DataSet data;  ///< errors of a reading about a run
  /// Errors of a reading about the mean history, where the scatter of runs is part of `data`.
  std::optional<inference::DataSet> mean_data{};
  /// Where the scatter has been measured on several packings.
  std::optional<inference::Replicates> replicates{};
  /// Of the errors of `data`, where the scatter of packings or twins is part of them.
  inference::KnownFrom known{};
  Eigen::MatrixXd of_scatter{};  ///< that part of the covariance of `data`; or empty
  inference::JointPrior priors;
  ReadingIndex readings;
  /// Kept from one plan to the next. A campaign has one plan in the making at a time.
  std::shared_ptr<PlanMemory> memory{};

  /// Load steps that a complete evaluation of the experiment has.
  std::vector<int> LoadSteps(int experiment) const;
  /// Numbers in one of its states.
  std::size_t StateSize(int experiment) const;
  /// Indices of the experiments with this role, in the order of the file.
  std::vector<int> ExperimentsOf(campaign::Role role) const;
};

/// Reads files by their digests in `files` (path -> digest) from the store. unread: becomes the
/// first error of the store itself, which is no fault of the campaign's and may pass; may be null.
campaign::FileReader StoredFiles(store::Reader& reader,
                                 const std::map<std::string, std::string>& files,
                                 absl::Status* unread = nullptr);

/// What a stored sample is run with.
campaign::RunOf ToRun(const campaign::Campaign& campaign, const store::SampleRecord& sample);

/// FAILED_PRECONDITION when what was accepted once is refused by this program (the message has the
/// first problem).
absl::StatusOr<std::shared_ptr<const Definition>> LoadDefinition(
    const campaign::MethodList& methods, store::Reader& reader,
    const store::NewCampaign& submitted);

std::shared_ptr<const Definition> MakeDefinition(campaign::Campaign campaign);

}  // namespace calib::planning
