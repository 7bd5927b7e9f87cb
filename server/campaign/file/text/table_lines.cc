#include "server/campaign/file/text/table_lines.h"

#include <algorithm>
#include <array>

#include "server/campaign/file/text/table_cells.h"

namespace calib::campaign {
namespace {

// What spreadsheets write where a cell could not be computed.
bool IsErrorOfASheet(std::string_view text) {
  constexpr std::array<std::string_view, 7> kSheetErrors = {"#N/A",  "#DIV/0!", "#VALUE!", "#REF!",
                                                            "#NUM!", "#NAME?",  "#NULL!"};
  return std::any_of(kSheetErrors.begin(), kSheetErrors.end(),
                     [text](std::string_view error) { return text.starts_with(error); });
}

std::string_view WithoutRemark(std::string_view line) {
  bool quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '"') quoted = !quoted;
    if (line[i] == '#' && !quoted && !IsErrorOfASheet(line.substr(i))) return line.substr(0, i);
  }
  return line;
}

}  // namespace

std::string_view WithoutCommentSigns(std::string_view line) {
  const std::size_t end = line.find_first_not_of("#*!%");
  if (end == std::string_view::npos) return {};
  const bool sign = end > 0 && (line.front() == '#' || line[end] == ' ' || line[end] == '\t');
  return sign ? line.substr(end) : line;
}

std::vector<TableLine> LinesOf(std::string_view text, int skip) {
  std::vector<TableLine> lines;
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view whole = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (number <= skip) continue;
    const bool comment = Trimmed(whole).starts_with('#') && !IsErrorOfASheet(Trimmed(whole));
    const std::string_view content =
        comment ? WithoutCommentSigns(Trimmed(whole)) : WithoutRemark(whole);
    if (!Trimmed(content).empty()) lines.push_back({number, content, comment});
  }
  return lines;
}

}  // namespace calib::campaign
