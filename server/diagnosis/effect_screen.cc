#include "server/diagnosis/effect_screen.h"

#include <algorithm>
#include <cassert>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "dem/registry/declared_effects.h"
#include "dem/registry/registry.h"
#include "inference/data/data_set.h"
#include "server/campaign/file/text/yaml_text.h"
#include "server/diagnosis/extension.h"
#include "server/diagnosis/numerical_choices.h"
#include "server/diagnosis/race_list.h"
#include "server/diagnosis/reading_effects.h"
#include "server/diagnosis/screen_strengths.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

constexpr double kNothing = 1e-8;     // of the square of a reading's sd, per reading
constexpr std::size_t kMostRows = 2;  // runs of the campaign from which an effect is tried
constexpr double kWeaker = 0.1;       // of a first strength with which no run comes to its end
constexpr const char* kLoadCell = "load_cell_error";

}  // namespace

std::vector<EffectScreen::Step> EffectScreen::StepsOf(const dem::EffectInfo& effect,
                                                      std::size_t rows) {
  std::vector<Step> steps;
  for (const dem::StrengthRay& ray : effect.rays) {
    if (effect.rays.size() == 1 && rows > 1) steps.push_back({&ray, ray.steps[0]});
    steps.push_back({&ray, ray.steps[1]});
  }
  if (steps.size() > rows) steps.resize(rows);
  return steps;
}

absl::StatusOr<std::vector<Eigen::VectorXd>> EffectScreen::MeasureNuisance(
    const std::vector<std::string>& without) {
  std::vector<campaign::Derivation> changes = NumericalChanges(base_);
  changes.resize(PlanOf(without, nullptr).shares.numerical);
  const auto what = [](const campaign::Derivation& change) {
    return "influence of numerical choices, " + change.name;
  };
  for (const campaign::Derivation& change : changes) {
    RETURN_IF_ERROR(base_.Announce(change, what(change)));
  }
  const Index best = base_.BestRuns(1).front();
  std::vector<Eigen::VectorXd> directions;
  for (const campaign::Derivation& change : changes) {
    ASSIGN_OR_RETURN(const auto view, base_.Run(change, what(change)));
    evaluations_ += base_.fitted_experiments();
    const report::RunTable runs = report::RunsOf(view, base_.readings().of_mean);
    if (runs.sample.empty()) continue;
    directions.emplace_back((runs.histories.row(0) - base_.runs().histories.row(best)).transpose());
  }
  return directions;
}

// Empty: the tests can show it.
std::string EffectScreen::WhyNotExcitable(const dem::EffectInfo& effect) const {
  std::string why = WhyNotShown(base_.view().campaign, effect);
  if (!why.empty()) return why;
  return effect.rays.empty() ? "the catalogue gives no strength to try" : "";
}

std::vector<const dem::EffectInfo*> EffectScreen::Excitable(const std::vector<std::string>& without,
                                                            Reasons* reasons) const {
  std::vector<const dem::EffectInfo*> effects;
  for (const dem::EffectInfo* info : dem::AllEffects(base_.view().campaign.model.user_effects)) {
    const dem::EffectInfo& effect = *info;
    const auto& has = base_.view().campaign.model.effects;
    if (std::find(has.begin(), has.end(), effect.name) != has.end()) continue;
    if (const std::string why = WhyNotJoin(base_.view().campaign, effect.name); !why.empty()) {
      if (reasons != nullptr) reasons->emplace_back(effect.name, why);
      continue;
    }
    const bool left_out = std::find(without.begin(), without.end(), effect.name) != without.end();
    const std::string why = left_out ? "left out as asked for" : WhyNotExcitable(effect);
    if (why.empty()) {
      effects.push_back(&effect);
    } else if (reasons != nullptr) {
      reasons->emplace_back(effect.name, why);
    }
  }
  return effects;
}

