#include "server/diagnosis/proposed_test.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <set>
#include <utility>

#include "calib/return_if_error.h"
#include "inference/diagnosis/next_runs.h"
#include "server/diagnosis/design_caps.h"
#include "server/diagnosis/stage_rows.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;
using inference::DesignPoints;
using inference::ModelEvidence;

constexpr double kHeld = 0.99;        // by the models that a next measurement is to tell apart
constexpr int kFewestWithEffect = 2;  // runs, as FeatureEmulator::Fit asks
constexpr int kFewestOfEach = 3;      // runs of a leading model: one more than an emulator asks for
constexpr Index kMoreThanPlane = 10;  // runs without effects, as StageCoordinates::Fit asks

const ModelEvidence& EvidenceOf(const AnsweredDesign& answered, Index model) {
  return answered.asked->evidence[0][static_cast<std::size_t>(model)];
}

// `count` draws evenly spread over those of a model; again: between them.
std::vector<Index> EvenDraws(Index draws, Index count, bool again) {
  std::vector<Index> rows;
  for (Index i = 0; i < count; ++i) {
    const Index even = (2 * i + 1) * draws / (2 * count);
    rows.push_back((even + (again ? draws / (2 * count) + 1 : 0)) % draws);
  }
  return rows;
}

// How many of n each of these models gets: in proportion to its probability, at least `least`.
std::vector<int> SharesOf(const Eigen::VectorXd& probability, int n, int least) {
  std::vector<int> shares;
  const double rest = n - least * static_cast<double>(probability.size());
  double sum = 0, before = 0;
  for (const double p : probability) {
    sum += rest * p / probability.sum();
    shares.push_back(least + static_cast<int>(std::lround(sum) - std::lround(before)));
    before = sum;
  }
  return shares;
}

void Append(const DesignPoints& part, DesignPoints& all) {
  const auto join = [](const Eigen::MatrixXd& below, Eigen::MatrixXd& above) {
    Eigen::MatrixXd both(above.rows() + below.rows(), below.cols());
    both.topRows(above.rows()) = above;
    both.bottomRows(below.rows()) = below;
    above = std::move(both);
  };
  join(part.base, all.base);
  join(part.strength, all.strength);
  join(part.shape, all.shape);
}

// The race as this test allows it to be calculated.
DesignRows RowsFor(const AnsweredDesign& answered, const BaseRuns& test) {
  const DesignRows& rows = answered.known->rows;
  Race race = rows.race();
  for (RacingEffect& entry : race.effects)
    entry.design.calculated = entry.shapes.empty() && test.calculated.count(entry.strength) > 0;
  return {rows.axes(), std::move(race), rows.unit()};
}

// Columns of these entries among those of points of the kept ones.
inference::PointColumns ColumnsOfEntries(const Knowledge& known, const std::vector<int>& entries) {
  inference::PointColumns columns;
  Index place = 0, shape = 0;
  for (const int entry : known.part.kept) {
    const int shapes = known.rows.race().effects[static_cast<std::size_t>(entry)].design.shapes;
    if (std::count(entries.begin(), entries.end(), entry) > 0) {
      columns.strength.push_back(place);
      for (int h = 0; h < shapes; ++h) columns.shape.push_back(shape + h);
    }
    ++place;
    shape += shapes;
  }
  return columns;
}

absl::Status FitTest(const inference::SetRuns& runs, KnownTest& test) {
  ASSIGN_OR_RETURN(inference::DiagnosisSet set, inference::DiagnosisSet::Fit(runs));
  test.known.set = std::make_shared<const inference::DiagnosisSet>(std::move(set));
  test.known.z =
      test.known.set->coordinates()->Of(Eigen::MatrixXd::Zero(1, runs.histories.cols())).row(0);
  test.holds = LeftOutHolds(test.known.set->emulator());
  return absl::OkStatus();
}

}  // namespace

LeadingModels LeadingOf(const AnsweredDesign& answered) {
  const inference::EffectProbabilities& probabilities = answered.asked->probabilities[0];
  LeadingModels leading;
  std::set<int> places;
  double held = 0;
  for (const Index i : inference::LeadingModels(answered.asked->evidence[0], probabilities, 0,
                                                inference::ForecastOptions().most_models)) {
    if (held >= kHeld) break;
    held += probabilities.model[i];
    leading.models.push_back(i);
    const std::vector<int>& effects = EvidenceOf(answered, i).model.effects;
    places.insert(effects.begin(), effects.end());
  }
  for (const int place : places)
    leading.part.kept.push_back(answered.known->part.kept[static_cast<std::size_t>(place)]);
  return leading;
}

