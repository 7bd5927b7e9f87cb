#include "server/campaign/file/shared/read_prior.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/keys/words.h"

namespace calib::campaign {
namespace {

using inference::Prior;
using inference::PriorKind;

constexpr const char* kEqualTo = "equal_to";

// A number that has to be there; NaN after a problem.
double Required(MapReader& map, const std::string& key, const std::string& unit, const Range& range,
                const std::string& kind) {
  if (map.Require(key, absl::StrCat("the prior ", kind, " needs it")) == nullptr) {
    return std::nan("");
  }
  return map.Quantity(key, unit, range).value_or(std::nan(""));
}

bool ReadBounds(MapReader& map, const std::string& unit, const std::string& kind, Prior& prior) {
  prior.min = Required(map, "min", unit, {}, kind);
  prior.max = Required(map, "max", unit, {}, kind);
  if (std::isnan(prior.min) || std::isnan(prior.max)) return false;
  if (prior.min >= prior.max) {
    map.Problem("min",
                absl::StrCat("the prior is upside down: min ", prior.min, " is not below max ",
                             prior.max, unit == "1" ? "" : " " + unit));
    return false;
  }
  if (prior.kind == PriorKind::kLogUniform && prior.min <= 0) {
    map.Problem(
        "min",
        "a log_uniform prior needs a min greater than 0; use uniform for ranges that hold 0");
    return false;
  }
  return true;
}

bool ReadMoments(MapReader& map, const std::string& unit, const std::string& kind, Prior& prior) {
  const bool log = prior.kind == PriorKind::kLogNormal;
  const Range positive{.min = 0, .min_open = true};
  // log_normal: `mean` is the median in units and `sd` the spread of ln x, so that both read
  // naturally.
  prior.mean = Required(map, "mean", unit, log ? positive : Range{}, kind);
  prior.sd = Required(map, "sd", log ? "1" : unit, positive, kind);
  if (const auto min = map.Quantity("min", unit, {})) prior.min = *min;
  if (const auto max = map.Quantity("max", unit, {})) prior.max = *max;
  if (std::isnan(prior.mean) || std::isnan(prior.sd)) return false;
  if (log) prior.mean = std::log(prior.mean);
  if (prior.min >= prior.max) {
    map.Problem("min", absl::StrCat("the prior is upside down: min ", prior.min,
                                    " is not below max ", prior.max));
    return false;
  }
  return true;
}

}  // namespace

bool HoldsMass(const Prior& prior, const std::string& key, MapReader& map) {
  constexpr double kLeast = 1e-4;  // as constraints, inference::JointPrior
  const double mass = prior.MassBetweenBounds();
  if (mass >= kLeast) return true;
  map.Problem(key, absl::StrCat("only a share of ", absl::StrFormat("%.2g", mass),
                                " of this prior lies between ", prior.min, " and ", prior.max,
                                "; at least ", absl::StrFormat("%g", kLeast),
                                " is needed: move its mean or the bounds, or widen its sd"));
  return false;
}

namespace {

std::optional<Prior> ReadFrom(MapReader& map, const std::string& unit) {
  if (map.Require("prior", "one of " + Listed(AllWords(kPriorWords))) == nullptr) {
    map.Ignore({"min", "max", "mean", "sd"});
    map.Finish();
    return std::nullopt;
  }
  const auto kind = map.Choice("prior", kPriorWords);
  if (!kind) {
    map.Ignore({"min", "max", "mean", "sd"});
    map.Finish();
    return std::nullopt;
  }
  Prior prior;
  prior.kind = *kind;
  const bool bounded = prior.kind == PriorKind::kUniform || prior.kind == PriorKind::kLogUniform;
  const std::string word = WordOf(kPriorWords, *kind);
  const bool read =
      bounded ? ReadBounds(map, unit, word, prior) : ReadMoments(map, unit, word, prior);
  map.Finish();
  if (!read) return std::nullopt;
  if (const auto valid = prior.Validate(); !valid.ok()) {
    map.Problem("prior", std::string(valid.message()));
    return std::nullopt;
  }
  if (!HoldsMass(prior, "prior", map)) return std::nullopt;
  return prior;
}

std::string SquareOf(const std::string& unit) {
  const auto parsed = ParseUnit(unit);
  if (!parsed.ok()) return "1";
  const Dimension& one = parsed->dimension;
  return SiName({.kilogram = 2 * one.kilogram,
                 .metre = 2 * one.metre,
                 .second = 2 * one.second,
                 .radian = 2 * one.radian});
}

// A normal of mean 0 cut off below it. Empty after a problem.
std::optional<Prior> ReadSpread(MapReader& parameter, const std::string& unit) {
  auto map = parameter.Map("spread");
  if (!map) return std::nullopt;
  map->Require("prior", "half_normal");
  map->Choice("prior");
  const double sd = Required(*map, "sd", unit, {.min = 0, .min_open = true}, "half_normal");
  map->Finish();
  if (std::isnan(sd)) return std::nullopt;
  return Prior{.kind = PriorKind::kNormal, .min = 0, .mean = 0, .sd = sd};
}

BesidePrior ReadBeside(MapReader& map, const std::string& unit) {
  BesidePrior beside{.nuisance = map.TrueOrFalse("nuisance").value_or(false)};
  const bool has = map.Has("per");
  beside.per = map.Choice("per", kPerWords);
  if (has && !map.Has("spread")) {
    map.Problem("per",
                "needs spread, the prior of how far the values lie apart, e.g. {prior: "
                "half_normal, sd: 0.05}");
  }
  for (const char* key : {"spread", "labels"}) {
    if (has || !map.Has(key)) continue;
    map.Problem(key, "belongs to per: experiment or per: batch; without it there is one value");
  }
  beside.spread = ReadSpread(map, unit);
  beside.labels = map.TextList("labels");
  return beside;
}

// The SI unit that the numbers of a free prior carry; the first that has one decides.
std::string UnitOfNumbers(MapReader& map) {
  if (const auto unit = map.Text("unit")) {
    const auto parsed = ParseUnit(*unit);
    if (parsed.ok()) return SiName(parsed->dimension);
    map.Problem("unit", std::string(parsed.status().message()));
    return "1";
  }
  for (const char* key : {"min", "max", "mean"}) {
    const YamlNode* node = map.Find(key);
    if (node == nullptr || node->kind != YamlNode::Kind::kScalar) continue;
    const auto quantity = SplitQuantity(node->scalar);
    if (!quantity.ok() || quantity->unit.empty()) continue;
    if (const auto unit = ParseUnit(quantity->unit); unit.ok()) return SiName(unit->dimension);
  }
  return "1";
}

}  // namespace

std::string UnitOfPrior(const YamlNode& node) {
  ProblemList ignored("");
  MapReader map(node, "", SectionOf("prior"), ignored);
  return UnitOfNumbers(map);
}

std::optional<Prior> ReadPrior(const YamlNode& node, const std::string& path,
                               const std::string& si_unit, ProblemList& problems) {
  MapReader map(node, path, SectionOf("prior"), problems);
  return node.kind == YamlNode::Kind::kMap ? ReadFrom(map, si_unit) : std::nullopt;
}

bool IsTied(const YamlNode& node) {
  return std::any_of(node.entries.begin(), node.entries.end(),
                     [](const YamlEntry& entry) { return entry.key == kEqualTo; });
}

std::optional<std::string> ReadTie(const YamlNode& node, const std::string& path,
                                   ProblemList& problems) {
  if (!IsTied(node)) return std::nullopt;
  MapReader map(node, path, SectionOf("tie"), problems);
  for (const char* key :
       {"prior", "min", "max", "mean", "sd", "nuisance", "per", "spread", "labels"}) {
    if (!map.Has(key)) continue;
    map.Problem(key, "has no place beside equal_to: what follows from others is not inferred");
    map.Ignore({key});
    return std::nullopt;
  }
  auto text = map.Text(kEqualTo);
  map.Finish();
  return text;
}

std::optional<Prior> ReadPriorOf(const YamlNode& node, const std::string& path,
                                 const std::string& si_unit, ProblemList& problems,
                                 BesidePrior& beside) {
  MapReader map(node, path, SectionOf("parameter"), problems);
  if (node.kind != YamlNode::Kind::kMap) return std::nullopt;
  beside = ReadBeside(map, si_unit);
  return ReadFrom(map, si_unit);
}

std::optional<inference::ErrorScale> ReadErrorScale(const YamlNode& node, const std::string& path,
                                                    const std::string& si_unit,
                                                    ProblemList& problems) {
  MapReader map(node, path, SectionOf("error_scale"), problems);
  if (node.kind != YamlNode::Kind::kMap) return std::nullopt;
  const bool on_variance =
      map.Choice("on", kErrorScaleWords).value_or(ErrorScaleOf::kSd) == ErrorScaleOf::kVariance;
  const auto prior = ReadFrom(map, on_variance ? SquareOf(si_unit) : si_unit);
  if (!prior) return std::nullopt;
  if (!(prior->min >= 0)) {
    map.Problem("min", "has to be 0 or more: this is the size of an error");
    return std::nullopt;
  }
  return inference::ErrorScale{.prior = *prior, .on_variance = on_variance};
}

std::optional<Prior> ReadFreePrior(const YamlNode& node, const std::string& path,
                                   ProblemList& problems, std::string& si_unit,
                                   BesidePrior& beside) {
  MapReader map(node, path, SectionOf("parameter"), problems);
  if (node.kind != YamlNode::Kind::kMap) return std::nullopt;
  si_unit = UnitOfNumbers(map);
  beside = ReadBeside(map, si_unit);
  return ReadFrom(map, si_unit);
}

}  // namespace calib::campaign
