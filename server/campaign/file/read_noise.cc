#include "server/campaign/file/read_noise.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "dem/registry/catalog.h"
#include "inference/data/gaussian_likelihood.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/keys/bounds.h"

namespace calib::campaign {
namespace {

constexpr double kNextToNothing = 1e-9;  // of the largest reading

struct NoiseSpec {
  std::optional<double> relative, floor, absolute;
  std::string column;
  std::string covariance;  // file
};

NoiseLaw LawOf(const NoiseSpec& spec) {
  return {.relative = spec.relative.value_or(0),
          .floor = spec.floor.value_or(0),
          .absolute = spec.absolute};
}

std::string UnitOf(const std::string& name, const LaboratoryTable* table) {
  if (table != nullptr) return table->UnitOf(name);
  const dem::ObservableInfo* info = dem::FindObservable(name);
  return info != nullptr ? info->unit : "1";
}

double LargestReading(const std::vector<double>& readings) {
  double largest = 0;
  for (const double reading : readings) {
    if (!std::isnan(reading)) largest = std::max(largest, std::abs(reading));
  }
  return largest;
}

// First reading that has no size to scale an error with; nullopt when all keep clear of zero.
std::optional<std::size_t> ReadingAtZero(const std::vector<double>& raw) {
  const double largest = LargestReading(raw);
  for (std::size_t i = 0; i < raw.size(); ++i) {
    if (std::isnan(raw[i])) continue;
    const bool crosses = i > 0 && raw[i] * raw[i - 1] < 0;
    if (std::abs(raw[i]) <= kNextToNothing * largest || crosses) return i;
  }
  return std::nullopt;
}

std::optional<NoiseSpec> ReadSpec(MapReader& noise, const std::string& unit) {
  const std::size_t before = noise.problems().size();
  NoiseSpec spec;
  spec.relative = noise.Quantity("relative");
  spec.floor = noise.Quantity("floor", unit, kNotNegative);
  spec.absolute = noise.Quantity("absolute", unit, kPositive);
  spec.column = noise.Text("column").value_or("");
  spec.covariance = noise.Text("covariance").value_or("");
  const int kinds =
      static_cast<int>(noise.Has("relative")) + static_cast<int>(noise.Has("absolute")) +
      static_cast<int>(noise.Has("column")) + static_cast<int>(noise.Has("covariance"));
  if (kinds != 1) {
    noise.problems().Add(noise.line(), noise.path(),
                         "needs exactly one of relative (with floor), absolute, column and "
                         "covariance");
  } else if (noise.Has("floor") && !noise.Has("relative")) {
    noise.Problem("floor", "belongs to relative noise: sd = sqrt((relative y)^2 + floor^2)");
  }
  if (noise.problems().size() > before) return std::nullopt;
  return spec;
}

std::vector<double> FromColumn(const NoiseSpec& spec, const std::string& name,
                               const LaboratoryTable& table, const std::vector<double>& raw,
                               ReadContext& context) {
  std::vector<double> sd = table.RawColumn(spec.column, name, context);
  for (std::size_t i = 0; i < sd.size(); ++i) {
    if (std::isnan(raw[i])) {
      sd[i] = std::nan("");
    } else if (!(sd[i] > 0)) {
      context.problems().AddIn(table.path(), table.LineOf(i), spec.column,
                               std::isnan(sd[i]) ? "is missing beside a reading"
                                                 : "a standard deviation has to be greater than 0");
    }
  }
  return sd;
}

// Empty where the errors can have this covariance and none of them follows from the others.
std::string WhyNoCovariance(const Eigen::MatrixXd& matrix) {
  constexpr double kRounding = 1e-9;
  const std::string advice =
      "add the independent part of each reading's error to the diagonal, or leave readings out";
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    if (!(matrix(i, i) > 0)) {
      return absl::StrCat("has the variance ", matrix(i, i), " in row ", i + 1,
                          "; a variance has to be greater than 0");
    }
  }
  const inference::OpenShare least = inference::LeastOpenShare(matrix);
  if (least.share > inference::kLeastOpenShare) return "";
  const std::string row = absl::StrCat("row ", least.reading + 1);
  if (least.share < -kRounding) {
    return absl::StrCat("is not positive definite, as a covariance is: ", row,
                        " contradicts the rows before it; see to its correlations");
  }
  return absl::StrCat("is singular to within rounding: the rows before leave a share of ",
                      std::max(least.share, 0.0), " of the variance of ", row,
                      " open (needed: ", inference::kLeastOpenShare, "); ", advice);
}

// Numbers of a square table without a header, row by row; one problem for what is wrong first.
Eigen::MatrixXd ReadCovariance(const MapReader& noise, const std::string& path,
                               std::size_t readings, double factor, ReadContext& context) {
  if (const std::size_t most = context.limits().covariance; readings > most) {
    noise.Problem("covariance",
                  absl::StrCat("is of ", readings, " readings, and this server factorises at most ",
                               most, " (calibd --max-covariance): correlation_length costs less"));
    return {};
  }
  const std::string* text = context.ReadNamedFile(noise, "covariance", path);
  if (text == nullptr) return {};
  const auto n = static_cast<Eigen::Index>(readings);
  const std::string wanted =
      absl::StrCat(readings, " numbers, one per reading, in the square of the observable's unit");
  Eigen::MatrixXd matrix(n, n);
  Eigen::Index row = 0;
  int line = 0;
  for (const absl::string_view raw : absl::StrSplit(*text, '\n')) {
    ++line;
    const absl::string_view content = raw.substr(0, raw.find('#'));
    const std::vector<std::string> fields =
        absl::StrSplit(content, absl::ByAnyChar(" ,\t\r"), absl::SkipEmpty());
    if (fields.empty()) continue;
    if (row == n || static_cast<Eigen::Index>(fields.size()) != n) {
      context.problems().AddIn(
          path, line, "",
          row == n
              ? absl::StrCat("has more than ", readings, " rows, but there are as many readings")
              : absl::StrCat("has ", fields.size(), " numbers; a row has ", wanted));
      return {};
    }
    for (Eigen::Index j = 0; j < n; ++j) {
      double value = 0;
      if (!absl::SimpleAtod(fields[static_cast<std::size_t>(j)], &value) || !std::isfinite(value)) {
        context.problems().AddIn(
            path, line, "",
            absl::StrCat(Quoted(fields[static_cast<std::size_t>(j)]), " is not a finite number"));
        return {};
      }
      matrix(row, j) = value * factor * factor;
    }
    ++row;
  }
  std::string problem;
  if (row < n) {
    problem = absl::StrCat("has ", row, " rows, but there are ", readings, " readings");
  } else if (((matrix - matrix.transpose()).cwiseAbs().array() >
              1e-9 * matrix.cwiseAbs().maxCoeff())
                 .any()) {
    problem = "is not symmetric, as a covariance is";
  } else {
    problem = WhyNoCovariance(matrix);
  }
  if (problem.empty()) return 0.5 * (matrix + matrix.transpose());
  context.problems().AddIn(path, 0, "", problem);
  return {};
}

std::vector<double> StandardDeviations(const NoiseSpec& spec, const MapReader& noise,
                                       const std::string& name, const LaboratoryTable& table,
                                       const std::vector<double>& raw, ReadContext& context) {
  if (!spec.column.empty()) return FromColumn(spec, name, table, raw, context);
  const NoiseLaw law = LawOf(spec);
  if (const auto zero = ReadingAtZero(raw); !law.absolute && law.floor == 0 && zero) {
    noise.Problem(
        "relative",
        absl::StrCat(name, " reaches zero (", table.path(), ":", table.LineOf(*zero),
                     "), where a relative error vanishes; add floor: ... or give absolute or "
                     "per-point noise"));
    return {};
  }
  std::vector<double> sd;
  sd.reserve(raw.size());
  for (const double value : raw) sd.push_back(ErrorOf(law, value));
  return sd;
}

void RefuseZeroReadings(const MapReader& experiment, const std::string& name,
                        const LaboratoryTable& table, const std::vector<double>& raw) {
  const double largest = LargestReading(raw);
  for (std::size_t i = 0; i < raw.size(); ++i) {
    if (std::isnan(raw[i]) || std::abs(raw[i]) > kNextToNothing * largest) continue;
    experiment.problems().Add(experiment.LineOf("observables"),
                              experiment.PathOf("observables." + name),
                              absl::StrCat("is zero in ", table.path(), ":", table.LineOf(i),
                                           ", but ess_target scales errors with the reading; leave "
                                           "the row out or use noise: given"));
    return;
  }
}

bool BelowRounding(const std::vector<double>& sd, const std::vector<double>& readings) {
  constexpr double kRounding = 1e-14;
  const double largest = LargestReading(readings);
  return std::any_of(sd.begin(), sd.end(),
                     [largest](double s) { return s > 0 && s < kRounding * largest; });
}

// The covariance of the readings that there are, as one of all rows.
void TakeCovariance(const MapReader& noise, const NoiseSpec& spec, const std::string& name,
                    const LaboratoryTable& table, const std::vector<double>& raw,
                    ReadContext& context, MeasuredObservable& observable) {
  const std::vector<Eigen::Index> rows = RowsRead(observable);
  const Eigen::MatrixXd read =
      ReadCovariance(noise, spec.covariance, rows.size(), table.Factor(name), context);
  if (read.size() == 0) return;
  const auto n = static_cast<Eigen::Index>(raw.size());
  observable.covariance.setConstant(n, n, std::nan(""));
  observable.covariance(rows, rows) = read;
  for (const Eigen::Index i : rows) {
    const double slope = table.Slope(name, raw[static_cast<std::size_t>(i)]);
    observable.covariance.row(i) *= slope;
    observable.covariance.col(i) *= slope;
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    observable.sd.push_back(std::sqrt(observable.covariance(i, i)));
  }
}

}  // namespace