EffectScreen::Plan EffectScreen::PlanOf(const std::vector<std::string>& without,
                                        Reasons* reasons) const {
  const std::vector<const dem::EffectInfo*> effects = Excitable(without, reasons);
  std::vector<bool> calculated;
  calculated.reserve(effects.size());
  for (const dem::EffectInfo* effect : effects) calculated.push_back(IsCalculated(*effect));
  Plan plan{.effects = {},
            .shares = SharesOfScreen(effects, calculated, base_.runs().sample.size(),
                                     std::max(1, base_.fitted_experiments()),
                                     NumericalChanges(base_).size()),
            .part = {}};
  plan.part = ScreenedPart(base_.view().campaign, effects, plan.shares.experiments);
  const std::vector<std::size_t> of_each = std::exchange(plan.shares.runs, {});
  for (std::size_t e = 0; e < effects.size(); ++e) {
    if (WhyNotShown(plan.part, *effects[e]).empty()) {
      plan.effects.push_back(effects[e]);
      plan.shares.runs.push_back(of_each[e]);
    } else if (reasons != nullptr) {
      reasons->emplace_back(effects[e]->name,
                            "the experiments that the screen runs do not show it");
    }
  }
  return plan;
}

std::int64_t EffectScreen::Planned(const std::vector<std::string>& without) const {
  const Plan plan = PlanOf(without, nullptr);
  std::size_t runs = 0;
  for (std::size_t e = 0; e < plan.effects.size(); ++e) {
    runs += StepsOf(*plan.effects[e], plan.shares.runs[e]).size();
  }
  return static_cast<std::int64_t>(plan.shares.numerical) * base_.fitted_experiments() +
         static_cast<std::int64_t>(runs) * plan.shares.experiments;
}

std::vector<Index> EffectScreen::ReadingsOf(const campaign::Campaign& part) const {
  const std::vector<inference::Reading>& all = base_.readings().of_mean.readings;
  std::vector<Index> readings;
  for (std::size_t k = 0; k < all.size(); ++k) {
    const auto experiment = static_cast<std::size_t>(all[k].experiment);
    if (part.experiments[experiment].role == campaign::Role::kCalibrate) {
      readings.push_back(static_cast<Index>(k));
    }
  }
  return readings;
}

std::vector<Index> EffectScreen::Readings(const std::vector<std::string>& without) const {
  return ReadingsOf(PlanOf(without, nullptr).part);
}

// Of the campaign's text, whose experiments stand in the same order.
std::vector<campaign::YamlNode> EffectScreen::EntriesOf(const campaign::Campaign& part) const {
  std::vector<campaign::YamlNode> entries;
  const campaign::YamlParse text = campaign::ParseYaml(base_.view().source.campaign_file());
  const campaign::YamlNode* list =
      text.root ? campaign::YamlFind(*text.root, "experiments") : nullptr;
  assert(list != nullptr && list->items.size() == part.experiments.size());
  for (std::size_t e = 0; e < part.experiments.size(); ++e) {
    if (part.experiments[e].role == campaign::Role::kCalibrate) entries.push_back(list->items[e]);
  }
  return entries;
}

std::string EffectScreen::WhatIsLeftOut(const std::vector<std::string>& without) const {
  const Plan plan = PlanOf(without, nullptr);
  std::vector<std::string> left_out;
  if (plan.shares.experiments < base_.fitted_experiments()) {
    std::vector<std::string> names;
    for (const campaign::Experiment& e : plan.part.experiments) {
      if (e.role == campaign::Role::kCalibrate) names.push_back(e.name);
    }
    left_out.push_back(absl::StrCat("runs effects in ", names.size(), " of ",
                                    base_.fitted_experiments(), " fitted experiments (",
                                    absl::StrJoin(names, ", "), "), the refits in all"));
  }
  const std::size_t numerical = NumericalChanges(base_).size();
  if (plan.shares.numerical < numerical) {
    left_out.push_back(
        absl::StrCat("varies ", plan.shares.numerical, " of ", numerical, " numerical choices"));
  }
  if (left_out.empty()) return "";
  return absl::StrCat("To cost no more than it may, the screen ", absl::StrJoin(left_out, " and "),
                      ": more samples allow more.");
}

