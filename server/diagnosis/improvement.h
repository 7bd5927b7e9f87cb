#pragma once
// compare -> diagnose -> extend until the misfit is explained or nothing helps. Held-out data are
// looked at for the first and the last model alone, after the verdict.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/client/client.h"
#include "server/client/laboratory.h"
#include "server/diagnosis/diagnosis.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

struct ImproveStep {
  std::string campaign{};
  std::vector<std::string> effects{};
  /// Of this model among those that competed when it was asked for last.
  std::optional<double> probability{};
  double rms_error = 0;  ///< of the fitted data, as in report::Comparison
  std::optional<double> heldout_rms_error{};
  double log_evidence = 0;
  std::string verdict{};
  std::vector<std::string> next_effects{};  ///< join the model in the next step; none: the last one
  std::string reason{};  ///< why the next effects, or why there is no next step; a sentence
};

struct ImprovementLimits {
  int effects = 3;  ///< that are added, at most
  /// Model evaluations of the designs and calibrations, those that were made before included, so
  /// that the same call ends the same way. What a calibration runs on held-out tests counts, and
  /// may exceed it.
  std::optional<std::int64_t> evaluations{};
  std::vector<std::string> without{};  ///< effects that are not to be thought of
};

class Improvement {
 public:
  /// laboratory and client must outlive it.
  Improvement(client::Laboratory& laboratory, client::Client& client,
              const ImprovementLimits& limits)
      : laboratory_(laboratory), client_(client), limits_(limits) {}

  /// Errors: those of the runs; FAILED_PRECONDITION when the base model cannot be judged.
  absl::Status From(report::CampaignView view);

  const std::vector<ImproveStep>& steps() const { return steps_; }
  /// Of the verdict, stored before held-out data were looked at.
  const std::string& digest() const { return digest_; }
  /// Digests of other verdicts on the first campaign for which its held-out data were opened
  /// before: they have been seen by whoever asks again.
  const std::vector<std::string>& opened_before() const { return opened_before_; }
  std::int64_t evaluations() const { return evaluations_; }
  /// One JSON document.
  std::string Json() const;

 private:
  bool Spent() const { return limits_.evaluations && evaluations_ >= *limits_.evaluations; }
  std::optional<std::int64_t> Left() const;
  absl::StatusOr<Diagnosis> Ask(const report::CampaignView& view, bool only_adequacy,
                                std::string& reason);
  absl::StatusOr<Diagnosis> Judge(const report::CampaignView& view, bool last);
  absl::StatusOr<std::optional<report::CampaignView>> Forward(const report::CampaignView& view,
                                                              const Diagnosis& diagnosis, int most);
  absl::StatusOr<report::CampaignView> Calibrate(const report::CampaignView& view,
                                                 const NamedModel& model,
                                                 const report::CampaignView* design);
  absl::Status Open();
  absl::StatusOr<std::vector<std::string>> OpenedBefore();

  client::Laboratory& laboratory_;
  client::Client& client_;
  ImprovementLimits limits_;
  std::int64_t evaluations_ = 0;
  std::vector<ImproveStep> steps_;
  std::optional<double> probability_{};  ///< of the model that is judged next
  std::optional<report::CampaignView> first_, last_;
  std::string digest_;
  std::vector<std::string> opened_before_;
};

}  // namespace calib::diagnosis
