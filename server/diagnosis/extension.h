#pragma once
// A campaign joined by effects: its text, warm-started from the posterior of the campaign without.

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "dem/registry/catalog.h"
#include "server/campaign/file/derive.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// Pressure, grain size and stiffness that make strengths of effects comparable; of tests without a
/// pressure, what the weight of their grains or their impact amounts to. Geometric mean of the
/// calibrated experiments.
dem::ReferenceState ReferenceOf(const report::CampaignView& view);

/// The priors with which an effect would join the model: of its parameters that are calibrated
/// then, by dotted name.
std::map<std::string, dem::DefaultPrior> PriorsOfExtension(const report::CampaignView& parent,
                                                           const dem::EffectInfo& effect);

/// Why an effect cannot join the model of a campaign, in a sentence; empty: it can.
std::string WhyNotJoin(const campaign::Campaign& campaign, const std::string& effect);

struct ExtensionPlan {
  std::vector<std::string> effects{};
  std::string purpose{};  ///< a word of kDerivedForWords
  /// What is known of the parameters with the effects, SI: the first samples, but for a tenth from
  /// the prior, are drawn twice as wide about it. Empty: half of them from the prior, half about
  /// the parent's posterior.
  std::map<std::string, campaign::FirstProposal::Place> near{};
  bool held_out = true;                             ///< false: held-out experiments stay closed
  std::optional<std::string> method{};              ///< of the parent's family; as the parent
  std::optional<int> samples{};                     ///< as the parent
  std::optional<int> iterations{};                  ///< as the parent
  std::optional<std::int64_t> model_evaluations{};  ///< budget; as the parent
  /// Runs of the extended model that it learns from beside its samples, where its method takes
  /// rows.
  std::vector<campaign::Derivation::Row> given{};
};

/// Without `near`, the parent's posterior is taken ten times as wide: parameters that were bent to
/// hide an effect lie far from where they belong.
/// Errors: INVALID_ARGUMENT for effects that are unknown or cannot join; FAILED_PRECONDITION when
/// no iteration of the parent is complete.
absl::StatusOr<std::string> ExtensionText(const report::CampaignView& parent,
                                          const ExtensionPlan& plan);

}  // namespace calib::diagnosis