void ReadNoise(const MapReader& experiment, const std::string& name, const YamlNode* node,
               const NoiseRules& rules, const LaboratoryTable* table,
               const std::vector<double>& raw, ReadContext& context,
               MeasuredObservable& observable) {
  const bool readable = table != nullptr && !raw.empty();
  if (!rules.noise_needed && rules.measured && readable)
    RefuseZeroReadings(experiment, name, *table, raw);
  const std::string path = experiment.PathOf("observables." + name);
  const bool given = node != nullptr && node->kind != YamlNode::Kind::kNull;
  bool noise_given = false;
  if (given) {
    MapReader map(*node, path, SectionOf("observable"), context.problems());
    observable.ess_weight = map.Quantity("weight").value_or(1);
    noise_given = map.Has("noise") || node->kind != YamlNode::Kind::kMap;
    if (auto noise = map.Map("noise")) {
      const auto spec = ReadSpec(*noise, UnitOf(name, table));
      observable.correlation_length =
          noise->Quantity("correlation_length", UnitOf(rules.control, table), kNotNegative)
              .value_or(0);
      noise->Finish();
      if (spec && (spec->relative || spec->absolute)) observable.noise = LawOf(*spec);
      if (spec && noise->Has("correlation_length") && !spec->covariance.empty()) {
        noise->Problem("correlation_length", "is part of the covariance already; remove it");
      }
      if (spec && readable && !spec->covariance.empty()) {
        TakeCovariance(*noise, *spec, name, *table, raw, context, observable);
      } else if (spec && readable) {
        observable.sd = StandardDeviations(*spec, *noise, name, *table, raw, context);
        if (BelowRounding(observable.sd, raw)) {
          context.problems().Add(node->line, path + ".noise",
                                 "is smaller than what a number holds of the readings: no run can "
                                 "come so close");
        }
        for (std::size_t i = 0; i < observable.sd.size(); ++i) {
          observable.sd[i] *= table->Slope(name, raw[i]);
        }
      }
    }
    map.Finish();
  }
  if (!noise_given && rules.noise_needed) {
    context.problems().Add(
        given ? node->line : experiment.LineOf("observables"), path + ".noise",
        "is missing; e.g. {relative: 0.02, floor: 0.01}, {absolute: 0.1 percent} or {column: sd}");
  }
}

}  // namespace calib::campaign