absl::StatusOr<std::vector<inference::Signature>> EffectScreen::MeasureSignatures(
    const std::vector<std::string>& without, const SquareOfDifference& square_of) {
  std::vector<inference::Signature> signatures;
  const Plan plan = PlanOf(without, &not_excitable_);
  const std::vector<const dem::EffectInfo*>& effects = plan.effects;
  if (effects.empty()) return signatures;
  readings_ = ReadingsOf(plan.part);
  if (plan.shares.experiments < base_.fitted_experiments()) entries_ = EntriesOf(plan.part);
  const std::vector<Index> runs = base_.BestRuns(kMostRows);
  for (const dem::EffectInfo* effect : effects) {
    signatures.push_back(
        {.name = effect->name, .differences = {}, .two_sided = effect->two_sided, .strengths = {}});
  }
  std::vector<std::vector<Step>> steps(effects.size());  // that are run
  for (std::size_t e = 0; e < effects.size(); ++e) {
    if (IsCalculated(*effects[e])) {
      Calculate(*effects[e], runs, signatures[e]);
    } else {
      steps[e] = StepsOf(*effects[e], plan.shares.runs[e]);
    }
  }
  for (std::size_t k = 0; k < kMostRows; ++k) {
    const Index like = runs[std::min(k, runs.size() - 1)];
    std::vector<Pair> pairs;
    // All at once, so that no worker waits for the last run of an effect.
    for (std::size_t e = 0; e < effects.size(); ++e) {
      if (k >= steps[e].size()) continue;
      const bool again = k > 0 && effects[e]->rays.size() == 1;
      if (again && signatures[e].differences.empty()) {
        steps[e][k].step = kWeaker * steps[e][0].step;
      } else if (again && dem::FindEffect(effects[e]->name) != nullptr) {
        steps[e][k].step =
            SecondStep(*effects[e], *steps[e][k].ray, square_of(signatures[e].differences.front()),
                       base_.view().campaign.model.contact, base_.state());
      }
      pairs.push_back(PairOf(*effects[e], steps[e][k], k, like));
      RETURN_IF_ERROR(base_.Announce(pairs.back().with, pairs.back().what));
    }
    auto pair = pairs.begin();
    for (std::size_t e = 0; e < effects.size(); ++e) {
      if (k >= steps[e].size()) continue;
      RETURN_IF_ERROR(Measure(*effects[e], *pair++, signatures[e]));
    }
  }
  const auto changes_nothing = [&square_of](const inference::Signature& signature) {
    return std::all_of(signature.differences.begin(), signature.differences.end(),
                       [&square_of](const auto& d) { return square_of(d) < kNothing; });
  };
  for (const inference::Signature& signature : signatures) {
    if (signature.differences.empty()) {
      const std::string& why = diverged_[signature.name];
      not_excitable_.emplace_back(signature.name, why.empty()
                                                      ? "runs with it diverge"
                                                      : "runs with it diverge (" + why + ")");
    } else if (changes_nothing(signature)) {
      not_excitable_.emplace_back(signature.name, "it changes nothing in these tests");
    }
  }
  std::erase_if(signatures, changes_nothing);  // of no differences too
  return signatures;
}

// A campaign for each step: rays set different parameters. Those of the ray are given by the rows;
// what it holds goes along.
EffectScreen::Pair EffectScreen::PairOf(const dem::EffectInfo& effect, Step step, std::size_t k,
                                        Index without) const {
  Pair pair{.step = step,
            .without = without,
            .with = base_.Derived("screen", absl::StrCat(effect.name, ", step ", k + 1)),
            .what = absl::StrCat("screen of ", effect.name, ", step ", k + 1)};
  pair.with.experiments = entries_;
  pair.with.effects = {effect.name};
  pair.with.fixed = dem::ParametersOnRay(effect, *step.ray, step.step,
                                         base_.view().campaign.model.contact, base_.state());
  pair.with.rows = {base_.RowLike(without)};
  return pair;
}

