#include "inference/emulator/emulated_path.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "inference/filter/ensemble.h"
#include "inference/numerics/log_weights.h"
#include "inference/numerics/weighted_moments.h"
#include "inference/sampling/philox.h"
#include "inference/tmcmc/tempering_step.h"

namespace calib::inference {
namespace {

using Eigen::Index;

constexpr double kNever = -std::numeric_limits<double>::infinity();
constexpr int kMostBatches = 50;  // of prior draws, to find those where the model is known; chosen
constexpr Index kFewest = 50;     // draws that a path is worth making of; chosen
constexpr double kAcceptance = 0.3;  // wanted of a Metropolis step, TmcmcOptions::acceptance

// prior x L_before^(1 - exponent) L_next^exponent, on the way from one load step to the next.
struct Bridge {
  const EmulatedLikelihood& before;
  const EmulatedLikelihood& next;
};

// Draws and what the likelihoods on both sides of a load step say of them. Rows throughout.
struct Cloud {
  Eigen::MatrixXd samples;  // N x free parameters and noise groups
  EmulatedPoints at;
  Eigen::VectorXd log_prior;
  Eigen::VectorXd before, next;  // ln p(readings before, up to this load step | sample)
  Eigen::VectorXd log_weights;   // normalised

  Index size() const { return samples.rows(); }

  void TakeRow(Index i, const Cloud& from, Index j) {
    samples.row(i) = from.samples.row(j);
    at.prediction.mean.row(i) = from.at.prediction.mean.row(j);
    at.prediction.sd.row(i) = from.at.prediction.sd.row(j);
    at.noise.row(i) = from.at.noise.row(j);
    at.unknown[i] = from.at.unknown[j];
    log_prior[i] = from.log_prior[j];
    before[i] = from.before[j];
    next[i] = from.next[j];
  }

  // Keeps the first rows.
  void Shrink(Index rows) {
    const auto keep = [rows](auto& values) { values.conservativeResize(rows, Eigen::NoChange); };
    keep(samples);
    keep(at.prediction.mean);
    keep(at.prediction.sd);
    keep(at.noise);
    for (Eigen::VectorXd* values : {&at.unknown, &log_prior, &before, &next}) {
      values->conservativeResize(rows);
    }
  }
};

class PathSampler {
 public:
  PathSampler(const EmulatedTarget& target, const EmulatedPathOptions& options)
      : target_(target), options_(options), scale_(FirstScale(target.prior().size())) {
    DrawKnown();
  }

  double log_evidence() const { return log_evidence_; }
  const Cloud& cloud() const { return cloud_; }

  void Advance(const Bridge& bridge) {
    cloud_.before = cloud_.next;
    cloud_.next = bridge.next.LogLikelihood(cloud_.at.prediction, cloud_.at.noise);
    const Eigen::VectorXd weighed = cloud_.log_weights + (cloud_.next - cloud_.before);
    if (2 * EffectiveSampleSize(NormalizedLogWeights(weighed)) >=
        static_cast<double>(cloud_.size())) {
      log_evidence_ += LogSumExp(weighed);
      cloud_.log_weights = NormalizedLogWeights(weighed);
      return;
    }
    Resample(cloud_.log_weights.array().exp());
    double exponent = 0;
    while (exponent < 1) {
      const TemperingStep step =
          NextExponent(cloud_.next - cloud_.before, exponent, options_.target_cv);
      log_evidence_ += step.log_mean_weight;
      const Eigen::MatrixXd factor =
          WeightedCovarianceFactor(ToStandard(target_.prior(), cloud_.samples), step.weights);
      Resample(step.weights);
      exponent = step.exponent;
      for (int k = 0; k < options_.steps; ++k) Move(bridge, exponent, factor);
    }
  }

 private:
  PhiloxStream Stream(Index row) const {
    return PhiloxStream({.seed = options_.seed,
                         .purpose = StreamPurpose::kEmulatedPath,
                         .iteration = move_,
                         .sample = static_cast<std::uint64_t>(row)});
  }

  Cloud Place(const Eigen::MatrixXd& samples) const {
    Cloud cloud;
    cloud.samples = samples;
    cloud.at = target_.At(samples);
    cloud.log_prior.resize(samples.rows());
    for (Index i = 0; i < samples.rows(); ++i) {
      cloud.log_prior[i] = target_.prior().LogStandardDensity(samples.row(i));
    }
    return cloud;
  }

  // Draws of the prior where the emulator knows the model, as many as are wanted or as a bounded
  // number of tries gives; the share of the prior that is known begins the evidence.
  void DrawKnown() {
    const Index wanted = options_.draws;
    Index taken = 0;
    Index known = 0;
    Index drawn = 0;
    for (int batch = 0; batch < kMostBatches && taken < wanted; ++batch) {
      Eigen::MatrixXd samples(wanted, static_cast<Index>(target_.prior().size()));
      for (Index i = 0; i < wanted; ++i) {
        PhiloxStream stream = Stream(i);
        samples.row(i) = target_.prior().Draw(stream);
      }
      ++move_;
      drawn += wanted;
      Cloud from = Place(samples);
      from.before = from.next = Eigen::VectorXd::Zero(wanted);
      if (batch == 0) cloud_ = from;
      for (Index i = 0; i < wanted; ++i) {
        if (!target_.IsKnown(from.at.unknown[i])) continue;
        ++known;
        if (taken < wanted) cloud_.TakeRow(taken++, from, i);
      }
    }
    cloud_.Shrink(taken);
    cloud_.log_weights = Eigen::VectorXd::Constant(taken, -std::log(static_cast<double>(taken)));
    log_evidence_ = std::log(static_cast<double>(known)) - std::log(static_cast<double>(drawn));
  }

