#include "server/diagnosis/run_matrices.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <numeric>
#include <optional>
#include <set>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/diagnosis/design_caps.h"
#include "server/messages/read_words.h"
#include "server/report/views/run_table.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;
using inference::DesignPoints;

constexpr double kEdgeOfBox = 1e-9;  // of rounding

// Whether scaled base parameters lie where an emulator is made for.
bool InBox(const Eigen::RowVectorXd& scaled) {
  return (scaled.array().abs() <= 1 + kEdgeOfBox).all();
}

// Complete runs of the batches whose numerics are unchanged.
struct DesignRuns {
  std::vector<std::vector<double>> values;
  std::vector<int> stream;
  std::vector<Eigen::RowVectorXd> readings;
};

DesignRuns RunsOfDesign(const DesignRows& rows, const std::vector<EndedBatch>& batches) {
  DesignRuns runs;
  for (const EndedBatch& batch : batches) {
    for (const EndedRun& ended : batch.runs) {
      if (!ended.readings || rows.ChangedNumerics(ended.run.values) >= 0) continue;
      runs.values.push_back(ended.run.values);
      runs.stream.push_back(ended.run.stream);
      runs.readings.push_back(*ended.readings);
    }
  }
  return runs;
}

// What numerical choices change, a column each.
Eigen::MatrixXd StagingOf(const BaseRuns& base, const DesignRows& rows,
                          const std::vector<EndedBatch>& batches) {
  const std::map<int, Eigen::VectorXd> change = ChangesByNumerics(base, rows, batches);
  Eigen::MatrixXd staging(base.histories.cols(), static_cast<Index>(change.size()));
  Index column = 0;
  for (const auto& [choice, difference] : change) staging.col(column++) = difference;
  return staging;
}

std::vector<Index> ShapesOf(const DesignRows& rows, const std::vector<int>& entries) {
  std::vector<Index> columns;
  for (const int k : entries) {
    const int shapes = rows.race().effects[static_cast<std::size_t>(k)].design.shapes;
    for (int h = 0; h < shapes; ++h) columns.push_back(rows.first_shape(k) + h);
  }
  return columns;
}

// Rows of the table that are witnesses of their own: of twins the first.
std::vector<Index> RunsOfTheirOwn(const report::CampaignView& view, const report::RunTable& table) {
  std::set<int> replicates;
  for (const v1::Sample& sample : view.samples) {
    if (messages::PurposeOf(sample) == campaign::SamplePurpose::kReplicate)
      replicates.insert(sample.index());
  }
  const bool varied = campaign::PackingsOfAll(view.campaign) > 0;
  std::vector<Index> rows;
  bool has_twin = false;
  for (std::size_t i = 0; i < table.sample.size(); ++i) {
    const bool twin = !varied && replicates.count(table.sample[i]) > 0;
    if (!twin || !has_twin) rows.push_back(static_cast<Index>(i));
    has_twin = has_twin || twin;
  }
  return rows;
}

constexpr int kDifferences = 32;  // of a calculated entry: five for each of its six features

// What load cells do, where the curves let it be calculated.
std::map<std::string, CurveEffect> CalculatedOn(const campaign::Campaign& campaign,
                                                const inference::DataSet& data) {
  const auto t = static_cast<Index>(data.readings.size());
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(1);
  if (!MisreadLoads(campaign, data, Eigen::MatrixXd::Zero(1, t), none, none)) return {};
  Eigen::RowVectorXd value(t), sd(t);
  for (Index k = 0; k < t; ++k) {
    value[k] = data.readings[static_cast<std::size_t>(k)].value;
    sd[k] = data.readings[static_cast<std::size_t>(k)].sd;
  }
  const auto misread = [=](const Eigen::MatrixXd& readings, const Eigen::VectorXd& gain,
                           const Eigen::VectorXd& offset) {
    const Eigen::MatrixXd histories = (readings.rowwise() - value) * sd.cwiseInverse().asDiagonal();
    const Eigen::MatrixXd read = *MisreadLoads(campaign, data, histories, gain, offset);
    return Eigen::MatrixXd((read * sd.asDiagonal()).rowwise() + value);
  };
  return {{"load_cell_error.gain",
           [misread](const Eigen::MatrixXd& readings, const Eigen::VectorXd& values) {
             return misread(readings, values, Eigen::VectorXd::Zero(values.size()));
           }},
          {"load_cell_error.offset",
           [misread](const Eigen::MatrixXd& readings, const Eigen::VectorXd& values) {
             return misread(readings, Eigen::VectorXd::Zero(values.size()), values);
           }}};
}

