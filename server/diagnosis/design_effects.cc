#include "server/diagnosis/design_effects.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "calib/return_if_error.h"
#include "inference/diagnosis/diagnosis_set.h"
#include "inference/diagnosis/next_measurement.h"
#include "inference/numerics/special_functions.h"
#include "server/campaign/model/race.h"
#include "server/diagnosis/base_misfit.h"
#include "server/diagnosis/design_caps.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;
using inference::DesignPoints;
using inference::ModelEvidence;

constexpr int kPointsOfModel = 3;  // that a next experiment is tried at

// The most probable model of entries whose effects are these; null: none of them has draws.
const ModelEvidence* ModelOf(const Knowledge& known, const Asked& asked,
                             const std::set<std::string>& effects) {
  const ModelEvidence* best = nullptr;
  double most = -1;
  for (std::size_t i = 0; i < asked.evidence[0].size(); ++i) {
    const ModelEvidence& own = asked.evidence[0][i];
    if (own.model.none_of_these || own.draws.rows() == 0) continue;
    const std::vector<std::string> names = EffectsNamed(known, own.model);
    const double probability = asked.probabilities[0].model[static_cast<Index>(i)];
    if (std::set<std::string>(names.begin(), names.end()) != effects || probability <= most)
      continue;
    most = probability;
    best = &own;
  }
  return best;
}

// Values of the base parameters and of the effects of a model.
std::map<std::string, double> ValuesOf(const Knowledge& known, const DesignPoints& draws, Index row,
                                       const std::set<std::string>& effects) {
  const std::vector<double> values =
      known.rows.Values(WholePoints(known.rows, known.part, draws), row);
  const std::vector<std::string>& names = known.rows.names();
  const std::size_t of_base = known.rows.race().base.size();
  std::map<std::string, double> result;
  for (std::size_t j = 0; j < names.size(); ++j) {
    if (j < of_base || effects.count(campaign::EffectNamedIn(names[j])) > 0)
      result[names[j]] = values[j];
  }
  return result;
}

// The best draw, and others spread over the rest.
std::vector<std::map<std::string, double>> PointsOf(const Knowledge& known,
                                                    const ModelEvidence& model,
                                                    const std::set<std::string>& effects) {
  std::vector<std::map<std::string, double>> points = {
      ValuesOf(known, BestDraw(known, model.draws), 0, effects)};
  const Index draws = model.draws.rows();
  for (int i = 1; i < kPointsOfModel && i < draws; ++i)
    points.push_back(ValuesOf(known, model.draws, i * draws / kPointsOfModel, effects));
  return points;
}

std::map<std::string, campaign::FirstProposal::Place> PosteriorOf(
    const Knowledge& known, const DesignPoints& draws, const std::set<std::string>& effects) {
  std::map<std::string, std::vector<double>> values;
  for (Index r = 0; r < draws.rows(); ++r) {
    for (const auto& [name, value] : ValuesOf(known, draws, r, effects))
      values[name].push_back(value);
  }
  std::map<std::string, campaign::FirstProposal::Place> posterior;
  for (const auto& [name, own] : values) {
    const Eigen::Map<const Eigen::VectorXd> all(own.data(), std::ssize(own));
    const double mean = all.mean();
    posterior[name] = {.center = mean, .sd = std::sqrt((all.array() - mean).square().mean())};
  }
  return posterior;
}

// Medians of an effect's parameters over draws.
std::map<std::string, double> MediansOf(const Knowledge& known, const DesignPoints& draws,
                                        const std::string& effect) {
  std::map<std::string, std::vector<double>> values;
  for (Index r = 0; r < draws.rows(); ++r) {
    for (const auto& [name, value] : ValuesOf(known, draws, r, {effect})) {
      if (campaign::EffectNamedIn(name) == effect) values[name].push_back(value);
    }
  }
  std::map<std::string, double> medians;
  for (auto& [name, own] : values) {
    const auto middle = own.begin() + static_cast<std::ptrdiff_t>(own.size() / 2);
    std::nth_element(own.begin(), middle, own.end());
    medians[name] = *middle;
  }
  return medians;
}

std::vector<ChangedCurve> CurvesOf(const HistoryScale& scale, const Eigen::RowVectorXd& with,
                                   const Eigen::RowVectorXd& without) {
  const Eigen::RowVectorXd change = scale.Readings(with) - scale.Readings(without);
  std::vector<ChangedCurve> curves;
  std::size_t column = 0;
  for (std::size_t c = 0; c < scale.curves().size(); ++c) {
    ChangedCurve& curve = curves.emplace_back();
    curve.experiment = scale.names()[c].first;
    curve.observable = scale.names()[c].second;
    for (Index i = 0; i < scale.curves()[c].path.size(); ++i)
      curve.change.push_back(change[scale.order()[column++]]);
  }
  return curves;
}

Eigen::RowVectorXd HistoryAt(const Knowledge& known, const DesignPoints& point) {
  return known.set->coordinates()->HistoriesAt(point).row(0);
}

