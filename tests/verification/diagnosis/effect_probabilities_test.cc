// Probabilities of the diagnosis: calibrated where truths come from the model that it takes for
// true; coverage of runs that the emulator has not seen; the whole chain on a simulator in closed
// form.

#include "inference/diagnosis/effect_probabilities.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <limits>
#include <vector>

#include "inference/diagnosis/run_variance.h"
#include "tests/support/effects_toy.h"
#include "tests/support/history_toy.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Stated and observed in bins of the stated probability.
class Reliability {
 public:
  void Add(double stated, bool true_one) {
    std::size_t bin = 0;
    while (bin + 1 < kEdges.size() && stated >= kEdges[bin + 1]) ++bin;
    ++count_[bin];
    stated_[bin] += stated;
    observed_[bin] += true_one ? 1 : 0;
    variance_[bin] += stated * (1 - stated);
  }
  // Every bin within three binomial standard deviations, and one event for those of next to no
  // expectation.
  void Check(const std::string& what) const {
    for (std::size_t b = 0; b < count_.size(); ++b) {
      std::cout << what << " from " << kEdges[b] << ": " << count_[b] << " stated " << stated_[b]
                << ", observed " << observed_[b] << "\n";
      EXPECT_LE(std::abs(observed_[b] - stated_[b]), 3 * std::sqrt(variance_[b]) + 1)
          << what << " bin " << b;
    }
  }

 private:
  static constexpr std::array<double, 6> kEdges = {0, 0.05, 0.2, 0.5, 0.8, 0.95};
  std::array<int, 6> count_{};
  std::array<double, 6> stated_{}, observed_{}, variance_{};
};

// Designs, each with an emulator of its own, and truths drawn from it: model by its prior share,
// strengths by their prior, coefficients by a realisation.
void CalibrateOn(int designs, int truths, const std::string& what) {
  Reliability models, effects;
  int covered = 0, all = 0;
  for (int design = 0; design < designs; ++design) {
    CoordinateToy toy({.parameters = 2,
                       .effects = 4,
                       .coordinates = 8,
                       .seed = 100 + static_cast<unsigned>(design),
                       .two_sided = {2}});
    auto emulator = FeatureEmulator::Fit(toy.features(), toy.Runs(50, 40, 8));
    ASSERT_TRUE(emulator.ok()) << emulator.status();
    const SpecimenErrors errors{.specimen = emulator->specimen(),
                                .run = emulator->variances().run,
                                .noise = Eigen::VectorXd::Constant(8, 0.2),
                                .staging = Eigen::MatrixXd(8, 0),
                                .share = 1,
                                .freedom = std::numeric_limits<double>::infinity()};
    const DiagnosisSet set(*std::move(emulator), errors);
    ModelSpace space = ToySpace(toy);
    space.tau_high = 6;
    const Eigen::VectorXd prior = space.LogPrior().array().exp();
    for (int t = 0; t < truths; ++t) {
      double u = toy.Uniform();
      Index chosen = 0;
      while (chosen + 1 < prior.size() && u >= prior[chosen]) u -= prior[chosen++];
      const EffectModel& truth = space.models[static_cast<std::size_t>(chosen)];
      std::vector<int> sign;
      for (const int k : truth.effects) {
        sign.push_back(
            space.effects[static_cast<std::size_t>(k)].two_sided && toy.Uniform() < 0.5 ? -1 : 1);
      }
      const ModelCube cube(space, truth, sign);
      Eigen::MatrixXd at(1, cube.dimensions());
      for (double& x : at.reshaped()) x = toy.Uniform();
      const DesignPoints point = cube.Points(at);
      const Eigen::MatrixXd coefficients = set.emulator().Realisation(
          77 + static_cast<std::uint64_t>(design), static_cast<std::uint64_t>(t));
      Eigen::VectorXd z = set.emulator().MeanOf(coefficients, point).row(0);
      z += (errors.specimen + errors.noise).cwiseSqrt().cwiseProduct(toy.Normal(8, 1).col(0));
      if (truth.none_of_these) {
        Eigen::MatrixXd j(8, 2);
        for (Index p = 0; p < 2; ++p)
          j.col(p) = set.emulator().BaseDerivative(point.base, p).row(0);
        const Eigen::MatrixXd along = Eigen::HouseholderQR<Eigen::MatrixXd>(j).householderQ() *
                                      Eigen::MatrixXd::Identity(8, 2);
        const Eigen::VectorXd d = cube.Tau(at)[0] / std::sqrt(6.0) * toy.Normal(8, 1);
        z += d - along * (along.transpose() * d);
      }
      const auto evidence = ModelEvidences(
          {{&set, z}}, space,
          {.sampling = {.seed = static_cast<std::uint64_t>(t)}, .draws = 2, .realisations = 2});
      ASSERT_TRUE(evidence.ok());
      const auto p = ProbabilitiesOf(*evidence, space);
      ASSERT_TRUE(p.ok());
      for (Index m = 0; m < p->model.size(); ++m) models.Add(p->model[m], m == chosen);
      for (int k = 0; k < 4; ++k)
        effects.Add(p->inclusion[k], std::count(truth.effects.begin(), truth.effects.end(), k) > 0);
      // The 95 % set of models.
      double above = 0;
      for (Index m = 0; m < p->model.size(); ++m)
        above += p->model[m] > p->model[chosen] ? p->model[m] : 0;
      covered += above < 0.95 ? 1 : 0;
      ++all;
    }
  }
  models.Check(what + ", models");
  effects.Check(what + ", effects");
  std::cout << "95 % sets hold the truth " << covered << " of " << all << " times\n";
  EXPECT_GE(covered, 0.95 * all - 3 * std::sqrt(0.95 * 0.05 * all));
}