// Differences that calculated entries of the part make of these base runs, at scaled points.
inference::CalculatedDifferences DifferencesOf(const BaseRuns& base, const DesignRows& rows,
                                               const PartOfRace& part,
                                               const std::vector<Index>& of_base,
                                               const Eigen::MatrixXd& scaled) {
  inference::CalculatedDifferences result;
  std::vector<std::size_t> calculated;
  for (std::size_t i = 0; i < part.kept.size(); ++i) {
    if (rows.race().effects[static_cast<std::size_t>(part.kept[i])].design.calculated)
      calculated.push_back(i);
  }
  if (calculated.empty() || of_base.empty()) return result;
  const auto all = static_cast<Index>(calculated.size()) * kDifferences;
  const auto columns = static_cast<Index>(part.kept.size());
  result.without = {
      .base = Eigen::MatrixXd(all, scaled.cols()),
      .strength = Eigen::MatrixXd::Zero(all, columns),
      .shape = Eigen::MatrixXd::Zero(all, static_cast<Index>(ShapesOf(rows, part.kept).size()))};
  result.with = result.without;
  result.outputs = Eigen::MatrixXd(all, base.histories.cols());
  const Eigen::VectorXd most = rows.Most(), other = rows.MostOther();
  Index row = 0;
  for (const std::size_t place : calculated) {
    const int k = part.kept[place];
    const RacingEffect& entry = rows.race().effects[static_cast<std::size_t>(k)];
    for (int i = 0; i < kDifferences; ++i, ++row) {
      const auto n = static_cast<Index>(of_base.size());
      const Index run = of_base[static_cast<std::size_t>(i * n / kDifferences)];
      const bool negative = entry.design.two_sided && i % 2 == 1;
      const double high = std::min(kDesignCaps.strengths.high, negative ? other[k] : most[k]);
      const double low = std::min(kDesignCaps.strengths.low, high / 2);
      // Strengths in another order than runs, which may go by the iterations of the campaign.
      const double at = (i * 13 % kDifferences + 0.5) / kDifferences;
      const double strength = (negative ? -1 : 1) * low * std::pow(high / low, at);
      result.with.base.row(row) = result.without.base.row(row) = scaled.row(run);
      result.with.strength(row, static_cast<Index>(place)) = strength;
      const double parameter = entry.null + (entry.near > 0 ? 1 : -1) * strength * rows.unit()[k];
      const Eigen::MatrixXd readings = base.readings.row(run);
      result.outputs.row(row) = base.scale.Scaled(base.calculated.at(entry.strength)(
                                    readings, Eigen::VectorXd::Constant(1, parameter))) -
                                base.histories.row(run);
    }
  }
  return result;
}

// Errors of readings that are stated.
absl::Status CheckErrors(const report::CampaignView& view, const inference::DataSet& data) {
  const absl::Status status = inference::ValidateData(data, inference::NoiseMode::kGiven);
  return status.ok() ? status
                     : absl::FailedPreconditionError(
                           absl::StrCat("the readings of ", view.status.campaign(),
                                        " cannot be judged: ", status.message()));
}

// Places of an experiment's readings among the columns of a history, ascending.
std::vector<Index> ColumnsOfExperiment(const HistoryScale& scale, const std::string& experiment) {
  std::vector<Index> columns;
  Index column = 0;
  for (std::size_t c = 0; c < scale.curves().size(); ++c) {
    for (Index i = 0; i < scale.curves()[c].path.size(); ++i, ++column) {
      if (scale.names()[c].first == experiment) columns.push_back(column);
    }
  }
  return columns;
}

}  // namespace

