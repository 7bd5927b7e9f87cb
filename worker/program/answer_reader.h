#pragma once
// What a program prints on standard output, as states and an end. Pure.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "calib/v1/common.pb.h"
#include "worker/program/answer_states.h"

namespace calib::worker {

/// What the answer is to.
struct Asked {
  std::vector<std::string> observables{};
  int load_steps = 0;
  std::string run{};        ///< of the request
  bool persistent = false;  ///< lines name their run, and an end is said
  bool checkpoint = false;  ///< a checkpoint may be named
  bool elsewhere = false;   ///< states stand in a table: no line is an answer
};

/// Takes the bytes in pieces of any size. A line that begins with '{' is an answer; others are
/// counted and dropped as they come. The run failed at a line that is no such object, a step out of
/// order or beyond the last, or a line over kLongestLine; it diverged at NaN, Infinity or null in
/// what was asked (answer_states.h). In `persistent` lines of another run are passed over. Not
/// thread-safe.
class AnswerReader {
 public:
  static constexpr std::size_t kLongestLine = std::size_t{1} << 20;  ///< bytes of an answer line
  static constexpr std::size_t kMostSamples = 5;                     ///< of ignored lines
  static constexpr std::size_t kLongestSample = 200;                 ///< bytes

  AnswerReader() = default;
  explicit AnswerReader(const Asked& asked) { BeginRun(asked); }

  /// What comes is the answer to another request. A line that has begun goes on: a program that
  /// stays may still be talking of the last run.
  void BeginRun(const Asked& asked);

  void Add(std::string_view bytes);
  /// Nothing more comes. A last line without its end counts if it is whole.
  void EndOfInput();

  std::vector<v1::State> TakeStates() { return states_.Take(); }
  /// Files that were named as checkpoints since the last call.
  std::vector<std::string> TakeCheckpoints();

  const AnswerStates& states() const { return states_; }
  /// Empty: neither has it gone wrong nor has an end been said.
  const std::optional<AnswerEnd>& end() const { return states_.end(); }
  /// Whether the program itself has said that this run is over; it then waits for another.
  bool said_end() const { return said_end_; }

  std::int64_t ignored_lines() const { return ignored_lines_; }
  const std::vector<std::string>& ignored_samples() const { return ignored_samples_; }

 private:
  void EndLine();
  void Ignore();
  void TooLong();
  bool Read(std::string_view line, bool may_be_cut);
  void ReadEnd(std::string_view word, const std::string& reason);
  void Fail(std::string reason) { states_.End(AnswerEnd::Kind::kFailed, std::move(reason)); }

  Asked asked_;
  AnswerStates states_;
  std::string line_;        // so far; of a line that is no answer its beginning
  bool in_line_ = false;    // it has begun
  bool is_answer_ = false;  // it begins with '{'
  bool too_long_ = false;
  bool said_end_ = false;
  std::int64_t ignored_lines_ = 0;
  std::vector<std::string> ignored_samples_;
  std::vector<std::string> checkpoints_;
};

}  // namespace calib::worker
