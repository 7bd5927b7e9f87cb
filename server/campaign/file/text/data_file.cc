#include "server/campaign/file/text/data_file.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <optional>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {
namespace {

constexpr std::string_view kBlanks = " \t\r\v\f";
constexpr int kMostProblemsPerColumn = 5;

std::string_view Trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

std::vector<std::string_view> SplitWords(std::string_view line) {
  std::vector<std::string_view> words;
  std::size_t at = line.find_first_not_of(kBlanks);
  while (at != std::string_view::npos) {
    const std::size_t end = std::min(line.find_first_of(kBlanks, at), line.size());
    words.push_back(line.substr(at, end - at));
    at = line.find_first_not_of(kBlanks, end);
  }
  return words;
}

std::vector<std::string_view> SplitFields(std::string_view line) {
  if (line.find(',') == std::string_view::npos) return SplitWords(line);
  std::vector<std::string_view> fields;
  std::size_t at = 0;
  while (at <= line.size()) {
    const std::size_t end = std::min(line.find(',', at), line.size());
    fields.push_back(Trimmed(line.substr(at, end - at)));
    at = end + 1;
  }
  while (!fields.empty() && fields.back().empty()) fields.pop_back();
  return fields;
}

std::optional<double> ParseNumber(std::string_view field) {
  if (field.starts_with('+')) field.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error != std::errc() || end != field.data() + field.size()) return std::nullopt;
  return value;
}

// 0,25 or -1,5e3
bool HasDecimalComma(std::string_view word) {
  const std::size_t comma = word.find(',');
  if (comma == std::string_view::npos || word.find(',', comma + 1) != std::string_view::npos) {
    return false;
  }
  std::string pointed(word);
  pointed[comma] = '.';
  const auto digit = [&](std::size_t at) {
    return at < word.size() && std::isdigit(static_cast<unsigned char>(word[at])) != 0;
  };
  return comma > 0 && digit(comma - 1) && digit(comma + 1) && ParseNumber(pointed).has_value();
}

// How spreadsheets write tables where the decimal sign is a comma; empty: not so. A row of fields
// that commas separate holds no two words of numbers without one between them.
std::string ForeignFormat(std::string_view line) {
  if (line.find(';') != std::string_view::npos) {
    return "separates its fields by ';': save the file with fields separated by tabs or commas and "
           "a point as the decimal sign";
  }
  const std::vector<std::string_view> words = SplitWords(line);
  const bool comma_ends_a_field = std::any_of(
      words.begin(), words.end(),
      [](std::string_view word) { return word.starts_with(',') || word.ends_with(','); });
  const auto decimal = std::find_if(words.begin(), words.end(), HasDecimalComma);
  if (words.size() < 2 || comma_ends_a_field || decimal == words.end()) return "";
  return absl::StrCat("has ", Quoted(std::string(*decimal)),
                      ", a number with a comma: save the file with a point as the decimal sign");
}

std::string ColumnName(std::string_view field) {
  if (field.size() >= 2 && field.front() == '"' && field.back() == '"') {
    field = field.substr(1, field.size() - 2);
  }
  return std::string(field);
}

struct HeaderLine {
  int line = 0;
  std::vector<std::string> names;
};

HeaderLine ReadHeader(int line, std::string_view content) {
  HeaderLine header{line, {}};
  for (const std::string_view field : SplitFields(content)) {
    header.names.push_back(ColumnName(field));
  }
  return header;
}

// Among the comment lines before the first row the one that names most of the wanted columns, else
// as many columns as the row has fields; later lines win.
const HeaderLine* ChooseHeader(const std::vector<HeaderLine>& comments,
                               const std::vector<std::string>& wanted, std::size_t fields) {
  const HeaderLine* best = nullptr;
  std::ptrdiff_t best_score = 0;
  for (const HeaderLine& comment : comments) {
    const auto named =
        std::count_if(wanted.begin(), wanted.end(), [&comment](const std::string& name) {
          return std::find(comment.names.begin(), comment.names.end(), name) != comment.names.end();
        });
    const std::ptrdiff_t score = 2 * named + (comment.names.size() == fields ? 1 : 0);
    if (score > 0 && score >= best_score) {
      best_score = score;
      best = &comment;
    }
  }
  return best;
}

}  // namespace