std::map<int, Eigen::VectorXd> ChangesByNumerics(const BaseRuns& base, const DesignRows& rows,
                                                 const std::vector<EndedBatch>& batches) {
  std::map<int, Eigen::VectorXd> change;  // by choice, the first that came
  const Index d = base.values.cols();
  // The same run with unchanged numerics, scaled; nothing: there is none.
  const auto unchanged = [&](const campaign::RunOf& run) -> std::optional<Eigen::RowVectorXd> {
    const Eigen::RowVectorXd own = Eigen::Map<const Eigen::RowVectorXd>(run.values.data(), d);
    for (Index i = 0; i < base.values.rows(); ++i) {
      if (base.stream[static_cast<std::size_t>(i)] == run.stream && base.values.row(i) == own)
        return base.histories.row(i);
    }
    const std::vector<double> values = rows.WithoutNumerics(run.values);
    for (const EndedBatch& batch : batches) {
      for (const EndedRun& ended : batch.runs) {
        if (ended.readings && ended.run.stream == run.stream && ended.run.values == values)
          return base.scale.Scaled(*ended.readings);
      }
    }
    return std::nullopt;
  };
  for (const EndedBatch& batch : batches) {
    for (const EndedRun& ended : batch.runs) {
      const int choice = rows.ChangedNumerics(ended.run.values);
      if (choice < 0 || !ended.readings) continue;
      const std::optional<Eigen::RowVectorXd> without = unchanged(ended.run);
      if (without)
        change.emplace(choice, (base.scale.Scaled(*ended.readings) - *without).transpose());
    }
  }
  return change;
}

int PackingsApart(const campaign::Campaign& campaign) {
  int packings = 0;
  for (const campaign::Experiment& experiment : campaign.experiments) {
    if (experiment.role != campaign::Role::kCalibrate || experiment.specimens.size() < 2) continue;
    packings = std::gcd(packings, static_cast<int>(experiment.specimens.size()));
  }
  return std::max(1, packings);
}

BaseRuns WithoutRuns(const campaign::Campaign& campaign) {
  const inference::DataSet data = campaign::MakeDataSet(campaign);
  BaseRuns base{.scale = HistoryScale(campaign, data),
                .elsewhere = campaign.precomputed.has_value(),
                .calculated = campaign::HasOwnEngine(campaign)
                                  ? CalculatedOn(campaign, data)
                                  : EffectsOnReadings(campaign).by_strength,
                .packings = PackingsApart(campaign)};
  const auto t = static_cast<Index>(data.readings.size());
  Eigen::VectorXd sd(t);
  for (Index k = 0; k < t; ++k) sd[k] = data.readings[static_cast<std::size_t>(k)].sd;
  const Eigen::MatrixXd correlation = sd.cwiseInverse().asDiagonal() *
                                      inference::ErrorCovariance(data) *
                                      sd.cwiseInverse().asDiagonal();
  base.noise = correlation(base.scale.order(), base.scale.order());
  base.share = 0;
  for (const campaign::Experiment& experiment : campaign.experiments) {
    if (experiment.role == campaign::Role::kCalibrate)
      base.share = std::max(base.share, campaign::ScatterShare(experiment));
  }
  base.sd = Eigen::VectorXd::Ones(t);
  return base;
}

absl::StatusOr<BaseRuns> BaseRunsOf(const report::CampaignView& view) {
  const inference::DataSet data = campaign::MakeDataSet(view.campaign);
  RETURN_IF_ERROR(CheckErrors(view, data));
  const report::RunTable table = report::RunsOf(view);
  const std::vector<Index> own = RunsOfTheirOwn(view, table);
  BaseRuns base = WithoutRuns(view.campaign);
  base.values = table.parameters(own, Eigen::all);
  base.readings = table.histories(own, Eigen::all);
  for (const Index i : own) base.stream.push_back(table.stream[static_cast<std::size_t>(i)]);
  const auto t = static_cast<Index>(data.readings.size());
  for (Index k = 0; k < t; ++k) {
    const inference::Reading& reading = data.readings[static_cast<std::size_t>(k)];
    base.readings.col(k) = base.readings.col(k).array() * reading.sd + reading.value;
  }
  base.histories = base.scale.Scaled(base.readings);
  int most = -1;
  std::size_t calibrated = 0;  // draws are run on what was held out alone
  for (const v1::Sample& sample : view.samples) {
    most = std::max(most, sample.index());
    calibrated += messages::PurposeOf(sample) != campaign::SamplePurpose::kDraw ? 1 : 0;
  }
  for (const int stream : table.stream) most = std::max(most, stream);
  base.samples = most + 1;
  base.unfinished = static_cast<int>(calibrated - table.sample.size());
  const report::ScatteredReadings scattered = report::ReadingsWithScatter(view);
  for (Index c = 0; c < t; ++c) {
    const auto k = static_cast<std::size_t>(base.scale.order()[static_cast<std::size_t>(c)]);
    base.sd[c] = scattered.of_mean.readings[k].sd / data.readings[k].sd;
  }
  if (scattered.twins.rows() > 0) base.twins = base.scale.Departures(scattered.twins);
  return base;
}

