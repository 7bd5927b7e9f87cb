#include "server/planning/early_stopping.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "server/methods/registry.h"
#include "server/planning/history.h"
#include "server/planning/posterior_record.h"
#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

testing::SmallCampaign Campaign(const std::string& extra, double noise = 0.01) {
  return testing::MakeSmallCampaign({.samples = 40,
                                     .max_iterations = 3,
                                     .load_steps = 12,
                                     .failure_attempts = 100,
                                     .relative_noise = noise,
                                     .extra = extra});
}

constexpr double kAllowed = 1e-3;
constexpr const char* kStopping = "early_stopping: {discard_at_most: 1e-3}\n";

// The noise is such that the model comes within two sd of its readings: further off, samples are
// looked for so widely that the weights that guide leave none to stop (0.01: none).
TEST(EarlyStopping, SavesStatesAndLosesNoMoreThanItStates) {
  constexpr double kNoise = 0.02;
  SimulatedService full("full");
  full.Submit(Campaign("", kNoise));
  full.RunToEnd(1, true);
  SimulatedService stopping("stopping");
  stopping.Submit(Campaign(kStopping, kNoise));
  stopping.RunToEnd(1, true);

  const v1::Posterior with = LastPosterior(stopping);
  EXPECT_GT(with.stopped_early(), 0);
  EXPECT_LE(with.stated_loss(), kAllowed);
  // The audit: one of at most fifty stopped samples went on to its end.
  EXPECT_EQ(with.audited(), 1);
  EXPECT_LE(with.audited_bound(), kAllowed);
  EXPECT_LE(with.measured_loss(), with.audited_bound());
  int audited = 0;
  for (const store::SampleRecord& sample : Value(stopping.Read().Samples(1))) {
    audited += std::isnan(sample.audited) ? 0 : 1;
    if (std::isnan(sample.audited)) continue;
    EXPECT_TRUE(std::isfinite(sample.log_weight)) << "it counts for what it is";
  }
  EXPECT_EQ(audited, with.audited());
  EXPECT_LT(stopping.Read().States(1)->size(), full.Read().States(1)->size());
  // The first iteration has nothing to compare with, so none of its samples is stopped.
  for (const store::EvaluationRecord& evaluation : Value(stopping.Read().Evaluations(1))) {
    if (evaluation.key.sample < 40) {
      EXPECT_EQ(evaluation.status, store::EvaluationStatus::kFinished);
    }
  }
  const v1::Posterior without = LastPosterior(full);
  EXPECT_EQ(without.stopped_early(), 0);
  EXPECT_EQ(without.stated_loss(), 0);
  for (int i = 0; i < with.parameters_size(); ++i) {
    const auto& parameter = without.parameters(i);
    // Stopped samples do not shape the next proposal, so the two campaigns run other samples and
    // emulate the same posterior from them: their means agree to the widths of both, not to the
    // stated loss.
    EXPECT_NEAR(with.parameters(i).mean(), parameter.mean(),
                std::hypot(with.parameters(i).sd(), parameter.sd()));
  }
}

// What the emulator learns from (inference/emulator/stopped_runs.h).
TEST(EarlyStopping, WhatStoppedRunsCameToReachesTheEmulator) {
  SimulatedService service("came_to");
  service.Submit(Campaign(kStopping, 0.02));
  service.RunToEnd(1, true);
  store::Reader reader = service.Read();
  const auto definition =
      *planning::LoadDefinition(methods::All(), reader, Value(reader.Campaign(1)).submitted);
  const planning::History history = *planning::LoadHistory(*definition, 1, reader);
  int stopped = 0;
  for (const inference::Iteration& iteration : history.iterations) {
    ASSERT_EQ(iteration.stopped.rows(), iteration.predictions.rows());
    for (Eigen::Index i = 0; i < iteration.stopped.rows(); ++i) {
      const Eigen::Index seen = iteration.stopped.row(i).array().isFinite().count();
      if (iteration.predictions.row(i).allFinite()) {
        EXPECT_EQ(seen, 0) << "a run at its end counts once";
        continue;
      }
      stopped += seen > 0 && seen < iteration.stopped.cols() ? 1 : 0;
    }
  }
  EXPECT_EQ(stopped, LastPosterior(service).stopped_early());
}

