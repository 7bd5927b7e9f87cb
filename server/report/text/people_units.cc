#include "server/report/text/people_units.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <numbers>

namespace calib::report {
namespace {

struct Step {
  double from;  // smallest size shown in this unit
  const char* label;
};

template <std::size_t N>
DisplayUnit Choose(const std::array<Step, N>& steps, double largest) {
  const Step* chosen = &steps.front();
  for (const Step& step : steps) {
    if (largest >= step.from) chosen = &step;
  }
  return {chosen->from > 0 ? 1 / chosen->from : 1, chosen->label};
}

constexpr std::array<Step, 4> kPressures = {{{1, "Pa"}, {1e3, "kPa"}, {1e6, "MPa"}, {1e9, "GPa"}}};
constexpr std::array<Step, 4> kMoments = {
    {{1e-9, "nN m/rad"}, {1e-6, "µN m/rad"}, {1e-3, "mN m/rad"}, {1, "N m/rad"}}};
constexpr std::array<Step, 3> kLengths = {{{1e-6, "µm"}, {1e-3, "mm"}, {1, "m"}}};
constexpr std::array<Step, 3> kTimes = {{{1e-6, "µs"}, {1e-3, "ms"}, {1, "s"}}};

}  // namespace

DisplayUnit UnitForPeople(const std::string& name, const std::string& si_unit, double largest) {
  if (si_unit == "Pa") return Choose(kPressures, largest);
  if (si_unit == "N m/rad") return Choose(kMoments, largest);
  if (si_unit == "m") return Choose(kLengths, largest);
  if (si_unit == "s") return Choose(kTimes, largest);
  if (si_unit == "rad") return {180 / std::numbers::pi, "deg"};
  if (si_unit == "1" || si_unit.empty()) {
    return name.ends_with("strain") ? DisplayUnit{100, "%"} : DisplayUnit{};
  }
  return {1, si_unit};
}

std::string NameForPeople(const std::string& name) {
  std::string shown;
  for (const char c : name) {
    if (c == '.') {
      shown += ": ";
    } else {
      shown += c == '_' ? ' ' : c;
    }
  }
  return shown;
}

std::string Number(double value, int digits) {
  if (std::isnan(value)) return "–";
  if (std::isinf(value)) return value > 0 ? "∞" : "−∞";
  if (value == 0) return "0";
  const double size = std::abs(value);
  if (size < 1e-3 || size >= 1e6) return fmt::format("{:.{}g}", value, digits);
  const int before = static_cast<int>(std::floor(std::log10(size))) + 1;
  std::string text = fmt::format("{:.{}f}", value, std::max(0, digits - before));
  if (text.find('.') != std::string::npos) {
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
  }
  return text;
}

std::string NumberWithUnit(double value, const std::string& name, const std::string& si_unit,
                           int digits) {
  const DisplayUnit unit = UnitForPeople(name, si_unit, std::abs(value));
  const std::string number = Number(value * unit.factor, digits);
  return unit.label.empty() ? number : number + " " + unit.label;
}

std::string DateForPeople(std::int64_t unix_ms) {
  const std::time_t seconds = unix_ms / 1000;
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  return fmt::format("{:04}-{:02}-{:02} {:02}:{:02} UTC", utc.tm_year + 1900, utc.tm_mon + 1,
                     utc.tm_mday, utc.tm_hour, utc.tm_min);
}

std::string Percent(double share, int digits) {
  return std::isnan(share) ? Number(share) : Number(100 * share, digits) + " %";
}

std::string ChanceInWords(double probability) {
  const double percent = 100 * probability;
  if (percent >= 99.5) return "more than 99 %";
  if (percent < 0.5) return "less than 1 %";
  return fmt::format("{} %", std::lround(percent));
}

std::string ShareExplained(double share) {
  constexpr double kLeast = 1e-3;
  return share > 0 && share < kLeast ? "< 0.1 %" : Percent(share, 2);
}

std::string StrengthInWords(const std::map<std::string, double>& amplitude,
                            const std::map<std::string, std::string>& units) {
  std::string text;
  for (const auto& [name, value] : amplitude) {
    const auto unit = units.find(name);
    text += fmt::format("{}{} = {}", text.empty() ? "" : ", ", name,
                        NumberWithUnit(value, name, unit == units.end() ? "1" : unit->second, 3));
  }
  return text;
}

std::string Duration(double seconds) {
  if (!(seconds >= 0)) return "–";
  const auto whole = static_cast<long>(std::llround(seconds));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {} s", whole / 60, whole % 60);
  return fmt::format("{} h {} min", whole / 3600, whole % 3600 / 60);
}

}  // namespace calib::report
