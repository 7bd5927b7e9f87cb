#include "server/diagnosis/knowledge.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "inference/diagnosis/diagnosis_set.h"
#include "inference/diagnosis/visible_strength.h"
#include "inference/numerics/special_functions.h"
#include "server/client/progress.h"
#include "server/diagnosis/design_caps.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;
using inference::DesignPoints;

// Lambda of a unit: (3.24 + 1.28)^2, a normal quantile each of a level of 0.01 shared by 17 effects
// and of a chance of 0.9.
constexpr double kSeen = 21;
constexpr double kUnseen = 4;     // lambda below which a strength has no prior
constexpr int kFewestRunsOn = 2;  // of an effect, as FeatureEmulator::Fit asks
// Strengths beyond ten times what was tried are a power law's guess.
constexpr double kBeyondTried = 10;
constexpr double kLargestUnits = 100;  // up to which lambda is looked at

// Entries of the part that may not act together.
std::vector<std::pair<int, int>> ExcludedIn(const Race& race, const PartOfRace& part) {
  std::vector<std::pair<int, int>> excluded;
  for (const auto& [a, b] : race.excluded) {
    const auto x = std::find(part.kept.begin(), part.kept.end(), a);
    const auto y = std::find(part.kept.begin(), part.kept.end(), b);
    if (x == part.kept.end() || y == part.kept.end()) continue;
    excluded.emplace_back(static_cast<int>(x - part.kept.begin()),
                          static_cast<int>(y - part.kept.begin()));
  }
  return excluded;
}

inference::ModelSpace SpaceOf(const KnownBefore& before, const DesignRows& rows,
                              const PartOfRace& part) {
  inference::ModelSpace space;
  const auto d = static_cast<Index>(rows.race().base.size());
  Index shapes = 0;
  for (const int k : part.kept) {
    space.effects.push_back(rows.race().effects[static_cast<std::size_t>(k)].design);
    shapes += space.effects.back().shapes;
  }
  space.strength.resize(space.effects.size());
  space.shape_low = Eigen::VectorXd::Constant(shapes, -1);
  space.shape_high = Eigen::VectorXd::Ones(shapes);
  space.base_low = Eigen::VectorXd::Constant(d, -1);
  space.base_high = Eigen::VectorXd::Ones(d);
  space.log_base_prior = [prior = before.prior, axes = rows.axes()](const Eigen::MatrixXd& base) {
    return LogBasePrior(prior, axes, base);
  };
  space.models =
      inference::AllModels(static_cast<int>(part.kept.size()), ExcludedIn(rows.race(), part));
  return space;
}

// Triples of pairs that lead, those of the most probable pair and effect first, and no more than
// may be asked.
std::vector<inference::EffectModel> LeadingTriples(
    const Asked& asked, const std::vector<std::pair<int, int>>& excluded) {
  const inference::EffectProbabilities& known = asked.probabilities[0];
  std::vector<Index> pairs;
  for (std::size_t i = 0; i < asked.space.models.size(); ++i) {
    const auto at = static_cast<Index>(i);
    if (asked.space.models[i].effects.size() == 2 && known.model[at] >= kDesignCaps.leading_pair)
      pairs.push_back(at);
  }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [&known](Index a, Index b) { return known.model[a] > known.model[b]; });
  std::vector<inference::EffectModel> triples;
  const auto weight = [&known](const inference::EffectModel& triple) {
    double sum = 0;
    for (const int e : triple.effects) sum += known.inclusion[e];
    return sum;
  };
  for (const Index i : pairs) {
    auto own = inference::TriplesOf(static_cast<int>(asked.space.effects.size()), excluded,
                                    {asked.space.models[static_cast<std::size_t>(i)]});
    std::stable_sort(own.begin(), own.end(),
                     [&weight](const auto& a, const auto& b) { return weight(a) > weight(b); });
    for (inference::EffectModel& triple : own) {
      if (static_cast<int>(triples.size()) == kDesignCaps.triples) return triples;
      if (std::find(triples.begin(), triples.end(), triple) == triples.end())
        triples.push_back(std::move(triple));
    }
  }
  return triples;
}

constexpr const char* kWeighing = "weighing the models";

