#include "server/diagnosis/measurement_errors.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "inference/numerics/decompositions.h"
#include "inference/sampling/philox.h"
#include "inference/scatter/packing_scatter.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

constexpr Index kDraws = 400;  // of measurements
constexpr int kRunsAbout = 5;  // runs of a campaign or a warm fit about its best point

// Correlated errors of the readings, one as variance.
Eigen::MatrixXd NoiseCorrelation(const inference::DataSet& data) {
  const Eigen::MatrixXd covariance = inference::ErrorCovariance(data);
  const Eigen::VectorXd inverse = covariance.diagonal().cwiseSqrt().cwiseInverse();
  return inverse.asDiagonal() * covariance * inverse.asDiagonal();
}

// Of the noise of each reading in the sd of histories.
Eigen::VectorXd NoiseSd(const FittedCampaign& base, const inference::DataSet& plain) {
  Eigen::VectorXd unit(static_cast<Index>(plain.readings.size()));
  for (Index k = 0; k < unit.size(); ++k) {
    const auto at = static_cast<std::size_t>(k);
    unit[k] = plain.readings[at].sd / base.readings().of_mean.readings[at].sd;
  }
  return unit;
}

Eigen::VectorXd InverseSd(const inference::DataSet& data) {
  Eigen::VectorXd inverse(static_cast<Index>(data.readings.size()));
  for (Index k = 0; k < inverse.size(); ++k) {
    inverse[k] = 1 / data.readings[static_cast<std::size_t>(k)].sd;
  }
  return inverse;
}

// Lower triangular, of a covariance in sd of the readings that may lack directions.
Eigen::MatrixXd FactorOf(const Eigen::MatrixXd& covariance) {
  constexpr double kNothing = 1e-10;  // of their variance
  const auto t = covariance.rows();
  return Eigen::LLT<Eigen::MatrixXd>(covariance + kNothing * Eigen::MatrixXd::Identity(t, t))
      .matrixL();
}

// What scatters of a measurement about the mean of the runs, of what the emulator misses of a run.
Eigen::VectorXd ScatterOfMissed(const FittedCampaign& base, const inference::DataSet& plain) {
  Eigen::VectorXd scatter(static_cast<Index>(plain.readings.size()));
  for (Index k = 0; k < scatter.size(); ++k) {
    const campaign::Experiment& experiment =
        base.view().campaign.experiments[static_cast<std::size_t>(
            plain.readings[static_cast<std::size_t>(k)].experiment)];
    const auto packings = static_cast<double>(experiment.specimens.size());
    const double share = campaign::ScatterShare(experiment);
    // A run departs less from the mean over R packings than from that over all, a new one more.
    scatter[k] = std::sqrt(base.readings().measured && packings > 1
                               ? (share + 1 / packings) / (1 - 1 / packings)
                               : share);
  }
  return scatter;
}

// What measurements are drawn from.
struct Drawn {
  Eigen::MatrixXd missed;    // n x T: what the emulator misses of single runs, or twins
  std::vector<int> group{};  // of each of them, may be empty
  Eigen::MatrixXd beside{};  // T x T: factor of the covariance of what is in none; may be empty
};

// Noise, nuisance and scatter of measurements.
void DrawMeasurements(const FittedCampaign& base, const Drawn& drawn,
                      const std::vector<Eigen::VectorXd>& nuisance, MeasurementErrors& errors) {
  const Eigen::MatrixXd& missed = drawn.missed;
  const campaign::Campaign& campaign = base.view().campaign;
  const inference::DataSet plain = campaign::MakeDataSet(campaign);
  const auto t = static_cast<Index>(plain.readings.size());
  const Eigen::VectorXd scatter = ScatterOfMissed(base, plain);
  const Eigen::MatrixXd noise =
      NoiseSd(base, plain).asDiagonal() *
      Eigen::MatrixXd(Eigen::LLT<Eigen::MatrixXd>(NoiseCorrelation(plain)).matrixL());
  const Eigen::LLT<Eigen::MatrixXd> factor(errors.of_run.covariance);
  errors.of_mean.draws.resize(kDraws, t);
  errors.of_run.draws.resize(kDraws, t);
  Eigen::VectorXd normal(t);
  for (Index s = 0; s < kDraws; ++s) {
    inference::PhiloxStream stream({.seed = campaign.filter.seed,
                                    .purpose = inference::StreamPurpose::kDiagnosisDraws,
                                    .iteration = 0,
                                    .sample = static_cast<std::uint64_t>(s)});
    for (Index k = 0; k < t; ++k) normal[k] = stream.Normal();
    Eigen::VectorXd draw = noise * normal;
    for (const Eigen::VectorXd& direction : nuisance) draw += stream.Normal() * direction;
    const Index own = s % missed.rows();
    const double sign = stream.Normal() < 0 ? -1 : 1;
    draw += sign * scatter.cwiseProduct(missed.row(own).transpose());
    if (drawn.beside.size() > 0) {
      for (Index k = 0; k < t; ++k) normal[k] = stream.Normal();
      draw += drawn.beside * normal;
    }
    errors.of_mean.draws.row(s) = draw;
    if (!drawn.group.empty()) {
      errors.of_mean.group.push_back(drawn.group[static_cast<std::size_t>(own)]);
    }
    // The fits take the closest of the runs about the right point.
    double closest = std::numeric_limits<double>::infinity();
    for (int k = 0; k < kRunsAbout; ++k) {
      const auto other =
          std::min(static_cast<Index>(stream.Uniform() * static_cast<double>(missed.rows())),
                   missed.rows() - 1);
      const Eigen::VectorXd difference = draw - missed.row(other).transpose();
      const double distance = factor.matrixL().solve(difference).squaredNorm();
      if (distance >= closest) continue;
      closest = distance;
      errors.of_run.draws.row(s) = difference;
    }
  }
}

}  // namespace

