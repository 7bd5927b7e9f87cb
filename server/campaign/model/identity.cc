#include "server/campaign/model/identity.h"

#include <algorithm>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "server/campaign/model/sha256.h"

namespace calib::campaign {
namespace {

std::string Column(const std::string& name, const std::vector<double>& values) {
  std::string text = absl::StrCat(name.size(), ":", name);
  for (const double value : values) absl::StrAppendFormat(&text, " %a", value);  // every bit
  return text;
}

std::string Readings(const Experiment& experiment) {
  std::vector<std::string> columns;
  for (const MeasuredObservable& observable : experiment.observables) {
    columns.push_back(Column(observable.name, observable.values));
  }
  std::sort(columns.begin(), columns.end());
  return absl::StrCat(Column(experiment.control_name, experiment.control), "\n",
                      absl::StrJoin(columns, "\n"), "\n");
}

}  // namespace

std::string IdentityDigest(const Submission& submission) {
  // Every part is preceded by its length, so that no two submissions read the same.
  const auto part = [](const std::string& text) {
    return absl::StrCat(text.size(), ":", text, "\n");
  };
  std::string canonical = part(submission.file_name) + part(submission.campaign_file);
  for (const auto& [path, digest] : submission.files) canonical += part(path) + part(digest);
  canonical += submission.seed ? absl::StrCat("seed ", *submission.seed) : "seed of the file";
  return Sha256Hex(canonical);
}

std::string DataDigest(const Campaign& campaign) {
  std::vector<std::string> experiments;
  for (const Experiment& experiment : campaign.experiments) {
    if (experiment.role == Role::kCalibrate) experiments.push_back(Readings(experiment));
  }
  std::sort(experiments.begin(), experiments.end());
  return Sha256Hex(absl::StrJoin(experiments, "\n"));
}

}  // namespace calib::campaign