TEST(EffectProbabilities, AreCalibratedForTruthsOfTheEmulator) { CalibrateOn(6, 20, "120 truths"); }

TEST(EffectProbabilitiesSlow, AreCalibratedForFiveHundredTruths) {
  CalibrateOn(20, 25, "500 truths");
}

// Runs of new packings that the emulator has not seen, and runs left out one by one.
TEST(EffectProbabilities, NineteenOfTwentyRunsLieWhereTheEmulatorSays) {
  int inside = 0, all = 0, left_inside = 0, left = 0;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    HistoryToy toy(seed);
    const SetRuns runs = toy.Runs(90, 110, 18);
    const auto set = DiagnosisSet::Fit(runs);
    ASSERT_TRUE(set.ok()) << set.status();
    const FeatureEmulator& emulator = set->emulator();
    const LeftOutRuns& out = emulator.left_out();
    left += static_cast<int>(out.error.size());
    left_inside +=
        static_cast<int>((out.error.array().square() < 1.96 * 1.96 * out.variance.array()).count());
    const DesignPoints fresh = toy.Points(90, 2);
    std::vector<int> packing;
    for (int i = 0; i < 90; ++i) packing.push_back(100 + i);
    const Eigen::MatrixXd z = set->coordinates()->Of(toy.Run(fresh, packing));
    const EmulatorPrediction p = emulator.Predict(fresh);
    for (Index i = 0; i < z.rows(); ++i) {
      for (Index c = 0; c < z.cols(); ++c) {
        const double variance = p.variance(i, c) + set->errors().specimen[c] +
                                emulator.variances().run[c] * p.added_run_variance[i];
        inside += std::abs(z(i, c) - p.mean(i, c)) < 1.96 * std::sqrt(variance) ? 1 : 0;
        ++all;
      }
    }
    std::cout << "kappa " << emulator.run_variance().single << " " << emulator.run_variance().pair
              << ", freedom " << emulator.freedom() << "\n";
  }
  std::cout << "fresh runs: " << 100.0 * inside / all
            << " % inside, left out: " << 100.0 * left_inside / left << " %\n";
  EXPECT_GE(inside, 0.93 * all);
  EXPECT_LE(inside, 0.97 * all);
  EXPECT_GE(left_inside, 0.93 * left);
  EXPECT_LE(left_inside, 0.97 * left);
}

// Six fresh runs at one point: their chance is that of chance where the emulator is right, and
// small where the simulator does there what no run of the design has shown.
TEST(EffectProbabilities, VerificationRunsKeepWhatIsRightAndRefuseWhatIsNot) {
  HistoryToy toy(7);
  const auto set = DiagnosisSet::Fit(toy.Runs(90, 110, 18));
  ASSERT_TRUE(set.ok());
  int refused = 0, found = 0, packing = 100;
  double mean = 0;
  const int n = 60;
  for (int t = 0; t < n; ++t) {
    const DesignPoints one = toy.Points(1, 1);
    const DesignPoints six = RowsOf(one, std::vector<Index>(6, 0));
    std::vector<int> on;
    for (int i = 0; i < 6; ++i) on.push_back(packing++);
    Eigen::MatrixXd histories = toy.Run(six, on);
    const double chance = VerificationChance(*set, six, on, histories);
    mean += chance / n;
    refused += chance < AnswerLevels().verification ? 1 : 0;
    // Three sd of a run, all along the first curve.
    histories.leftCols(HistoryToy::kReadings).array() += 0.06;
    found += VerificationChance(*set, six, on, histories) < AnswerLevels().verification ? 1 : 0;
  }
  std::cout << "verification: " << refused << " of " << n << " right ones refused, mean chance "
            << mean << "; " << found << " shifted ones found\n";
  EXPECT_LE(refused, 4);  // 0.6 by chance, and scatter is known from 18 packings
  EXPECT_GT(mean, 0.25);
  EXPECT_GE(found, 0.5 * n);
}

ModelSpace HistorySpace() {
  ModelSpace space{.effects = HistoryToy::Effects()};
  space.strength.assign(HistoryToy::kEffects,
                        {.low = 0.4, .high = 5, .negative_low = 0.4, .negative_high = 5});
  space.shape_low = space.shape_high = Eigen::VectorXd(0);
  space.base_low = Eigen::Vector2d(-1, -1);
  space.base_high = Eigen::Vector2d(1, 1);
  space.models = AllModels(HistoryToy::kEffects, {});
  return space;
}