absl::Status SetProbabilities(Asked& asked) {
  asked.probabilities.clear();
  for (const auto& evidence : asked.evidence) {
    ASSIGN_OR_RETURN(auto probabilities, inference::ProbabilitiesOf(evidence, asked.space));
    asked.probabilities.push_back(std::move(probabilities));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::shared_ptr<const inference::DiagnosisSet>> FitSet(
    const KnownBefore& before, const DesignRows& rows, const std::vector<EndedBatch>& batches,
    const PartOfRace& part) {
  const client::BusyLine busy("fitting the emulator of the runs");
  ASSIGN_OR_RETURN(inference::DiagnosisSet set,
                   inference::DiagnosisSet::Fit(SetRunsOf(before.base, rows, batches, part)));
  return std::make_shared<const inference::DiagnosisSet>(std::move(set));
}

// A strength of one kept entry.
struct EntryStrength {
  int place = 0;  // among the kept
  int sign = 1;
  double most = 0;
};

std::vector<EntryStrength> SidesOf(const DesignRows& rows, const PartOfRace& part) {
  const Eigen::VectorXd most = rows.Most(), other = rows.MostOther();
  std::vector<EntryStrength> sides;
  for (std::size_t i = 0; i < part.kept.size(); ++i) {
    const int k = part.kept[i], place = static_cast<int>(i);
    sides.push_back({.place = place, .sign = 1, .most = most[k]});
    if (rows.race().effects[static_cast<std::size_t>(k)].design.two_sided)
      sides.push_back({.place = place, .sign = -1, .most = other[k]});
  }
  return sides;
}

// Whether an entry shows at one side: at some strength of a design lambda is above what has a prior
// and twice what chance makes of an effect that changes nothing, which is the emulator's own
// variance of the change (at large strengths it grows faster than lambda does).
bool IsSeen(const KnownBefore& before, const inference::ModelSpace& space,
            const inference::DiagnosisSet& set, const EntryStrength& at) {
  DesignPoints point{.base = before.region.centre.transpose(),
                     .strength = Eigen::MatrixXd::Zero(1, static_cast<Index>(space.effects.size())),
                     .shape = Eigen::MatrixXd::Zero(1, space.shape_low.size())};
  const Eigen::RowVectorXd without = set.emulator().Factor(point).row(0);
  const Eigen::VectorXd measurement = set.errors().OfMeasurement();
  for (const double strength : {1.0, 3.0, 10.0, kDesignCaps.strengths.high}) {
    point.strength(0, at.place) = at.sign * std::min(at.most, strength);
    const Eigen::RowVectorXd change = set.emulator().Factor(point).row(0) - without;
    const Eigen::VectorXd variance = (change.cwiseAbs2() * set.emulator().shrink()).transpose();
    if (inference::SquaredDistanceFromBase({&set}, space, point) >=
        kUnseen + 2 * variance.cwiseQuotient(measurement).sum())
      return true;
  }
  return false;
}

// Units in SI at which lambda is kSeen, the smaller of both signs; whether there are such.
struct SeenUnits {
  Eigen::VectorXd unit;       // of all entries
  std::vector<bool> reached;  // of those of the part
};

SeenUnits UnitsSeen(const KnownBefore& before, const DesignRows& rows, const PartOfRace& part,
                    const inference::DiagnosisSet& set) {
  const inference::ModelSpace space = SpaceOf(before, rows, part);
  Eigen::VectorXd unit = rows.unit();
  std::vector<double> least(part.kept.size(), std::numeric_limits<double>::infinity());
  std::vector<bool> reached(part.kept.size(), false);
  for (const EntryStrength& side : SidesOf(rows, part)) {
    const double strength =
        inference::StrengthOfLambda({&set}, space, before.region.centre.transpose(),
                                    {.effect = side.place,
                                     .sign = side.sign,
                                     .lambda = kSeen,
                                     .largest = std::min(side.most, kLargestUnits)});
    double& own = least[static_cast<std::size_t>(side.place)];
    own = std::min(own, strength);
    if (strength < std::min(side.most, kLargestUnits))
      reached[static_cast<std::size_t>(side.place)] = true;
  }
  for (std::size_t i = 0; i < part.kept.size(); ++i) {
    const RacingEffect& entry = rows.race().effects[static_cast<std::size_t>(part.kept[i])];
    double& own = unit[part.kept[i]];
    const double most = std::abs(entry.far) * kBeyondTried;
    if (least[i] * own > most) reached[i] = false;
    own = std::clamp(least[i] * own, std::abs(entry.near) / kBeyondTried, most);
    // Of what is not seen before its end strengths are tried to both sides of half of it.
    own = std::min(own, std::max(entry.most, entry.most_other) / (reached[i] ? 1 : 2));
  }
  return {.unit = std::move(unit), .reached = std::move(reached)};
}

// The rows whose entries end where runs do not come to their ends: at the weakest run of an entry
// alone that did not, of those stronger than every run with it that did. Runs beyond it would be
// wasted, and what shows only just below it would be tried nowhere.
DesignRows EndingWhereRunsEnd(const DesignRows& rows, const std::vector<EndedBatch>& batches) {
  const auto count = static_cast<Index>(rows.race().effects.size());
  // Distances from the null to either side, SI.
  struct Side {
    Eigen::VectorXd reached, end;
  };
  const Side from = {
      .reached = Eigen::VectorXd::Zero(count),
      .end = Eigen::VectorXd::Constant(count, std::numeric_limits<double>::infinity())};
  std::array<Side, 2> sides = {from, from};
  const auto each = [&](bool finished, const auto& tell) {
    for (const EndedBatch& batch : batches) {
      for (const EndedRun& ended : batch.runs) {
        if (ended.readings.has_value() != finished) continue;
        const Eigen::RowVectorXd strength = rows.Points({ended.run.values}).strength.row(0);
        if (!finished && (strength.array() != 0).count() != 1) continue;
        for (Index k = 0; k < count; ++k) {
          if (strength[k] != 0)
            tell(sides[strength[k] > 0 ? 0 : 1], k, std::abs(strength[k]) * rows.unit()[k]);
        }
      }
    }
  };
  each(true, [](Side& side, Index k, double distance) {
    side.reached[k] = std::max(side.reached[k], distance);
  });
  each(false, [](Side& side, Index k, double distance) {
    if (distance > side.reached[k]) side.end[k] = std::min(side.end[k], distance);
  });
  return rows.EndingAt(sides[0].end, sides[1].end);
}

// Why too few runs with the entry are there to learn from, in a clause.
std::string WhyRunsEnd(const DesignRows& rows, const std::vector<EndedBatch>& batches, int entry) {
  std::string reason;
  bool ended_early = false;
  for (const EndedBatch& batch : batches) {
    for (const EndedRun& ended : batch.runs) {
      if (ended.readings || rows.Points({ended.run.values}).strength(0, entry) == 0) continue;
      ended_early = true;
      if (!ended.reason.empty()) reason = ended.reason;
    }
  }
  if (!ended_early) return "too few runs have it where the measurement may lie";
  return reason.empty() ? "runs with it diverge"
                        : absl::StrCat("runs with it diverge (", reason, ")");
}

// Largest strength to a side that was run, or without end where the entry itself ends there.
inference::DesignRange RangeWithEnds(const DesignRows& rows, const PartOfRace& part,
                                     const DesignPoints& points) {
  constexpr double kAtTheEnd = 0.98;  // of the way
  inference::DesignRange range = inference::RangeOf(points);
  const Eigen::VectorXd most = rows.Most(), other = rows.MostOther();
  const double without_end = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < part.kept.size(); ++i) {
    const int k = part.kept[i];
    const auto place = static_cast<Index>(i);
    const RacingEffect& entry = rows.race().effects[static_cast<std::size_t>(k)];
    // Calculated at any strength.
    if (entry.design.calculated)
      range.strength_high[place] = range.negative_high[place] = without_end;
    if (entry.ends && range.strength_high[place] >= kAtTheEnd * most[k])
      range.strength_high[place] = without_end;
    if (entry.other_ends && range.negative_high[place] >= kAtTheEnd * other[k])
      range.negative_high[place] = without_end;
  }
  return range;
}

// What is asked of the models of a space.
struct EvidenceQuestion {
  std::vector<inference::MeasuredSet> measured;
  inference::ModelSpace space;
  std::vector<std::vector<inference::StrengthPrior>> priors{};
  inference::EvidenceOptions options;

  absl::StatusOr<std::vector<std::vector<inference::ModelEvidence>>> Of(
      const inference::ModelSpace& models) const {
    return inference::ModelEvidencesUnder(measured, models, priors, options);
  }
};

EvidenceQuestion QuestionOf(const KnownBefore& before, const Knowledge& knowledge, Effort effort,
                            const FurtherMeasured* further) {
  EvidenceQuestion question{.measured = {{.set = knowledge.set.get(), .z = knowledge.z}},
                            .space = SpaceOf(before, knowledge.rows, knowledge.part),
                            .options = {.sampling = {.seed = before.seed}}};
  if (further != nullptr) {
    question.space.models = further->models;
    question.space.log_prior = further->log_prior;
    question.measured.insert(question.measured.end(), further->sets.begin(), further->sets.end());
  }
  const Eigen::VectorXd most = knowledge.rows.Most(), other = knowledge.rows.MostOther();
  double widest_low = std::numeric_limits<double>::infinity(), widest_high = 0;
  const auto prior_of = [&](double low, double high) {
    std::vector<inference::StrengthPrior> prior;
    for (const int k : knowledge.part.kept) {
      // Half of the end, where an effect ends before it is seen.
      prior.push_back({.low = std::min(low, most[k] / 2),
                       .high = std::min(high, most[k]),
                       .negative_low = std::min(low, other[k] / 2),
                       .negative_high = std::min(high, other[k])});
    }
    return prior;
  };
  for (const StrengthWidth& width : kStrengthWidths) {
    question.priors.push_back(prior_of(width.low, width.high));
    widest_low = std::min(widest_low, width.low);
    widest_high = std::max(widest_high, width.high);
    if (effort == Effort::kToChoose) break;
  }
  question.space.strength = prior_of(widest_low, widest_high);
  inference::EvidenceOptions& options = question.options;
  // The width of a probability that runs are chosen by is that of a batch that moves it by a tenth.
  if (effort == Effort::kToChoose) {
    options.sampling.start = 256;
    options.sampling.points = 250;
    options.sampling.iterations = 2;
    options.draws = 64;
    options.realisations = 2;
  } else {
    options.realisations = 16;
  }
  return question;
}

}  // namespace

