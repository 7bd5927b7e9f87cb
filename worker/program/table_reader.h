#pragma once
// States from a table that a program writes: a row per load step. Pure.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "calib/v1/worker.pb.h"
#include "worker/program/answer_states.h"

namespace calib::worker {

/// Takes the bytes of the table in pieces of any size; a line counts once its end is there. Before
/// the first row stands a header, which may begin with '#'; of several lines with '#' it is the one
/// that names the columns. Cells are separated by commas where the header has one, else by white
/// space. Row k is load step k; empty lines and later lines with '#' are passed over. The run
/// diverged at a cell with nan, inf, null or nothing (of commas) in what was asked, and failed at a
/// row of another length, a cell that is no number, a row beyond the last. Columns of `table` that
/// were not asked are `others` of their state, the rest of the table is dropped. Not thread-safe.
class TableReader {
 public:
  static constexpr std::size_t kLongestRow = std::size_t{1} << 20;  ///< bytes

  TableReader(v1::ProgramTable table, std::vector<std::string> observables, int load_steps);

  void Add(std::string_view bytes);
  /// Nothing more comes; a last row without the end of its line counts if it is whole.
  void EndOfInput();

  std::vector<v1::State> TakeStates() { return states_.Take(); }
  const AnswerStates& states() const { return states_; }
  const std::optional<AnswerEnd>& end() const { return states_.end(); }
  /// The run failed for a reason of the table's file.
  void Fail(std::string reason) { states_.End(AnswerEnd::Kind::kFailed, std::move(reason)); }

 private:
  void Line(std::string_view line, bool may_be_cut);
  void Header(std::string_view line, bool commented);
  void Row(std::string_view line, bool may_be_cut);

  v1::ProgramTable table_;
  AnswerStates states_;
  std::string line_;
  bool has_header_ = false;
  bool by_comma_ = false;
  std::size_t cells_ = 0;             // of a row
  std::vector<std::size_t> columns_;  // of table_.columns()
  int rows_ = 0;
};

}  // namespace calib::worker
