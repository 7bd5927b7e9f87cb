#include "server/campaign/file/text/quantity.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {
namespace {

struct NamedUnit {
  std::string name;
  Unit unit;
  bool takes_prefix = false;
};

const std::vector<NamedUnit>& NamedUnits() {
  static const auto* const units = new std::vector<NamedUnit>{
      {"Pa", {1, {1, -1, -2, 0}}, true},
      {"N", {1, {1, 1, -2, 0}}, true},
      {"J", {1, {1, 2, -2, 0}}, true},
      {"W", {1, {1, 2, -3, 0}}, true},
      {"m", {1, {0, 1, 0, 0}}, true},
      {"s", {1, {0, 0, 1, 0}}, true},
      {"g", {1e-3, {1, 0, 0, 0}}, true},
      {"Hz", {1, {0, 0, -1, 0}}, true},
      {"rad", {1, {0, 0, 0, 1}}, true},
      {"deg", {std::numbers::pi / 180, {0, 0, 0, 1}}},
      {"degree", {std::numbers::pi / 180, {0, 0, 0, 1}}},
      {"degrees", {std::numbers::pi / 180, {0, 0, 0, 1}}},
      {"\u00b0", {std::numbers::pi / 180, {0, 0, 0, 1}}},
      {"percent", {1e-2, {}}},
      {"%", {1e-2, {}}},
      {"bar", {1e5, {1, -1, -2, 0}}, true},
      {"psi", {6894.757293168361, {1, -1, -2, 0}}},  // pound-force per square inch [NIST SP 811]
      {"ksf", {47880.25898033584, {1, -1, -2, 0}}},  // 1000 pound-force per square foot, same
      {"kgf", {9.80665, {1, 1, -2, 0}}},
      {"l", {1e-3, {0, 3, 0, 0}}, true},
      {"t", {1e3, {1, 0, 0, 0}}},
      {"min", {60, {0, 0, 1, 0}}},
      {"h", {3600, {0, 0, 1, 0}}},
      {"rpm", {2 * std::numbers::pi / 60, {0, 0, -1, 1}}},
      {"1", {1, {}}},
  };
  return *units;
}

struct Prefix {
  const char* name;
  double factor;
};
constexpr std::array<Prefix, 10> kPrefixes = {{{"p", 1e-12},
                                               {"n", 1e-9},
                                               {"u", 1e-6},
                                               {"\u00b5", 1e-6},
                                               {"\u03bc", 1e-6},
                                               {"m", 1e-3},
                                               {"c", 1e-2},
                                               {"k", 1e3},
                                               {"M", 1e6},
                                               {"G", 1e9}}};

struct KindOfQuantity {
  Dimension dimension;
  const char* si_name;
  const char* description;
};

const std::vector<KindOfQuantity>& Kinds() {
  static const auto* const kinds = new std::vector<KindOfQuantity>{
      {{}, "1", "a dimensionless number (plain, or percent)"},
      {{1, -1, -2, 0}, "Pa", "a pressure (Pa, kPa, MPa, GPa)"},
      {{0, 0, 0, 1}, "rad", "an angle (deg, rad)"},
      {{1, -3, 0, 0}, "kg/m^3", "a density (kg/m^3, g/cm^3)"},
      {{0, 0, -1, 0}, "1/s", "a rate (1/s, 1/min)"},
      {{0, 1, 0, 0}, "m", "a length (m, mm, um)"},
      {{0, 0, 1, 0}, "s", "a time (s, ms, min)"},
      {{1, 0, 0, 0}, "kg", "a mass (kg, g)"},
      {{1, 1, -2, 0}, "N", "a force (N, mN, kN)"},
      {{1, 0, -2, 0}, "N/m", "a stiffness or surface energy (N/m, J/m^2, mJ/m^2)"},
      {{1, 2, -2, -1}, "N m/rad", "a rotational stiffness or moment (N m/rad, N m)"},
      {{0, 1, -1, 0}, "m/s", "a speed (m/s, mm/s)"},
      {{0, 1, -2, 0}, "m/s^2", "an acceleration (m/s^2)"},
      {{0, 2, 0, 0}, "m^2", "an area (m^2, mm^2)"},
      {{0, 3, 0, 0}, "m^3", "a volume (m^3, mm^3)"},
      {{1, -1, -1, 0}, "Pa s", "a viscosity (Pa s, mPa s)"},
      {{1, 0, -1, 0}, "kg/s", "a mass flow or damping coefficient (kg/s, N s/m)"},
      {{0, 0, -1, 1}, "rad/s", "an angular speed (rad/s, deg/s, rpm)"},
      {{-1, 1, 2, 0}, "1/Pa", "a compliance (1/Pa, 1/MPa)"},
  };
  return *kinds;
}

bool Near(double a, double b) { return std::abs(a - b) < 1e-9; }

const KindOfQuantity* FindKind(const Dimension& dimension) {
  for (const KindOfQuantity& kind : Kinds()) {
    if (SameKind(kind.dimension, dimension)) return &kind;
  }
  return nullptr;
}

std::string Describe(const Dimension& dimension) {
  const KindOfQuantity* kind = FindKind(dimension);
  return kind != nullptr ? kind->description : absl::StrCat("a quantity in ", SiName(dimension));
}

std::optional<Unit> FindFactor(const std::string& name) {
  for (const NamedUnit& named : NamedUnits()) {
    if (named.name == name) return named.unit;
  }
  for (const NamedUnit& named : NamedUnits()) {
    if (!named.takes_prefix || !name.ends_with(named.name)) continue;
    const std::string head = name.substr(0, name.size() - named.name.size());
    for (const Prefix& prefix : kPrefixes) {
      if (head == prefix.name) return Unit{prefix.factor * named.unit.factor, named.unit.dimension};
    }
  }
  return std::nullopt;
}

absl::Status UnknownUnit(const std::string& name) {
  static const std::vector<std::string> usual = {"Pa", "kPa", "MPa", "GPa", "deg", "rad", "percent",
                                                 "m",  "mm",  "um",  "s",   "ms",  "kg",  "g",
                                                 "N",  "mN",  "kN",  "J",   "Hz"};
  const std::string nearest = Nearest(name, usual);
  return absl::InvalidArgumentError(
      absl::StrCat("unknown unit ", Quoted(name),
                   nearest.empty() ? "" : absl::StrCat("; did you mean '", nearest, "'?")));
}

// Splits "m^-3" or "m3" into the name and its exponent.
absl::StatusOr<std::pair<std::string, double>> SplitExponent(const std::string& factor) {
  if (factor == "1") return std::pair{factor, 1.0};
  const std::size_t caret = factor.find('^');
  const std::size_t name_end =
      caret != std::string::npos ? caret : factor.find_first_of("0123456789");
  if (name_end == std::string::npos) return std::pair{factor, 1.0};
  const std::string digits = factor.substr(caret != std::string::npos ? caret + 1 : name_end);
  double exponent = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), exponent);
  if (error != std::errc() || end != digits.data() + digits.size() || !(std::abs(exponent) < 10)) {
    return absl::InvalidArgumentError(
        absl::StrCat("cannot read the exponent of the unit ", Quoted(factor)));
  }
  return std::pair{factor.substr(0, name_end), exponent};
}