Eigen::VectorXd GuidingWeights(const planning::Definition& definition,
                               const planning::History& history, double exponent) {
  const Eigen::VectorXd importance =
      inference::LogImportance(definition.priors, history.iterations);
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(importance.size());
  Eigen::Index at = 0;
  for (const inference::Iteration& iteration : history.iterations) {
    const Eigen::VectorXd likelihood = *inference::LogLikelihood(
        definition.data, definition.campaign.filter, iteration.predictions);
    for (const double value : likelihood) {
      if (std::isfinite(value)) weights[at] = importance[at] + exponent * value;
      ++at;
    }
  }
  const double largest = weights.maxCoeff();
  weights = (weights.array() == 0).select(0.0, (weights.array() - largest).exp()).eval();
  return weights / weights.sum();
}

// The same samples from the same proposals, once complete and once with every sample of the last
// iteration ended where its bound fell below the threshold; so much loss is allowed that it shows.
TEST(EarlyStopping, TotalVariationIsWithinTheStatedLoss) {
  SimulatedService full("variation");
  full.Submit(Campaign("", 0.2));
  full.RunToEnd(1, true);
  store::Reader reader = full.Read();
  campaign::Campaign allowed =
      (*planning::LoadDefinition(methods::All(), reader, Value(reader.Campaign(1)).submitted))
          ->campaign;
  allowed.early_stopping.emplace().discard_at_most = 0.1;
  const auto definition = planning::MakeDefinition(std::move(allowed));
  const planning::History complete = *planning::LoadHistory(*definition, 1, reader);
  planning::History before = complete;
  const inference::Iteration last = complete.iterations.back();
  before.iterations.pop_back();
  const auto thresholds = *planning::StopThresholds(*definition, before, last);

  planning::History stopped = complete;
  stopped.stopped_keys.clear();
  const Eigen::Index readings = last.predictions.cols();
  int saved = 0;
  const auto likelihood =
      *inference::GaussianLikelihood::Create(definition->data, inference::NoiseMode::kGiven);
  for (Eigen::Index i = 0; i < last.predictions.rows(); ++i) {
    const Eigen::RowVectorXd run = last.predictions.row(i);
    Eigen::RowVectorXd seen = Eigen::RowVectorXd::Constant(readings, std::nan(""));
    for (Eigen::Index t = 0; t + 1 < readings; ++t) {
      seen[t] = run[t];
      if (planning::BestPossible(likelihood, seen) >= thresholds[static_cast<std::size_t>(i)])
        continue;
      stopped.iterations.back().predictions.row(i).setConstant(std::nan(""));
      stopped.stopped.back().row(i) = seen;
      const auto first = static_cast<int>((stopped.iterations.size() - 1) * 40);
      stopped.stopped_keys.push_back({1, first + static_cast<int>(i), 0});
      saved += static_cast<int>(readings - 1 - t);
      break;
    }
  }
  ASSERT_GT(saved, 0);
  const auto loss = *planning::StatedLoss(*definition, stopped);
  ASSERT_TRUE(loss.resume.empty());
  EXPECT_GT(loss.stated, 1e-6);
  EXPECT_LE(loss.stated, 0.1);
  const double exponent = *inference::GuidingExponent(
      definition->priors, definition->data, definition->campaign.filter, stopped.iterations);
  const Eigen::VectorXd with = GuidingWeights(*definition, complete, exponent);
  const Eigen::VectorXd without = GuidingWeights(*definition, stopped, exponent);
  const double variation = 0.5 * (with - without).cwiseAbs().sum();
  EXPECT_GT(variation, 0);
  EXPECT_LE(variation, loss.stated);
}

