#include "inference/data/data_set.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"

namespace calib::inference {
namespace {

using Group = std::pair<int, int>;  // experiment, observable

std::string Name(const Reading& reading) {
  return absl::StrCat("the reading of experiment ", reading.experiment, ", load step ",
                      reading.load_step, ", observable ", reading.observable);
}

double EssWeight(const DataSet& data, const Reading& reading) {
  return data.ess_weights.empty() ? 1 : data.ess_weights[reading.experiment][reading.observable];
}

absl::Status ValidateEssTarget(const DataSet& data, const Reading& reading) {
  if (reading.value == 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        Name(reading),
        " is zero: an error relative to it is zero too; leave it out or use noise: given."));
  }
  if (data.ess_weights.empty()) return absl::OkStatus();
  const bool missing =
      reading.experiment >= static_cast<int>(data.ess_weights.size()) ||
      reading.observable >= static_cast<int>(data.ess_weights[reading.experiment].size());
  if (missing || !(EssWeight(data, reading) > 0) || !std::isfinite(EssWeight(data, reading))) {
    return absl::InvalidArgumentError(
        absl::StrCat("observable ", reading.observable, " of experiment ", reading.experiment,
                     " has no positive weight for the effective-sample-size target."));
  }
  return absl::OkStatus();
}

absl::Status ValidateCorrelations(const DataSet& data) {
  std::map<Group, std::vector<double>> controls;
  for (const Correlation& correlation : data.correlations) {
    const std::string name =
        absl::StrCat("the correlation length of observable ", correlation.observable,
                     " of experiment ", correlation.experiment);
    if (!(correlation.length > 0) || !std::isfinite(correlation.length)) {
      return absl::InvalidArgumentError(
          absl::StrCat(name, " is ", correlation.length, "; it must be positive."));
    }
    if (!controls.try_emplace({correlation.experiment, correlation.observable}).second) {
      return absl::InvalidArgumentError(absl::StrCat(name, " is given twice."));
    }
  }
  for (const Reading& reading : data.readings) {
    const auto group = controls.find({reading.experiment, reading.observable});
    if (group != controls.end()) group->second.push_back(reading.control);
  }
  for (auto& [group, values] : controls) {
    std::sort(values.begin(), values.end());
    const auto twin = std::adjacent_find(values.begin(), values.end());
    if (twin != values.end()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "experiment ", group.first, " has two readings of observable ", group.second,
          " at the control ", *twin,
          ": with a correlation length their errors would be one and the same; keep one of them."));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status ValidateData(const DataSet& data, NoiseMode noise) {
  if (data.readings.empty()) return absl::InvalidArgumentError("there are no readings.");
  for (const Reading& reading : data.readings) {
    if (reading.experiment < 0 || reading.observable < 0 || reading.load_step < 0) {
      return absl::InvalidArgumentError(absl::StrCat(Name(reading), " has a negative index."));
    }
    if (!std::isfinite(reading.value) || !std::isfinite(reading.control)) {
      return absl::InvalidArgumentError(
          absl::StrCat(Name(reading), " or its control is not a finite number."));
    }
    if (noise == NoiseMode::kEssTarget) {
      if (auto valid = ValidateEssTarget(data, reading); !valid.ok()) return valid;
    } else if (!(reading.sd > 0) || !std::isfinite(reading.sd)) {
      return absl::InvalidArgumentError(absl::StrCat(Name(reading), " has the standard deviation ",
                                                     reading.sd, "; it must be positive."));
    }
  }
  return noise == NoiseMode::kEssTarget ? absl::OkStatus() : ValidateCorrelations(data);
}

DataSet WithRelativeErrors(const DataSet& data, double sigma) {
  DataSet scaled = data;
  scaled.correlations.clear();
  for (Reading& reading : scaled.readings) {
    reading.sd = std::sqrt(sigma * EssWeight(data, reading)) * std::abs(reading.value);
  }
  return scaled;
}

}  // namespace calib::inference
