#include "server/campaign/checks/warning.h"

#include "absl/strings/str_cat.h"

namespace calib::campaign {

std::string Sentence(const Warning& warning) {
  const char* const comma = warning.experiment.empty() || warning.name.empty() ? "" : ", ";
  const bool whole = warning.experiment.empty() && warning.name.empty();
  return absl::StrCat(warning.experiment, comma, warning.name, whole ? "" : ": ", warning.message);
}

std::vector<std::string> Sentences(const std::vector<Warning>& warnings) {
  std::vector<std::string> sentences;
  sentences.reserve(warnings.size());
  for (const Warning& warning : warnings) sentences.push_back(Sentence(warning));
  return sentences;
}

}  // namespace calib::campaign