absl::StatusOr<TestRuns> RunsOfTest(const report::CampaignView& design, const DesignRows& rows,
                                    int most) {
  const inference::DataSet data = campaign::MakeDataSet(design.campaign);
  RETURN_IF_ERROR(CheckErrors(design, data));
  TestRuns result{.base = WithoutRuns(design.campaign)};
  ASSIGN_OR_RETURN(std::vector<EndedBatch> batches, EndedBatchesOf(design, rows.names()));
  std::vector<EndedRun> without;
  if (std::ssize(batches) > most) batches.resize(static_cast<std::size_t>(most));
  for (EndedBatch& batch : batches) {
    if (batch.stage == campaign::SamplePurpose::kVerification) continue;
    EndedBatch& others = result.batches.emplace_back(EndedBatch{.stage = batch.stage});
    for (EndedRun& ended : batch.runs) {
      const bool has_effect = (rows.Points({ended.run.values}).strength.array() != 0).any() ||
                              rows.ChangedNumerics(ended.run.values) >= 0;
      if (has_effect) {
        others.runs.push_back(std::move(ended));
      } else if (ended.readings) {
        without.push_back(std::move(ended));
      }
    }
  }
  const auto d = static_cast<Index>(rows.race().base.size());
  const auto n = static_cast<Index>(without.size());
  result.base.values.resize(n, d);
  result.base.readings.resize(n, static_cast<Index>(data.readings.size()));
  for (Index i = 0; i < n; ++i) {
    const EndedRun& own = without[static_cast<std::size_t>(i)];
    result.base.values.row(i) = Eigen::Map<const Eigen::RowVectorXd>(own.run.values.data(), d);
    result.base.readings.row(i) = *own.readings;
    result.base.stream.push_back(own.run.stream);
  }
  result.base.histories = result.base.scale.Scaled(result.base.readings);
  return result;
}

inference::SetRuns OfExperiment(const inference::SetRuns& runs, const HistoryScale& scale,
                                const std::string& experiment) {
  const std::vector<Index> columns = ColumnsOfExperiment(scale, experiment);
  inference::SetRuns own = runs;
  own.curves.clear();
  for (std::size_t c = 0; c < runs.curves.size(); ++c) {
    if (scale.names()[c].first == experiment) own.curves.push_back(runs.curves[c]);
  }
  own.histories = runs.histories(Eigen::all, columns);
  own.noise = runs.noise(columns, columns);
  if (runs.differences.outputs.rows() > 0)
    own.differences.outputs = runs.differences.outputs(Eigen::all, columns);
  if (runs.staging.size() > 0) own.staging = runs.staging(columns, Eigen::all);
  if (runs.twins.rows() > 0) own.twins = runs.twins(Eigen::all, columns);
  return own;
}

int FewestBaseRuns(int parameters) {
  const int quadratic = (parameters + 1) * (parameters + 2) / 2;
  return std::max(4 * quadratic, quadratic + 10);
}

PartOfRace WholeOf(const Race& race) {
  PartOfRace part;
  for (int k = 0; k < static_cast<int>(race.effects.size()); ++k) part.kept.push_back(k);
  return part;
}

std::vector<int> EntriesRun(const Race& race, const std::vector<int>& entries) {
  std::vector<int> run;
  for (const int k : entries) {
    if (!race.effects[static_cast<std::size_t>(k)].design.calculated) run.push_back(k);
  }
  return run;
}

Race WithCalculated(const Race& race, const BaseRuns& base) {
  Race marked = race;
  for (RacingEffect& entry : marked.effects)
    entry.design.calculated = entry.shapes.empty() && base.calculated.count(entry.strength) > 0;
  return !base.elsewhere && EntriesRun(marked, WholeOf(marked).kept).empty() ? race : marked;
}

