#include "server/report/text/text_table.h"

#include <algorithm>
#include <cctype>
#include <cstdint>

namespace calib::report {
namespace {

constexpr std::size_t kWidestCell = 48;

bool BeginsCharacter(char c) { return (static_cast<std::uint8_t>(c) & 0xC0U) != 0x80U; }

std::size_t Width(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), BeginsCharacter));
}

// Control characters would let a campaign's name paint on the terminal.
std::string Cleaned(const std::string& text) {
  std::string shown;
  std::size_t width = 0;
  for (const char c : text) {
    if (BeginsCharacter(c) && ++width > kWidestCell) return shown + "…";
    shown += std::iscntrl(static_cast<unsigned char>(c)) != 0 ? ' ' : c;
  }
  return shown;
}

}  // namespace

TextTable::TextTable(const std::vector<std::string>& columns) {
  std::vector<std::string> header;
  for (const std::string& column : columns) {
    left_.push_back(column.starts_with('<'));
    header.push_back(column.substr(left_.back() ? 1 : 0));
  }
  rows_.push_back(std::move(header));
}

void TextTable::AddRow(std::vector<std::string> cells) {
  cells.resize(left_.size());
  for (std::string& cell : cells) cell = Cleaned(cell);
  rows_.push_back(std::move(cells));
}

std::string TextTable::ToString() const {
  if (rows_.size() < 2) return "";
  std::vector<std::size_t> widths(left_.size(), 0);
  for (const auto& row : rows_) {
    for (std::size_t k = 0; k < row.size(); ++k) widths[k] = std::max(widths[k], Width(row[k]));
  }
  std::string text;
  for (const auto& row : rows_) {
    std::string line;
    for (std::size_t k = 0; k < row.size(); ++k) {
      const std::string room(widths[k] - Width(row[k]), ' ');
      line += (k > 0 ? "  " : "") + (left_[k] ? row[k] + room : room + row[k]);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  return text;
}

std::string Wrapped(const std::string& text, const std::string& first, const std::string& indent) {
  constexpr std::size_t kWidth = 98;
  std::string out = first;
  std::size_t column = first.size();
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    if (column + (end - at) + 1 > kWidth) {
      out.erase(out.find_last_not_of(' ') + 1);
      out += "\n" + indent;
      column = indent.size();
    }
    out += text.substr(at, end - at) + " ";
    column += end - at + 1;
    at = end + 1;
  }
  while (!out.empty() && out.back() == ' ') out.pop_back();
  return out + "\n";
}

}  // namespace calib::report