DataTable::DataTable(std::string text, const std::vector<std::string>& wanted,
                     std::vector<TableProblem>& problems)
    : text_(std::move(text)) {
  std::string_view rest = text_;
  if (rest.starts_with("\xEF\xBB\xBF")) rest.remove_prefix(3);  // byte order mark
  std::vector<HeaderLine> comments;
  for (int line = 1; !rest.empty(); ++line) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    std::string_view content = Trimmed(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (content.starts_with('#')) {
      if (rows_.empty() && header_line_ == 0) {
        comments.push_back(
            ReadHeader(line, content.substr(content.find_first_not_of('#') == std::string_view::npos
                                                ? content.size()
                                                : content.find_first_not_of('#'))));
      }
      continue;
    }
    content = Trimmed(content.substr(0, content.find('#')));
    if (const std::string problem = ForeignFormat(content); !problem.empty()) {
      problems.push_back({line, "", problem});
      return;
    }
    std::vector<std::string_view> fields = SplitFields(content);
    if (fields.empty()) continue;
    if (rows_.empty() && header_line_ == 0 && !ParseNumber(fields.front())) {
      header_line_ = line;
      columns_ = ReadHeader(line, content).names;
      continue;
    }
    rows_.push_back({line, std::move(fields)});
  }
  if (rows_.empty()) {
    problems.push_back({0, "", "holds no rows of numbers"});
    return;
  }
  if (header_line_ == 0) {
    const HeaderLine* header = ChooseHeader(comments, wanted, rows_.front().fields.size());
    if (header == nullptr) {
      problems.push_back({rows_.front().line, "",
                          "has no header line above the first row that names the columns"});
      return;
    }
    header_line_ = header->line;
    columns_ = header->names;
  }
  for (const Row& row : rows_) {
    if (row.fields.size() > columns_.size()) {
      problems.push_back(
          {row.line, "",
           absl::StrCat("has ", row.fields.size(), " fields, but the header in line ", header_line_,
                        " names ", columns_.size(), " columns")});
      if (problems.size() >= static_cast<std::size_t>(kMostProblemsPerColumn)) return;
    }
  }
}

std::ptrdiff_t DataTable::IndexOf(const std::string& column) const {
  const auto at = std::find(columns_.begin(), columns_.end(), column);
  return at == columns_.end() ? -1 : at - columns_.begin();
}

bool DataTable::Has(const std::string& column) const { return IndexOf(column) >= 0; }

std::vector<double> DataTable::Column(const std::string& name,
                                      std::vector<TableProblem>& problems) const {
  std::vector<double> values(rows_.size(), std::nan(""));
  const std::ptrdiff_t index = IndexOf(name);
  if (index < 0) {
    problems.push_back(
        {header_line_, name, "is not a column of this file; " + Suggestion(name, columns_)});
    return values;
  }
  if (std::count(columns_.begin(), columns_.end(), name) > 1) {
    problems.push_back({header_line_, name, "is the name of more than one column"});
    return values;
  }
  int bad = 0;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const Row& row = rows_[i];
    std::string what;
    if (static_cast<std::size_t>(index) >= row.fields.size()) {
      what = absl::StrCat("is missing: the line has ", row.fields.size(), " of ", columns_.size(),
                          " fields");
    } else if (const std::string_view field = row.fields[static_cast<std::size_t>(index)];
               field.empty()) {
      what = "is empty, expected a number";
    } else if (const auto number = ParseNumber(field); !number) {
      what = Quoted(std::string(field)) + " is not a number";
    } else if (!std::isfinite(*number)) {
      what = Quoted(std::string(field)) +
             " is not a finite number; leave out readings that were not taken";
    } else {
      values[i] = *number;
      continue;
    }
    if (++bad <= kMostProblemsPerColumn) problems.push_back({row.line, name, what});
  }
  if (bad > kMostProblemsPerColumn) {
    problems.push_back(
        {0, name, absl::StrCat("has ", bad - kMostProblemsPerColumn, " more bad fields")});
  }
  return values;
}

std::vector<std::string> DataTable::Texts(const std::string& name) const {
  const std::ptrdiff_t index = IndexOf(name);
  std::vector<std::string> texts;
  if (index < 0) return texts;
  for (const Row& row : rows_) {
    const bool present = static_cast<std::size_t>(index) < row.fields.size();
    texts.emplace_back(present ? row.fields[static_cast<std::size_t>(index)] : std::string_view());
  }
  return texts;
}

}  // namespace calib::campaign
