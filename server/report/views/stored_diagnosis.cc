#include "server/report/views/stored_diagnosis.h"

#include <cmath>
#include <nlohmann/json.hpp>

namespace calib::report {
namespace {

using Document = nlohmann::json;

// What is missing, null or of another type stays as it was: another version may have written it.
void Read(const Document& document, const char* key, double& value) {
  const auto found = document.find(key);
  if (found != document.end() && found->is_number()) value = found->get<double>();
}
void Read(const Document& document, const char* key, bool& value) {
  const auto found = document.find(key);
  if (found != document.end() && found->is_boolean()) value = found->get<bool>();
}
void Read(const Document& document, const char* key, std::string& value) {
  const auto found = document.find(key);
  if (found != document.end() && found->is_string()) value = found->get<std::string>();
}

std::vector<std::string> Names(const Document& json) {
  std::vector<std::string> names;
  if (!json.is_array()) return names;
  for (const Document& name : json) {
    if (name.is_string()) names.push_back(name);
  }
  return names;
}

std::vector<EvidenceOfEffects> ReadEvidences(const Document& json) {
  std::vector<EvidenceOfEffects> list;
  const auto found = json.find("log_evidences");
  if (found == json.end() || !found->is_array()) return list;
  for (const Document& entry : *found) {
    if (!entry.is_object() || !entry.contains("effects")) continue;
    EvidenceOfEffects own{.effects = Names(entry["effects"]),
                          .log_evidence = std::nan(""),
                          .log_evidence_se = std::nan("")};
    Read(entry, "log_evidence", own.log_evidence);
    Read(entry, "log_evidence_se", own.log_evidence_se);
    if (std::isfinite(own.log_evidence) && own.log_evidence_se >= 0) list.push_back(own);
  }
  return list;
}

}  // namespace

absl::StatusOr<StoredDiagnosis> ReadDiagnosis(const std::string& text) {
  const Document json = Document::parse(text, nullptr, false);
  StoredDiagnosis d;
  if (json.is_object()) {
    Read(json, "campaign", d.campaign);
    Read(json, "verdict", d.verdict);
  }
  if (d.campaign.empty() || d.verdict.empty()) {
    return absl::InvalidArgumentError("the document kept as a diagnosis is none");
  }
  d.evidences = ReadEvidences(json);
  Read(json, "only_adequacy", d.only_adequacy);
  if (const auto adequacy = json.find("adequacy");
      adequacy != json.end() && adequacy->is_object()) {
    Read(*adequacy, "chi2", d.chi2);
  }
  if (const auto next = json.find("next_experiment"); next != json.end() && next->is_object()) {
    Read(*next, "snippet", d.next_experiment);
  }
  if (const auto then = json.find("then"); then != json.end() && then->is_object())
    Read(*then, "file", d.then_file);
  return d;
}

const StoredDiagnosis* LatestOf(const std::vector<StoredDiagnosis>& diagnoses,
                                const std::string& campaign) {
  const StoredDiagnosis* latest = nullptr;
  for (const StoredDiagnosis& d : diagnoses) {
    if (d.campaign != campaign) continue;
    const bool says_less = latest != nullptr && d.verdict == latest->verdict &&
                           d.chi2 == latest->chi2 && d.next_experiment.empty() &&
                           d.then_file == latest->then_file && !latest->next_experiment.empty();
    if (says_less) continue;  // improve asks for no next experiment
    if (latest == nullptr || latest->only_adequacy || !d.only_adequacy) latest = &d;
  }
  return latest;
}

}  // namespace calib::report
