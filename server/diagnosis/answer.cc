#include "server/diagnosis/answer.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/return_if_error.h"
#include "server/report/text/people_units.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;
using inference::EffectModel;
using inference::EffectProbabilities;

// Entries as effects: names in the order of the entries, and for each entry its effect.
struct EffectsOfEntries {
  std::vector<std::string> names;
  std::vector<int> of;
};

EffectsOfEntries EffectsFrom(const std::vector<std::string>& effect_of) {
  EffectsOfEntries effects;
  for (const std::string& name : effect_of) {
    const auto found = std::find(effects.names.begin(), effects.names.end(), name);
    effects.of.push_back(static_cast<int>(found - effects.names.begin()));
    if (found == effects.names.end()) effects.names.push_back(name);
  }
  return effects;
}

// Models of effects, each once in the order of their first; for each model of entries its place.
struct MergedModels {
  std::vector<EffectModel> models;
  std::vector<std::size_t> place;
};

MergedModels MergeModels(const std::vector<EffectModel>& models, const EffectsOfEntries& effects) {
  MergedModels merged;
  for (const EffectModel& model : models) {
    std::set<int> each;
    for (const int k : model.effects) each.insert(effects.of[static_cast<std::size_t>(k)]);
    const EffectModel own{.effects = {each.begin(), each.end()},
                          .none_of_these = model.none_of_these};
    const auto found = std::find(merged.models.begin(), merged.models.end(), own);
    merged.place.push_back(static_cast<std::size_t>(found - merged.models.begin()));
    if (found == merged.models.end()) merged.models.push_back(own);
  }
  return merged;
}

EffectProbabilities MergeProbabilities(const EffectProbabilities& of, const MergedModels& merged,
                                       const EffectsOfEntries& effects) {
  const auto k = static_cast<Index>(effects.names.size());
  EffectProbabilities result{
      .model = Eigen::VectorXd::Zero(static_cast<Index>(merged.models.size())),
      .inclusion = Eigen::VectorXd::Zero(k),
      .share = Eigen::VectorXd::Zero(k),
      .adequate = of.adequate,
      .none_of_these = of.none_of_these,
      .inclusion_sd = Eigen::VectorXd::Zero(k)};
  for (std::size_t i = 0; i < merged.place.size(); ++i)
    result.model[static_cast<Index>(merged.place[i])] += of.model[static_cast<Index>(i)];
  for (std::size_t i = 0; i < merged.models.size(); ++i) {
    const EffectModel& model = merged.models[i];
    const double p = result.model[static_cast<Index>(i)];
    for (const int e : model.effects) {
      result.inclusion[e] += p;
      result.share[e] += p / static_cast<double>(model.effects.size());
    }
  }
  for (std::size_t i = 0; i < effects.of.size(); ++i) {
    double& sd = result.inclusion_sd[effects.of[i]];
    sd = std::max(sd, of.inclusion_sd[static_cast<Index>(i)]);
  }
  return result;
}

Eigen::VectorXd LargestOf(const Eigen::VectorXd& of_entries, const EffectsOfEntries& effects) {
  Eigen::VectorXd result = Eigen::VectorXd::Zero(static_cast<Index>(effects.names.size()));
  for (std::size_t i = 0; i < effects.of.size(); ++i)
    result[effects.of[i]] = std::max(result[effects.of[i]], of_entries[static_cast<Index>(i)]);
  return result;
}

// Smallest angle between any two entries of two effects.
Eigen::MatrixXd AnglesOfEffects(const Eigen::MatrixXd& angles, const EffectsOfEntries& effects) {
  const auto k = static_cast<Index>(effects.names.size());
  Eigen::MatrixXd result = Eigen::MatrixXd::Constant(k, k, 90);
  result.diagonal().setZero();
  for (std::size_t a = 0; a < effects.of.size(); ++a) {
    for (std::size_t b = 0; b < effects.of.size(); ++b) {
      double& own = result(effects.of[a], effects.of[b]);
      own = std::min(own, angles(static_cast<Index>(a), static_cast<Index>(b)));
    }
  }
  return result;
}

std::vector<std::string> NamesIn(const std::vector<int>& effects,
                                 const std::vector<std::string>& names) {
  std::vector<std::string> result;
  result.reserve(effects.size());
  for (const int e : effects) result.push_back(names[static_cast<std::size_t>(e)]);
  return result;
}

std::string InWords(const NamedModel& model) {
  if (model.none_of_these) return "something that this library lacks";
  if (model.effects.empty()) return "nothing (the model as it is)";
  return absl::StrJoin(model.effects, " with ");
}

constexpr double kWorthTelling = 0.05;   // of a second specimen: one chance in twenty
constexpr std::size_t kMostInWords = 3;  // models of a set that are said one by one

constexpr const char* kNumberWords[] = {"none", "one", "two",   "three", "four",
                                        "five", "six", "seven", "eight", "nine"};

std::string NumberInWords(std::size_t n) {
  return n < std::size(kNumberWords) ? kNumberWords[n] : absl::StrCat(n);
}