// Of a model's draws the one that comes closest to the measurement, with the errors that the base
// model has at its best: an emulator that knows an effect less well excuses nothing.
struct Closest {
  double square = 0;
  Eigen::RowVectorXd history;
};

Closest ClosestOf(const Knowledge& known, const DesignPoints& base_at_best,
                  const ModelEvidence& model) {
  Index row = 0;
  const double square = SquaresAsAt(known, base_at_best, model.draws).minCoeff(&row);
  return {.square = square, .history = HistoryAt(known, inference::RowsOf(model.draws, {row}))};
}

// Chance that a right base model comes closer by as much with strengths: each takes one square of
// Student's law. Half of that of one lies at zero where it has one sign.
double ChanceOfCloser(const Knowledge& known, double closer, std::size_t of_strengths,
                      bool two_sided) {
  if (!(closer > 0)) return 1;
  const auto strengths = static_cast<double>(of_strengths);
  const inference::FisherLaw law{.numerator = strengths,
                                 .denominator = known.set->errors().freedom};
  return (two_sided || of_strengths > 1 ? 1 : 0.5) * law.Tail(closer / strengths);
}

void DescribeEffect(const KnownBefore& before, const Knowledge& known, const Asked& asked,
                    const DesignPoints& base_at_best, const Closest& base, const Answer& answer,
                    EffectAnswer& own) {
  const Race& race = known.rows.race();
  bool two_sided = false;
  for (std::size_t i = 0; i < known.part.kept.size(); ++i) {
    const int k = known.part.kept[i];
    const RacingEffect& entry = race.effects[static_cast<std::size_t>(k)];
    if (entry.name != own.effect) continue;
    two_sided = two_sided || entry.design.two_sided;
    if (known.reached[i])
      own.visible[entry.strength] = entry.null + (entry.near > 0 ? 1 : -1) * known.rows.unit()[k];
    for (std::size_t j = 0; j < known.part.kept.size(); ++j) {
      const int l = known.part.kept[j];
      const std::string& other = race.effects[static_cast<std::size_t>(l)].name;
      if (other == own.effect) continue;
      const double angle = known.angles(static_cast<Index>(i), static_cast<Index>(j));
      const auto [place, fresh] = own.angles.try_emplace(other, angle);
      if (!fresh) place->second = std::min(place->second, angle);
    }
  }
  own.rms = answer.rms;
  const ModelEvidence* model = ModelOf(known, asked, {own.effect});
  if (model == nullptr) return;
  own.amplitude = MediansOf(known, model->draws, own.effect);
  const Closest closest = ClosestOf(known, base_at_best, *model);
  own.rms = RmsOf(before.base, closest.history);
  const double without = RmsOf(before.base, base.history);
  const double excess = without * without - 1;
  if (excess > 0) own.explained = std::clamp((excess + 1 - own.rms * own.rms) / excess, 0.0, 1.0);
  // Closer in the coordinates and further off in what these leave out is no closer.
  if (own.rms < without) {
    own.p_value =
        ChanceOfCloser(known, base.square - closest.square, model->model.effects.size(), two_sided);
  }
  if (own.probability >= kDesignCaps.asked)
    own.curves = CurvesOf(before.base.scale, closest.history, base.history);
}

}  // namespace

absl::Status DescribeEffects(const KnownBefore& before, const Knowledge& known, const Asked& asked,
                             Answer& answer) {
  for (NamedModel& named : answer.probabilities) {
    const bool base = named.effects.empty();
    if (named.none_of_these || (!base && named.probability < kDesignCaps.asked)) continue;
    const std::set<std::string> effects(named.effects.begin(), named.effects.end());
    const ModelEvidence* model = ModelOf(known, asked, effects);
    if (model == nullptr) continue;
    named.points = PointsOf(known, *model, effects);
    for (Index i = 0; i < kDrawsOfModel; ++i) {
      named.draws.push_back(
          ValuesOf(known, model->draws, i * model->draws.rows() / kDrawsOfModel, effects));
    }
    named.posterior = PosteriorOf(known, model->draws, effects);
    named.rms = RmsOf(before.base, HistoryAt(known, BestDraw(known, model->draws)));
  }
  const ModelEvidence* base_model = ModelOf(known, asked, {});
  if (base_model == nullptr) return absl::OkStatus();
  const DesignPoints base_at_best = BestDraw(known, base_model->draws);
  const Closest base = ClosestOf(known, base_at_best, *base_model);
  for (EffectAnswer& own : answer.candidates)
    DescribeEffect(before, known, asked, base_at_best, base, answer, own);
  if (known.part.kept.empty()) return absl::OkStatus();
  ASSIGN_OR_RETURN(
      const inference::Forecast repeat,
      inference::ExpectedInformation({.set = known.set.get(), .measured = known.z},
                                     asked.evidence[0], asked.probabilities[0],
                                     {.leading = kDesignCaps.asked, .seed = before.seed}));
  answer.repeat_names_alone = repeat.named_right;
  return absl::OkStatus();
}

}  // namespace calib::diagnosis