void Multiply(Unit& product, const Unit& factor, double exponent) {
  product.factor *= std::pow(factor.factor, exponent);
  product.dimension.kilogram += exponent * factor.dimension.kilogram;
  product.dimension.metre += exponent * factor.dimension.metre;
  product.dimension.second += exponent * factor.dimension.second;
  product.dimension.radian += exponent * factor.dimension.radian;
}

}  // namespace

absl::StatusOr<Unit> ParseUnit(const std::string& text) {
  Unit product;
  double sign = 1;  // of the next factor's exponent: -1 behind a slash
  std::size_t at = 0;
  while (at < text.size()) {
    if (std::string("/* ").find(text[at]) != std::string::npos) {
      if (text[at] == '/') sign = -1;
      ++at;
      continue;
    }
    const std::size_t end = std::min(text.find_first_of("/* ", at), text.size());
    ASSIGN_OR_RETURN(const auto factor, SplitExponent(text.substr(at, end - at)));
    const std::optional<Unit> unit = FindFactor(factor.first);
    if (!unit) return UnknownUnit(factor.first);
    Multiply(product, *unit, sign * factor.second);
    sign = 1;
    at = end;
  }
  return product;
}

bool SameKind(const Dimension& a, const Dimension& b) {
  const bool same =
      Near(a.kilogram, b.kilogram) && Near(a.metre, b.metre) && Near(a.second, b.second);
  const bool only_angle = Near(a.kilogram, 0) && Near(a.metre, 0) && Near(a.second, 0);
  return same && (!only_angle || Near(a.radian, b.radian));
}

