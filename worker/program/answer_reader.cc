#include "worker/program/answer_reader.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "proto/rpc/text_kinds.h"

namespace calib::worker {
namespace {

constexpr double kLargestStep = 1e6;  // what v1::State holds

const JsonMember* FindMember(const std::vector<JsonMember>& members, std::string_view name) {
  const auto found = std::find_if(members.begin(), members.end(),
                                  [&](const JsonMember& member) { return member.name == name; });
  return found != members.end() ? &*found : nullptr;
}

/// The text that a member is; nullptr: there is none, or it is no text.
const std::string* TextOf(const std::vector<JsonMember>& members, std::string_view name) {
  const JsonMember* member = FindMember(members, name);
  return member != nullptr && member->kind == JsonMember::Kind::kText ? &member->text : nullptr;
}

std::string Beginning(std::string_view line) {
  constexpr std::size_t kShown = 60;
  return rpc::Fitted(v1::NAME, absl::StrCat(std::string(line.substr(0, kShown)),
                                            line.size() > kShown ? "..." : ""));
}

}  // namespace

void AnswerReader::BeginRun(const Asked& asked) {
  asked_ = asked;
  states_ = AnswerStates(asked.observables, asked.load_steps);
  said_end_ = false;
  ignored_lines_ = 0;
  ignored_samples_.clear();
  checkpoints_.clear();
}

std::vector<std::string> AnswerReader::TakeCheckpoints() { return std::exchange(checkpoints_, {}); }

void AnswerReader::Add(std::string_view bytes) {
  while (!bytes.empty()) {
    if (!in_line_) {
      in_line_ = true;
      is_answer_ = bytes.front() == '{' && !asked_.elsewhere;
    }
    const std::size_t newline = bytes.find('\n');
    const std::string_view piece = bytes.substr(0, newline);
    // Two bytes more than allowed: a CR, and one that tells that the line is too long.
    const std::size_t most = is_answer_ ? kLongestLine + 2 : kLongestSample;
    line_.append(piece.substr(0, most - std::min(most, line_.size())));
    if (is_answer_ && line_.size() == most && !too_long_) TooLong();
    if (newline == std::string_view::npos) return;
    EndLine();
    bytes.remove_prefix(newline + 1);
  }
}

void AnswerReader::EndLine() {
  if (line_.ends_with('\r')) line_.pop_back();
  if (!is_answer_) {
    Ignore();
  } else if (line_.size() > kLongestLine) {
    if (!too_long_) TooLong();
  } else {
    Read(line_, false);
  }
  line_.clear();
  in_line_ = false;
  too_long_ = false;
}

// Told at once, and once: the line may never end, or end in a later run.
void AnswerReader::TooLong() {
  too_long_ = true;
  Fail(absl::StrCat("a line of the answer is longer than 1 MiB: ", Beginning(line_)));
}

void AnswerReader::Ignore() {
  ++ignored_lines_;
  if (ignored_samples_.size() < kMostSamples) {
    ignored_samples_.push_back(rpc::Fitted(v1::NAME, line_));
  }
}

void AnswerReader::EndOfInput() {
  if (!in_line_) return;
  if (line_.ends_with('\r')) line_.pop_back();
  if (!is_answer_) {
    Ignore();
  } else if (!too_long_) {
    // Of a program that was ended in the middle of a line its end is told, not the line.
    Read(line_, true);
  }
  line_.clear();
  in_line_ = false;
}

// False: it is no answer.
bool AnswerReader::Read(std::string_view line, bool may_be_cut) {
  const auto members = ReadJsonObject(line);
  if (!members.ok()) {
    if (!may_be_cut) {
      Fail(absl::StrCat("a line of the answer is no JSON object (",
                        std::string(members.status().message()), "): ", Beginning(line)));
    }
    return false;
  }
  if (asked_.persistent) {
    const std::string* run = TextOf(*members, "run");
    if (run == nullptr) {
      Fail(absl::StrCat("a line of the answer does not say its run: ", Beginning(line)));
      return false;
    }
    if (*run != asked_.run) return true;
  }
  const JsonMember* step = FindMember(*members, "load_step");
  // A program that can stay may as well be started for each run.
  const bool may_end = asked_.persistent || step == nullptr;
  const std::string* end = may_end ? TextOf(*members, "end") : nullptr;
  const std::string* checkpoint = asked_.checkpoint ? TextOf(*members, "checkpoint") : nullptr;
  if (step != nullptr) {
    const double number = step->number;
    if (step->kind != JsonMember::Kind::kNumber || !(number >= 0 && number <= kLargestStep) ||
        number != std::trunc(number)) {
      Fail(absl::StrCat("load_step is no whole number from 0: ", Beginning(line)));
      return false;
    }
    std::vector<JsonMember> said;
    std::copy_if(members->begin(), members->end(), std::back_inserter(said),
                 [&](const JsonMember& member) {
                   return member.name != "load_step" && member.name != "run";
                 });
    states_.Say(static_cast<int>(number), said);
  } else if (end == nullptr && checkpoint == nullptr) {
    Fail(absl::StrCat("a line of the answer has no load_step: ", Beginning(line)));
    return false;
  }
  if (checkpoint != nullptr) checkpoints_.push_back(*checkpoint);
  if (end != nullptr) {
    const std::string* reason = TextOf(*members, "reason");
    ReadEnd(*end, reason != nullptr ? *reason : "");
  }
  return true;
}

void AnswerReader::ReadEnd(std::string_view word, const std::string& reason) {
  said_end_ = true;
  const std::string why = rpc::Fitted(v1::PATH, reason);  // a sentence on one line
  if (word == "complete" && states_.complete()) {
    states_.End(AnswerEnd::Kind::kComplete, "");
  } else if (word == "complete") {
    Fail(absl::StrCat("the program said that the run is complete with ", states_.reached(), " of ",
                      states_.load_steps(), " states"));
  } else if (word == "diverged") {
    states_.End(AnswerEnd::Kind::kDiverged,
                why.empty()
                    ? absl::StrCat("the program said that the run diverged after ",
                                   states_.reached(), " of ", states_.load_steps(), " states")
                    : why);
  } else {
    Fail(absl::StrCat("the program ended the run with \"", Beginning(word), "\"",
                      why.empty() ? "" : ": ", why));
  }
}

}  // namespace calib::worker