inference::DesignPoints PartOfPoints(const DesignRows& rows, const PartOfRace& part,
                                     const DesignPoints& points) {
  return {.base = points.base,
          .strength = points.strength(Eigen::all, part.kept),
          .shape = points.shape(Eigen::all, ShapesOf(rows, part.kept))};
}

inference::DesignPoints WholePoints(const DesignRows& rows, const PartOfRace& part,
                                    const DesignPoints& points) {
  DesignPoints whole{
      .base = points.base,
      .strength = Eigen::MatrixXd::Zero(points.rows(), static_cast<Index>(rows.unit().size())),
      .shape = Eigen::MatrixXd::Zero(points.rows(), rows.shape_count())};
  whole.strength(Eigen::all, part.kept) = points.strength;
  whole.shape(Eigen::all, ShapesOf(rows, part.kept)) = points.shape;
  return whole;
}

int RunsWith(const DesignRows& rows, const std::vector<EndedBatch>& batches, int entry) {
  const DesignPoints points = rows.Points(RunsOfDesign(rows, batches).values);
  int runs = 0;
  for (Index i = 0; i < points.base.rows(); ++i)
    runs += points.strength(i, entry) != 0 && InBox(points.base.row(i)) ? 1 : 0;
  return runs;
}

inference::SetRuns SetRunsOf(const BaseRuns& base, const DesignRows& rows,
                             const std::vector<EndedBatch>& batches, const PartOfRace& part) {
  const DesignRuns design = RunsOfDesign(rows, batches);
  const DesignPoints points = rows.Points(design.values);
  std::vector<bool> known(rows.race().effects.size(), false);
  for (const int k : part.kept) known[static_cast<std::size_t>(k)] = true;
  for (const int k : part.flat) known[static_cast<std::size_t>(k)] = true;
  const Eigen::MatrixXd scaled = rows.axes().Scaled(base.values);
  std::vector<Index> of_base, of_design;
  for (Index i = 0; i < scaled.rows(); ++i) {
    if (InBox(scaled.row(i))) of_base.push_back(i);
  }
  for (Index i = 0; i < points.rows(); ++i) {
    bool all_known = InBox(points.base.row(i));
    for (std::size_t k = 0; k < known.size(); ++k)
      all_known = all_known && (known[k] || points.strength(i, static_cast<Index>(k)) == 0);
    if (all_known) of_design.push_back(i);
  }
  const auto n = static_cast<Index>(of_base.size()), m = static_cast<Index>(of_design.size());
  const DesignPoints own = PartOfPoints(rows, part, inference::RowsOf(points, of_design));
  inference::SetRuns runs{.curves = base.scale.curves(),
                          .points = {.base = Eigen::MatrixXd(n + m, scaled.cols()),
                                     .strength = Eigen::MatrixXd::Zero(n + m, own.strength.cols()),
                                     .shape = Eigen::MatrixXd::Zero(n + m, own.shape.cols())},
                          .histories = Eigen::MatrixXd(n + m, base.histories.cols()),
                          .differences = DifferencesOf(base, rows, part, of_base, scaled),
                          .noise = base.noise,
                          .staging = StagingOf(base, rows, batches),
                          .share = base.share,
                          .twins = base.twins};
  for (const int k : part.kept)
    runs.effects.push_back(rows.race().effects[static_cast<std::size_t>(k)].design);
  runs.points.base.topRows(n) = scaled(of_base, Eigen::all);
  runs.points.base.bottomRows(m) = own.base;
  runs.points.strength.bottomRows(m) = own.strength;
  runs.points.shape.bottomRows(m) = own.shape;
  runs.histories.topRows(n) = base.histories(of_base, Eigen::all);
  for (const Index i : of_base)
    runs.packing.push_back(base.stream[static_cast<std::size_t>(i)] % base.packings);
  for (Index i = 0; i < m; ++i) {
    const auto from = static_cast<std::size_t>(of_design[static_cast<std::size_t>(i)]);
    runs.histories.row(n + i) = base.scale.Scaled(design.readings[from]).row(0);
    runs.packing.push_back(design.stream[from] % base.packings);
  }
  return runs;
}

}  // namespace calib::diagnosis