std::string SiName(const Dimension& dimension) {
  if (const KindOfQuantity* kind = FindKind(dimension)) return kind->si_name;
  std::string name;
  const auto append = [&name](const char* unit, double exponent) {
    if (Near(exponent, 0)) return;
    absl::StrAppend(&name, name.empty() ? "" : " ", unit);
    if (!Near(exponent, 1)) absl::StrAppend(&name, "^", exponent);
  };
  append("kg", dimension.kilogram);
  append("m", dimension.metre);
  append("s", dimension.second);
  append("rad", dimension.radian);
  return name;
}

std::string KindOfUnit(const std::string& unit) {
  const auto parsed = ParseUnit(unit);
  return parsed.ok() ? Describe(parsed->dimension) : "a quantity in " + unit;
}

absl::StatusOr<Quantity> SplitQuantity(const std::string& text) {
  const std::string trimmed(absl::StripAsciiWhitespace(text));
  const char* begin = trimmed.data();
  const char* const end = begin + trimmed.size();
  if (begin != end && *begin == '+') ++begin;
  if (trimmed == ".inf" || trimmed == "+.inf") return Quantity{HUGE_VAL, ""};
  Quantity quantity;
  const auto [rest, error] = std::from_chars(begin, end, quantity.value);
  if (error == std::errc::result_out_of_range) {
    return absl::InvalidArgumentError(
        absl::StrCat(Quoted(text), " is too large or too small a number"));
  }
  if (error != std::errc() || std::isnan(quantity.value)) {
    return absl::InvalidArgumentError(absl::StrCat(Quoted(text), " is not a number"));
  }
  if (end - rest > 1 && *rest == ',' && std::isdigit(static_cast<unsigned char>(rest[1])) != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat(Quoted(text), " has a comma in its number: write a decimal point"));
  }
  quantity.unit = std::string(absl::StripAsciiWhitespace(std::string(rest, end)));
  return quantity;
}

absl::StatusOr<double> ParseQuantity(const std::string& text, const std::string& si_unit) {
  const auto quantity = SplitQuantity(text);
  if (!quantity.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat(quantity.status().message(), ", expected ", KindOfUnit(si_unit)));
  }
  if (quantity->unit.empty()) return quantity->value;
  const auto unit = ParseUnit(quantity->unit);
  if (!unit.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat(unit.status().message(), ", expected ", KindOfUnit(si_unit)));
  }
  const auto wanted = ParseUnit(si_unit);
  if (wanted.ok() && !SameKind(unit->dimension, wanted->dimension)) {
    return absl::InvalidArgumentError(absl::StrCat(
        quantity->unit, " is ", Describe(unit->dimension), ", expected ", KindOfUnit(si_unit)));
  }
  return quantity->value * unit->factor;
}

}  // namespace calib::campaign
