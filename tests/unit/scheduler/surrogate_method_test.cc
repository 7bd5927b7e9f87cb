// surrogate_msrs as a campaign: points chosen while others run, through simulated workers and the
// store.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <string>

#include "inference/sampling/philox.h"
#include "server/planning/posterior_record.h"
#include "tests/unit/scheduler/simulated_service.h"

namespace calib::scheduler {
namespace {

using ::testing::HasSubstr;

// Without twins: what is counted here are its points.
testing::SmallCampaign Campaign(int samples, int times, double noise, const std::string& extra = "",
                                const std::string& inference = "") {
  return testing::MakeSmallCampaign({.samples = samples,
                                     .max_iterations = times,
                                     .load_steps = 12,
                                     .failure_attempts = 100,
                                     .relative_noise = noise,
                                     .method = "surrogate_msrs",
                                     .inference = "  replicates: 0\n" + inference,
                                     .extra = extra});
}

v1::Posterior Posterior(SimulatedService& service, std::size_t iteration) {
  return *planning::PosteriorFromJson(*Value(service.Read().Iterations(1)).at(iteration).posterior);
}

TEST(SurrogateCampaign, FindsABetterFitThanTheDesign) {
  SimulatedService service("surrogate");
  service.Submit(Campaign(10, 5, 0.02));
  service.RunToEnd(1, true);
  const auto iterations = Value(service.Read().Iterations(1));
  ASSERT_EQ(iterations.size(), 6U) << "10 points, then 40 in eights";
  double first = std::numeric_limits<double>::infinity();  // of -ln likelihood
  double best = first;
  double weight = 0;
  for (const store::SampleRecord& sample : Value(service.Read().Samples(1))) {
    EXPECT_EQ(sample.sample / 10, sample.iteration);
    EXPECT_LT(sample.sample % 10, sample.iteration == 0 ? 10 : 8);
    best = std::min(best, -sample.log_likelihood);
    if (sample.iteration == 0) first = best;
    weight += std::exp(sample.log_weight);
  }
  EXPECT_LT(best, first);
  EXPECT_EQ(weight, 1) << "the best run alone";
}

// What a run that is stopped could still have come to is worse than the best of the round before:
// it takes no part in the surrogate, and which are stopped does not depend on who answers first.
TEST(SurrogateCampaign, EndsHopelessRunsEarlyAndFindsAsGoodAFit) {
  struct SearchEnd {
    double best = -std::numeric_limits<double>::infinity();  // ln likelihood
    int stopped = 0;
    std::vector<double> log_likelihoods{};
  };
  const auto run = [](const std::string& name, const std::string& termination, unsigned order) {
    SimulatedService service(name);
    service.Submit(Campaign(10, 5, 0.02, "", "  termination: " + termination + "\n"));
    service.RunToEnd(order, order == 1);
    SearchEnd ended;
    ended.stopped =
        Posterior(service, Value(service.Read().Iterations(1)).size() - 1).stopped_early();
    for (const store::SampleRecord& sample : Value(service.Read().Samples(1))) {
      ended.log_likelihoods.push_back(sample.log_likelihood);
      if (sample.log_likelihood > ended.best) ended.best = sample.log_likelihood;
    }
    return ended;
  };
  const SearchEnd all = run("surrogate_all", "off", 1);
  const SearchEnd some = run("surrogate_some", "4", 1);
  const SearchEnd again = run("surrogate_again", "4", 2);
  EXPECT_EQ(all.stopped, 0);
  EXPECT_GE(some.stopped, 1);
  EXPECT_LT(some.stopped, 40) << "of the forty after the design";
  ASSERT_EQ(again.log_likelihoods.size(), some.log_likelihoods.size());
  for (std::size_t i = 0; i < some.log_likelihoods.size(); ++i) {
    const double a = some.log_likelihoods[i];
    const double b = again.log_likelihoods[i];
    EXPECT_TRUE(a == b || (std::isnan(a) && std::isnan(b))) << i << ": " << a << " and " << b;
  }
  // In sd of the likelihood of a fit at the noise: 12 readings.
  EXPECT_GT(some.best, all.best - 3 * std::sqrt(12 / 2.0));
}

TEST(SurrogateCampaign, WithoutAnEmulatorTheBestRunIsGivenAndNoInterval) {
  SimulatedService service("surrogate_none");
  service.Submit(Campaign(5, 1, 0.02));
  service.RunToEnd(1, true);
  const v1::Posterior posterior = Posterior(service, 0);
  EXPECT_EQ(posterior.posterior_from(), "none");
  EXPECT_FALSE(posterior.converged());
  EXPECT_TRUE(std::isnan(posterior.log_evidence()));
  ASSERT_GE(posterior.warnings_size(), 1);
  EXPECT_THAT(posterior.warnings(0), HasSubstr("optimiser"));
  int best = 0;
  for (const store::SampleRecord& sample : Value(service.Read().Samples(1))) {
    if (sample.log_weight != 0) continue;
    ++best;
    EXPECT_EQ(posterior.parameters(0).mean(), sample.parameters[0]);
    EXPECT_EQ(posterior.parameters(1).mean(), sample.parameters[1]);
  }
  EXPECT_EQ(best, 1);
  EXPECT_TRUE(std::isnan(posterior.parameters(0).sd()));
}

TEST(SurrogateCampaign, AnAdequateEmulatorOfItsRunsGivesThePosterior) {
  SimulatedService service("surrogate_emulated");
  service.Submit(Campaign(20, 3, 0.05));
  service.RunToEnd(1, true);
  const auto last = Value(service.Read().Iterations(1)).size() - 1;
  const v1::Posterior posterior = Posterior(service, last);
  EXPECT_EQ(posterior.posterior_from(), "emulator");
  EXPECT_TRUE(posterior.converged());
  EXPECT_GT(posterior.draws_size(), 0);
  EXPECT_LT(posterior.parameters(1).q05(), posterior.parameters(1).q95());
  EXPECT_EQ(Posterior(service, 0).posterior_from(), "none") << "asked at the end alone";
}

// Fourteen runs teach an emulator, seven of them none: nothing says how far that is settled.
TEST(SurrogateCampaign, HasNotConvergedWhereHalfOfItsRunsGiveNoPosterior) {
  SimulatedService service("surrogate_few");
  service.Submit(Campaign(14, 1, 0.05));
  service.RunToEnd(1, true);
  const v1::Posterior posterior = Posterior(service, 0);
  EXPECT_EQ(posterior.posterior_from(), "emulator");
  EXPECT_TRUE(std::isnan(posterior.parameters(0).split_half()));
  EXPECT_FALSE(posterior.converged());
}

TEST(SurrogateCampaign, SameBitsWhateverGoesWrong) {
  SimulatedService calm("surrogate_calm");
  calm.Submit(Campaign(10, 3, 0.02));
  calm.RunToEnd(1, true);
  const std::string expected = calm.Fingerprint();
  for (unsigned seed = 1; seed <= 3; ++seed) {
    SimulatedService storm("surrogate_storm");
    storm.Submit(Campaign(10, 3, 0.02));
    storm.RunToEnd(seed, false);
    EXPECT_TRUE(storm.Fingerprint() == expected) << "seed " << seed;
  }
}

TEST(SurrogateCampaign, TheBudgetOfModelEvaluationsEndsIt) {
  SimulatedService service("surrogate_budget");
  service.Submit(Campaign(10, 100, 0.02, "budget: {model_evaluations: 30}\n"));
  service.RunToEnd(1, true);
  EXPECT_EQ(Value(service.Read().Evaluations(1)).size(), 30U);
}

TEST(SurrogateCampaign, TheBudgetOfCoreHoursEndsIt) {
  SimulatedService service("surrogate_core_hours");
  service.core_seconds = 60;
  service.Submit(Campaign(10, 100, 0.02, "budget: {core_hours: 0.5}\n"));
  service.RunToEnd(1, true);
  const double used = Value(service.Read().EffortOf(1)).core_seconds;  // points cut short cost less
  EXPECT_LE(used, 1800);
  EXPECT_GT(used, 1800 - 2 * 60);
}

std::string InFlight(int points, const char* decisions = "reproducible") {
  return "  termination: off\n  in_flight: " + std::to_string(points) +
         "\n  decisions: " + decisions + "\n";
}

/// Seconds of a run, lognormal: one in twelve takes twice the median or more.
double ServiceTime(int attempt) {
  inference::PhiloxStream stream({.seed = 3, .sample = static_cast<std::uint64_t>(attempt)});
  return 100 * std::exp(0.5 * stream.Normal());
}

// Fixed lag: point k is chosen by the results up to k - L, which is the same whoever is fast.
TEST(SurrogateCampaign, SamePointsForAnyNumberOfWorkersAndAnyServiceTimes) {
  for (const int in_flight : {3, 20}) {
    std::string expected;
    for (const int workers : {1, 3, 8}) {
      SimulatedService service("surrogate_workers");
      service.Submit(Campaign(10, 3, 0.02, "", InFlight(in_flight)));
      service.RunTimed(workers, ServiceTime);
      const std::string found = service.Fingerprint();
      if (expected.empty()) expected = found;
      EXPECT_TRUE(found == expected) << workers << " workers, in_flight " << in_flight;
      EXPECT_EQ(Value(service.Read().Samples(1)).size(), 30U);
    }
  }
}

// The ends of what is under way are not waited for: a point is chosen as soon as it may be.
TEST(SurrogateCampaign, ChoosesTheNextPointWhenTheOldestOfEightHasEnded) {
  SimulatedService service("surrogate_lag");
  service.Submit(Campaign(10, 4, 0.02, "", InFlight(8)));
  const std::int64_t team = service.Connect("team", 40);
  std::vector<v1::Lease> design;
  for (int i = 0; i < 10; ++i) {
    design.push_back(service.Next(team, v1::ServerMessage::kLease).lease());
    ASSERT_NE(design.back().attempt(), 0);
  }
  const auto samples = [&service] { return Value(service.Read().Samples(1)).size(); };
  const auto end = [&](int i) {
    const v1::Lease& lease = design[static_cast<std::size_t>(i)];
    service.SendStates(team, lease, 0, 12);
    service.SendEnd(team, lease.attempt(), v1::Finished::OUTCOME_COMPLETED);
  };
  // A surrogate of two parameters needs five values.
  for (const int i : {0, 1, 2, 4, 5, 6, 7}) {
    end(i);
    EXPECT_EQ(samples(), 10U) << "point 3 is not known";
  }
  end(3);
  EXPECT_EQ(samples(), 16U) << "points 0 to 7 are known, which is enough for point 15";
  end(9);
  EXPECT_EQ(samples(), 16U);
  end(8);
  EXPECT_EQ(samples(), 18U);
  // The design has ended: its posterior is there beside the points under way.
  EXPECT_TRUE(Value(service.Read().Iterations(1)).at(0).posterior.has_value());
  EXPECT_EQ(service.Campaign().progress.iteration, 1);
}

// Eight workers, 100 points. In rounds of eight, as points were chosen before, they waited for
// 0.49 of the time.
TEST(SurrogateCampaign, WorkersWaitLessThanInRounds) {
  const auto idle = [](const std::string& inference) {
    SimulatedService service("surrogate_idle");
    service.Submit(Campaign(20, 5, 0.02, "", inference));
    const auto shift = service.RunTimed(8, ServiceTime);
    EXPECT_EQ(Value(service.Read().Samples(1)).size(), 100U);
    return 1 - shift.computing / (8 * shift.elapsed);
  };
  const double lag_of_8 = idle(InFlight(8));
  const double lag_of_16 = idle(InFlight(16));
  const double lag_of_32 = idle(InFlight(32));
  const double at_once = idle(InFlight(8, "immediate"));
  std::cout << "share of the time that workers wait, in flight 8: " << lag_of_8
            << ", 16: " << lag_of_16 << ", 32: " << lag_of_32 << ", immediate: " << at_once << "\n";
  EXPECT_LT(lag_of_8, 0.4);
  EXPECT_LT(lag_of_16, 0.15);
  EXPECT_LT(lag_of_32, 0.08);
  EXPECT_LT(at_once, 0.08);
}

// Points end when later iterations have long begun: a model that diverges wherever it is asked now
// still pauses its campaign (failure.pause_above of the last points, half here).
TEST(SurrogateCampaign, PausesWhenItsLastPointsDiverge) {
  constexpr int kPoints = 10;
  SimulatedService service("surrogate_pause");
  service.Submit(Campaign(kPoints, 10, 0.02));
  const std::int64_t worker = service.Connect("w", 1);
  for (int k = 0;
       k < 3 * kPoints && service.Campaign().progress.state == store::CampaignState::kRunning;
       ++k) {
    const v1::ServerMessage message = service.Next(worker, v1::ServerMessage::kLease);
    if (!message.has_lease()) break;
    if (k < kPoints) service.SendStates(worker, message.lease(), 0, 12);
    service.SendEnd(worker, message.lease().attempt(),
                    k < kPoints ? v1::Finished::OUTCOME_COMPLETED : v1::Finished::OUTCOME_DIVERGED,
                    k < kPoints ? "" : "a grain escaped");
  }
  const store::CampaignProgress progress = service.Campaign().progress;
  EXPECT_EQ(progress.state, store::CampaignState::kPaused);
  EXPECT_THAT(progress.reason, HasSubstr("6 of 10 samples diverged"));
  EXPECT_THAT(progress.reason, HasSubstr(", last: "));
}

TEST(SurrogateCampaign, DecidedAtOnceItSaysSoAndEndsRunsByTheBestOfTheMoment) {
  const auto run = [](const char* name, const char* decisions) {
    SimulatedService service(name);
    service.Submit(Campaign(10, 5, 0.02, "",
                            std::string("  termination: 4\n  decisions: ") + decisions + "\n"));
    service.RunTimed(4, ServiceTime);
    return Posterior(service, Value(service.Read().Iterations(1)).size() - 1);
  };
  const v1::Posterior in_order = run("surrogate_in_order", "reproducible");
  const v1::Posterior at_once = run("surrogate_at_once", "immediate");
  const auto says_so = [](const v1::Posterior& posterior) {
    return std::any_of(
        posterior.warnings().begin(), posterior.warnings().end(),
        [](const std::string& text) { return text.find("not reproducible") != text.npos; });
  };
  EXPECT_FALSE(says_so(in_order));
  EXPECT_TRUE(says_so(at_once));
  EXPECT_GE(at_once.stopped_early(), 1);
  EXPECT_EQ(at_once.model_evaluations(), 50);
}

// What was decided is in the store: a server that is killed goes on from there.
TEST(SurrogateCampaign, DecidedAtOnceItSurvivesWhateverGoesWrong) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    SimulatedService storm("surrogate_at_once_storm");
    storm.Submit(Campaign(10, 3, 0.02, "", "  decisions: immediate\n"));
    storm.RunToEnd(seed, false);
    EXPECT_EQ(Value(storm.Read().Samples(1)).size(), 30U);
  }
}

}  // namespace
}  // namespace calib::scheduler
