#include "worker/program/request.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "worker/program/json_text.h"

namespace calib::worker {
namespace {

/// "{}" where there are none; on one line.
absl::StatusOr<std::string> SettingsText(const v1::ProgramRun& program) {
  std::string settings = program.settings().empty() ? "{}" : program.settings();
  if (const auto members = ReadJsonObject(settings); !members.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("the settings of the run are no JSON object: ",
                                                   std::string(members.status().message())));
  }
  // Inside of texts JSON has no line ends but escaped ones.
  std::replace(settings.begin(), settings.end(), '\n', ' ');
  std::replace(settings.begin(), settings.end(), '\r', ' ');
  return settings;
}

template <typename List, typename ToText>
std::string Joined(const List& list, const ToText& to_text) {
  std::string joined;
  for (const auto& entry : list) {
    absl::StrAppend(&joined, joined.empty() ? "" : ", ", to_text(entry));
  }
  return joined;
}

}  // namespace

absl::StatusOr<std::string> RequestText(const v1::ProgramRun& program, const std::string& run) {
  const auto settings = SettingsText(program);
  if (!settings.ok()) return settings.status();
  const std::map<std::string, double> parameters(program.parameters().begin(),
                                                 program.parameters().end());
  const std::map<std::string, std::string> units(program.units().begin(), program.units().end());
  const auto number_of = [](const auto& entry) {
    return absl::StrCat(QuotedJson(entry.first), ": ", NumberText(entry.second));
  };
  const auto text_of = [](const auto& entry) {
    return absl::StrCat(QuotedJson(entry.first), ": ", QuotedJson(entry.second));
  };
  const auto quoted = [](const std::string& text) { return QuotedJson(text); };
  const std::string test =
      program.test().empty() ? "" : absl::StrCat(", \"test\": ", QuotedJson(program.test()));
  return absl::StrCat(
      "{\"run\": ", QuotedJson(run), ", \"experiment\": ", QuotedJson(program.experiment()), test,
      ", \"realization\": ", program.realization(), ", \"parameters\": {",
      Joined(parameters, number_of), "}, \"units\": {", Joined(units, text_of), "}, \"effects\": [",
      Joined(program.effects(), quoted), "], \"settings\": ", *settings,
      ", \"control\": {\"name\": ", QuotedJson(program.control()), ", \"values\": [",
      Joined(program.control_values(), NumberText), "]}, \"observables\": [",
      Joined(program.observables(), quoted), "], \"seed\": ", program.seed(),
      ", \"threads\": ", std::max(1, program.threads()), "}");
}

std::string StopText(const std::string& run) {
  return absl::StrCat("{\"stop\": ", QuotedJson(run), "}");
}

absl::StatusOr<std::map<std::string, std::string>> Replacements(const v1::ProgramRun& program,
                                                                const std::string& scratch) {
  const auto settings = SettingsText(program);
  if (!settings.ok()) return settings.status();
  std::map<std::string, std::string> replacements{
      {"scratch", scratch},
      {"threads", absl::StrCat(std::max(1, program.threads()))},
      {"seed", absl::StrCat(program.seed())},
  };
  for (const auto& [name, value] : program.parameters()) {
    replacements.emplace(name, NumberText(value));
  }
  const auto members = ReadJsonObject(*settings);
  if (!members.ok()) return members.status();
  for (const JsonMember& member : *members) {
    switch (member.kind) {
      case JsonMember::Kind::kNumber:
        replacements.emplace(member.name, NumberText(member.number));
        break;
      case JsonMember::Kind::kText:
        replacements.emplace(member.name, member.text);
        break;
      case JsonMember::Kind::kTrue:
        replacements.emplace(member.name, "true");
        break;
      case JsonMember::Kind::kFalse:
        replacements.emplace(member.name, "false");
        break;
      default:
        break;
    }
  }
  return replacements;
}

std::string Replaced(std::string_view text,
                     const std::map<std::string, std::string>& replacements) {
  std::string replaced;
  replaced.reserve(text.size());
  while (!text.empty()) {
    const std::size_t open = text.find('{');
    const std::size_t close = text.find_first_of("{}", open == text.npos ? open : open + 1);
    if (close == std::string_view::npos) break;
    const bool after_dollar = open > 0 && text[open - 1] == '$';
    const auto found = text[close] == '}' && !after_dollar
                           ? replacements.find(std::string(text.substr(open + 1, close - open - 1)))
                           : replacements.end();
    if (found != replacements.end()) {
      replaced.append(text.substr(0, open)).append(found->second);
      text.remove_prefix(close + 1);
    } else {
      // '}' may stand before the next '{'; what is before the brace that closes is done with. The
      // dollar of "${" stays in sight of its brace since both are copied together.
      replaced.append(text.substr(0, close));
      text.remove_prefix(close);
      if (text.front() == '}') {
        replaced += '}';
        text.remove_prefix(1);
      }
    }
  }
  return replaced.append(text);
}

}  // namespace calib::worker
