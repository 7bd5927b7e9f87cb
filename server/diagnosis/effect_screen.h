#pragma once
// What each effect would change: pairs of runs with and without it, from the best runs of a fitted
// campaign, on the same packing with the same seed.

#include <Eigen/Dense>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "dem/registry/catalog.h"
#include "dem/registry/registry.h"
#include "inference/diagnosis/screen.h"
#include "server/campaign/file/text/yaml_tree.h"
#include "server/campaign/model/campaign.h"
#include "server/diagnosis/fitted_campaign.h"
#include "server/diagnosis/screen_shares.h"

namespace calib::diagnosis {

/// Squared length of a difference of histories over that of a measurement from a model that is
/// right.
using SquareOfDifference = std::function<double(const Eigen::VectorXd&)>;

class EffectScreen {
 public:
  explicit EffectScreen(const FittedCampaign& base) : base_(base) {}

  /// What twice the rate, half the step and twice the damping of staging change: no physics. Those
  /// of experiments with a loading_rate and of flows are left as they are; none where there are no
  /// others. Of all, or as many as SharesOfScreen() says.
  absl::StatusOr<std::vector<Eigen::VectorXd>> MeasureNuisance(
      const std::vector<std::string>& without);

  /// Model evaluations that MeasureNuisance() and MeasureSignatures() take together.
  std::int64_t Planned(const std::vector<std::string>& without) const;

  /// The readings that signatures are about, ascending: all, or where SharesOfScreen() says so
  /// those of ScreenedPart().
  std::vector<Eigen::Index> Readings(const std::vector<std::string>& without) const;

  /// What is left out to keep within the cap, in a sentence; empty: nothing.
  std::string WhatIsLeftOut(const std::vector<std::string>& without) const;

  /// One signature of each effect that the fitted tests can show, of as many runs as
  /// SharesOfScreen() says and over Readings(). `without` take no part. The first strength is the
  /// catalogue's; the second is that of SecondStep(), or as a user's effect says.
  absl::StatusOr<std::vector<inference::Signature>> MeasureSignatures(
      const std::vector<std::string>& without, const SquareOfDifference& square_of);

  /// Parameters in SI at a multiple of the `which`th difference of a signature; what the ray of
  /// strength holds constant is part of it.
  std::map<std::string, double> StrengthOf(const std::string& effect, std::size_t which,
                                           double multiple) const;

  /// Effects that could not be judged, and why.
  const std::vector<std::pair<std::string, std::string>>& not_excitable() const {
    return not_excitable_;
  }
  std::int64_t evaluations() const { return evaluations_; }

  /// A run with an effect in all fitted experiments: everything that its parameters are set to, SI,
  /// and its history.
  struct EffectRun {
    std::map<std::string, double> values;
    Eigen::VectorXd history;
    int stream = 0;  ///< that of the run without the effect
  };
  std::vector<EffectRun> RunsWith(const std::string& effect) const;

 private:
  // One step away from the model without the effect.
  struct Step {
    const dem::StrengthRay* ray = nullptr;
    double step = 0;
  };
  // A run without the effect and the campaign that repeats it with the effect.
  struct Pair {
    Step step;
    Eigen::Index without = 0;
    campaign::Derivation with;
    std::string what;
  };
  Pair PairOf(const dem::EffectInfo& effect, Step step, std::size_t k, Eigen::Index without) const;
  static std::vector<Step> StepsOf(const dem::EffectInfo& effect, std::size_t rows);
  std::string WhyNotExcitable(const dem::EffectInfo& effect) const;
  /// reasons: of those that are not, added where it is not nullptr.
  using Reasons = std::vector<std::pair<std::string, std::string>>;
  std::vector<const dem::EffectInfo*> Excitable(const std::vector<std::string>& without,
                                                Reasons* reasons) const;
  // What is run, and on what.
  struct Plan {
    std::vector<const dem::EffectInfo*> effects;
    ScreenShares shares;
    campaign::Campaign part;  ///< as ScreenedPart()
  };
  Plan PlanOf(const std::vector<std::string>& without, Reasons* reasons) const;
  std::vector<Eigen::Index> ReadingsOf(const campaign::Campaign& part) const;
  std::vector<campaign::YamlNode> EntriesOf(const campaign::Campaign& part) const;
  bool IsCalculated(const dem::EffectInfo& effect) const;
  void Calculate(const dem::EffectInfo& effect, const std::vector<Eigen::Index>& runs,
                 inference::Signature& signature);
  absl::Status Measure(const dem::EffectInfo& effect, const Pair& pair,
                       inference::Signature& signature);
  void Keep(const dem::EffectInfo& effect, const Pair& pair, const Eigen::RowVectorXd& history,
            int stream, inference::Signature& signature);

  const FittedCampaign& base_;
  std::vector<Eigen::Index> readings_;       // as Readings()
  std::vector<campaign::YamlNode> entries_;  // experiments of the runs; none: all that are fitted
  std::map<std::string, std::vector<Step>> tried_;
  std::map<std::string, std::vector<EffectRun>> runs_with_;
  std::map<std::string, std::string> diverged_;  // by effect: why its last run did
  std::vector<std::pair<std::string, std::string>> not_excitable_;
  std::int64_t evaluations_ = 0;
};

}  // namespace calib::diagnosis
