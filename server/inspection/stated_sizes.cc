#include "server/inspection/stated_sizes.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>
#include <string_view>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "server/campaign/file/text/quantity.h"

namespace calib::inspection {
namespace {

// Numbers with a unit of one kind in a text, SI, with the place where each begins.
std::vector<std::pair<std::size_t, double>> QuantitiesIn(const std::string& text,
                                                         const std::string& si_unit) {
  std::vector<std::pair<std::size_t, double>> found;
  const auto is_digit = [&text](std::size_t i) {
    return i < text.size() && std::isdigit(static_cast<unsigned char>(text[i])) != 0;
  };
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (!is_digit(i)) continue;
    std::size_t end = i;
    while (is_digit(end) ||
           (end < text.size() && (text[end] == '.' || text[end] == ',') && is_digit(end + 1))) {
      ++end;
    }
    std::string number = text.substr(i, end - i);
    std::replace(number.begin(), number.end(), ',', '.');
    std::size_t unit = end;
    while (unit < text.size() && (text[unit] == ' ' || text[unit] == '_')) ++unit;
    std::size_t unit_end = unit;
    while (unit_end < text.size() &&
           std::isalpha(static_cast<unsigned char>(text[unit_end])) != 0) {
      ++unit_end;
    }
    if (unit_end > unit) {
      const auto value = campaign::ParseQuantity(
          absl::StrCat(number, " ", text.substr(unit, unit_end - unit)), si_unit);
      if (value.ok()) found.emplace_back(i, *value);
    }
    i = end;
  }
  return found;
}

// The quantity that stands behind one of some words in a line.
template <std::size_t N>
std::optional<double> Behind(const std::vector<std::string>& remarks,
                             const std::array<const char*, N>& words, const std::string& si_unit) {
  for (const std::string& remark : remarks) {
    const std::string lower = absl::AsciiStrToLower(remark);
    for (const char* word : words) {
      const std::size_t at = lower.find(word);
      if (at == std::string::npos) continue;
      for (const auto& [place, value] : QuantitiesIn(remark, si_unit)) {
        if (place > at && value > 0) return value;
      }
    }
  }
  return std::nullopt;
}

}  // namespace

StatedSizes StatedSizesOf(const std::vector<std::string>& remarks) {
  StatedSizes sizes;
  sizes.height =
      Behind(remarks, std::array{"height", "hoehe", "höhe", "h0", "gauge length"}, "m").value_or(0);
  sizes.diameter = Behind(remarks, std::array{"diameter", "durchmesser", "d0"}, "m").value_or(0);
  sizes.pressure = Behind(remarks,
                          std::array{"confining", "cell pressure", "zelldruck", "sigma3", "sigma_3",
                                     "σ3", "p0", "consolidat"},
                          "Pa")
                       .value_or(0);
  return sizes;
}

double PressureInName(const std::string& file) {
  const auto found = QuantitiesIn(file.substr(file.find_last_of('/') + 1), "Pa");
  return found.size() == 1 ? found.front().second : 0;
}

}  // namespace calib::inspection
