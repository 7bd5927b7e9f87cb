#include "worker/program/answer_states.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <utility>

#include "absl/strings/str_cat.h"
#include "proto/rpc/text_kinds.h"

namespace calib::worker {
namespace {

bool MayBeAName(const std::string& name) {
  return !name.empty() && rpc::Fitted(v1::NAME, name) == name;
}

bool IsTheSame(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

}  // namespace

AnswerStates::AnswerStates(std::vector<std::string> observables, int load_steps)
    : observables_(std::move(observables)),
      load_steps_(load_steps),
      values_(observables_.size(), std::nullopt) {
  for (std::size_t k = 0; k < observables_.size(); ++k) index_.emplace(observables_[k], k);
}

void AnswerStates::End(AnswerEnd::Kind kind, std::string reason) {
  if (!end_.has_value()) end_ = AnswerEnd{.kind = kind, .reason = std::move(reason)};
}

std::string AnswerStates::FirstMissing() const {
  for (std::size_t k = 0; k < values_.size(); ++k) {
    if (!values_[k].has_value()) return observables_[k];
  }
  return "";
}

// False: the step is out of order.
bool AnswerStates::BeginStep(int load_step) {
  const auto fail = [this](std::string reason) {
    End(AnswerEnd::Kind::kFailed, std::move(reason));
    return false;
  };
  if (load_step >= load_steps_) {
    return fail(absl::StrCat("load step ", load_step, " is beyond the last, ", load_steps_ - 1));
  }
  if (load_step != step_ && (!begun_ || load_step != step_ + 1)) {
    return fail(absl::StrCat("load step ", load_step, " is out of order: ",
                             begun_ ? absl::StrCat("the last was ", step_) : "the first is 0"));
  }
  begun_ = true;
  if (load_step == step_) return true;
  if (reached_ == step_) {
    return fail(absl::StrCat("load step ", load_step, " began, and load step ", step_, " had no ",
                             FirstMissing()));
  }
  step_ = load_step;
  values_.assign(observables_.size(), std::nullopt);
  others_.clear();
  known_others_.clear();
  return true;
}

// False: that was the end.
bool AnswerStates::SayAsked(std::size_t index, const JsonMember& member) {
  const auto end = [&](AnswerEnd::Kind kind, const char* what) {
    End(kind, absl::StrCat(member.name, " is ", what, " at load step ", step_));
    return false;
  };
  switch (member.kind) {
    case JsonMember::Kind::kNumber:
      break;
    case JsonMember::Kind::kNull:
      return end(AnswerEnd::Kind::kDiverged, "null");
    default:
      return end(AnswerEnd::Kind::kFailed, "no number");
  }
  if (std::isnan(member.number)) return end(AnswerEnd::Kind::kDiverged, "NaN");
  if (std::isinf(member.number)) return end(AnswerEnd::Kind::kDiverged, "infinite");
  std::optional<double>& value = values_[index];
  if (value.has_value() && !IsTheSame(*value, member.number)) {
    End(AnswerEnd::Kind::kFailed,
        absl::StrCat(member.name, " has two values at load step ", step_, ": ", NumberText(*value),
                     " and ", NumberText(member.number)));
    return false;
  }
  value = member.number;
  return true;
}

void AnswerStates::Say(int load_step, std::span<const JsonMember> said) {
  if (end_.has_value() || !BeginStep(load_step)) return;
  for (const JsonMember& member : said) {
    if (const auto asked = index_.find(member.name); asked != index_.end()) {
      if (!SayAsked(asked->second, member)) return;
    } else if (member.kind == JsonMember::Kind::kNumber && std::isfinite(member.number) &&
               known_others_.size() < kMostOthers && MayBeAName(member.name) &&
               known_others_.insert(member.name).second) {
      others_.emplace(member.name, member.number);
    }
  }
  const bool given = reached_ > step_;
  if (given ? others_.empty() : !FirstMissing().empty()) return;
  v1::State& state = ready_.emplace_back();
  state.set_load_step(step_);
  if (!given) {
    for (const auto& value : values_) state.add_values(value.value_or(0));
    reached_ = step_ + 1;
  }
  state.mutable_others()->insert(others_.begin(), others_.end());
  others_.clear();
}

std::vector<v1::State> AnswerStates::Take() { return std::exchange(ready_, {}); }

}  // namespace calib::worker