// A parameter that the first reading knows to a third of its prior's width, and four later readings
// that every run meets to a tenth of their error: over a hundred samples are effective, and what a
// stopped run could still have held is little more than what it holds. A bound that is a tenth too
// small, or forgets the importance of samples, falls short.
TEST(EarlyStopping, TotalVariationIsWithinAStatedLossThatIsHardlyLarger) {
  constexpr Eigen::Index kSamples = 200;
  constexpr Eigen::Index kReadings = 5;
  constexpr double kLaterSd = 0.2;
  planning::Definition definition = *planning::MakeDefinition(campaign::Campaign{});
  definition.campaign.early_stopping =
      campaign::EarlyStopping{.discard_at_most = 0.5, .exponent = 1};
  definition.priors =
      std::vector<inference::Prior>{{.kind = inference::PriorKind::kUniform, .min = -3, .max = 3}};
  for (int t = 0; t < kReadings; ++t) {
    definition.data.readings.push_back({.load_step = t, .value = 0, .sd = t == 0 ? 1 : kLaterSd});
  }
  planning::History complete;
  for (int k = 0; k < 2; ++k) {
    inference::Iteration iteration;
    if (k == 1) {  // narrower than the prior: samples that stop are worth more than one
      iteration.proposal.components.push_back({.weight = 1,
                                               .mean = Eigen::VectorXd::Zero(1),
                                               .covariance = Eigen::MatrixXd::Constant(1, 1, 0.3)});
      iteration.proposal.defensive_share = 0.5;
      iteration.proposal.log_acceptance =
          inference::LogMassInSupport(iteration.proposal.components, definition.priors);
    }
    iteration.parameters = *inference::DrawSamples(iteration.proposal, definition.priors,
                                                   definition.campaign.filter, k, kSamples);
    iteration.predictions = Eigen::MatrixXd::Constant(kSamples, kReadings, 0.1 * kLaterSd);
    iteration.predictions.col(0) = iteration.parameters;
    complete.iterations.push_back(std::move(iteration));
    complete.stopped.push_back(Eigen::MatrixXd::Constant(kSamples, kReadings, std::nan("")));
    for (int i = 0; i < kSamples; ++i) {
      complete.samples.push_back(
          {.sample = static_cast<int>(complete.samples.size()), .iteration = k});
    }
  }
  planning::History before = complete;
  before.iterations.pop_back();
  const auto thresholds = *planning::StopThresholds(definition, before, complete.iterations[1]);

  planning::History stopped = complete;
  const auto likelihood =
      *inference::GaussianLikelihood::Create(definition.data, inference::NoiseMode::kGiven);
  for (int i = 0; i < kSamples; ++i) {
    Eigen::RowVectorXd seen = Eigen::RowVectorXd::Constant(kReadings, std::nan(""));
    seen[0] = complete.iterations[1].predictions(i, 0);
    if (planning::BestPossible(likelihood, seen) >= thresholds[static_cast<std::size_t>(i)])
      continue;
    stopped.iterations[1].predictions.row(i).setConstant(std::nan(""));
    stopped.stopped[1].row(i) = seen;
    stopped.stopped_keys.push_back({0, static_cast<int>(kSamples) + i, 0});
  }
  const auto loss = *planning::StatedLoss(definition, stopped);
  ASSERT_TRUE(loss.resume.empty());
  const Eigen::VectorXd with = GuidingWeights(definition, complete, 1);
  const Eigen::VectorXd without = GuidingWeights(definition, stopped, 1);
  EXPECT_GT(1 / with.squaredNorm(), 100) << "effective samples";
  EXPECT_GT(stopped.stopped_keys.size(), 20U);
  EXPECT_GT(loss.stated, 0.01);
  const double variation = 0.5 * (with - without).cwiseAbs().sum();
  EXPECT_LE(variation, loss.stated);
  EXPECT_GT(variation, 0.9 * loss.stated) << "the case is no longer tight";
}