absl::StatusOr<Knowledge> Learn(const KnownBefore& before, const DesignRows& of_guess,
                                const std::vector<EndedBatch>& batches, bool with_flat) {
  const DesignRows guess = EndingWhereRunsEnd(of_guess, batches);
  Knowledge known{.rows = guess, .part = {}, .set = nullptr};
  for (int k = 0; k < static_cast<int>(guess.race().effects.size()); ++k) {
    if (guess.race().effects[static_cast<std::size_t>(k)].design.calculated ||
        RunsWith(guess, batches, k) >= kFewestRunsOn) {
      known.part.kept.push_back(k);
    } else {
      known.out.emplace_back(k, WhyRunsEnd(guess, batches, k));
    }
  }
  ASSIGN_OR_RETURN(known.set, FitSet(before, guess, batches, known.part));
  SeenUnits seen_units = UnitsSeen(before, guess, known.part, *known.set);
  known.rows = guess.With(guess.axes(), std::move(seen_units.unit));
  known.reached = std::move(seen_units.reached);
  if (with_flat) {
    const inference::ModelSpace space = SpaceOf(before, guess, known.part);
    std::vector<bool> seen(known.part.kept.size(), false);
    for (const EntryStrength& side : SidesOf(guess, known.part)) {
      if (IsSeen(before, space, *known.set, side))
        seen[static_cast<std::size_t>(side.place)] = true;
    }
    PartOfRace part;
    std::vector<bool> reached;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const int k = known.part.kept[i];
      (seen[i] ? part.kept : part.flat).push_back(k);
      if (seen[i]) reached.push_back(known.reached[i]);
      if (!seen[i]) known.out.emplace_back(k, "it changes nothing in these tests that can be seen");
    }
    known.part = std::move(part);
    known.reached = std::move(reached);
  }
  const inference::SetRuns runs = SetRunsOf(before.base, known.rows, batches, known.part);
  ASSIGN_OR_RETURN(known.set, FitSet(before, known.rows, batches, known.part));
  known.z =
      known.set->coordinates()->Of(Eigen::MatrixXd::Zero(1, before.base.histories.cols())).row(0);
  known.range = RangeWithEnds(known.rows, known.part, runs.points);
  known.angles =
      inference::SignatureAngles({known.set.get()}, before.region.centre.transpose(),
                                 Eigen::VectorXd::Ones(static_cast<Index>(known.part.kept.size())));
  if (before.base.unfinished > 0) {
    known.warnings.push_back(absl::StrCat(before.base.unfinished,
                                          " runs of the campaign did not come to their last "
                                          "reading; the emulator does not know them"));
  }
  return known;
}

