#pragma once
// A calibration of a model with more effects, made again with more runs until it has found what a
// refit of the diagnosis found.

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/client/laboratory.h"
#include "server/diagnosis/diagnosis.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// Where a refit has come closest.
struct ClosestRun {
  std::map<std::string, double> values{};  ///< of the calibrated parameters, SI; empty: not known
  double rms = std::numeric_limits<double>::infinity();  ///< residual over noise sd
};

ClosestRun ClosestRunWith(const std::string& effect, const Diagnosis& diagnosis);

/// Posterior means of all but an effect's parameters. What is needless is weak, so that the others
/// are near where they will be without it.
ClosestRun ClosestRunWithout(const std::string& effect, const report::CampaignView& view);

/// Of the fitted data, as in report::Comparison.
double ErrorOf(const report::CampaignView& view);

class ExtendedCalibration {
 public:
  /// times: as often as the parent's iterations are made at most, >= 1. budget: model evaluations
  /// of the fitted tests; none: as many as it takes. laboratory must outlive it.
  ExtendedCalibration(client::Laboratory& laboratory, int times, std::optional<std::int64_t> budget)
      : laboratory_(laboratory), times_(times), budget_(budget) {}

  /// The parent's iterations with the effects on top, about `closest`; as many again, and so on, as
  /// long as they do not come as close as that. Of these the closest by what is fitted. Errors:
  /// RESOURCE_EXHAUSTED where the budget allows no iteration; those of the runs.
  absl::StatusOr<report::CampaignView> Of(const report::CampaignView& parent,
                                          const std::vector<std::string>& effects,
                                          const ClosestRun& closest);

  /// That were made, held-out ones too.
  std::int64_t evaluations() const { return evaluations_; }

 private:
  absl::StatusOr<report::CampaignView> Once(const report::CampaignView& parent,
                                            const std::vector<std::string>& effects,
                                            const ClosestRun& closest, int times);

  client::Laboratory& laboratory_;
  int times_;
  std::optional<std::int64_t> budget_;
  std::int64_t evaluations_ = 0;
};

}  // namespace calib::diagnosis
