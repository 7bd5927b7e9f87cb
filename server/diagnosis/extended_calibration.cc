#include "server/diagnosis/extended_calibration.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/registry/declared_effects.h"
#include "server/campaign/model/race.h"
#include "server/messages/read_words.h"
#include "server/report/views/comparison.h"

namespace calib::diagnosis {
namespace {

constexpr int kPerParameter = 5;   // samples of an iteration
constexpr int kFewIterations = 2;  // the fewest by which a posterior is seen to stand still
constexpr double kAsFar = 2;       // as ExtensionPlan::near

// No calibration takes more: all iterations, replicates and held-out draws.
std::int64_t MostEvaluations(const campaign::Campaign& campaign, int samples, int iterations) {
  constexpr std::int64_t kReplicatesAndDraws = 100;
  return (static_cast<std::int64_t>(samples) * iterations + kReplicatesAndDraws) *
         static_cast<std::int64_t>(campaign.experiments.size());
}

// Of all parameters of effects that join.
std::map<std::string, dem::DefaultPrior> PriorsOfAll(const report::CampaignView& parent,
                                                     const std::vector<std::string>& effects) {
  std::map<std::string, dem::DefaultPrior> priors;
  for (const std::string& name : effects) {
    if (const auto* effect = dem::FindEffect(parent.campaign.model.user_effects, name))
      priors.merge(PriorsOfExtension(parent, *effect));
  }
  return priors;
}

// Priors of what an extension calibrates, by name.
class PriorsInExtension {
 public:
  PriorsInExtension(const report::CampaignView& parent, const std::vector<std::string>& effects)
      : joining_(PriorsOfAll(parent, effects)) {
    for (const campaign::CalibratedParameter& own : parent.campaign.parameters) {
      base_.emplace(own.name, own.prior);
      order_.push_back(own.name);
    }
    prior_ = campaign::Priors(parent.campaign);
  }
  std::size_t size() const { return base_.size() + joining_.size(); }
  bool Has(const std::string& name) const {
    return base_.count(name) > 0 || joining_.count(name) > 0;
  }
  bool IsInside(const std::string& name, double value) const {
    if (const auto base = base_.find(name); base != base_.end())
      return base->second.InSupport(value);
    const auto joins = joining_.find(name);
    return joins != joining_.end() && joins->second.min <= value && value <= joins->second.max;
  }
  bool AreInside(const std::map<std::string, double>& values) const {
    const bool each = values.size() == size() &&
                      std::all_of(values.begin(), values.end(),
                                  [&](const auto& v) { return IsInside(v.first, v.second); });
    if (!each || !prior_.is_constrained()) return each;
    Eigen::VectorXd base(static_cast<Eigen::Index>(order_.size()));
    for (std::size_t j = 0; j < order_.size(); ++j) {
      const auto known = values.find(order_[j]);
      if (known == values.end()) return false;
      base[static_cast<Eigen::Index>(j)] = known->second;
    }
    return prior_.MeetsConstraints(base);
  }

