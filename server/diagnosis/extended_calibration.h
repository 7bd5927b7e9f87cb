#pragma once
// A calibration of a model with more effects, begun where a diagnosis has seen it fit and made
// again with more runs until it comes as close.

#include <cstdint>
#include <optional>

#include "absl/status/statusor.h"
#include "server/client/laboratory.h"
#include "server/diagnosis/answer.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// Of the fitted data, as in report::Comparison.
double ErrorOf(const report::CampaignView& view);

class ExtendedCalibration {
 public:
  /// times: as often as the parent's iterations are made at most, >= 1. budget: model evaluations
  /// of the fitted tests; none: as many as it takes. laboratory must outlive it.
  ExtendedCalibration(client::Laboratory& laboratory, int times, std::optional<std::int64_t> budget)
      : laboratory_(laboratory), times_(times), budget_(budget) {}

  /// The parent's iterations with the model's effects on top, about its posterior; as many again,
  /// and so on, as long as they do not come as close. Of these the closest by what is fitted.
  /// Errors: RESOURCE_EXHAUSTED where the budget allows no iteration; those of the runs.
  absl::StatusOr<report::CampaignView> Of(const report::CampaignView& parent,
                                          const NamedModel& model);

  /// That were made, held-out ones too.
  std::int64_t evaluations() const { return evaluations_; }

 private:
  absl::StatusOr<report::CampaignView> Once(const report::CampaignView& parent,
                                            const NamedModel& model, int times);

  client::Laboratory& laboratory_;
  int times_;
  std::optional<std::int64_t> budget_;
  std::int64_t evaluations_ = 0;
};

}  // namespace calib::diagnosis