TEST(EarlyStopping, AuditTakesAFiftiethOfTheStoppedChosenByTheSeed) {
  const auto definition = planning::MakeDefinition(campaign::Campaign{});
  planning::History history;
  planning::Loss loss;
  EXPECT_TRUE(planning::ToAudit(*definition, history, loss).empty());
  for (int i = 0; i < 101; ++i) {
    history.samples.push_back({.sample = i, .iteration = 0});
    loss.bounds[i] = 1e-6;
  }
  const auto first = planning::ToAudit(*definition, history, loss);
  ASSERT_EQ(first.size(), 3U);
  EXPECT_TRUE(std::is_sorted(first.begin(), first.end()));
  EXPECT_EQ(planning::ToAudit(*definition, history, loss), first);
  for (const int sample : first) {
    history.samples[static_cast<std::size_t>(sample)].audited = 1e-6;
    loss.bounds.erase(sample);
  }
  EXPECT_TRUE(planning::ToAudit(*definition, history, loss).empty()) << "three of 101 are enough";
}

TEST(EarlyStopping, AuditSaysWhatTheAuditedHold) {
  SimulatedService full("audit");
  full.Submit(Campaign("", 0.2));
  full.RunToEnd(1, true);
  store::Reader reader = full.Read();
  const auto definition =
      *planning::LoadDefinition(methods::All(), reader, Value(reader.Campaign(1)).submitted);
  planning::History history = *planning::LoadHistory(*definition, 1, reader);
  EXPECT_EQ(planning::AuditOf(*definition, history)->samples, 0);
  const double exponent = *inference::GuidingExponent(
      definition->priors, definition->data, definition->campaign.filter, history.iterations);
  const Eigen::VectorXd weights = GuidingWeights(*definition, history, exponent);
  history.samples[3].audited = 0.01;
  history.samples[8].audited = 0.02;
  const planning::Audit audit = *planning::AuditOf(*definition, history);
  EXPECT_EQ(audit.samples, 2);
  EXPECT_DOUBLE_EQ(audit.bound, 0.03);
  EXPECT_NEAR(audit.measured, weights[3] + weights[8], 1e-12);
}

TEST(EarlyStopping, SameBitsWhateverGoesWrong) {
  SimulatedService calm("stopping_calm");
  calm.Submit(Campaign(kStopping));
  calm.RunToEnd(1, true);
  const std::string expected = calm.Fingerprint();
  for (unsigned seed = 1; seed <= 5; ++seed) {
    SimulatedService service("stopping_storm");
    service.Submit(Campaign(kStopping));
    service.RunToEnd(seed, false);
    EXPECT_TRUE(service.Fingerprint() == expected) << "seed " << seed;
  }
}