  // Systematic: one uniform number for all, weights summing to one.
  void Resample(const Eigen::VectorXd& weights) {
    const Cloud from = cloud_;
    const Index n = cloud_.size();
    const double u = Stream(0).Uniform();
    ++move_;
    double sum = weights[0];
    Index parent = 0;
    for (Index i = 0; i < n; ++i) {
      const double wanted = (static_cast<double>(i) + u) / static_cast<double>(n);
      while (sum < wanted && parent + 1 < n) sum += weights[++parent];
      cloud_.TakeRow(i, from, parent);
    }
    cloud_.log_weights.setConstant(n, -std::log(static_cast<double>(n)));
  }

  // One Metropolis step of every draw; the scale follows the share that was accepted.
  void Move(const Bridge& bridge, double exponent, const Eigen::MatrixXd& factor) {
    const JointPrior& prior = target_.prior();
    const Index n = cloud_.size();
    Eigen::MatrixXd proposals(n, cloud_.samples.cols());
    Eigen::VectorXd log_u(n);
    Eigen::VectorXd normal(proposals.cols());
    for (Index i = 0; i < n; ++i) {
      PhiloxStream stream = Stream(i);
      for (double& z : normal) z = stream.Normal();
      const Eigen::VectorXd jump = scale_ * (factor * normal);
      proposals.row(i) = prior.FromStandard(prior.ToStandard(cloud_.samples.row(i)) + jump);
      log_u[i] = std::log(stream.Uniform());
      // Outside the support: stays where it is, and nothing is asked of the emulator out there.
      if (prior.LogStandardDensity(proposals.row(i)) == kNever) {
        proposals.row(i) = cloud_.samples.row(i);
        log_u[i] = std::numeric_limits<double>::infinity();
      }
    }
    ++move_;
    Cloud proposed = Place(proposals);
    proposed.before = bridge.before.LogLikelihood(proposed.at.prediction, proposed.at.noise);
    proposed.next = bridge.next.LogLikelihood(proposed.at.prediction, proposed.at.noise);
    const auto density = [exponent](const Cloud& cloud, Index i) {
      return cloud.log_prior[i] + (1 - exponent) * cloud.before[i] + exponent * cloud.next[i];
    };
    int accepted = 0;
    for (Index i = 0; i < n; ++i) {
      if (!target_.IsKnown(proposed.at.unknown[i])) continue;
      if (!(log_u[i] < density(proposed, i) - density(cloud_, i))) continue;
      cloud_.TakeRow(i, proposed, i);
      ++accepted;
    }
    scale_ = NextScale(scale_, prior.size(), accepted / static_cast<double>(n), kAcceptance);
  }

  const EmulatedTarget& target_;
  const EmulatedPathOptions& options_;
  double scale_;
  std::uint64_t move_ = 0;
  Cloud cloud_;
  double log_evidence_ = 0;
};

}  // namespace

absl::StatusOr<PosteriorPath> EmulatedPath(const EmulatedTarget& target,
                                           const EmulatedLikelihood& likelihood,
                                           const DataSet& data, const EmulatedPathOptions& options,
                                           const std::stop_token& stop) {
  PathSampler sampler(target, options);
  if (sampler.cloud().size() < kFewest) {
    return absl::FailedPreconditionError(
        "Almost nowhere in the prior does the emulator know the mean history of the model.");
  }
  const StepOffsets steps = LoadSteps(data);
  PosteriorPath path;
  const Index count = steps.steps();
  const auto d = static_cast<Index>(target.Complete(sampler.cloud().samples.topRows(1)).cols());
  path.mean.resize(count, d);
  path.cov.resize(count, d);
  path.ess.resize(count);
  path.log_evidence.resize(count);
  EmulatedLikelihood before = likelihood.First(0);
  for (Index s = 0; s < count; ++s) {
    if (stop.stop_requested()) return absl::CancelledError("the path was stopped.");
    const int begin = steps.offsets[static_cast<std::size_t>(s)];
    EmulatedLikelihood next = likelihood.First(steps.offsets[static_cast<std::size_t>(s) + 1]);
    sampler.Advance({.before = before, .next = next});
    before = std::move(next);
    const Cloud& cloud = sampler.cloud();
    const Eigen::MatrixXd parameters = target.Complete(cloud.samples);
    const Eigen::VectorXd mean = WeightedMean(cloud.log_weights, parameters);
    const Eigen::MatrixXd covariance = WeightedCovariance(cloud.log_weights, parameters, mean);
    for (Index j = 0; j < d; ++j) {
      const double sd = std::sqrt(covariance(j, j));
      path.mean(s, j) = mean[j];
      path.cov(s, j) =
          mean[j] == 0 ? std::numeric_limits<double>::quiet_NaN() : sd / std::abs(mean[j]);
    }
    path.ess[s] = EffectiveSampleSize(cloud.log_weights) / static_cast<double>(cloud.size());
    path.log_evidence[s] = sampler.log_evidence();
    const Reading& reading = data.readings[static_cast<std::size_t>(begin)];
    path.experiment.push_back(reading.experiment);
    path.load_step.push_back(reading.load_step);
  }
  return path;
}

}  // namespace calib::inference