// Exact, the specimen does not feel what a load cell reads: no run would tell more.
bool EffectScreen::IsCalculated(const dem::EffectInfo& effect) const {
  return effect.name == kLoadCell &&
         MisreadLoads(base_.view().campaign, base_.readings().of_mean,
                      base_.runs().histories.topRows(1), Eigen::VectorXd::Zero(1),
                      Eigen::VectorXd::Zero(1))
             .has_value();
}

// Every ray at the catalogue's second strength, as StepsOf() has them run.
void EffectScreen::Calculate(const dem::EffectInfo& effect, const std::vector<Index>& runs,
                             inference::Signature& signature) {
  for (std::size_t k = 0; k < effect.rays.size(); ++k) {
    const Index like = runs[std::min(k, runs.size() - 1)];
    const Pair pair = PairOf(effect, {&effect.rays[k], effect.rays[k].steps[1]}, k, like);
    const auto strength = [&pair](const char* parameter) {
      const auto found = pair.with.fixed.find(absl::StrCat(kLoadCell, ".", parameter));
      return Eigen::VectorXd::Constant(1, found == pair.with.fixed.end() ? 0.0 : found->second);
    };
    const Eigen::MatrixXd with =
        *MisreadLoads(base_.view().campaign, base_.readings().of_mean,
                      base_.runs().histories.row(like), strength("gain"), strength("offset"));
    const std::vector<int>& streams = base_.runs().stream;
    Keep(effect, pair, with(0, readings_), streams[static_cast<std::size_t>(like)], signature);
  }
}

absl::Status EffectScreen::Measure(const dem::EffectInfo& effect, const Pair& pair,
                                   inference::Signature& signature) {
  ASSIGN_OR_RETURN(const auto view, base_.Run(pair.with, pair.what));
  evaluations_ += entries_.empty() ? base_.fitted_experiments() : std::ssize(entries_);
  const report::RunTable with = report::RunsOf(
      view, inference::Restricted(base_.readings().of_mean, {readings_.begin(), readings_.end()}));
  if (with.sample.empty()) {
    for (const v1::Sample& sample : view.samples) diverged_[effect.name] = sample.reason();
    return absl::OkStatus();
  }
  Keep(effect, pair, with.histories.row(0), with.stream.front(), signature);
  return absl::OkStatus();
}

void EffectScreen::Keep(const dem::EffectInfo& effect, const Pair& pair,
                        const Eigen::RowVectorXd& history, int stream,
                        inference::Signature& signature) {
  signature.differences.emplace_back(
      (history - base_.runs().histories(pair.without, readings_)).transpose());
  if (effect.rays.size() == 1)
    signature.strengths.push_back(ShareAt(*pair.step.ray, pair.step.step));
  tried_[effect.name].push_back(pair.step);
  if (!entries_.empty()) return;
  EffectRun run{.values = pair.with.rows.front().values, .history = history, .stream = stream};
  run.values.insert(pair.with.fixed.begin(), pair.with.fixed.end());
  runs_with_[effect.name].push_back(std::move(run));
}

std::vector<EffectScreen::EffectRun> EffectScreen::RunsWith(const std::string& effect) const {
  const auto found = runs_with_.find(effect);
  return found == runs_with_.end() ? std::vector<EffectRun>{} : found->second;
}

std::map<std::string, double> EffectScreen::StrengthOf(const std::string& name, std::size_t which,
                                                       double multiple) const {
  const Step& step = tried_.at(name)[which];
  const dem::EffectInfo* effect = dem::FindEffect(base_.view().campaign.model.user_effects, name);
  return dem::ParametersOnRay(*effect, *step.ray, step.step * StepFor(*step.ray, multiple),
                              base_.view().campaign.model.contact, base_.state());
}

}  // namespace calib::diagnosis
