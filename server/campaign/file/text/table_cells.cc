#include "server/campaign/file/text/table_cells.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>

#include "absl/strings/match.h"
#include "absl/strings/str_join.h"

namespace calib::campaign {
namespace {

constexpr std::string_view kBlankSigns = " \t\r\v\f";

bool IsDigit(std::string_view text, std::size_t at) {
  return at < text.size() && std::isdigit(static_cast<unsigned char>(text[at])) != 0;
}

std::string Unquoted(std::string_view cell) {
  if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"') {
    cell = cell.substr(1, cell.size() - 2);
  }
  return std::string(cell);
}

std::vector<std::string> PartedBy(std::string_view line, char sign) {
  std::vector<std::string> cells;
  std::string cell;
  bool quoted = false;      // inside quotes
  bool was_quoted = false;  // the cell had them
  const auto end_cell = [&] {
    cells.emplace_back(was_quoted ? cell : std::string(Trimmed(cell)));
    cell.clear();
    was_quoted = false;
  };
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (c == '"' && quoted && i + 1 < line.size() && line[i + 1] == '"') {
      cell.push_back('"');
      ++i;
    } else if (c == '"' && (quoted || Trimmed(cell).empty())) {
      if (!quoted) cell.clear();
      quoted = !quoted;
      was_quoted = true;
    } else if (c == sign && !quoted) {
      end_cell();
    } else if (!was_quoted || quoted) {
      cell.push_back(c);
    }
  }
  end_cell();
  return cells;
}

std::vector<std::string> PartedByBlanks(std::string_view line) {
  std::vector<std::string> cells;
  std::size_t at = line.find_first_not_of(kBlankSigns);
  while (at != std::string_view::npos) {
    std::size_t end = std::min(line.find_first_of(kBlankSigns, at), line.size());
    if (line[at] == '"') {
      const std::size_t close = line.find('"', at + 1);
      const bool ends =
          close != std::string_view::npos &&
          (close + 1 == line.size() || kBlankSigns.find(line[close + 1]) != std::string_view::npos);
      if (ends) end = close + 1;
    }
    cells.push_back(Unquoted(line.substr(at, end - at)));
    at = line.find_first_not_of(kBlankSigns, end);
  }
  return cells;
}

std::vector<std::string> PartedByGaps(std::string_view line) {
  std::vector<std::string> cells;
  line = Trimmed(line);
  std::size_t begin = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const bool gap = line[i] == '\t' || (line[i] == ' ' && i + 1 < line.size() &&
                                         kBlankSigns.find(line[i + 1]) != std::string_view::npos);
    if (!gap) continue;
    cells.push_back(Unquoted(Trimmed(line.substr(begin, i - begin))));
    i = std::min(line.find_first_not_of(kBlankSigns, i), line.size()) - 1;
    begin = i + 1;
  }
  if (begin < line.size()) cells.push_back(Unquoted(Trimmed(line.substr(begin))));
  return cells;
}

bool InBrackets(std::string_view word) {
  return (word.starts_with('(') && word.ends_with(')')) ||
         (word.starts_with('[') && word.ends_with(']'));
}

std::vector<std::string> PartedWithUnits(std::string_view line) {
  std::vector<std::string> cells;
  for (const std::string& word : PartedByBlanks(line)) {
    if (!cells.empty() && InBrackets(word) && !InBrackets(cells.back())) {
      cells.back() += " " + word;
    } else {
      cells.push_back(word);
    }
  }
  return cells;
}

// "(kPa)", "strain[%]".
bool EndsWithUnit(std::string_view word) {
  return (word.ends_with(')') && word.find('(') != std::string_view::npos) ||
         (word.ends_with(']') && word.find('[') != std::string_view::npos);
}

