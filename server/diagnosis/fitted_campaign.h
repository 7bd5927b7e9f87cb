#pragma once
// A finished campaign as the starting point of further ones: its runs, which of them are best, and
// the campaigns derived from them.

#include <Eigen/Dense>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "dem/registry/catalog.h"
#include "server/campaign/file/derive.h"
#include "server/client/laboratory.h"
#include "server/report/views/campaign_view.h"
#include "server/report/views/run_table.h"

namespace calib::diagnosis {

class FittedCampaign {
 public:
  /// Both must outlive it.
  FittedCampaign(client::Laboratory& laboratory, const report::CampaignView& view);

  const report::CampaignView& view() const { return view_; }
  /// All histories are in the sd of readings().of_mean.
  const report::ScatteredReadings& readings() const { return readings_; }
  const report::RunTable& runs() const { return runs_; }
  /// See ClosedFormsWithout.
  const std::vector<std::optional<Eigen::MatrixXd>>& closed_forms_without() const {
    return closed_forms_without_;
  }
  const dem::ReferenceState& state() const { return state_; }
  const std::string& id() const { return view_.status.campaign(); }
  int fitted_experiments() const;

  /// Rows of runs() by their misfit, the smallest first: at most `count`.
  std::vector<Eigen::Index> BestRuns(std::size_t count) const;
  /// The same parameters, specimen and seed as a run.
  campaign::Derivation::Row RowLike(Eigen::Index run) const;
  /// Nothing changed yet, held-out experiments left out.
  campaign::Derivation Derived(const std::string& purpose, const std::string& what) const;

  /// Submits without waiting.
  absl::Status Announce(const campaign::Derivation& derivation, const std::string& what) const;
  absl::StatusOr<report::CampaignView> Run(const campaign::Derivation& derivation,
                                           const std::string& what) const;
  absl::Status Announce(const std::string& text, const std::string& what) const;
  absl::StatusOr<report::CampaignView> Run(const std::string& text, const std::string& what) const;

 private:
  client::Laboratory& laboratory_;
  const report::CampaignView& view_;
  report::ScatteredReadings readings_;
  report::RunTable runs_;
  std::vector<std::optional<Eigen::MatrixXd>> closed_forms_without_;
  dem::ReferenceState state_;
};

}  // namespace calib::diagnosis