absl::StatusOr<Knowledge> LearnBase(const KnownBefore& before, const DesignRows& rows,
                                    const std::vector<EndedBatch>& batches) {
  Knowledge known{.rows = rows, .part = {}, .set = nullptr};
  ASSIGN_OR_RETURN(known.set, FitSet(before, rows, batches, known.part));
  known.z =
      known.set->coordinates()->Of(Eigen::MatrixXd::Zero(1, before.base.histories.cols())).row(0);
  known.angles.resize(0, 0);
  return known;
}

absl::StatusOr<Asked> AskEvidences(const KnownBefore& before, const Knowledge& knowledge,
                                   Effort effort) {
  const EvidenceQuestion question = QuestionOf(before, knowledge, effort, nullptr);
  Asked asked{.space = question.space};
  const client::BusyLine busy(kWeighing);
  ASSIGN_OR_RETURN(asked.evidence, question.Of(asked.space));
  return asked;
}

absl::StatusOr<Asked> Ask(const KnownBefore& before, const Knowledge& knowledge, Effort effort,
                          const FurtherMeasured* further) {
  EvidenceQuestion question = QuestionOf(before, knowledge, effort, further);
  Asked asked{.space = question.space};
  const client::BusyLine busy(kWeighing);
  ASSIGN_OR_RETURN(asked.evidence, question.Of(asked.space));
  RETURN_IF_ERROR(SetProbabilities(asked));
  if (effort == Effort::kToChoose || further != nullptr) return asked;
  const auto excluded = ExcludedIn(knowledge.rows.race(), knowledge.part);
  inference::ModelSpace triples = asked.space;
  triples.models = LeadingTriples(asked, excluded);
  if (triples.models.empty()) return asked;
  question.options.first = static_cast<int>(asked.space.models.size());
  ASSIGN_OR_RETURN(auto evidence, question.Of(triples));
  for (std::size_t w = 0; w < evidence.size(); ++w)
    std::move(evidence[w].begin(), evidence[w].end(), std::back_inserter(asked.evidence[w]));
  asked.space.models.insert(asked.space.models.end(), triples.models.begin(), triples.models.end());
  asked.space.triples =
      inference::CountTriples(static_cast<int>(asked.space.effects.size()), excluded);
  RETURN_IF_ERROR(SetProbabilities(asked));
  return asked;
}