// Decided at once, runs of the first iteration are stopped too: by the mass that has finished by
// then. What that may lose is stated against all of it in the end, and audited, as ever.
TEST(EarlyStopping, DecidedAtOnceItStopsInTheFirstIterationWithinTheStatedLoss) {
  const auto campaign = [](const std::string& decisions) {
    return testing::MakeSmallCampaign(
        {.samples = 40,
         .max_iterations = 1,
         .load_steps = 12,
         .failure_attempts = 100,
         .relative_noise = 0.02,
         .method = "sqmc",
         .inference = "  ess_target: 0.1\n  replicates: 0\n  decisions: " + decisions + "\n",
         .extra = "early_stopping: {discard_at_most: 1e-3, exponent: 1}\n"});
  };
  SimulatedService depth("at_once_not");
  depth.Submit(campaign("reproducible"));
  depth.RunToEnd(1, true);
  for (unsigned seed = 1; seed <= 3; ++seed) {
    SimulatedService service("at_once");
    service.Submit(campaign("immediate"));
    service.RunToEnd(seed, seed == 1);
    const v1::Posterior with = LastPosterior(service);
    EXPECT_GT(with.stopped_early(), 0);
    EXPECT_LE(with.stated_loss(), kAllowed);
    EXPECT_GE(with.audited(), 1);
    EXPECT_LE(with.measured_loss(), with.audited_bound());
    EXPECT_LT(service.Read().States(1)->size(), depth.Read().States(1)->size());
    double variation = 0;
    const auto full = Value(depth.Read().Samples(1));
    const auto part = Value(service.Read().Samples(1));
    ASSERT_EQ(full.size(), part.size());
    for (std::size_t i = 0; i < full.size(); ++i) {
      ASSERT_EQ(full[i].parameters, part[i].parameters);
      variation += 0.5 * std::abs(std::exp(full[i].log_weight) - std::exp(part[i].log_weight));
    }
    EXPECT_LE(variation, with.stated_loss());
  }
}

// Depth first, thresholds of the last iteration put so high that most of them stop samples that
// count: only the bounds taken again at its end can bring these back. What is stopped by the others
// may stay so.
TEST(EarlyStopping, WhatWasStoppedTooSoonIsResumedUntilTheLossIsAllowed) {
  constexpr int kSamples = 40;
  const auto campaign = [](const std::string& extra) {
    return testing::MakeSmallCampaign({.samples = kSamples,
                                       .max_iterations = 2,
                                       .load_steps = 12,
                                       .failure_attempts = 100,
                                       .relative_noise = 0.05,
                                       .inference = "  replicates: 0\n",
                                       .extra = extra});
  };
  SimulatedService full("too_soon_full");
  full.Submit(campaign(""));
  full.RunToEnd(1, true);

  SimulatedService service("too_soon");
  service.Submit(campaign("early_stopping: {discard_at_most: 1e-3, exponent: 1}\n"));
  const auto worker = service.Connect("w0", 1);  // the one that RunToEnd goes on with
  using Message = v1::ServerMessage;
  for (int i = 0; i < kSamples; ++i) {
    const v1::Lease lease = service.Next(worker, Message::kLease).lease();
    service.SendStates(worker, lease, 0, 12);
    service.SendEnd(worker, lease.attempt(), v1::Finished::OUTCOME_COMPLETED);
  }
  store::Reader reader = service.Read();
  const auto definition =
      *planning::LoadDefinition(methods::All(), reader, Value(reader.Campaign(1)).submitted);
  const auto likelihood =
      *inference::GaussianLikelihood::Create(definition->data, inference::NoiseMode::kGiven);
  const double perfect = planning::BestPossible(
      likelihood, Eigen::RowVectorXd::Constant(likelihood.readings(), std::nan("")));
  ASSERT_EQ(Value(reader.Samples(1)).size(), 2U * kSamples) << "the last iteration has begun";
  service.Write([perfect](store::Transaction& transaction) {
    for (int sample = kSamples; sample < 2 * kSamples; ++sample) {
      transaction.SetStopBelow(1, sample, perfect - (sample % 4 == 0 ? 25 : 3));
    }
  });
  service.Restart();
  service.RunToEnd(1, true);

  int resumed = 0;
  for (const store::EventRecord& event : Value(service.Read().Events(1))) {
    resumed += event.what.find("stopped early are resumed") != std::string::npos ? 1 : 0;
  }
  EXPECT_GE(resumed, 1);
  int finished = 0;  // of those that were stopped
  for (const store::SampleRecord& sample : Value(service.Read().Samples(1))) {
    if (sample.sample < kSamples || !std::isfinite(sample.log_weight)) continue;
    finished += sample.log_likelihood < perfect - 3 && std::isnan(sample.audited) ? 1 : 0;
  }
  EXPECT_GT(finished, 0) << "none of the resumed lies below the threshold that had stopped it";
  const v1::Posterior with = LastPosterior(service);
  EXPECT_GT(with.stopped_early(), 0) << "all were resumed";
  EXPECT_GT(with.stated_loss(), 0);
  EXPECT_LE(with.stated_loss(), kAllowed);
  double variation = 0;
  double lost = 0;  // without resuming
  const auto whole = Value(full.Read().Samples(1));
  const auto part = Value(service.Read().Samples(1));
  ASSERT_EQ(whole.size(), part.size());
  for (std::size_t i = 0; i < whole.size(); ++i) {
    ASSERT_EQ(whole[i].parameters, part[i].parameters);
    variation += 0.5 * std::abs(std::exp(whole[i].log_weight) - std::exp(part[i].log_weight));
    if (i >= kSamples && whole[i].log_likelihood < perfect - 3) {
      lost += std::exp(whole[i].log_weight);
    }
  }
  EXPECT_GT(lost, 10 * kAllowed) << "the thresholds were not too high";
  EXPECT_LE(variation, with.stated_loss());
}

