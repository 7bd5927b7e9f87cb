#include "inference/data/data_set.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"

namespace calib::inference {
namespace {

using Group = std::pair<int, int>;  // experiment, observable

// What a covariance may depart from symmetry and from the squares of the stated sd, over those
// squares; chosen: text files carry nine digits and more.
constexpr double kAgrees = 1e-9;

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

absl::Status ValidateCovariances(const DataSet& data) {
  const ReadingGroups groups = GroupsOf(data);
  std::map<Group, int> seen;
  for (const Correlation& correlation : data.correlations) {
    ++seen[{correlation.experiment, correlation.observable}];
  }
  for (const GroupCovariance& covariance : data.covariances) {
    const Group key{covariance.experiment, covariance.observable};
    const std::string name =
        absl::StrCat("the covariance of observable ", key.second, " of experiment ", key.first);
    const auto group = groups.find(key);
    const Eigen::Index size =
        group == groups.end() ? 0 : static_cast<Eigen::Index>(group->second.size());
    const Eigen::MatrixXd& matrix = covariance.matrix;
    if (matrix.rows() != size || matrix.cols() != size) {
      return absl::InvalidArgumentError(absl::StrCat(
          name, " is ", matrix.rows(), " x ", matrix.cols(), "; it has ", size, " readings."));
    }
    if (++seen[key] > 1) {
      return absl::InvalidArgumentError(
          absl::StrCat(name, " is given twice, or beside a correlation length."));
    }
    for (Eigen::Index i = 0; i < size; ++i) {
      const double sd = data.readings[group->second[i]].sd;
      if (!(std::abs(matrix(i, i) - sd * sd) <= kAgrees * sd * sd)) {
        return absl::InvalidArgumentError(absl::StrCat(name, " has the variance ", matrix(i, i),
                                                       " for reading ", i,
                                                       " whose standard deviation is ", sd, "."));
      }
    }
    const Eigen::VectorXd sd = matrix.diagonal().cwiseSqrt();
    const Eigen::MatrixXd asymmetry = (matrix - matrix.transpose()).cwiseAbs();
    if (!matrix.allFinite() ||
        (asymmetry.array() > kAgrees * (sd * sd.transpose()).array()).any()) {
      return absl::InvalidArgumentError(absl::StrCat(name, " is not finite and symmetric."));
    }
  }
  return absl::OkStatus();
}

absl::Status ValidateNoiseGroups(const DataSet& data) {
  std::map<Group, int> seen;
  for (const NoiseGroup& group : data.noise_groups) {
    if (group.members.empty()) return absl::InvalidArgumentError("a noise group has no members.");
    const VarianceFactorPrior& prior = group.prior;
    if (!(prior.shape > 0 && prior.rate > 0) || !std::isfinite(prior.shape + prior.rate)) {
      return absl::InvalidArgumentError(
          absl::StrCat("the prior of a noise group's variance factor has shape ", prior.shape,
                       " and rate ", prior.rate, "; both must be positive."));
    }
    for (const Group& member : group.members) {
      if (++seen[member] == 1) continue;
      return absl::InvalidArgumentError(absl::StrCat("observable ", member.second,
                                                     " of experiment ", member.first,
                                                     " stands in two noise groups."));
    }
  }
  return absl::OkStatus();
}

absl::Status ValidateModelErrors(const DataSet& data) {
  std::map<Group, int> seen;
  for (const ModelError& error : data.model_errors) {
    if (error.members.empty()) return absl::InvalidArgumentError("a model error has no members.");
    if (!error.relative && !error.absolute) {
      return absl::InvalidArgumentError("a model error is neither relative nor absolute.");
    }
    for (const auto& scale : {error.relative, error.absolute}) {
      if (!scale) continue;
      RETURN_IF_ERROR(scale->prior.Validate());
      if (!(scale->prior.min >= 0)) {
        return absl::InvalidArgumentError(absl::StrCat("the prior of a model error begins at ",
                                                       scale->prior.min,
                                                       "; a standard deviation is not negative."));
      }
    }
    for (const Group& member : error.members) {
      if (++seen[member] == 1) continue;
      return absl::InvalidArgumentError(absl::StrCat("observable ", member.second,
                                                     " of experiment ", member.first,
                                                     " stands in two model errors."));
    }
  }
  return absl::OkStatus();
}

}  // namespace

std::vector<NoiseGroup> NoiseGroupsOf(const DataSet& data) {
  const ReadingGroups groups = GroupsOf(data);
  std::map<Group, NoiseGroup> by_first;
  std::map<Group, bool> taken;
  for (const NoiseGroup& given : data.noise_groups) {
    NoiseGroup group{.members = {}, .prior = given.prior};
    for (const Group& member : given.members) {
      taken[member] = true;
      if (groups.count(member) > 0) group.members.push_back(member);
    }
    if (group.members.empty()) continue;
    std::sort(group.members.begin(), group.members.end());
    by_first[group.members.front()] = std::move(group);
  }
  for (const auto& [key, readings] : groups) {
    if (taken.count(key) == 0) by_first[key] = {.members = {key}};
  }
  std::vector<NoiseGroup> all;
  all.reserve(by_first.size());
  for (auto& [first, group] : by_first) all.push_back(std::move(group));
  return all;
}

DataSet Reversed(const DataSet& data) {
  DataSet reversed = data;
  std::reverse(reversed.readings.begin(), reversed.readings.end());
  for (GroupCovariance& covariance : reversed.covariances) {
    covariance.matrix = covariance.matrix.reverse().eval();
  }
  return reversed;
}

ReadingGroups GroupsOf(const DataSet& data) {
  ReadingGroups groups;
  for (int t = 0; t < static_cast<int>(data.readings.size()); ++t) {
    groups[{data.readings[t].experiment, data.readings[t].observable}].push_back(t);
  }
  return groups;
}

bool IsCorrelated(const DataSet& data, std::pair<int, int> group) {
  const auto is_of = [&group](const auto& entry) {
    return entry.experiment == group.first && entry.observable == group.second;
  };
  return std::any_of(data.correlations.begin(), data.correlations.end(), is_of) ||
         std::any_of(data.covariances.begin(), data.covariances.end(), is_of);
}

Eigen::MatrixXd ErrorCorrelation(const DataSet& data, std::pair<int, int> group,
                                 const std::vector<int>& readings) {
  const auto size = static_cast<Eigen::Index>(readings.size());
  for (const GroupCovariance& covariance : data.covariances) {
    if (Group(covariance.experiment, covariance.observable) != group) continue;
    const Eigen::VectorXd inverse = covariance.matrix.diagonal().cwiseSqrt().cwiseInverse();
    return inverse.asDiagonal() * covariance.matrix * inverse.asDiagonal();
  }
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(size, size);
  for (const Correlation& c : data.correlations) {
    if (Group(c.experiment, c.observable) != group) continue;
    for (Eigen::Index i = 0; i < size; ++i) {
      for (Eigen::Index j = 0; j < i; ++j) {
        const double distance =
            data.readings[readings[i]].control - data.readings[readings[j]].control;
        correlation(i, j) = correlation(j, i) = std::exp(-std::abs(distance) / c.length);
      }
    }
  }
  return correlation;
}

Eigen::MatrixXd ErrorCovariance(const DataSet& data) {
  const auto t = static_cast<Eigen::Index>(data.readings.size());
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(t, t);
  for (const auto& [key, readings] : GroupsOf(data)) {
    const Eigen::MatrixXd correlation = ErrorCorrelation(data, key, readings);
    for (Eigen::Index i = 0; i < correlation.rows(); ++i) {
      for (Eigen::Index j = 0; j < correlation.cols(); ++j) {
        covariance(readings[i], readings[j]) =
            data.readings[readings[i]].sd * correlation(i, j) * data.readings[readings[j]].sd;
      }
    }
  }
  return covariance;
}

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
      RETURN_IF_ERROR(ValidateEssTarget(data, reading));
    } else if (!(reading.sd > 0) || !std::isfinite(reading.sd)) {
      return absl::InvalidArgumentError(absl::StrCat(Name(reading), " has the standard deviation ",
                                                     reading.sd, "; it must be positive."));
    }
  }
  if (noise == NoiseMode::kEssTarget) return absl::OkStatus();
  RETURN_IF_ERROR(ValidateCorrelations(data));
  RETURN_IF_ERROR(ValidateCovariances(data));
  RETURN_IF_ERROR(ValidateNoiseGroups(data));
  return ValidateModelErrors(data);
}

