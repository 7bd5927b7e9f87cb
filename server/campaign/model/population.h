#pragma once
// Parameters with a value for each experiment or batch around a common one,
// {per: batch, spread: {prior: half_normal, sd: 0.05}}: a hierarchical model
//   value of label l = common + spread * score_l,   score_l ~ N(0, 1)
// [Gelman et al. 2013, Bayesian Data Analysis, ch. 5; non-centred, Betancourt & Girolami 2015].
// Common value, spread and scores are calibrated parameters; the values of the labels follow. A
// label that no fitted experiment has keeps the prior of its score: its value is a draw from the
// population. Pure.

#include <array>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "inference/prior/joint_prior.h"
#include "inference/sampling/philox.h"
#include "server/campaign/model/word_table.h"

namespace calib::campaign {

struct Campaign;
struct Experiment;

enum class Per { kExperiment, kBatch };
inline constexpr std::array kPerWords = {
    Word{Per::kExperiment, "experiment"},
    Word{Per::kBatch, "batch"},
};

struct Population {
  std::string name{};  ///< of the common value; dotted
  std::string unit{};  ///< SI
  Per per = Per::kExperiment;
  std::size_t common = 0, spread = 0;  ///< indices into Campaign::parameters
  std::vector<std::string> labels{};   ///< that have a value of their own
  std::vector<std::size_t> scores{};   ///< of each label, indices into Campaign::parameters
  /// What every value has to lie in, SI: the bounds of the common value's prior.
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
};

/// "NAME.spread", "NAME@LABEL" and "NAME@LABEL.score". No label ends in ".score".
std::string SpreadName(const std::string& name);
std::string MemberName(const std::string& name, const std::string& label);
std::string ScoreName(const std::string& name, const std::string& label);
inline constexpr const char* kScoreSuffix = ".score";
/// Whether it is such a name of a score.
bool IsScoreName(const std::string& name);

/// The label of an experiment under a population of this kind; empty: it has none.
const std::string& LabelOf(Per per, const Experiment& experiment);

/// Values of a population's labels in their order, SI. values: in the order of
/// Campaign::parameters.
std::vector<double> MembersOf(const Population& population, std::span<const double> values);

/// The values as an experiment has them: in the place of each common value that of the experiment's
/// label. An experiment of another label has the common value. values: in the order of
/// Campaign::parameters, with common values; never those that this function gave.
std::vector<double> ValuesIn(const Campaign& campaign, const Experiment& experiment,
                             std::span<const double> values);

/// A draw of the score of a label that nothing is known of, where the common value and the spread
/// are these: standard normal, cut off where its value would leave the population's bounds.
double DrawScore(const Population& population, double common, double spread,
                 inference::PhiloxStream& stream);

/// The bounds of all values of labels, for JointPrior; none where nothing bounds them.
std::vector<inference::MemberBounds> MemberBoundsOf(const Campaign& campaign);

/// Parameters that the readings of the fitted experiments can choose: a population counts as the
/// labels of these experiments.
int FreeParameters(const Campaign& campaign);

}  // namespace calib::campaign