 private:
  std::map<std::string, inference::Prior> base_;
  std::vector<std::string> order_;  // of these in the parent
  inference::JointPrior prior_;     // of them
  std::map<std::string, dem::DefaultPrior> joining_;
};

// What an extension calibrates of a run of the design; empty where the numerics are changed.
std::map<std::string, double> ValuesInExtension(const PriorsInExtension& priors,
                                                const campaign::Campaign& design,
                                                const v1::Sample& sample) {
  std::map<std::string, double> values;
  for (std::size_t j = 0; j < design.parameters.size(); ++j) {
    const std::string& name = design.parameters[j].name;
    const double value = sample.parameters(static_cast<int>(j));
    if (campaign::IsNumerics(design, name) && value != campaign::NullOf(design, name)) return {};
    if (priors.Has(name)) values[name] = value;
  }
  return values;
}

// Draws of the posterior farther from its mean, but where that lies outside a prior.
std::vector<std::map<std::string, double>> WiderDraws(const PriorsInExtension& priors,
                                                      const NamedModel& model, int most) {
  std::vector<std::map<std::string, double>> wider;
  const auto draws = static_cast<int>(model.draws.size());
  for (int i = 0; i < std::min(most, draws); ++i) {
    const auto& draw = model.draws[static_cast<std::size_t>(i * draws / std::min(most, draws))];
    std::map<std::string, double> moved = draw;
    for (auto& [name, value] : moved) {
      const auto place = model.posterior.find(name);
      if (place == model.posterior.end()) continue;
      value = place->second.center + kAsFar * (value - place->second.center);
    }
    if (priors.AreInside(moved)) {
      wider.push_back(std::move(moved));
    } else if (priors.AreInside(draw)) {
      wider.push_back(draw);
    }
  }
  return wider;
}

}  // namespace

std::vector<campaign::Derivation::Row> RunsOfModel(const report::CampaignView& parent,
                                                   const report::CampaignView& design,
                                                   const std::vector<std::string>& effects) {
  const std::set<std::string> wanted(effects.begin(), effects.end());
  const PriorsInExtension priors(parent, effects);
  std::vector<campaign::Derivation::Row> rows;
  for (const v1::Sample& sample : design.samples) {
    if (messages::StatusOf(sample) != campaign::EvaluationStatus::kFinished) continue;
    const std::vector<double> all(sample.parameters().begin(), sample.parameters().end());
    const std::vector<std::string> active = campaign::ActiveEffects(design.campaign, all);
    if (std::set(active.begin(), active.end()) != wanted) continue;
    auto values = ValuesInExtension(priors, design.campaign, sample);
    if (!priors.AreInside(values)) continue;
    rows.push_back({.like = sample.has_stream()
                                ? sample.stream()
                                : campaign::StreamOf(design.campaign, sample.index()),
                    .values = std::move(values)});
  }
  return rows;
}

double ErrorOf(const report::CampaignView& view) {
  return report::Compare(view, report::PredictReadings(view)).rms_error;
}

absl::StatusOr<ExtensionPlan> PlanExtended(const report::CampaignView& parent,
                                           const NamedModel& model,
                                           const ExtendedOptions& options) {
  const std::optional<std::int64_t>& budget = options.budget;
  const campaign::Campaign& campaign = parent.campaign;
  if (campaign.precomputed)  // its runs are there
    return ExtensionPlan{.effects = model.effects, .purpose = "extension"};
  ExtensionPlan plan{.effects = model.effects,
                     .purpose = "extension",
                     .near = model.posterior,
                     .samples = std::nullopt,
                     .iterations = std::nullopt};
  int samples = campaign.samples;
  int iterations = campaign.max_iterations;
  int first = 0;  // runs that come first, beside those of the design
  const bool learns = campaign.method->weighs_samples() || campaign.method->takes_rows();
  if (learns && options.design != nullptr)
    plan.given = RunsOfModel(parent, *options.design, model.effects);
  if (!plan.given.empty()) plan.method = campaign.method->extended_by();
  if (campaign.method->weighs_samples()) {
    const PriorsInExtension priors(parent, model.effects);
    samples = kPerParameter * static_cast<int>(priors.size());
    iterations = kFewIterations * options.times;
    plan.method = campaign.method->extended_by();
    plan.samples = samples;
    plan.iterations = iterations;
    for (auto& draw : WiderDraws(priors, model, samples)) {
      plan.given.push_back(
          {.like = static_cast<int>(plan.given.size()), .values = std::move(draw)});
      ++first;
    }
    first += samples;
  }
  const auto fitted =
      std::count_if(campaign.experiments.begin(), campaign.experiments.end(),
                    [](const auto& e) { return e.role == campaign::Role::kCalibrate; });
  if (!campaign.method->weighs_samples()) {
    campaign::Campaign grown = campaign;
    grown.parameters.resize(PriorsInExtension(parent, model.effects).size());
    grown.table.reset();
    first = campaign.method->FirstBatch(grown) + static_cast<int>(plan.given.size());
  }
  const std::int64_t least = static_cast<std::int64_t>(first) * fitted;
  if (budget && *budget < least) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "an iteration takes ", least, " model evaluations, and ", *budget, " are left"));
  }
  const std::optional<std::int64_t>& own = campaign.budget.model_evaluations;
  if (budget && (own || *budget < MostEvaluations(campaign, samples, iterations + 1)))
    plan.model_evaluations = own ? std::min(*budget, *own) : *budget;
  return plan;
}

bool IsFound(const report::CampaignView& extended, const NamedModel& model) {
  // Over a posterior, of noise sd: where the emulator knows less, the mean may lie anywhere
  // (inference/emulator/README.md).
  constexpr double kKnown = 0.3;
  // A right model at its posterior misses readings by their errors.
  constexpr double kRight = 1;
  if (!extended.campaign.method->weighs_samples() || extended.posterior.converged()) return true;
  if (extended.posterior.posterior_from() == "none") return false;
  const double unknown = extended.posterior.posterior_from() == "emulator"
                             ? extended.posterior.emulator().unknown()
                             : 0;
  return unknown <= kKnown && ErrorOf(extended) <= std::max(model.rms, kRight);
}

}  // namespace calib::diagnosis
