#pragma once
// The states of one run, put together from what the program says of each load step. Pure.

#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "calib/v1/common.pb.h"
#include "worker/program/json_text.h"

namespace calib::worker {

/// How an answer ended.
struct AnswerEnd {
  enum class Kind {
    kComplete,  ///< the program said so, and every state is there
    kDiverged,  ///< the model cannot go on
    kFailed,    ///< the program does not keep to what was agreed
  };
  Kind kind = Kind::kFailed;
  std::string reason{};  ///< a sentence; empty: complete
};

/// Load steps come in order, from 0, each once it is reached; several sayings of one step add up.
/// An asked observable that is said twice has one value, or the answer failed. Of what was not
/// asked the first saying counts; it is dropped where it is no finite number, has no name that a
/// message could hold, or would be more than kMostOthers of one step. Not thread-safe.
class AnswerStates {
 public:
  static constexpr std::size_t kMostOthers = 256;  ///< what v1::State holds

  AnswerStates() = default;
  AnswerStates(std::vector<std::string> observables, int load_steps);

  /// What is said of a load step: numbers, and null or text, which an observable may not be. After
  /// an end nothing counts any more.
  void Say(int load_step, std::span<const JsonMember> said);
  /// The first end counts.
  void End(AnswerEnd::Kind kind, std::string reason);

  /// States since the last call: with `values` in the order of the observables once all of a step
  /// are known, or, of a step whose state was given, without values and with `others` only.
  std::vector<v1::State> Take();

  int reached() const { return reached_; }  ///< load steps that are complete
  int load_steps() const { return load_steps_; }
  bool complete() const { return reached_ == load_steps_; }
  const std::optional<AnswerEnd>& end() const { return end_; }

 private:
  bool BeginStep(int load_step);
  bool SayAsked(std::size_t index, const JsonMember& member);
  std::string FirstMissing() const;

  std::vector<std::string> observables_;
  std::map<std::string, std::size_t> index_;
  int load_steps_ = 0;
  int step_ = 0;  // of which was said last
  bool begun_ = false;
  int reached_ = 0;
  std::vector<std::optional<double>> values_;  // of step_
  std::map<std::string, double> others_;       // of step_, not given yet
  std::set<std::string> known_others_;         // of step_
  std::vector<v1::State> ready_;
  std::optional<AnswerEnd> end_;
};

}  // namespace calib::worker
