#include "server/page/question.h"

#include <algorithm>
#include <charconv>
#include <map>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"

namespace calib::page {
namespace {

absl::StatusOr<int> WholeNumber(const std::string& text, const std::string& what) {
  int number = 0;
  const char* end = text.data() + text.size();
  const auto [at, error] = std::from_chars(text.data(), end, number);
  if (error != std::errc() || at != end || number < 0 || text.front() == '-') {
    return absl::InvalidArgumentError(
        absl::StrCat("the ", what, " in the address is no whole number from 0 on"));
  }
  return number;
}

absl::StatusOr<std::optional<int>> NumberIn(const Target& target, const std::string& name) {
  const auto given = target.query.find(name);
  if (given == target.query.end()) return std::optional<int>();
  ASSIGN_OR_RETURN(const int number, WholeNumber(given->second, name));
  return std::optional<int>(number);
}

/// As ids are: what is none need not be asked for.
bool IsWord(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return absl::ascii_islower(c) || absl::ascii_isdigit(c);
  });
}

absl::Status NoSuchAddress() { return absl::NotFoundError("there is nothing at this address"); }

const std::map<std::string, Document, std::less<>>& DocumentsOfCampaigns() {
  static const std::map<std::string, Document, std::less<>> documents = {
      {"lineage", Document::kLineage},         {"posterior", Document::kPosterior},
      {"compare", Document::kCompare},         {"diagnosis", Document::kDiagnosis},
      {"improvement", Document::kImprovement}, {"samples", Document::kSamples},
      {"states", Document::kStates},           {"grains", Document::kGrains},
  };
  return documents;
}

absl::StatusOr<Question> OfAllCampaigns(const Target& target) {
  Question question{.document = Document::kList};
  ASSIGN_OR_RETURN(question.limit, NumberIn(target, "limit"));
  if (const auto after = target.query.find("after"); after != target.query.end()) {
    question.after = after->second;
  }
  return question;
}

}  // namespace

std::string Question::Key() const {
  return absl::StrCat(static_cast<int>(document), "/", number.value_or(-1), "/", limit.value_or(-1),
                      "/", load_step.value_or(-1), "/", campaign.size(), "/", campaign, "/",
                      experiment.size(), "/", experiment, "/", after);
}

absl::StatusOr<Question> ParseQuestion(const Target& target) {
  constexpr std::size_t kNames = 2;  // "api" and "v1" come before
  const auto& path = target.path;
  if (path.size() == kNames + 1 && path[kNames] == "workers") {
    return Question{.document = Document::kWorkers};
  }
  if (path.size() <= kNames || path[kNames] != "campaigns") return NoSuchAddress();
  if (path.size() == kNames + 1) return OfAllCampaigns(target);
  Question question{.document = Document::kShow, .campaign = path[kNames + 1]};
  if (!IsWord(question.campaign)) {
    return absl::NotFoundError(absl::StrCat("there is no campaign \"", question.campaign,
                                            "\" (ids are like c1; see list)"));
  }
  if (path.size() == kNames + 2) return question;
  const auto found = DocumentsOfCampaigns().find(path[kNames + 2]);
  if (found == DocumentsOfCampaigns().end()) return NoSuchAddress();
  question.document = found->second;
  const bool of_sample =
      question.document == Document::kStates || question.document == Document::kGrains;
  if (path.size() != kNames + (of_sample ? 4 : 3)) return NoSuchAddress();
  if (of_sample) {
    ASSIGN_OR_RETURN(question.number, WholeNumber(path.back(), "sample"));
  }
  if (question.document == Document::kGrains) {
    const auto named = target.query.find("experiment");
    if (named != target.query.end()) question.experiment = named->second;
    ASSIGN_OR_RETURN(question.load_step, NumberIn(target, "load_step"));
  }
  if (question.document == Document::kPosterior) {
    ASSIGN_OR_RETURN(question.number, NumberIn(target, "iteration"));
  }
  return question;
}

}  // namespace calib::page
