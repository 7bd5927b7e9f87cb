#include "worker/program/table_reader.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "proto/rpc/text_kinds.h"

namespace calib::worker {
namespace {

std::string_view WithoutSpace(std::string_view text) {
  while (!text.empty() && absl::ascii_isspace(static_cast<unsigned char>(text.front()))) {
    text.remove_prefix(1);
  }
  while (!text.empty() && absl::ascii_isspace(static_cast<unsigned char>(text.back()))) {
    text.remove_suffix(1);
  }
  return text;
}

std::vector<std::string_view> CellsOf(std::string_view line, bool by_comma) {
  std::vector<std::string_view> cells;
  if (by_comma) {
    for (std::size_t comma = 0; comma != std::string_view::npos;) {
      comma = line.find(',');
      cells.push_back(WithoutSpace(line.substr(0, comma)));
      if (comma != std::string_view::npos) line.remove_prefix(comma + 1);
    }
    return cells;
  }
  for (line = WithoutSpace(line); !line.empty(); line = WithoutSpace(line)) {
    const std::size_t end = std::min(line.find_first_of(" \t\v\f\r"), line.size());
    cells.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
  return cells;
}

std::string_view WithoutQuotes(std::string_view cell) {
  const bool quoted = cell.size() >= 2 && cell.front() == '"' && cell.back() == '"';
  return quoted ? cell.substr(1, cell.size() - 2) : cell;
}

/// A cell in SI; kText: it is no number.
JsonMember MemberOf(const v1::ProgramColumn& column, std::string_view cell) {
  JsonMember member{.name = column.name()};
  if (cell.starts_with('+')) cell.remove_prefix(1);
  if (const auto number = ReadDecimal(cell); number.has_value()) {
    member.kind = JsonMember::Kind::kNumber;
    member.number = column.factor() * *number;
    return member;
  }
  const std::string word =
      absl::AsciiStrToLower(std::string(cell.substr(cell.starts_with('-') ? 1 : 0)));
  member.kind = JsonMember::Kind::kNumber;
  if (word == "nan") {
    member.number = std::numeric_limits<double>::quiet_NaN();
  } else if (word == "inf" || word == "infinity") {
    member.number = std::numeric_limits<double>::infinity();
  } else {
    member.kind = word.empty() || word == "null" || word == "none" ? JsonMember::Kind::kNull
                                                                   : JsonMember::Kind::kText;
  }
  return member;
}

std::string ShownCells(const std::vector<std::string_view>& cells) {
  constexpr std::size_t kShown = 20;
  std::string shown;
  for (std::size_t k = 0; k < std::min(cells.size(), kShown); ++k) {
    absl::StrAppend(&shown, k == 0 ? "" : ", ", std::string(WithoutQuotes(cells[k])));
  }
  return rpc::Fitted(v1::NAME, absl::StrCat(shown, cells.size() > kShown ? ", ..." : ""));
}

}  // namespace

TableReader::TableReader(v1::ProgramTable table, std::vector<std::string> observables,
                         int load_steps)
    : table_(std::move(table)), states_(std::move(observables), load_steps) {}

void TableReader::Add(std::string_view bytes) {
  while (!bytes.empty()) {
    const std::size_t newline = bytes.find('\n');
    const std::string_view piece = bytes.substr(0, newline);
    if (line_.size() + piece.size() > kLongestRow) {
      Fail(absl::StrCat("a line of ", table_.file(), " is longer than 1 MiB"));
      return;
    }
    line_.append(piece);
    if (newline == std::string_view::npos) return;
    Line(line_, false);
    line_.clear();
    bytes.remove_prefix(newline + 1);
  }
}

void TableReader::EndOfInput() {
  if (!line_.empty()) Line(line_, true);
  line_.clear();
}

void TableReader::Line(std::string_view line, bool may_be_cut) {
  line = WithoutSpace(line);
  const bool commented = line.starts_with('#');
  if (line.empty() || states_.end().has_value() || (has_header_ && commented)) return;
  if (!has_header_) {
    if (!may_be_cut) Header(WithoutSpace(line.substr(commented ? 1 : 0)), commented);
  } else {
    Row(line, may_be_cut);
  }
}

void TableReader::Header(std::string_view line, bool commented) {
  by_comma_ = line.find(',') != std::string_view::npos;
  const auto cells = CellsOf(line, by_comma_);
  columns_.clear();
  for (const v1::ProgramColumn& column : table_.columns()) {
    const auto found = std::find_if(cells.begin(), cells.end(), [&](std::string_view cell) {
      return WithoutQuotes(cell) == column.column();
    });
    if (found == cells.end()) {
      if (!commented) {
        Fail(absl::StrCat(table_.file(), " has no column ", column.column(),
                          "; its first line has: ", ShownCells(cells)));
      }
      return;  // a remark before the header
    }
    columns_.push_back(static_cast<std::size_t>(found - cells.begin()));
  }
  cells_ = cells.size();
  has_header_ = true;
}

void TableReader::Row(std::string_view line, bool may_be_cut) {
  const auto cells = CellsOf(line, by_comma_);
  if (cells.size() != cells_) {
    if (!may_be_cut) {
      Fail(absl::StrCat("row ", rows_, " of ", table_.file(), " has ", cells.size(),
                        " cells, its header has ", cells_));
    }
    return;
  }
  std::vector<JsonMember> said;
  said.reserve(cells.size());
  for (int k = 0; k < table_.columns_size(); ++k) {
    said.push_back(MemberOf(table_.columns(k), cells[columns_[static_cast<std::size_t>(k)]]));
  }
  states_.Say(rows_, said);
  ++rows_;
  // A row is all that is said of its step.
  if (!states_.end().has_value() && states_.reached() < rows_) {
    Fail(absl::StrCat(table_.file(), " is not asked for every observable of the run"));
  }
}

}  // namespace calib::worker