// Of the models that truths are drawn from: the base and one effect.
double ShareOfDrawn(const EffectProbabilities& p, const ModelSpace& space) {
  double share = 0;
  for (std::size_t m = 0; m < space.models.size(); ++m) {
    const EffectModel& model = space.models[m];
    if (!model.none_of_these && model.effects.size() <= 1) {
      share += p.model[static_cast<Eigen::Index>(m)];
    }
  }
  return share;
}

// What became of measurements of one design.
struct OfDesign {
  int adequate = 0, wrong = 0, named = 0, covered = 0;
  double size = 0;
  /// Nulls among those that were measured, and how many were said to be: of one design their
  /// errors go together, by its emulator.
  double stated = 0, observed = 0;
};

// A design on the simulator, then measurements without and with an effect.
void MeasureOneDesign(unsigned seed, int nulls, int with, Reliability& reliability,
                      OfDesign& result) {
  HistoryToy toy(seed);
  const SetRuns runs = toy.Runs(90, 110, 18);
  const auto set = DiagnosisSet::Fit(runs);
  ASSERT_TRUE(set.ok()) << set.status();
  const ModelSpace space = HistorySpace();
  for (int t = 0; t < nulls + with; ++t) {
    DesignPoints point = toy.Points(1, 0);
    point.base *= 0.8;
    const int effect = t < nulls ? -1 : t % HistoryToy::kEffects;
    if (effect >= 0) {
      const double s = 0.4 * std::pow(5 / 0.4, toy.Uniform());
      point.strength(0, effect) = effect == 4 && toy.Uniform() < 0.5 ? -s : s;
    }
    const Eigen::VectorXd z = set->coordinates()->Of(toy.Measure(point)).row(0);
    const auto evidence = ModelEvidences(
        {{&*set, z}}, space,
        {.sampling = {.seed = static_cast<std::uint64_t>(t)}, .draws = 100, .realisations = 2});
    ASSERT_TRUE(evidence.ok());
    const auto p = ProbabilitiesOf(*evidence, space);
    ASSERT_TRUE(p.ok());
    std::vector<std::vector<int>> each;
    for (int k = 0; k < HistoryToy::kEffects; ++k) {
      each.push_back({k});
      reliability.Add(p->inclusion[k], k == effect);
    }
    const auto answer = AnswerOf({.widths = {*p},
                                  .beyond = {BeyondDesign(*evidence, *p, RangeOf(runs.points))},
                                  .families = each,
                                  .verification = Eigen::VectorXd::Ones(HistoryToy::kEffects)},
                                 space.models);
    ASSERT_TRUE(answer.ok());
    result.adequate += effect < 0 && p->adequate > 0.5 ? 1 : 0;
    result.stated += p->adequate / ShareOfDrawn(*p, space);
    result.observed += effect < 0 ? 1 : 0;
    for (const int k : answer->alone) (k == effect ? result.named : result.wrong) += 1;
    result.covered += std::any_of(answer->set.begin(), answer->set.end(),
                                  [&](const CredibleEntry& e) { return e.effect == effect; })
                          ? 1
                          : 0;
    result.size += static_cast<double>(answer->set.size());
  }
}

void WholeChain(int designs, int nulls, int with) {
  Reliability reliability;
  OfDesign all;
  Eigen::ArrayXd excess(designs);  // of nulls that were measured over those that were stated
  for (int d = 0; d < designs; ++d) {
    OfDesign one;
    MeasureOneDesign(50 + static_cast<unsigned>(d), nulls, with, reliability, one);
    if (testing::Test::HasFatalFailure()) return;
    excess[d] = (one.observed - one.stated) / (nulls + with);
    all.adequate += one.adequate;
    all.wrong += one.wrong;
    all.named += one.named;
    all.covered += one.covered;
    all.size += one.size;
  }
  const int n = designs * (nulls + with);
  std::cout << all.adequate << " of " << designs * nulls << " without effect adequate, "
            << all.named << " of " << designs * with << " effects named, " << all.wrong
            << " wrong names, " << all.covered << " of " << n << " in the 95 % set of mean size "
            << all.size / n << "\n";
  reliability.Check("simulator");
  EXPECT_LE(all.wrong, 0.02 * n + 2 * std::sqrt(0.02 * n));
  EXPECT_GE(all.named, 0.3 * designs * with);
  EXPECT_GE(all.covered, 0.95 * n - 3 * std::sqrt(0.0475 * n));
  if (designs < 2) return;
  const double error = std::sqrt((excess - excess.mean()).square().sum() / (designs - 1) / designs);
  std::cout << "nulls over those stated: " << excess.mean() << " +- " << error << " of all\n";
  EXPECT_LE(std::abs(excess.mean()), 3 * error);
}

TEST(EffectProbabilities, WholeChainOnASimulator) { WholeChain(1, 12, 18); }

TEST(EffectProbabilitiesSlow, WholeChainOnTenDesignsOfThirtyNullsAndThirtyEffects) {
  WholeChain(10, 30, 30);
}

}  // namespace
}  // namespace calib::inference