std::vector<std::string> EffectsNamed(const Knowledge& knowledge,
                                      const inference::EffectModel& model) {
  std::vector<std::string> names;
  for (const int k : model.effects) {
    const int entry = knowledge.part.kept[static_cast<std::size_t>(k)];
    const std::string& name = knowledge.rows.race().effects[static_cast<std::size_t>(entry)].name;
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  return names;
}

DesignPoints BestDraw(const Knowledge& knowledge, const DesignPoints& draws) {
  Index best = 0;
  knowledge.set->LogDensity(knowledge.z, draws).maxCoeff(&best);
  return inference::RowsOf(draws, {best});
}

Eigen::VectorXd SquaresAsAt(const Knowledge& knowledge, const DesignPoints& at,
                            const DesignPoints& points) {
  const inference::DiagnosisSet& set = *knowledge.set;
  const inference::SpecimenErrors& errors = set.errors();
  Eigen::MatrixXd v = errors.staging * errors.staging.transpose();
  v.diagonal() +=
      inference::DiagonalVariance(set.emulator().Predict(at), errors).row(0).transpose();
  const Eigen::LLT<Eigen::MatrixXd> factor(v);
  const Eigen::MatrixXd r =
      (-set.emulator().Predict(points).mean).rowwise() + knowledge.z.transpose();
  const Eigen::MatrixXd solved = factor.solve(r.transpose());
  return r.cwiseProduct(solved.transpose()).rowwise().sum();
}

Eigen::VectorXd SquaresOfMisfit(const inference::DiagnosisSet& set, const Eigen::VectorXd& z,
                                const DesignPoints& points) {
  const inference::EmulatorPrediction prediction = set.emulator().Predict(points);
  const inference::SpecimenErrors& errors = set.errors();
  const Eigen::MatrixXd diagonal = inference::DiagonalVariance(prediction, errors);
  Eigen::VectorXd squares(points.rows());
  for (Index i = 0; i < points.rows(); ++i) {
    Eigen::MatrixXd v = errors.staging * errors.staging.transpose();
    v.diagonal() += diagonal.row(i).transpose();
    const Eigen::VectorXd r = z - prediction.mean.row(i).transpose();
    squares[i] = r.dot(Eigen::LLT<Eigen::MatrixXd>(v).solve(r));
  }
  return squares;
}

double ChanceOfMisfit(const inference::DiagnosisSet& set, const Eigen::VectorXd& history,
                      const DesignPoints& points, int fitted) {
  const Eigen::VectorXd z = set.coordinates()->Of(history.transpose()).row(0);
  Index closest = 0;
  const double least = SquaresOfMisfit(set, z, points).minCoeff(&closest);
  const auto degrees = static_cast<double>(std::max<Index>(1, z.size() - fitted));
  const double inside =
      inference::FisherLaw{.numerator = degrees, .denominator = set.errors().freedom}.Tail(least /
                                                                                           degrees);
  const double outside =
      set.coordinates()->LeftOut(history, inference::RowsOf(points, {closest})).chance;
  return std::min(1.0, 2 * std::min(inside, outside));
}

}  // namespace calib::diagnosis
