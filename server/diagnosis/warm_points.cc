#include "server/diagnosis/warm_points.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "calib/return_if_error.h"
#include "dem/registry/catalog.h"
#include "dem/registry/model_parameters.h"
#include "inference/emulator/emulated_target.h"
#include "inference/emulator/search_widening.h"
#include "server/diagnosis/reading_effects.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

constexpr int kDraws = 1000;  // of the emulated posterior

// As the inference sees runs: predictions in the units of the readings.
inference::Iteration IterationOf(const report::RunTable& runs, const inference::DataSet& data) {
  inference::Iteration iteration;
  iteration.parameters = runs.parameters;
  iteration.predictions = runs.histories;
  for (Index k = 0; k < runs.histories.cols(); ++k) {
    const inference::Reading& reading = data.readings[static_cast<std::size_t>(k)];
    iteration.predictions.col(k) =
        (runs.histories.col(k).array() * reading.sd + reading.value).matrix();
  }
  return iteration;
}

// Column in the parent's table of each parameter of `extended`, -1: it is on top.
std::vector<Index> ColumnsOf(const campaign::Campaign& parent, const campaign::Campaign& extended) {
  std::vector<Index> from(extended.parameters.size(), -1);
  for (std::size_t j = 0; j < from.size(); ++j) {
    for (std::size_t k = 0; k < parent.parameters.size(); ++k) {
      if (parent.parameters[k].name == extended.parameters[j].name) from[j] = static_cast<Index>(k);
    }
  }
  return from;
}

std::vector<Index> OnTop(const campaign::Campaign& parent, const campaign::Campaign& extended) {
  std::vector<Index> on_top;
  const std::vector<Index> from = ColumnsOf(parent, extended);
  for (std::size_t j = 0; j < from.size(); ++j) {
    if (from[j] < 0) on_top.push_back(static_cast<Index>(j));
  }
  return on_top;
}

// The parent's runs with what is on top spread over its prior; empty where that cannot be drawn.
report::RunTable SpreadOnTop(const report::RunTable& without, const campaign::Campaign& parent,
                             const campaign::Campaign& extended) {
  const auto spread =
      inference::DrawSamples(inference::Proposal{}, campaign::Priors(extended), extended.filter, 0,
                             static_cast<int>(without.parameters.rows()));
  if (!spread.ok()) return {};
  report::RunTable table = without;
  table.parameters = *spread;
  const std::vector<Index> from = ColumnsOf(parent, extended);
  for (std::size_t j = 0; j < from.size(); ++j) {
    if (from[j] >= 0) table.parameters.col(static_cast<Index>(j)) = without.parameters.col(from[j]);
  }
  return table;
}

}  // namespace

void Append(const report::RunTable& more, report::RunTable& runs) {
  const Index before = runs.histories.rows();
  const Index n = more.histories.rows();
  if (n == 0) return;
  runs.parameters.conservativeResize(before + n, more.parameters.cols());
  runs.histories.conservativeResize(before + n, more.histories.cols());
  runs.parameters.bottomRows(n) = more.parameters;
  runs.histories.bottomRows(n) = more.histories;
  runs.sample.insert(runs.sample.end(), more.sample.begin(), more.sample.end());
  runs.stream.insert(runs.stream.end(), more.stream.begin(), more.stream.end());
}

report::RunTable RunsOfScreen(const std::vector<EffectScreen::EffectRun>& runs,
                              const campaign::Campaign& extended) {
  report::RunTable table;
  for (const EffectScreen::EffectRun& run : runs) {
    Eigen::RowVectorXd point(static_cast<Index>(extended.parameters.size()));
    bool known = true;
    for (Index j = 0; j < point.size(); ++j) {
      const campaign::CalibratedParameter& parameter =
          extended.parameters[static_cast<std::size_t>(j)];
      const auto value = run.values.find(parameter.name);
      known = known && value != run.values.end() && parameter.prior.InSupport(value->second);
      if (known) point(j) = value->second;
    }
    if (!known) continue;
    report::RunTable one;
    one.parameters = point;
    one.histories = run.history.transpose();
    one.stream = {run.stream};
    Append(one, table);
  }
  return table;
}

report::RunTable RunsWithoutEffect(const report::RunTable& without,
                                   const campaign::Campaign& parent,
                                   const campaign::Campaign& extended) {
  std::vector<std::pair<Index, double>> nulls;
  for (const Index j : OnTop(parent, extended)) {
    const campaign::CalibratedParameter& own = extended.parameters[static_cast<std::size_t>(j)];
    const dem::ParameterInfo* info = dem::FindParameter(extended.model, own.name);
    const auto null =
        info == nullptr ? std::nullopt : dem::NullValueOf(*info, extended.model.contact);
    // A prior over orders of magnitude ends where the effect no longer matters.
    if (null) nulls.emplace_back(j, std::clamp(*null, own.prior.min, own.prior.max));
  }
  if (nulls.empty()) return {};
  report::RunTable table = SpreadOnTop(without, parent, extended);
  for (Index i = 0; i < table.parameters.rows(); ++i) {
    const auto& [j, null] = nulls[static_cast<std::size_t>(i) % nulls.size()];
    table.parameters(i, j) = null;
  }
  return table;
}