std::string OneOf(std::vector<std::string> words) {
  const std::string last = words.back();
  words.pop_back();
  return words.empty() ? last : absl::StrCat(absl::StrJoin(words, ", "), " or ", last);
}

// The first few, and how many more.
std::string SomeOf(std::vector<std::string> words) {
  const std::size_t more = words.size() - kMostInWords;
  words.resize(kMostInWords);
  return absl::StrCat(absl::StrJoin(words, ", "), " and ", more, " more");
}

const NamedFamily* SurestFamily(const Answer& answer) {
  const auto family = std::max_element(
      answer.families.begin(), answer.families.end(),
      [](const NamedFamily& a, const NamedFamily& b) { return a.probability < b.probability; });
  return family == answer.families.end() ? nullptr : &*family;
}

std::string Acts(const NamedFamily& family) {
  return absl::StrCat(OneOf(family.effects), " acts, ", report::ChanceInWords(family.probability));
}

std::string ReasonInWords(inference::NotNamed reason) {
  switch (reason) {
    case inference::NotNamed::kOtherPrior:
      return "it is so probable only if its strength is thought to be of one size before";
    case inference::NotNamed::kBeyondDesign:
      return "the measurement lies outside what the runs reach";
    case inference::NotNamed::kVerification:
      return "fresh runs do not keep what the emulator says of it";
  }
  return "";
}

}  // namespace

const char* ToString(AnswerVerdict verdict) { return campaign::WordOf(kVerdictWords, verdict); }

absl::StatusOr<Answer> AnswerFrom(const AnswerParts& parts, const inference::AnswerLevels& levels) {
  const auto entries = static_cast<Index>(parts.effect_of.size());
  if (parts.widths.empty() || parts.beyond.size() != parts.widths.size() ||
      parts.chance.size() != parts.models.size() || parts.angles.rows() != entries ||
      parts.angles.cols() != entries)
    return absl::InvalidArgumentError("parts of an answer do not fit");
  const EffectsOfEntries effects = EffectsFrom(parts.effect_of);
  const std::vector<std::string>& names = effects.names;
  const MergedModels merged = MergeModels(parts.models, effects);
  inference::AnswerBasis basis;
  for (std::size_t w = 0; w < parts.widths.size(); ++w) {
    basis.widths.push_back(MergeProbabilities(parts.widths[w], merged, effects));
    basis.beyond.push_back(LargestOf(parts.beyond[w], effects));
  }
  std::vector<std::pair<int, int>> kin;
  kin.reserve(parts.kin.size());
  for (const auto& [a, b] : parts.kin) {
    kin.emplace_back(effects.of[static_cast<std::size_t>(a)],
                     effects.of[static_cast<std::size_t>(b)]);
  }
  basis.families = inference::Families(AnglesOfEffects(parts.angles, effects), kin);
  // Once runs were made to verify, a name needs some of its own.
  basis.verification =
      Eigen::VectorXd::Constant(static_cast<Index>(names.size()), parts.verified ? 0 : 1);
  for (std::size_t e = 0; e < names.size(); ++e) {
    const auto found = parts.verification.find(names[e]);
    if (found != parts.verification.end())
      basis.verification[static_cast<Index>(e)] = found->second;
  }
  ASSIGN_OR_RETURN(const inference::DiagnosisAnswer core,
                   inference::AnswerOf(basis, merged.models, levels));
  const EffectProbabilities& reference = basis.widths[0];

  Answer answer{.sure = core.sure,
                .adequate = reference.adequate,
                .none_of_these = reference.none_of_these,
                .adequacy_p = parts.adequacy_p};
  for (std::size_t i = 0; i < merged.models.size(); ++i) {
    answer.probabilities.push_back({.effects = NamesIn(merged.models[i].effects, names),
                                    .none_of_these = merged.models[i].none_of_these,
                                    .probability = reference.model[static_cast<Index>(i)]});
  }
  std::stable_sort(
      answer.probabilities.begin(), answer.probabilities.end(),
      [](const NamedModel& a, const NamedModel& b) { return a.probability > b.probability; });
  double sum = 0;
  for (const NamedModel& model : answer.probabilities) {
    answer.credible_set.push_back(model);
    sum += model.probability;
    if (sum >= levels.set) break;
  }
  for (const inference::ProbableFamily& family : core.families) {
    answer.families.push_back(
        {.effects = NamesIn(family.effects, names), .probability = family.probability});
  }

  for (std::size_t e = 0; e < names.size(); ++e) {
    EffectAnswer& own = answer.candidates.emplace_back();
    own.effect = names[e];
    own.probability = reference.inclusion[static_cast<Index>(e)];
    own.uncertain = reference.inclusion_sd[static_cast<Index>(e)];
    own.alone = std::count(core.alone.begin(), core.alone.end(), static_cast<int>(e)) > 0;
    for (const auto& [effect, reason] : core.not_named) {
      if (effect == static_cast<int>(e)) own.not_named = reason;
    }
  }
  const auto in_set = [&answer](const EffectAnswer& candidate) {
    return std::any_of(
        answer.credible_set.begin(), answer.credible_set.end(), [&](const NamedModel& model) {
          return std::count(model.effects.begin(), model.effects.end(), candidate.effect) > 0;
        });
  };
  std::stable_sort(answer.candidates.begin(), answer.candidates.end(),
                   [&](const EffectAnswer& a, const EffectAnswer& b) {
                     const bool a_in = in_set(a), b_in = in_set(b);
                     return a_in != b_in ? a_in : a.probability > b.probability;
                   });

  const NamedModel& first = answer.probabilities.front();
  const auto is_named = [&answer](const std::string& name) {
    return std::any_of(
        answer.candidates.begin(), answer.candidates.end(),
        [&name](const EffectAnswer& own) { return own.effect == name && own.alone; });
  };
  bool any_passes = false;
  for (std::size_t i = 0; i < parts.models.size(); ++i)
    any_passes = any_passes || (!parts.models[i].none_of_these && parts.chance[i] >= parts.level);
  if (!first.effects.empty() && std::all_of(first.effects.begin(), first.effects.end(), is_named)) {
    answer.verdict = AnswerVerdict::kMissingEffect;
    for (const EffectAnswer& own : answer.candidates) {
      if (std::count(first.effects.begin(), first.effects.end(), own.effect) > 0)
        answer.effects.push_back(own.effect);
    }
  } else if (parts.adequacy_p >= parts.level) {
    answer.verdict = AnswerVerdict::kAdequate;
  } else if (core.unexplained || !any_passes) {
    answer.verdict = AnswerVerdict::kUnexplained;
  }
  answer.sentence = VerdictInWords(answer);
  return answer;
}

