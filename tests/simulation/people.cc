#include "tests/simulation/people.h"

#include <algorithm>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "tests/simulation/campaigns.h"

namespace calib::simulation {

void People::Submit(int campaign, const std::string& owner, Time at) {
  const SimulatedCampaign& chosen = Campaigns()[static_cast<std::size_t>(campaign)];
  Asked& asked = Wish("submit", 0, at);
  asked.campaign = campaign;
  asked.wish.owner = owner;
  asked.wish.files = chosen.files.files;
  asked.wish.yaml = chosen.files.yaml;
}

People::Asked& People::Wish(const std::string& verb, std::int64_t campaign, Time at) {
  Asked& asked = asked_.emplace_back();
  asked.wish.verb = verb;
  asked.wish.campaign = campaign;
  asked.wish.key = absl::StrCat("r", ++last_request_);
  asked.at = at;
  return asked;
}

void People::Ask(std::size_t i, ServerProcess& server) {
  asked_[i].under_way = true;
  const ServerProcess::Wish wish = asked_[i].wish;
  told_.event(absl::StrCat("somebody asks: ", wish.verb, " c", wish.campaign, " ", wish.key));
  if (wish.verb == "delete") ledger_.Deletes(wish.campaign);
  server.Ask(wish, [this, i](const absl::StatusOr<std::string>& answer) { Answer(i, answer); });
}

void People::Answer(std::size_t i, const absl::StatusOr<std::string>& answer) {
  Asked& asked = asked_[i];
  const std::string& verb = asked.wish.verb;
  told_.event(absl::StrCat(asked.wish.key,
                           " is answered: ", answer.ok() ? *answer : answer.status().ToString()));
  asked.under_way = false;
  if (absl::IsUnavailable(answer.status()) || absl::IsResourceExhausted(answer.status()) ||
      absl::IsPermissionDenied(answer.status())) {
    asked.at = clocks_.now + milliseconds(dice_.Between(20, 800));
    return;
  }
  if (verb == "add_runs" && absl::IsFailedPrecondition(answer.status()) &&
      ledger_.StateOf(asked.wish.campaign) != "cancelled") {  // what it has must end first
    asked.at = clocks_.now + milliseconds(dice_.Between(20, 500));
    return;
  }
  asked.answered = true;
  if (!answer.ok()) {
    if (verb == "submit")
      told_.violate(absl::StrCat("a campaign is refused: ", answer.status().ToString()));
    return;
  }
  if (verb == "add_runs") {
    AddRuns(asked.wish.campaign, asked.campaign, asked.wish.runs.iteration + 1);
  }
  if (verb != "quota" && verb != "submit" && verb != "add_runs") ledger_.Answered(asked.wish.key);
  if (verb == "cancel") ledger_.Cancelled(asked.wish.campaign);
  if (verb == "resume") resumed_.insert(asked.wish.campaign);
  if (verb == "submit") {
    const std::int64_t id = std::stoll(answer->substr(1));
    if (submitted_.emplace(id, asked.campaign).second) {
      ledger_.Submitted(id);
      AddRuns(id, asked.campaign, 0);
    }
  }
}

/// The next batch of a design, if there is one.
void People::AddRuns(std::int64_t id, int campaign, int batch) {
  const auto& batches = Campaigns()[static_cast<std::size_t>(campaign)].batches;
  if (batch >= static_cast<int>(batches.size())) return;
  Asked& asked = Wish("add_runs", id, clocks_.now);
  asked.campaign = campaign;
  asked.wish.runs = batches[static_cast<std::size_t>(batch)];
  asked.wish.runs.campaign = id;
}

/// Whoever paused campaigns, or set quotas, thinks better of it.
void People::SetRight() {
  for (const std::int64_t campaign : ledger_.Paused()) {
    const bool is_asked = std::any_of(asked_.begin(), asked_.end(), [&](const Asked& asked) {
      return !asked.answered && asked.wish.verb == "resume" && asked.wish.campaign == campaign;
    });
    if (!is_asked) Wish("resume", campaign, clocks_.now);
  }
  if (std::exchange(has_quota_, false)) {
    Asked& asked = Wish("quota", 0, clocks_.now);
    asked.wish.owner = "ann";
    asked.wish.number = -1;
  }
}

void People::WishAnything() {
  if (submitted_.empty()) return;
  auto chosen = submitted_.begin();
  std::advance(chosen, dice_.Below(static_cast<int>(submitted_.size())));
  const std::int64_t id = chosen->first;
  // The first submitted is to come to its end.
  const bool may_go = id > 1;
  switch (dice_.Below(8)) {
    case 0:
    case 1:
      Wish("pause", id, clocks_.now);
      break;
    case 2:
    case 3:
    case 4:
      Wish("resume", id, clocks_.now);
      break;
    case 5:
      Wish("priority", id, clocks_.now).wish.number = dice_.Between(-3, 3);
      break;
    case 6:
      if (may_go) {
        Wish(ledger_.StateOf(id) == "cancelled" ? "delete" : "cancel", id, clocks_.now);
      }
      break;
    default: {
      Asked& asked = Wish("quota", 0, clocks_.now);
      asked.wish.owner = "ann";
      asked.wish.number = dice_.Below(3);
      has_quota_ = true;
    }
  }
}

bool People::IsDue(std::size_t i) const {
  const Asked& asked = asked_[i];
  return !asked.answered && !asked.under_way && asked.at <= clocks_.now;
}

Time People::next() const {
  Time next = Time::max();
  for (const Asked& asked : asked_) {
    if (!asked.answered && !asked.under_way) next = std::min(next, asked.at);
  }
  return next;
}

std::vector<std::string> People::Waiting() const {
  std::vector<std::string> verbs;
  for (const Asked& asked : asked_) {
    if (!asked.answered) verbs.push_back(asked.wish.verb);
  }
  return verbs;
}

void People::ServerIsGone() {
  for (Asked& asked : asked_) {
    if (asked.under_way) asked.at = clocks_.now + milliseconds(dice_.Below(1000));
    asked.under_way = false;
  }
}

}  // namespace calib::simulation
