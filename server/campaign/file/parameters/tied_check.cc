#include "server/campaign/file/parameters/tied_check.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "dem/registry/model_parameters.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/model/race.h"

namespace calib::campaign {
namespace {

constexpr double kTailOfTied = 0.001;   // quantile that stands for the end of a prior without one
constexpr std::size_t kMostVaried = 8;  // 3^8 points

bool IsWord(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

// A formula in names that the formula library takes.
struct PlainFormula {
  std::string text;
  std::vector<std::string> names;   // of the parameters, in the order in which they come first
  std::vector<std::string> stands;  // for each of these in `text`
  std::string unknown;              // a name that is none; empty: there is none
};

// Whether a name that begins at `at` could end before `end`.
bool EndsAt(const std::string& text, std::size_t end) {
  if (end >= text.size()) return true;
  if (IsWord(text[end])) return false;
  return !(text[end] == '.' && end + 1 < text.size() && IsWord(text[end + 1]));
}

// Length of the longest of the names that stands at a place; 0: none.
std::size_t NameAt(const std::string& text, std::size_t at, const std::vector<std::string>& names) {
  std::size_t longest = 0;
  for (const std::string& name : names) {
    if (name.size() > longest && text.compare(at, name.size(), name) == 0 &&
        EndsAt(text, at + name.size())) {
      longest = name.size();
    }
  }
  return longest;
}

std::size_t WordAt(const std::string& text, std::size_t at) {
  std::size_t end = at;
  while (end < text.size() && (IsWord(text[end]) || text[end] == '.')) ++end;
  return end - at;
}

// Length of the number at a place; 0: none.
std::size_t NumberAt(const std::string& text, std::size_t at) {
  if (std::isdigit(static_cast<unsigned char>(text[at])) == 0 && text[at] != '.') return 0;
  const std::string rest = text.substr(at);
  char* end = nullptr;
  std::strtod(rest.c_str(), &end);
  return static_cast<std::size_t>(end - rest.c_str());
}

bool IsOfFormulas(const std::string& word) {
  const auto& functions = dem::FormulaFunctions();
  return word == "pi" || std::find(functions.begin(), functions.end(), word) != functions.end();
}

PlainFormula InPlainNames(const std::string& text, const std::vector<std::string>& names) {
  PlainFormula plain;
  for (std::size_t at = 0; at < text.size();) {
    if (const std::size_t length = NameAt(text, at, names); length > 0) {
      const std::string name = text.substr(at, length);
      auto place = std::find(plain.names.begin(), plain.names.end(), name) - plain.names.begin();
      if (place == std::ssize(plain.names)) {
        plain.names.push_back(name);
        plain.stands.push_back(absl::StrCat("value", place, "_"));
      }
      plain.text += plain.stands[static_cast<std::size_t>(place)];
      at += length;
      continue;
    }
    std::size_t length = NumberAt(text, at);
    if (length == 0 && IsWord(text[at])) {
      length = WordAt(text, at);
      const std::string word = text.substr(at, length);
      if (!IsOfFormulas(word) && plain.unknown.empty()) plain.unknown = word;
    }
    length = std::max<std::size_t>(length, 1);
    plain.text += text.substr(at, length);
    at += length;
  }
  return plain;
}

std::optional<std::string> UnitOf(const Campaign& campaign, const std::vector<TieAsWritten>& ties,
                                  const std::string& name) {
  for (const CalibratedParameter& parameter : campaign.parameters) {
    if (parameter.name == name) return parameter.unit;
  }
  for (const TieAsWritten& tie : ties) {
    if (tie.name == name) return tie.unit;
  }
  const dem::ParameterInfo* info = dem::FindParameter(campaign.model, name);
  if (info == nullptr) return std::nullopt;
  return dem::UnitFor(*info, campaign.model.contact);
}

// Why a parameter cannot stand for another one; empty: it can.
std::string WhyOtherKind(const std::string& name, const std::string& unit,
                         const std::string& other) {
  const auto own = ParseUnit(unit);
  const auto another = ParseUnit(other);
  if (!own.ok() || !another.ok() || SameKind(own->dimension, another->dimension)) return "";
  return absl::StrCat("is ", KindOfUnit(unit), ", but ", name, " is ", KindOfUnit(other),
                      "; write what one is of the other, e.g. \"2 * ", name, "\" in SI units");
}

std::vector<std::string> NamesToTieTo(const std::vector<TieAsWritten>& ties,
                                      const Campaign& campaign) {
  std::vector<std::string> names;
  for (const CalibratedParameter& parameter : campaign.parameters) names.push_back(parameter.name);
  for (const auto& [name, value] : campaign.model.parameters) names.push_back(name);
  for (const TieAsWritten& tie : ties) names.push_back(tie.name);
  return names;
}

// Empty after a problem.
std::optional<TiedParameter> TiedOf(const TieAsWritten& tie, const std::vector<TieAsWritten>& ties,
                                    const Campaign& campaign, const SayOfTied& say) {
  const auto refuse = [&](const std::string& why) {
    say(tie.name, why);
    return std::nullopt;
  };
  const std::vector<std::string> names = NamesToTieTo(ties, campaign);
  const PlainFormula plain = InPlainNames(tie.text, names);
  if (!plain.unknown.empty()) {
    return refuse(absl::StrCat(Quoted(plain.unknown), " is neither calibrated nor fixed here; ",
                               Suggestion(plain.unknown, names)));
  }
  if (const auto found = dem::Formula::Check(plain.text, plain.stands); !found.message.empty()) {
    std::string message = found.message;
    for (std::size_t k = 0; k < plain.names.size(); ++k) {
      message = absl::StrReplaceAll(message, {{plain.stands[k], plain.names[k]}});
    }
    return refuse(absl::StrCat(Quoted(tie.text), ": ", message));
  }
  if (plain.names.empty()) {
    return refuse(
        absl::StrCat(Quoted(tie.text), " names no parameter; a number belongs into model.fixed"));
  }
  std::string own = tie.unit;
  if (plain.names.front() == absl::StripAsciiWhitespace(tie.text)) {
    const auto unit = UnitOf(campaign, ties, plain.names.front());
    if (own.empty() && unit) own = *unit;
    const std::string why = unit && !tie.unit.empty()
                                ? WhyOtherKind(plain.names.front(), tie.unit, *unit)
                                : std::string();
    if (!why.empty()) return refuse(why);
  }
  return TiedParameter{.name = tie.name,
                       .unit = own.empty() ? "1" : own,
                       .range = tie.range,
                       .text = tie.text,
                       .formula = dem::Formula(plain.text, plain.stands),
                       .inputs = plain.names,
                       .setting = tie.setting};
}

// The way from a parameter back to itself along `tied`; empty: there is none.
std::vector<std::string> CircleFrom(const std::string& start, const std::string& at,
                                    const std::vector<TiedParameter>& tied,
                                    std::vector<std::string> way) {
  if (std::find(way.begin(), way.end(), at) != way.end()) return {};
  way.push_back(at);
  const auto found = std::find_if(tied.begin(), tied.end(),
                                  [&at](const TiedParameter& one) { return one.name == at; });
  if (found == tied.end()) return {};
  for (const std::string& next : found->inputs) {
    if (next == start) {
      way.push_back(start);
      return way;
    }
    if (auto circle = CircleFrom(start, next, tied, way); !circle.empty()) return circle;
  }
  return {};
}

// Of a design: what its runs may lack.
bool IsOfRuns(const Campaign& campaign, const std::string& name) {
  const std::string effect = EffectNamedIn(name);
  const bool numerics = RunsAreAdded(campaign) && IsNumerics(campaign, name);
  return numerics ||
         std::find(campaign.race.begin(), campaign.race.end(), effect) != campaign.race.end();
}

bool SayCircles(const std::vector<TiedParameter>& tied, const SayOfTied& say) {
  bool any = false;
  std::vector<std::string> said;
  for (const TiedParameter& one : tied) {
    const auto circle = CircleFrom(one.name, one.name, tied, {});
    if (circle.empty()) continue;
    any = true;
    if (std::find(said.begin(), said.end(), one.name) == said.end()) {
      say(one.name, circle.size() == 2
                        ? std::string("is tied to itself; give it a prior or a fixed value")
                        : absl::StrCat("is tied to itself by way of others: ",
                                       absl::StrJoin(circle, " follows from "),
                                       "; one of them needs a prior or a fixed value"));
    }
    said.insert(said.end(), circle.begin(), circle.end());
  }
  return any;
}

// --- values --------------------------------------------------------------------------------------

std::array<double, 3> PlacesOf(const inference::Prior& prior) {
  return {std::isfinite(prior.min) ? prior.min : prior.Quantile(kTailOfTied), prior.Quantile(0.5),
          std::isfinite(prior.max) ? prior.max : prior.Quantile(1 - kTailOfTied)};
}

bool MeetsAll(const Campaign& campaign, const std::vector<double>& values) {
  return !campaign.tied_prior ||
         campaign.tied_prior->MeetsConstraints(Eigen::Map<const Eigen::VectorXd>(
             values.data(), static_cast<Eigen::Index>(values.size())));
}

}  // namespace

void TieParameters(const std::vector<TieAsWritten>& ties, Campaign& campaign,
                   const SayOfTied& say) {
  std::vector<TiedParameter> tied;
  for (const TieAsWritten& tie : ties) {
    if (campaign.model.parameters.contains(tie.name)) {
      say(tie.name, "is both tied and fixed; keep one of them");
    } else if (IsOfRuns(campaign, tie.name)) {
      say(tie.name,
          "is of an effect or the numerics that each run of a design has or lacks, and cannot be "
          "tied");
    } else if (auto one = TiedOf(tie, ties, campaign, say)) {
      tied.push_back(*std::move(one));
    }
  }
  if (tied.size() < ties.size() || SayCircles(tied, say)) return;
  while (!tied.empty()) {  // without circles one of them needs no other
    const auto next = std::find_if(tied.begin(), tied.end(), [&tied](const TiedParameter& one) {
      return std::none_of(tied.begin(), tied.end(), [&one](const TiedParameter& other) {
        return std::find(one.inputs.begin(), one.inputs.end(), other.name) != one.inputs.end();
      });
    });
    campaign.tied.push_back(*next);
    tied.erase(next);
  }
}

void CheckTiedValues(const Campaign& campaign, const SayOfTied& say) {
  for (std::size_t k = 0; k < campaign.tied.size(); ++k) {
    const TiedParameter& tied = campaign.tied[k];
    std::vector<std::size_t> varied = FollowsFrom(campaign, tied);
    varied.resize(std::min(varied.size(), kMostVaried));
    std::size_t points = 1;
    for (std::size_t i = 0; i < varied.size(); ++i) points *= 3;
    for (std::size_t point = 0; point < points; ++point) {
      std::vector<double> values = MiddleValues(campaign);
      std::vector<std::string> where;
      std::size_t rest = point;
      for (const std::size_t j : varied) {
        values[j] = PlacesOf(campaign.parameters[j].prior)[rest % 3];
        where.push_back(absl::StrCat(campaign.parameters[j].name, " = ", values[j]));
        rest /= 3;
      }
      if (!MeetsAll(campaign, values)) continue;
      const double value = TiedValues(campaign, values)[k];
      if (std::isfinite(value) && tied.range.Contains(value)) continue;
      say(tied.name,
          absl::StrCat(std::isfinite(value) ? absl::StrCat("is ", value) : "has no finite value",
                       where.empty() ? "" : " where ", absl::StrJoin(where, ", "),
                       where.empty() ? "" : " (a corner, an edge or the middle of the prior)",
                       "; allowed: ", tied.range.Describe(tied.unit)));
      break;
    }
  }
}

}  // namespace calib::campaign