std::vector<campaign::RunOf> RowsOfTest(const AnsweredDesign& answered,
                                        const LeadingModels& leading, const BaseRuns& test,
                                        int made) {
  const bool again = made > 0;
  const Knowledge& known = *answered.known;
  const DesignRows rows = RowsFor(answered, test);
  // Calculated entries are off in runs.
  std::vector<bool> off;
  for (const int entry : known.part.kept)
    off.push_back(rows.race().effects[static_cast<std::size_t>(entry)].design.calculated);
  std::vector<Index> with;
  Eigen::VectorXd of_all(static_cast<Index>(leading.models.size()));
  for (std::size_t i = 0; i < leading.models.size(); ++i) {
    const Index model = leading.models[i];
    of_all[static_cast<Index>(i)] = answered.asked->probabilities[0].model[model];
    const std::vector<int>& effects = EvidenceOf(answered, model).model.effects;
    if (std::any_of(effects.begin(), effects.end(),
                    [&off](int k) { return !off[static_cast<std::size_t>(k)]; }))
      with.push_back(static_cast<Index>(i));
  }
  const Index d = answered.before->base.values.cols();
  DesignPoints points{.base = Eigen::MatrixXd(0, d),
                      .strength = Eigen::MatrixXd(0, static_cast<Index>(known.part.kept.size())),
                      .shape = Eigen::MatrixXd()};
  const auto add = [&](Index place, int count, bool without) {
    const DesignPoints& draws =
        EvidenceOf(answered, leading.models[static_cast<std::size_t>(place)]).draws;
    DesignPoints own = inference::RowsOf(draws, EvenDraws(draws.rows(), count, again));
    for (std::size_t k = 0; k < off.size(); ++k) {
      if (without || off[k]) own.strength.col(static_cast<Index>(k)).setZero();
    }
    Append(own, points);
  };
  points.shape.resize(0, EvidenceOf(answered, leading.models.front()).draws.shape.cols());
  if (!again) {
    const std::vector<int> base = SharesOf(of_all, static_cast<int>(d + 1 + kMoreThanPlane), 0);
    for (std::size_t i = 0; i < base.size(); ++i) add(static_cast<Index>(i), base[i], true);
  }
  if (!with.empty()) {
    const int n = std::max(kRunsOfTest, 2 * kFewestOfEach * static_cast<int>(with.size()));
    const std::vector<int> shares = SharesOf(of_all(with), n, kFewestOfEach);
    for (std::size_t i = 0; i < with.size(); ++i) add(with[i], shares[i], false);
  }
  return AdmissibleRows(*answered.design, rows, answered.before->region,
                        WholePoints(known.rows, known.part, points),
                        answered.before->base.samples + made);
}

absl::StatusOr<KnownTest> LearnTest(const AnsweredDesign& answered, const LeadingModels& leading,
                                    const report::CampaignView& design, int batches) {
  ASSIGN_OR_RETURN(TestRuns runs, RunsOfTest(design, answered.known->rows, batches));
  DesignRows rows = RowsFor(answered, runs.base);
  KnownTest test{.base = std::move(runs.base),
                 .known = {.rows = std::move(rows), .part = {}, .set = nullptr}};
  for (const int entry : leading.part.kept) {
    const RacingEffect& own = test.known.rows.race().effects[static_cast<std::size_t>(entry)];
    if (own.design.calculated ||
        RunsWith(test.known.rows, runs.batches, entry) >= kFewestWithEffect) {
      test.known.part.kept.push_back(entry);
    } else {
      test.unknown.push_back(own.name);
    }
  }
  test.columns = ColumnsOfEntries(*answered.known, test.known.part.kept);
  RETURN_IF_ERROR(
      FitTest(SetRunsOf(test.base, test.known.rows, runs.batches, test.known.part), test));
  return test;
}

bool LeftOutHolds(const inference::FeatureEmulator& emulator) {
  constexpr double kInside = 0.9, kNormalQuantile = 1.6449;  // of 0.95
  const inference::LeftOutRuns& left = emulator.left_out();
  const double inside = (left.error.array().abs() <= kNormalQuantile * left.variance.array().sqrt())
                            .cast<double>()
                            .mean();
  return inside >=
         kInside - 2 * std::sqrt(kInside * (1 - kInside) / static_cast<double>(left.error.rows()));
}

absl::StatusOr<KnownTest> LearnRepeat(const AnsweredDesign& answered,
                                      const campaign::Campaign& base,
                                      const std::string& experiment) {
  const Knowledge& known = *answered.known;
  campaign::Campaign alone = base;
  std::erase_if(alone.experiments, [&](const auto& own) { return own.name != experiment; });
  const inference::SetRuns runs =
      OfExperiment(SetRunsOf(answered.before->base, known.rows, *answered.batches, known.part),
                   answered.before->base.scale, experiment);
  KnownTest test{.base = WithoutRuns(alone),
                 .known = {.rows = known.rows, .part = known.part, .set = nullptr}};
  RETURN_IF_ERROR(FitTest(runs, test));
  return test;
}

absl::StatusOr<inference::Forecast> ForecastOf(const AnsweredDesign& answered,
                                               const inference::ProposedMeasurement& proposed) {
  return inference::ExpectedInformation(
      proposed, answered.asked->evidence[0], answered.asked->probabilities[0],
      {.leading = kDesignCaps.asked, .seed = answered.before->seed});
}

}  // namespace calib::diagnosis