std::vector<std::string> PartedBehindUnits(std::string_view line) {
  std::vector<std::string> cells;
  std::vector<std::string> words;  // of a name whose unit is still to come
  for (const std::string& word : PartedByBlanks(line)) {
    words.push_back(word);
    if (!EndsWithUnit(word)) continue;
    cells.push_back(absl::StrJoin(words, " "));
    words.clear();
  }
  cells.insert(cells.end(), words.begin(), words.end());
  return cells;
}

}  // namespace

std::string_view Trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlankSigns);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlankSigns) - begin + 1);
}

std::vector<std::string> CellsOf(std::string_view line, Parting parting) {
  switch (parting) {
    case Parting::kSemicolons:
      return PartedBy(line, ';');
    case Parting::kCommas:
      return PartedBy(line, ',');
    case Parting::kTabs:
      return PartedBy(line, '\t');
    case Parting::kBlanks:
      return PartedByBlanks(line);
    case Parting::kGaps:
      return PartedByGaps(line);
    case Parting::kUnits:
      return PartedWithUnits(line);
    case Parting::kUnitEnds:
      return PartedBehindUnits(line);
  }
  return {};
}

std::optional<double> NumberIn(std::string_view cell, DecimalMark mark) {
  std::string text(cell);
  constexpr std::string_view kLongMinus = "\u2212";
  if (absl::StartsWith(text, std::string(kLongMinus))) {
    text.replace(0, kLongMinus.size(), "-");
  }
  if (mark == DecimalMark::kComma) {
    if (text.find('.') != std::string::npos) return std::nullopt;
    std::replace(text.begin(), text.end(), ',', '.');
  }
  for (std::size_t i = 1; i < text.size(); ++i) {
    const bool between = IsDigit(text, i + 1) || text.find_first_of("+-", i + 1) == i + 1;
    const bool behind = IsDigit(text, i - 1) || text[i - 1] == '.';
    if ((text[i] == 'D' || text[i] == 'd') && between && behind) text[i] = 'e';
  }
  const char* begin = text.data();
  const char* const end = begin + text.size();
  if (begin != end && *begin == '+' && end - begin > 1 && begin[1] != '-') ++begin;
  double value = 0;
  const auto [rest, error] = std::from_chars(begin, end, value);
  if (error != std::errc() || rest != end) return std::nullopt;
  return value;
}

bool HasDecimalComma(std::string_view cell) {
  const std::size_t comma = cell.find(',');
  if (comma == std::string_view::npos || comma == 0) return false;
  return IsDigit(cell, comma - 1) && IsDigit(cell, comma + 1) &&
         NumberIn(cell, DecimalMark::kComma).has_value();
}

bool MayHoldThousands(std::string_view cell) {
  if (!cell.empty() && (cell.front() == '-' || cell.front() == '+')) cell.remove_prefix(1);
  std::size_t group = 0;  // digits of the running group
  int commas = 0;
  for (std::size_t i = 0; i < cell.size(); ++i) {
    if (cell[i] == ',') {
      if (group == 0 || group > 3 || (commas > 0 && group != 3)) return false;
      group = 0;
      ++commas;
    } else if (IsDigit(cell, i)) {
      ++group;
    } else {
      return false;
    }
  }
  return commas > 0 && group == 3 && cell.front() != '0';
}

bool SaysMissing(std::string_view cell, const std::vector<std::string>& more) {
  constexpr std::array<std::string_view, 4> kUsual = {"nan", "na", "n/a", "#n/a"};
  if (cell.empty()) return true;
  const std::string text(cell);
  return std::any_of(kUsual.begin(), kUsual.end(),
                     [&text](std::string_view word) {
                       return absl::EqualsIgnoreCase(text, std::string(word));
                     }) ||
         std::any_of(more.begin(), more.end(), [&text](const std::string& word) {
           if (text == word) return true;
           const auto number = NumberIn(text, DecimalMark::kPoint);
           return number && number == NumberIn(word, DecimalMark::kPoint);
         });
}

}  // namespace calib::campaign