DataSet Restricted(const DataSet& data, const std::vector<int>& readings) {
  DataSet part = data;
  part.readings.clear();
  for (const int t : readings) part.readings.push_back(data.readings[t]);
  const ReadingGroups groups = GroupsOf(data);
  for (GroupCovariance& covariance : part.covariances) {
    const auto group = groups.find({covariance.experiment, covariance.observable});
    std::vector<Eigen::Index> kept;
    for (std::size_t i = 0; group != groups.end() && i < group->second.size(); ++i) {
      if (std::binary_search(readings.begin(), readings.end(), group->second[i])) {
        kept.push_back(static_cast<Eigen::Index>(i));
      }
    }
    covariance.matrix = Eigen::MatrixXd(covariance.matrix(kept, kept));
  }
  std::erase_if(part.covariances, [](const GroupCovariance& c) { return c.matrix.size() == 0; });
  return part;
}

DataSet WithLargerErrors(const DataSet& data, double factor) {
  DataSet scaled = data;
  for (Reading& reading : scaled.readings) reading.sd *= factor;
  for (GroupCovariance& covariance : scaled.covariances) covariance.matrix *= factor * factor;
  return scaled;
}

DataSet WithRelativeErrors(const DataSet& data, double sigma) {
  DataSet scaled = data;
  scaled.correlations.clear();
  scaled.covariances.clear();
  for (Reading& reading : scaled.readings) {
    reading.sd = std::sqrt(sigma * EssWeight(data, reading)) * std::abs(reading.value);
  }
  return scaled;
}

}  // namespace calib::inference
