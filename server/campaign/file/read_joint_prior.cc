#include "server/campaign/file/read_joint_prior.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "inference/numerics/decompositions.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {
namespace {

using inference::LinearConstraint;

std::vector<std::string> Names(const Campaign& campaign) {
  std::vector<std::string> names;
  for (const CalibratedParameter& parameter : campaign.parameters) names.push_back(parameter.name);
  return names;
}

std::optional<std::size_t> IndexOf(const Campaign& campaign, const std::string& name) {
  for (std::size_t j = 0; j < campaign.parameters.size(); ++j) {
    if (campaign.parameters[j].name == name) return j;
  }
  return std::nullopt;
}

std::string Unknown(const Campaign& campaign, const std::string& name) {
  return absl::StrCat("'", name, "' is not calibrated here; calibrated are ",
                      Listed(Names(campaign)));
}

// --- correlations --------------------------------------------------------------------------------

std::optional<Eigen::MatrixXd> ReadCorrelation(MapReader& map, const Campaign& campaign) {
  const YamlNode* node = map.Find("prior_correlation");
  if (node == nullptr) return std::nullopt;
  const auto d = static_cast<Eigen::Index>(campaign.parameters.size());
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(d, d);
  const std::string path = map.PathOf("prior_correlation");
  constexpr const char* kForm =
      "has to be a list of [parameter, parameter, number], e.g. "
      "[[young_modulus, friction_angle, 0.5]]";
  if (node->kind != YamlNode::Kind::kSequence) {
    map.Problem("prior_correlation", kForm);
    return std::nullopt;
  }
  bool sound = true;
  const auto refuse = [&](const YamlNode& item, const std::string& message) {
    map.problems().Add(item.line, path, message);
    sound = false;
  };
  for (const YamlNode& item : node->items) {
    if (item.kind != YamlNode::Kind::kSequence || item.items.size() != 3) {
      refuse(item, kForm);
      continue;
    }
    const auto first = IndexOf(campaign, item.items[0].scalar);
    const auto second = IndexOf(campaign, item.items[1].scalar);
    if (!first || !second) {
      refuse(item, Unknown(campaign, item.items[first ? 1 : 0].scalar));
      continue;
    }
    const auto value =
        ReadQuantity(item.items[2], path, "1",
                     {.min = -1, .max = 1, .min_open = true, .max_open = true}, map.problems());
    if (!value) {
      sound = false;
      continue;
    }
    const auto j = static_cast<Eigen::Index>(*first);
    const auto k = static_cast<Eigen::Index>(*second);
    if (j == k || correlation(j, k) != 0) {
      refuse(item, j == k ? absl::StrCat(item.items[0].scalar, " is correlated with itself by one")
                          : absl::StrCat("the correlation of ", item.items[0].scalar, " and ",
                                         item.items[1].scalar, " is given twice"));
      continue;
    }
    correlation(j, k) = correlation(k, j) = *value;
  }
  if (!sound) return std::nullopt;
  const Eigen::LLT<Eigen::MatrixXd> factor(correlation);
  if (factor.info() != Eigen::Success || factor.matrixLLT().diagonal().minCoeff() < 1e-6) {
    map.Problem("prior_correlation",
                "these correlations contradict each other: their matrix is not positive definite; "
                "weaken one of them");
    return std::nullopt;
  }
  return correlation;
}

// --- constraints ---------------------------------------------------------------------------------

// coefficient * parameter, or a constant.
struct Term {
  double value = 0;
  std::optional<std::size_t> parameter;
  std::optional<Dimension> dimension;  // empty: a plain constant, SI of whatever is needed
};

Dimension Product(const Dimension& a, const Dimension& b) {
  return {.kilogram = a.kilogram + b.kilogram,
          .metre = a.metre + b.metre,
          .second = a.second + b.second,
          .radian = a.radian + b.radian};
}

// "a + 2 * b - 3 deg" at the signs between blanks; the sign goes with its term.
std::vector<std::string> SplitTerms(const std::string& side) {
  std::vector<std::string> terms(1);
  for (std::size_t i = 0; i < side.size(); ++i) {
    const bool sign = (side[i] == '+' || side[i] == '-') && i > 0 && side[i - 1] == ' ' &&
                      i + 1 < side.size() && side[i + 1] == ' ';
    if (sign && !absl::StripAsciiWhitespace(terms.back()).empty()) {
      terms.emplace_back(side[i] == '-' ? 1 : 0, '-');
      ++i;  // the blank behind it
    } else {
      terms.back() += side[i];
    }
  }
  return terms;
}

// Empty: a problem, put into `wrong`.
std::optional<Term> ReadTerm(const std::string& text, const Campaign& campaign,
                             std::string& wrong) {
  std::string rest(absl::StripAsciiWhitespace(text));
  Term term{.value = 1, .parameter = std::nullopt, .dimension = std::nullopt};
  if (rest.size() > 1 && rest[0] == '-' &&
      (std::isalpha(static_cast<unsigned char>(rest[1])) != 0)) {
    term.value = -1;
    rest = rest.substr(1);
  }
  std::string number;
  std::string name;
  const std::size_t star = rest.rfind('*');
  if (star != std::string::npos) {
    number = std::string(absl::StripAsciiWhitespace(rest.substr(0, star)));
    name = std::string(absl::StripAsciiWhitespace(rest.substr(star + 1)));
  } else if (!rest.empty() && std::isalpha(static_cast<unsigned char>(rest[0])) != 0) {
    name = rest;
  } else {
    number = rest;
  }
  if (!name.empty()) {
    term.parameter = IndexOf(campaign, name);
    if (!term.parameter) {
      wrong = Unknown(campaign, name);
      return std::nullopt;
    }
    term.dimension =
        ParseUnit(campaign.parameters[*term.parameter].unit).value_or(Unit{}).dimension;
  }
  if (number.empty() && !name.empty()) return term;
  const auto quantity = SplitQuantity(number);
  if (!quantity.ok() || !std::isfinite(quantity->value)) {
    wrong = absl::StrCat("'", std::string(absl::StripAsciiWhitespace(text)),
                         "' is no term; a term is NAME, NUMBER * NAME or NUMBER with a unit");
    return std::nullopt;
  }
  const auto unit = ParseUnit(quantity->unit);
  if (!unit.ok()) {
    wrong = std::string(unit.status().message());
    return std::nullopt;
  }
  term.value *= quantity->value * unit->factor;
  if (term.parameter) {
    term.dimension = Product(*term.dimension, unit->dimension);
  } else if (!quantity->unit.empty()) {
    term.dimension = unit->dimension;
  }
  return term;
}

std::optional<LinearConstraint> ParseConstraint(const std::string& text, const Campaign& campaign,
                                                std::string& wrong) {
  const std::size_t at = text.find_first_of("<>");
  const bool or_equal = at != std::string::npos && at + 1 < text.size() && text[at + 1] == '=';
  const std::size_t behind = at + (or_equal ? 2 : 1);
  if (at == std::string::npos || text.find_first_of("<>=", behind) != std::string::npos) {
    wrong = absl::StrCat("'", text,
                         "' is no constraint; write one inequality, e.g. "
                         "friction_angle <= 2 * other");
    return std::nullopt;
  }
  const double direction = text[at] == '<' ? 1 : -1;
  LinearConstraint constraint{
      .coefficients = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(campaign.parameters.size()))};
  std::optional<Dimension> dimension;
  for (const bool left : {true, false}) {
    const std::string side = left ? text.substr(0, at) : text.substr(behind);
    const double sign = left ? direction : -direction;
    for (const std::string& part : SplitTerms(side)) {
      const auto term = ReadTerm(part, campaign, wrong);
      if (!term) return std::nullopt;
      if (term->dimension && !dimension) dimension = term->dimension;
      if (term->dimension && !SameKind(*term->dimension, *dimension)) {
        wrong = absl::StrCat("'", std::string(absl::StripAsciiWhitespace(part)), "' is in ",
                             SiName(*term->dimension), ", what stands before it in ",
                             SiName(*dimension), "; give its number the unit that is missing");
        return std::nullopt;
      }
      if (term->parameter) {
        constraint.coefficients[static_cast<Eigen::Index>(*term->parameter)] += sign * term->value;
      } else {
        constraint.limit -= sign * term->value;
      }
    }
  }
  if (constraint.coefficients.isZero(0.0)) {
    wrong = absl::StrCat("'", text, "' constrains no parameter");
    return std::nullopt;
  }
  return constraint;
}