// Of few finished samples the guiding exponent is one, and stops what lies a few nats lower:
// without an exponent of the campaign's nothing is stopped before twice as many as it leaves
// effective.
TEST(EarlyStopping, DecidedAtOnceItWaitsForTheSamplesThatGuide) {
  constexpr int kSamples = 40;
  constexpr int kWanted = 16;  // 2 x 0.2 x 40
  planning::Definition definition = *planning::MakeDefinition(campaign::Campaign{});
  definition.campaign.samples = kSamples;
  definition.campaign.filter = {.ess_target = 0.2, .seed = 3};
  definition.campaign.early_stopping = campaign::EarlyStopping{.discard_at_most = 1e-3};
  definition.campaign.decisions = campaign::Decisions::kImmediate;
  definition.priors =
      std::vector<inference::Prior>{{.kind = inference::PriorKind::kUniform, .min = -3, .max = 3}};
  definition.data.readings.push_back({.load_step = 0, .value = 0, .sd = 0.01});
  inference::Iteration iteration;
  iteration.parameters = *inference::DrawSamples(iteration.proposal, definition.priors,
                                                 definition.campaign.filter, 0, kSamples);
  for (const int done : {1, kWanted - 1, kWanted}) {
    for (const bool given : {false, true}) {
      definition.campaign.early_stopping->exponent =
          given ? std::optional<double>(1) : std::nullopt;
      planning::History history;
      history.iterations = {iteration};
      history.iterations[0].predictions = iteration.parameters;
      history.iterations[0].predictions.bottomRows(kSamples - done).setConstant(std::nan(""));
      history.ended = {std::vector<char>(kSamples, 0)};
      std::fill_n(history.ended[0].begin(), done, 1);
      for (int i = 0; i < kSamples; ++i) {
        history.samples.push_back(
            {.sample = i, .iteration = 0, .stop_below = -std::numeric_limits<double>::infinity()});
      }
      const auto thresholds = *planning::ThresholdsNow(definition, history);
      const bool known = given || done >= kWanted;
      EXPECT_EQ(thresholds.size(), known ? static_cast<std::size_t>(kSamples - done) : 0U)
          << done << " finished, exponent " << (given ? "given" : "guiding");
    }
  }
}

// Two calibrated experiments, each enough to tell that a sample cannot count: the second iteration
// has the same samples from the same proposal with early stopping and without.
testing::SmallCampaign TwoExperiments(const std::string& extra) {
  return testing::MakeSmallCampaign({.samples = 60,
                                     .max_iterations = 2,
                                     .load_steps = 12,
                                     .failure_attempts = 100,
                                     .relative_noise = 0.04,
                                     .with_second = true,
                                     .inference = "  replicates: 0\n",
                                     .extra = extra});
}
constexpr const char* kOwnWeights = "early_stopping: {discard_at_most: 1e-3, exponent: 1}\n";

