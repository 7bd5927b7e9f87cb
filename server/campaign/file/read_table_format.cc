#include "server/campaign/file/read_table_format.h"

#include <array>
#include <charconv>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {
namespace {

std::optional<Parting> ReadSeparator(MapReader& data) {
  struct Separator {
    const char* sign;
    const char* word;
    Parting parting;
  };
  constexpr std::array kSeparators = {
      Separator{";", "semicolon", Parting::kSemicolons}, Separator{",", "comma", Parting::kCommas},
      Separator{"\t", "tab", Parting::kTabs}, Separator{" ", "blanks", Parting::kBlanks}};
  const auto text = data.Text("separator");
  if (!text) return std::nullopt;
  for (const Separator& separator : kSeparators) {
    if (*text == separator.sign || *text == separator.word ||
        (*text == "\\t" && separator.sign[0] == '\t')) {
      return separator.parting;
    }
  }
  data.Problem("separator", absl::StrCat(Quoted(*text), " is none of ';', ',', tab and blanks"));
  return std::nullopt;
}

std::optional<int> RowNumber(const std::string& text) {
  int number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number < 1) return std::nullopt;
  return number;
}

// "3-40", "3-", "5".
void ReadRows(MapReader& data, TableFormat& format) {
  const auto text = data.Text("rows");
  if (!text) return;
  const std::size_t dash = text->find('-');
  const auto first = RowNumber(text->substr(0, dash));
  const bool open = dash != std::string::npos && dash + 1 == text->size();
  const auto last =
      dash == std::string::npos ? first : RowNumber(text->substr(std::min(dash + 1, text->size())));
  if (!first || (!last && !open) || (last && *last < *first)) {
    data.Problem("rows", absl::StrCat(Quoted(*text),
                                      " is no range of rows, which count from 1, e.g. 3-40 or 3-"));
    return;
  }
  format.first_row = *first;
  format.last_row = last;
}

}  // namespace

TableFormat ReadTableFormat(MapReader& data) {
  constexpr std::array kMarks = {Word{DecimalMark::kPoint, "point"},
                                 Word{DecimalMark::kComma, "comma"}};
  TableFormat format;
  format.parting = ReadSeparator(data);
  format.decimal = data.Choice("decimal", kMarks);
  format.skip = static_cast<int>(data.Integer("skip").value_or(0));
  format.header = !data.Choice("header").has_value();
  ReadRows(data, format);
  format.where = data.TextMap("where").value_or(format.where);
  format.missing = data.TextList("missing").value_or(format.missing);
  if (!format.header && !format.where.empty()) {
    data.Problem("where", "names columns, but header: none says that none has a name");
  }
  return format;
}

}  // namespace calib::campaign