std::string VerdictInWords(const Answer& answer) {
  std::string beside;  // why a probable effect is not named
  for (const EffectAnswer& own : answer.candidates) {
    if (!own.not_named) continue;
    beside = absl::StrCat(" ", own.effect, ", ", report::ChanceInWords(own.probability),
                          ", is not named: ", ReasonInWords(*own.not_named), ".");
    break;
  }
  switch (answer.verdict) {
    case AnswerVerdict::kMissingEffect: {
      double least = 1;
      for (const EffectAnswer& own : answer.candidates) {
        if (own.alone) least = std::min(least, own.probability);
      }
      return absl::StrCat("Missing: ", absl::StrJoin(answer.effects, " with "), ", ",
                          report::ChanceInWords(least),
                          answer.sure ? "." : ", or something alike that this library lacks.");
    }
    case AnswerVerdict::kAdequate: {
      const std::string passes =
          "The model is adequate: it misses the readings no more than a right one would";
      if (answer.probabilities.empty()) return absl::StrCat(passes, ".");  // nobody raced
      const NamedModel& first = answer.probabilities.front();
      if (first.effects.empty() && !first.none_of_these) {
        return absl::StrCat(passes, "; that nothing is missing has probability ",
                            report::ChanceInWords(answer.adequate), ".", beside);
      }
      const NamedFamily* family = SurestFamily(answer);
      return absl::StrCat(passes, ". Yet ",
                          family != nullptr
                              ? Acts(*family)
                              : absl::StrCat(InWords(first), " is more probable (",
                                             report::ChanceInWords(first.probability),
                                             ") than that nothing is missing (",
                                             report::ChanceInWords(answer.adequate), ")"),
                          ".", beside);
    }
    case AnswerVerdict::kUnexplained:
      if (answer.candidates.empty())
        return "The model misses the readings by more than noise and scatter explain.";
      if (answer.none_of_these >= inference::AnswerLevels().unexplained) {
        return absl::StrCat("None of these, ", report::ChanceInWords(answer.none_of_these),
                            ": what is missing is like no effect of this library.", beside);
      }
      return absl::StrCat("No model of the race explains the readings.", beside);
    case AnswerVerdict::kAmbiguous: {
      std::vector<std::string> words;
      double sum = 0;
      for (const NamedModel& model : answer.credible_set) {
        words.push_back(InWords(model));
        sum += model.probability;
      }
      if (words.size() == 1) {
        return absl::StrCat(words[0], ", ", report::ChanceInWords(sum),
                            ", and not certain enough to be named.", beside);
      }
      const std::string end =
          absl::StrCat("; which of them, these tests cannot tell",
                       answer.repeat_names_alone >= kWorthTelling
                           ? absl::StrCat("; on a second specimen they would, with probability ",
                                          report::ChanceInWords(answer.repeat_names_alone))
                           : "",
                       ".", beside);
      if (words.size() <= kMostInWords) {
        return absl::StrCat("One of these ", NumberInWords(words.size()), ", ",
                            report::ChanceInWords(sum), ": ", OneOf(words), end);
      }
      if (const NamedFamily* family = SurestFamily(answer))
        return absl::StrCat(Acts(*family), ": ", SomeOf(words), end);
      return absl::StrCat("One of these ", NumberInWords(words.size()), ", ",
                          report::ChanceInWords(sum), ": ", SomeOf(words), end);
    }
  }
  return "";
}

}  // namespace calib::diagnosis