std::optional<report::RunTable> RunsMisread(const report::RunTable& without,
                                            const campaign::Campaign& parent,
                                            const inference::DataSet& data,
                                            const campaign::Campaign& extended) {
  report::RunTable table = SpreadOnTop(without, parent, extended);
  Eigen::VectorXd gain = Eigen::VectorXd::Zero(table.parameters.rows());
  Eigen::VectorXd offset = gain;
  for (const Index j : OnTop(parent, extended)) {
    const std::string& name = extended.parameters[static_cast<std::size_t>(j)].name;
    if (name == "load_cell_error.gain") {
      gain = table.parameters.col(j);
    } else if (name == "load_cell_error.offset") {
      offset = table.parameters.col(j);
    } else {
      return std::nullopt;
    }
  }
  auto misread = MisreadLoads(parent, data, table.histories, gain, offset);
  if (!misread) return std::nullopt;
  table.histories = *std::move(misread);
  return table;
}

namespace {

absl::StatusOr<inference::EmulatedResult> EmulateBy(
    const campaign::Campaign& campaign, const inference::DataSet& data, double scatter_share,
    const std::vector<inference::Iteration>& iterations) {
  const inference::JointPrior priors = campaign::Priors(campaign);
  inference::EmulatorOptions options{.training = {}, .draws = kDraws, .seed = campaign.filter.seed};
  options.training.scatter_share = scatter_share;
  options.training.relevant_runs = std::max<int>(20, static_cast<int>(5 * priors.size()));
  return inference::EmulatedPosterior(priors, data, options, iterations);
}

double ScatterShare(const report::ScatteredReadings& readings) { return readings.measured ? 0 : 1; }

double NearestSquare(const Eigen::MatrixXd& points, const Eigen::RowVectorXd& to) {
  return points.rows() == 0 ? std::numeric_limits<double>::infinity()
                            : (points.rowwise() - to).rowwise().squaredNorm().minCoeff();
}

// Those that are not twice as near to a point that diverged as to any that ended, in the order
// drawn; where they are too few, others are left among them.
absl::StatusOr<Eigen::MatrixXd> DrawWhereRunsEnd(const inference::Proposal& proposal,
                                                 const inference::JointPrior& priors,
                                                 const inference::FilterOptions& filter,
                                                 const Eigen::MatrixXd& ended,
                                                 const Eigen::MatrixXd& diverged, int batch,
                                                 int count) {
  constexpr int kTimes = 8;
  // The right point may lie beside some that diverged (adhesion beside spheres that stick).
  constexpr double kNear = 2 * 2;
  if (diverged.rows() == 0) return inference::DrawSamples(proposal, priors, filter, batch, count);
  auto drawn = inference::DrawSamples(proposal, priors, filter, batch, kTimes * count);
  if (!drawn.ok()) return drawn;
  const Eigen::MatrixXd good = inference::ToStandard(priors, ended);
  const Eigen::MatrixXd bad = inference::ToStandard(priors, diverged);
  const Eigen::MatrixXd standard = inference::ToStandard(priors, *drawn);
  std::vector<Index> order(static_cast<std::size_t>(drawn->rows()));
  std::iota(order.begin(), order.end(), Index{0});
  std::stable_partition(order.begin(), order.end(), [&](Index row) {
    return NearestSquare(good, standard.row(row)) <= kNear * NearestSquare(bad, standard.row(row));
  });
  order.resize(static_cast<std::size_t>(count));
  return Eigen::MatrixXd((*drawn)(order, Eigen::all));
}

}  // namespace

absl::StatusOr<inference::EmulatedResult> Emulate(const campaign::Campaign& campaign,
                                                  const report::ScatteredReadings& readings,
                                                  const report::RunTable& runs) {
  return EmulateBy(campaign, readings.of_mean, ScatterShare(readings),
                   {IterationOf(runs, readings.of_mean)});
}

absl::StatusOr<Eigen::MatrixXd> NextPoints(const campaign::Campaign& campaign,
                                           const report::ScatteredReadings& readings,
                                           const report::RunTable& runs,
                                           const Eigen::MatrixXd& diverged, int batch, int count) {
  const inference::JointPrior priors = campaign::Priors(campaign);
  const std::vector<inference::Iteration> iterations = {IterationOf(runs, readings.of_mean)};
  const inference::DataSet wider = inference::WithLargerErrors(
      readings.of_mean, inference::SearchWidening(readings.of_mean, iterations));
  const auto emulated = EmulateBy(campaign, wider, ScatterShare(readings), iterations);
  if (!emulated.ok() || emulated->draws.rows() == 0) {
    return DrawWhereRunsEnd({}, priors, campaign.filter, runs.parameters, diverged, batch, count);
  }
  ASSIGN_OR_RETURN(const auto about,
                   inference::FitProposalToDraws(priors, campaign.filter, emulated->draws,
                                                 static_cast<std::size_t>(batch), {},
                                                 inference::ClosestDraws(*emulated)));
  return DrawWhereRunsEnd(about, priors, campaign.filter, runs.parameters, diverged, batch, count);
}

Eigen::MatrixXd DivergedPoints(const report::CampaignView& view) {
  const auto d = static_cast<Index>(view.campaign.parameters.size());
  Eigen::MatrixXd points(0, d);
  for (const v1::Sample& sample : view.samples) {
    if (sample.status() != "diverged" || sample.parameters_size() != d) continue;
    points.conservativeResize(points.rows() + 1, d);
    for (Index j = 0; j < d; ++j) {
      points(points.rows() - 1, j) = sample.parameters(static_cast<int>(j));
    }
  }
  return points;
}

}  // namespace calib::diagnosis