std::optional<std::vector<LinearConstraint>> ReadConstraints(MapReader& map,
                                                             const Campaign& campaign) {
  std::vector<LinearConstraint> constraints;
  const YamlNode* node = map.Find("constraints");
  if (node == nullptr) return constraints;
  const std::string path = map.PathOf("constraints");
  const bool single = node->kind == YamlNode::Kind::kScalar;
  if (!single && node->kind != YamlNode::Kind::kSequence) {
    map.Problem("constraints", "has to be a list of inequalities between parameters");
    return std::nullopt;
  }
  const std::vector<YamlNode> items = single ? std::vector<YamlNode>{*node} : node->items;
  bool sound = true;
  for (const YamlNode& item : items) {
    std::string wrong;
    auto constraint = item.kind == YamlNode::Kind::kScalar
                          ? ParseConstraint(item.scalar, campaign, wrong)
                          : std::nullopt;
    if (constraint) {
      constraints.push_back(*std::move(constraint));
      continue;
    }
    sound = false;
    map.problems().Add(item.line, path,
                       wrong.empty() ? "has to be an inequality between parameters" : wrong);
  }
  if (!sound) return std::nullopt;
  return constraints;
}

}  // namespace

void ReadJointPrior(MapReader& campaign_map, Campaign& campaign) {
  campaign_map.Ignore({"prior_correlation", "constraints"});
  const bool given = campaign_map.Has("prior_correlation") || campaign_map.Has("constraints");
  std::vector<inference::MemberBounds> members = MemberBoundsOf(campaign);
  if (!given && members.empty()) return;
  const std::size_t before = campaign_map.problems().size();
  const auto correlation = ReadCorrelation(campaign_map, campaign);
  auto constraints = ReadConstraints(campaign_map, campaign);
  if (campaign_map.problems().size() > before || !constraints) return;
  const bool constrained = !constraints->empty();
  auto prior = inference::JointPrior::Create(MarginalPriors(campaign),
                                             correlation.value_or(Eigen::MatrixXd{}),
                                             *std::move(constraints), std::move(members));
  if (!prior.ok()) {
    campaign_map.Problem(constrained ? "constraints"
                         : given     ? "prior_correlation"
                                     : "parameters",
                         std::string(prior.status().message()));
    return;
  }
  if (campaign.method->holds_parameters() && (constrained || correlation)) {
    campaign_map.Problem(constrained ? "constraints" : "prior_correlation",
                         "does not go with inference.freeze: parameters can be held only where "
                         "the priors are independent of each other");
    return;
  }
  campaign.tied_prior = *std::move(prior);
}

}  // namespace calib::campaign