TEST(EarlyStopping, ExperimentsOfAStoppedSampleAreNotRunInVain) {
  SimulatedService full("two_full");
  full.Submit(TwoExperiments(""));
  full.RunToEnd(1, true);
  SimulatedService stopping("two_stopping");
  stopping.Submit(TwoExperiments(kOwnWeights));
  stopping.RunToEnd(1, true);
  const v1::Posterior with = LastPosterior(stopping);
  EXPECT_GT(with.stopped_early(), 5);
  EXPECT_LE(with.stated_loss(), kAllowed);

  // The posterior is the same but for what was stated.
  const auto all = Value(full.Read().Samples(1));
  const auto part = Value(stopping.Read().Samples(1));
  ASSERT_EQ(all.size(), part.size());
  double variation = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    ASSERT_EQ(all[i].parameters, part[i].parameters);
    variation += 0.5 * std::abs(std::exp(all[i].log_weight) - std::exp(part[i].log_weight));
  }
  EXPECT_LE(variation, with.stated_loss());

  // Of a stopped sample nothing was begun behind the experiment that stopped it.
  std::map<store::EvaluationKey, int> steps;
  for (const store::StateRecord& state : Value(stopping.Read().States(1))) ++steps[state.key];
  int spared = 0;
  int by_both = 0;  // the first experiment alone could not tell
  for (const store::EvaluationRecord& first : Value(stopping.Read().Evaluations(1))) {
    if (first.key.experiment != 0) continue;
    const store::EvaluationKey second{1, first.key.sample, 1};
    if (first.status == store::EvaluationStatus::kStoppedEarly) {
      EXPECT_GT(steps[first.key], 0);
      EXPECT_EQ(steps.count(second), 0U) << "sample " << first.key.sample;
      ++spared;
    } else if (steps[second] < 12) {
      EXPECT_EQ(steps[first.key], 12);
      ++by_both;
    }
  }
  EXPECT_GE(spared, 2);
  EXPECT_GT(by_both, 0);
  EXPECT_EQ(spared + by_both, with.stopped_early());
  EXPECT_EQ(with.model_evaluations(), LastPosterior(full).model_evaluations() - spared);

  // What goes on is run whole, the experiments that had not been begun too.
  EXPECT_EQ(with.audited(), 1);
  for (const store::SampleRecord& sample : part) {
    if (std::isnan(sample.audited)) continue;
    for (const int experiment : {0, 1}) {
      EXPECT_EQ((steps[{1, sample.sample, experiment}]), 12);
    }
    EXPECT_TRUE(std::isfinite(sample.log_weight));
  }
}

TEST(EarlyStopping, SeveralExperimentsHaveTheSameBitsWhateverGoesWrong) {
  for (const std::string rungs : {"", ", rungs: [0.3, 0.6]"}) {
    const std::string extra = "early_stopping: {discard_at_most: 1e-3, exponent: 1" + rungs + "}\n";
    SimulatedService calm("two_calm");
    calm.Submit(TwoExperiments(extra));
    calm.RunToEnd(1, true);
    const std::string expected = calm.Fingerprint();
    for (unsigned seed = 1; seed <= 3; ++seed) {
      SimulatedService service("two_storm");
      service.Submit(TwoExperiments(extra));
      service.RunToEnd(seed, false);
      EXPECT_TRUE(service.Fingerprint() == expected) << "seed " << seed << rungs;
    }
  }
}

TEST(EarlyStopping, ThresholdIsNeverSetWithoutAFinishedSample) {
  SimulatedService service("thresholds");
  service.Submit(Campaign(kStopping));
  for (const store::SampleRecord& sample : Value(service.Read().Samples(1))) {
    EXPECT_TRUE(std::isnan(sample.stop_below));
  }
}

}  // namespace
}  // namespace calib::scheduler