MeasurementErrors ErrorsOfMeasurements(const FittedCampaign& base,
                                       const inference::StateEmulator& emulator,
                                       const Eigen::VectorXd& not_known,
                                       const std::vector<int>& packing,
                                       const std::vector<Eigen::VectorXd>& nuisance) {
  const report::ScatteredReadings& readings = base.readings();
  const inference::DataSet& data = readings.of_mean;
  const auto t = static_cast<Index>(data.readings.size());
  const inference::PrincipalComponents& components = emulator.components();
  // Of a history, from standard deviations of its scores.
  const auto covariance_of = [&](const Eigen::VectorXd& sd) -> Eigen::MatrixXd {
    const Eigen::MatrixXd factor = components.basis * sd.asDiagonal();
    Eigen::MatrixXd covariance = factor * emulator.correlation() * factor.transpose();
    covariance.diagonal() += components.remainder;
    return covariance;
  };
  Eigen::MatrixXd numerical = Eigen::MatrixXd::Zero(t, t);
  for (const Eigen::VectorXd& direction : nuisance) {
    numerical += direction * direction.transpose();
  }
  const Eigen::VectorXd& sd = emulator.scatter_sd();
  const Eigen::MatrixXd missed =
      covariance_of((not_known.array().square() + sd.array().square()).sqrt());
  const inference::DataSet plain = campaign::MakeDataSet(base.view().campaign);
  // As large as near the best point: far out the emulator knows less, which is no scatter.
  Drawn drawn{.missed = emulator.cross_validation().standardised *
                        missed.diagonal().cwiseSqrt().asDiagonal()};
  MeasurementErrors errors;
  if (readings.measured) {
    Eigen::VectorXd unit(t);  // sd of one run's difference over that of the mean history's
    double square = 0;
    for (Index k = 0; k < t; ++k) {
      const auto at = static_cast<std::size_t>(k);
      unit[k] = readings.of_run.readings[at].sd / data.readings[at].sd;
      const double of_mean = data.readings[at].sd / plain.readings[at].sd;
      square += (unit[k] * unit[k] - 1) * of_mean * of_mean;
    }
    errors.scatter = std::sqrt(square / static_cast<double>(t));
    errors.of_mean.covariance = NoiseCorrelation(data) + numerical + covariance_of(not_known);
    const Eigen::VectorXd noise = NoiseSd(base, plain);
    const Eigen::MatrixXd closed_form =
        NoiseCorrelation(data) - noise.asDiagonal() * NoiseCorrelation(plain) * noise.asDiagonal();
    // On several packings the emulator's runs show it; on one the twins, each a packing of its own.
    const auto twins = readings.twins.rows();
    std::vector<int> own = packing;
    if (twins > 0) {
      drawn.missed = std::sqrt(static_cast<double>(twins) / static_cast<double>(twins - 1)) *
                     readings.twins * InverseSd(data).asDiagonal();
      drawn.beside = FactorOf(covariance_of(not_known));
      own.resize(static_cast<std::size_t>(twins));
      std::iota(own.begin(), own.end(), 0);
    }
    errors.packings = static_cast<int>(twins > 0 ? twins : readings.departures.rows());
    const std::set<int> apart(own.begin(), own.end());
    if (static_cast<Index>(own.size()) == drawn.missed.rows() &&
        static_cast<int>(apart.size()) >= kFewestPackings) {
      inference::PackingScatter scatter = inference::ScatterBetweenPackings(
          drawn.missed * ScatterOfMissed(base, plain).asDiagonal(), own,
          [&](std::optional<int> left_out) {
            const auto& forms = base.closed_forms_without();
            const bool known = left_out && static_cast<std::size_t>(*left_out) < forms.size();
            return known ? forms[static_cast<std::size_t>(*left_out)].value_or(closed_form)
                         : closed_form;
          },
          errors.of_mean.covariance - closed_form);
      errors.of_mean.covariance = std::move(scatter.covariance);
      errors.of_mean.without = std::move(scatter.without);
      errors.packings = static_cast<int>(apart.size());
      drawn.group = std::move(scatter.group);
    }
    errors.of_run.covariance =
        unit.asDiagonal() * NoiseCorrelation(readings.of_run) * unit.asDiagonal();
    errors.of_run.covariance += numerical;
  } else {
    const Eigen::MatrixXd noise = NoiseCorrelation(data) + numerical;
    errors.scatter = emulator.cross_validation().scatter_rms;
    errors.of_mean.covariance = noise + missed;
    errors.of_run.covariance = noise + 2 * covariance_of(sd);
  }
  DrawMeasurements(base, drawn, nuisance, errors);
  return errors;
}

}  // namespace calib::diagnosis
