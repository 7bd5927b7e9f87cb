#include "inference/diagnosis/screen.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>
#include <set>

#include "calib/return_if_error.h"
#include "inference/diagnosis/drawn_tail.h"
#include "inference/diagnosis/fall_tail.h"
#include "inference/diagnosis/whitened.h"
#include "inference/numerics/decompositions.h"
#include "inference/numerics/special_functions.h"
#include "inference/sampling/philox.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// The verdicts' limits; chosen.
constexpr double kPower = 0.9;         // chance that an effect of Score::detectable is found
constexpr double kNotExcluded = 0.95;  // probability inside which points are not excluded
constexpr double kSmall = 0.1;         // p value whose frequency tells judgements' independence
constexpr double kClose = 25;          // degrees between signatures that may be confused
// Times the chi-squared of a right model: what a rival at an angle to the truth leaves is beyond
// doubt when it is more.
constexpr double kToldApart = 4;
constexpr Index kFewestBlocks = 8;  // that an advantage is resampled by

// A difference seen from every point.
struct Direction {
  Eigen::VectorXd whitened;  // T
  double square = 0;
  Eigen::VectorXd along;  // G, points . whitened
};

double Amplitude(double slope, double square, bool two_sided, double limit) {
  if (!(square > 0)) return 0;
  return std::clamp(-slope / square, two_sided ? -limit : 0.0, limit);
}

std::vector<std::vector<Direction>> DirectionsOf(const std::vector<Signature>& candidates,
                                                 const Whitened& model) {
  std::vector<std::vector<Direction>> directions;
  for (const Signature& candidate : candidates) {
    std::vector<Direction>& own = directions.emplace_back();
    for (const Eigen::VectorXd& difference : candidate.differences) {
      Direction direction{
          .whitened = model.factor->matrixL().solve(difference), .square = 0, .along = {}};
      direction.square = direction.whitened.squaredNorm();
      direction.along = Along(model, direction.whitened);
      own.push_back(std::move(direction));
    }
  }
  return directions;
}

// Variance of the draws along a direction that has unit length in `model`'s coordinates, were
// each group's as large as `model`'s.
double VarianceAlong(const Eigen::VectorXd& direction, const Whitened& model,
                     const std::vector<DrawnGroup>& groups) {
  if (groups.empty() || direction.isZero()) return 1;
  const Eigen::VectorXd unwhitened = model.factor->matrixL() * direction;
  double sum = 0;
  double count = 0;
  for (const DrawnGroup& group : groups) {
    const Eigen::VectorXd own = group.model.factor->matrixL().solve(unwhitened);
    sum += (own.transpose() * group.draws).squaredNorm() / own.squaredNorm();
    count += static_cast<double>(group.draws.cols());
  }
  return sum / count;
}

struct Fit {
  double chi2 = std::numeric_limits<double>::infinity();
  double amplitude = 0;
  int difference = 0;
  Index point = 0;
};

// Smallest |point + u + a w|^2; `distances` holds |point + u|^2 for all points.
Fit BestFit(const std::vector<Direction>& directions, const Eigen::VectorXd& distances,
            const Eigen::VectorXd* offset, bool two_sided, double limit) {
  Fit best;
  for (std::size_t k = 0; k < directions.size(); ++k) {
    const Direction& direction = directions[k];
    const double shift = offset == nullptr ? 0 : direction.whitened.dot(*offset);
    for (Index g = 0; g < distances.size(); ++g) {
      const double slope = direction.along[g] + shift;
      const double a = Amplitude(slope, direction.square, two_sided, limit);
      const double chi2 = distances[g] + a * (2 * slope + a * direction.square);
      if (chi2 < best.chi2) {
        best = {.chi2 = chi2, .amplitude = a, .difference = static_cast<int>(k), .point = g};
      }
    }
  }
  return best;
}

// Holm's step-down adjustment of ascending p values.
void Holm(std::vector<Score>& scores) {
  double running = 0;
  const std::size_t n = scores.size();
  for (std::size_t i = 0; i < n; ++i) {
    running = std::max(running, std::min(1.0, static_cast<double>(n - i) * scores[i].p_value));
    scores[i].adjusted = running;
  }
}

// Square of what an effect changes, without what chance adds to differences of single runs: from
// products of different ones, each taken to the last strength. Of a single one its own square.
double SquareOfEffect(const std::vector<Eigen::VectorXd>& differences,
                      const std::vector<double>& strengths, double length) {
  if (strengths.size() < 2 || strengths.size() != differences.size()) return length * length;
  double sum = 0;
  int pairs = 0;
  for (std::size_t a = 0; a < differences.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b, ++pairs) {
      sum += differences[a].dot(differences[b]) / (strengths[a] * strengths[b]);
    }
  }
  return sum / pairs * strengths.back() * strengths.back();
}

// Orthonormal, in the model's coordinates.
Eigen::MatrixXd SpanOf(const Eigen::MatrixXd& shapes, const Whitened& model) {
  const Eigen::MatrixXd whitened = LowerSolved(*model.factor, shapes);
  return OrthonormalColumns(Eigen::HouseholderQR<Eigen::MatrixXd>(whitened));
}

// How many independent judgements the columns of `squares` (draws in rows) amount to: by how much
// oftener than one of them their smallest p value is below a tenth.
double IndependentJudgements(const Eigen::MatrixXd& squares, const std::vector<DrawnTail>& tails) {
  double below = 0;
  for (Index s = 0; s < squares.rows(); ++s) {
    double smallest = 1;
    for (Index k = 0; k < squares.cols(); ++k) {
      smallest = std::min(smallest, tails[static_cast<std::size_t>(k)](squares(s, k)));
    }
    below += smallest < kSmall ? 1 : 0;
  }
  return std::clamp(below / (kSmall * static_cast<double>(squares.rows())), 1.0,
                    static_cast<double>(squares.cols()));
}

}  // namespace

absl::StatusOr<Adequacy> TestAdequacy(const FittedModel& model) {
  ASSIGN_OR_RETURN(const auto whitened, Whiten(model));
  Adequacy adequacy;
  adequacy.chi2 = whitened.squares.minCoeff(&adequacy.best);
  if (model.draws.rows() == 0) {
    adequacy.degrees = static_cast<double>(model.histories.readings() - model.parameters);
    adequacy.p_chi2 =
        adequacy.degrees > 0 ? GammaQ(0.5 * adequacy.degrees, 0.5 * adequacy.chi2) : 1;
    adequacy.p_value = adequacy.p_chi2;
    return adequacy;
  }
  for (const Eigen::MatrixXd& shapes : model.shapes) {
    if (shapes.rows() != model.histories.readings() || shapes.cols() >= shapes.rows()) {
      return absl::InvalidArgumentError("diagnosis: shapes do not fit the histories");
    }
  }
  ASSIGN_OR_RETURN(const auto groups, DrawsOf(model));
  // For each draw its chi-squared, and that of the residual's part in the span of each set of
  // shapes.
  Eigen::MatrixXd squares(model.draws.rows(), static_cast<Index>(1 + model.shapes.size()));
  for (const DrawnGroup& group : groups) {
    const Eigen::MatrixXd offsets = group.draws.colwise() - group.model.Point(adequacy.best);
    const Nearest nearest = NearestTo(group.model, offsets);
    squares(group.number, 0) = nearest.squares;
    const Eigen::MatrixXd residuals =
        group.model.axes * group.model.points(Eigen::all, nearest.points) + offsets;
    for (std::size_t k = 0; k < model.shapes.size(); ++k) {
      squares(group.number, static_cast<Index>(k + 1)) =
          (SpanOf(model.shapes[k], group.model).transpose() * residuals).colwise().squaredNorm();
    }
  }
  std::vector<DrawnTail> tails;
  for (Index k = 0; k < squares.cols(); ++k) {
    if (model.without.empty()) {
      tails.emplace_back(squares.col(k), std::vector<int>{}, std::max(0, model.packings - 1));
    } else {
      tails.emplace_back(squares.col(k), model.group);
    }
  }
  if (!tails.front().varies()) {
    return absl::InvalidArgumentError("diagnosis: the draws do not vary");
  }
  adequacy.degrees = tails.front().mean();
  adequacy.p_chi2 = tails.front()(adequacy.chi2);
  const Eigen::VectorXd residual = whitened.Point(adequacy.best);
  for (std::size_t k = 0; k < model.shapes.size(); ++k) {
    const double square = (SpanOf(model.shapes[k], whitened).transpose() * residual).squaredNorm();
    adequacy.p_shapes = std::min(adequacy.p_shapes.value_or(1), tails[k + 1](square));
  }
  adequacy.p_value = std::min(1.0, IndependentJudgements(squares, tails) *
                                       std::min(adequacy.p_chi2, adequacy.p_shapes.value_or(1)));
  return adequacy;
}

absl::StatusOr<std::vector<Index>> PointsNotExcluded(const FittedModel& model, int count) {
  ASSIGN_OR_RETURN(const auto whitened, Whiten(model));
  const Eigen::VectorXd& squares = whitened.squares;
  std::vector<Index> near(static_cast<std::size_t>(squares.size()));
  std::iota(near.begin(), near.end(), Index{0});
  const double most =
      squares.minCoeff() + 2 * GammaPInverse(0.5 * std::max(1, model.parameters), kNotExcluded);
  std::erase_if(near, [&](Index i) { return squares[i] > most; });
  std::stable_sort(near.begin(), near.end(),
                   [&](Index a, Index b) { return squares[a] < squares[b]; });
  near.erase(near.begin());  // the closest
  const auto wanted = std::min(static_cast<std::size_t>(count), near.size());
  std::vector<Index> some;
  for (std::size_t k = 0; k < wanted; ++k)
    some.push_back(near[(2 * k + 1) * near.size() / (2 * wanted)]);
  return some;
}

double ExplainableMisfit(const Adequacy& base) {
  return std::max(base.chi2 - base.degrees, std::sqrt(2 * base.degrees));
}

absl::StatusOr<std::vector<Score>> Screen(const FittedModel& model,
                                          const std::vector<Signature>& candidates,
                                          const ScreenOptions& options) {
  ASSIGN_OR_RETURN(const auto whitened, Whiten(model));
  ASSIGN_OR_RETURN(const auto adequacy, TestAdequacy(model));
  ASSIGN_OR_RETURN(const auto groups, DrawsOf(model));
  const Index t = model.histories.readings();
  for (const Signature& candidate : candidates) {
    for (const Eigen::VectorXd& difference : candidate.differences) {
      if (difference.size() != t || !difference.allFinite()) {
        return absl::InvalidArgumentError("diagnosis: a signature does not fit the histories");
      }
    }
  }
  const std::vector<std::vector<Direction>> directions = DirectionsOf(candidates, whitened);
  // Measurements of the fitted model itself.
  const Eigen::VectorXd fitted = whitened.Point(adequacy.best);
  std::vector<std::vector<double>> simulated(candidates.size());
  const auto simulate = [&](const Whitened& own, const std::vector<std::vector<Direction>>& along,
                            const Eigen::VectorXd& drawn) {
    const Eigen::VectorXd offset = drawn - own.Point(adequacy.best);
    const Eigen::VectorXd distances = DistancesFrom(own, offset);
    const double base = distances.minCoeff();
    for (std::size_t c = 0; c < candidates.size(); ++c) {
      simulated[c].push_back(base - BestFit(along[c], distances, &offset, candidates[c].two_sided,
                                            options.max_amplitude)
                                        .chi2);
    }
  };
  for (const DrawnGroup& group : groups) {
    const std::vector<std::vector<Direction>> along = DirectionsOf(candidates, group.model);
    for (Index k = 0; k < group.draws.cols(); ++k) simulate(group.model, along, group.draws.col(k));
  }
  for (int s = 0; groups.empty() && s < options.simulations; ++s) {
    PhiloxStream stream({.seed = options.seed,
                         .purpose = StreamPurpose::kDiagnosisNull,
                         .iteration = 0,
                         .sample = static_cast<std::uint64_t>(s)});
    Eigen::VectorXd drawn(t);
    for (Index k = 0; k < t; ++k) drawn[k] = stream.Normal();
    simulate(whitened, directions, drawn);
  }
  std::vector<Score> scores;
  std::vector<Eigen::VectorXd> visible;  // what no choice of the parameters imitates
  const double excess = ExplainableMisfit(adequacy);
  // In sd along a direction: either sign of every difference of every candidate is a chance.
  const auto reach = [&](std::size_t differences) {
    const auto chances = static_cast<double>(candidates.size() * differences);
    return SdAsked(options.level / chances, model) + NormalTailQuantile(1 - kPower);
  };
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    Score score{.name = candidates[c].name};
    const Fit fit = BestFit(directions[c], whitened.squares, nullptr, candidates[c].two_sided,
                            options.max_amplitude);
    if (std::isfinite(fit.chi2)) {
      score.gain = std::max(0.0, adequacy.chi2 - fit.chi2);
      score.amplitude = fit.amplitude;
      score.difference = fit.difference;
      score.explained = std::clamp(score.gain / excess, 0.0, 1.0);
      const Eigen::VectorXd left =
          model.histories[fit.point] +
          fit.amplitude * candidates[c].differences[static_cast<std::size_t>(fit.difference)];
      score.rms = std::sqrt(left.squaredNorm() / static_cast<double>(t));
    }
    score.p_value = ChanceOfFall(score.gain, {.simulated = simulated[c],
                                              .freedom = 1,
                                              .packings = model.packings,
                                              .left_out = !model.without.empty()});
    std::vector<Eigen::VectorXd> rests;  // that the parameters do not imitate
    for (const Direction& direction : directions[c]) {
      // The point that imitates the effect best, seen from the fitted one.
      Index imitation = 0;
      (whitened.squares - 2 * Along(whitened, fitted + direction.whitened)).minCoeff(&imitation);
      rests.emplace_back(fitted + direction.whitened - whitened.Point(imitation));
    }
    const auto longest = std::max_element(
        rests.begin(), rests.end(),
        [](const auto& x, const auto& y) { return x.squaredNorm() < y.squaredNorm(); });
    const Eigen::VectorXd strongest = rests.empty() ? Eigen::VectorXd::Zero(t) : *longest;
    const double length = strongest.norm();
    visible.push_back(length > 0 ? Eigen::VectorXd(strongest / length) : strongest);
    const double sd = std::sqrt(VarianceAlong(visible.back(), whitened, groups));
    const double square = SquareOfEffect(rests, candidates[c].strengths, length);
    score.detectable = square > 0 ? reach(rests.size()) * sd / std::sqrt(square)
                                  : std::numeric_limits<double>::infinity();
    const bool on_one_ray = candidates[c].strengths.size() > 1;
    score.detectable_difference = static_cast<int>(
        on_one_ray ? rests.size() - 1 : static_cast<std::size_t>(longest - rests.begin()));
    scores.push_back(std::move(score));
  }
  for (std::size_t a = 0; a < scores.size(); ++a) {
    for (std::size_t b = 0; b < scores.size(); ++b) {
      if (a == b) continue;
      const double cosine = visible[a].dot(visible[b]);
      const bool either_sign = candidates[a].two_sided || candidates[b].two_sided;
      const double angle =
          std::acos(std::clamp(either_sign ? std::abs(cosine) : cosine, -1.0, 1.0)) * 180 /
          std::numbers::pi;
      scores[a].angles[scores[b].name] = angle;
      const double sine = std::sin(angle * std::numbers::pi / 180);
      const double left = sine * sine * std::max(scores[a].gain, scores[b].gain);
      if (angle < kClose && left < kToldApart * adequacy.degrees) {
        scores[a].confusable_with.push_back(scores[b].name);
      }
    }
    std::stable_sort(scores[a].confusable_with.begin(), scores[a].confusable_with.end(),
                     [&angles = scores[a].angles](const std::string& x, const std::string& y) {
                       return angles.at(x) < angles.at(y);
                     });
  }
  std::stable_sort(scores.begin(), scores.end(), [](const Score& a, const Score& b) {
    return a.p_value != b.p_value ? a.p_value < b.p_value : a.gain > b.gain;
  });
  Holm(scores);
  return scores;
}

absl::StatusOr<double> SignificanceOfGain(const FittedModel& base, const FittedModel& extended) {
  ASSIGN_OR_RETURN(const auto whitened, Whiten(base));
  if (base.draws.rows() == 0 || extended.parameters <= base.parameters ||
      extended.histories.readings() != base.histories.readings() ||
      extended.histories.points() < 1 || !extended.histories.AllFinite()) {
    return absl::InvalidArgumentError(
        "diagnosis: a gain needs draws of the base model and an extension of it");
  }
  ASSIGN_OR_RETURN(const auto groups, DrawsOf(base));
  Index best = 0;
  const double chi2 = whitened.squares.minCoeff(&best);
  std::vector<double> gains;
  for (const DrawnGroup& group : groups) {
    const Eigen::MatrixXd offsets = group.draws.colwise() - group.model.Point(best);
    const Eigen::VectorXd own =
        NearestTo(group.model, offsets).squares -
        NearestTo(WhitenBy(group.model.factor, extended.histories), offsets).squares;
    for (const double gain : own) gains.push_back(std::max(0.0, gain));
  }
  const Whitened larger = WhitenBy(whitened.factor, extended.histories);
  return ChanceOfFall(std::max(0.0, chi2 - larger.squares.minCoeff()),
                      {.simulated = std::move(gains),
                       .freedom = std::max(1, extended.parameters - base.parameters),
                       .packings = base.packings,
                       .left_out = !base.without.empty()});
}

absl::StatusOr<Advantage> Compare(const FittedModel& a, const FittedModel& b, int block) {
  std::vector<Eigen::VectorXd> terms;  // minus log density, reading given the earlier ones
  for (const FittedModel* model : {&a, &b}) {
    ASSIGN_OR_RETURN(const auto whitened, Whiten(*model));
    Index best = 0;
    whitened.squares.minCoeff(&best);
    const Eigen::MatrixXd lower = whitened.factor->matrixL();
    terms.emplace_back(0.5 * whitened.Point(best).array().square() +
                       lower.diagonal().array().log());
  }
  if (terms[0].size() != terms[1].size() || block < 1) {
    return absl::InvalidArgumentError("diagnosis: the models describe different readings");
  }
  const Eigen::VectorXd difference = terms[1] - terms[0];
  const Index length =
      std::min<Index>(block, std::max<Index>(1, difference.size() / kFewestBlocks));
  std::vector<double> sums;
  for (Index k = 0; k < difference.size(); k += length) {
    sums.push_back(difference.segment(k, std::min(length, difference.size() - k)).sum());
  }
  if (sums.size() < 2) {  // one reading says nothing of its own chance
    return Advantage{.nats = difference.sum(), .sd = std::numeric_limits<double>::infinity()};
  }
  // Resampling n blocks with replacement: the standard deviation of the sum in closed form.
  const auto n = static_cast<double>(sums.size());
  const double mean = std::accumulate(sums.begin(), sums.end(), 0.0) / n;
  double square = 0;
  for (const double sum : sums) square += (sum - mean) * (sum - mean);
  return Advantage{.nats = difference.sum(), .sd = std::sqrt(square * n / (n - 1))};
}

absl::StatusOr<double> LeftOutError(const FittedModel& model, const std::vector<int>& group) {
  const Index t = model.histories.readings();
  const std::set<int> groups(group.begin(), group.end());
  if (static_cast<Index>(group.size()) != t || groups.size() < 2) {
    return absl::InvalidArgumentError(
        "diagnosis: leaving out needs two groups of readings or more");
  }
  // The model at some of the readings.
  const auto at = [&model](const std::vector<Index>& readings) {
    return FittedModel{.histories = model.histories.At(readings),
                       .covariance = model.covariance(readings, readings),
                       .parameters = model.parameters};
  };
  double sum = 0;
  for (const int one : groups) {
    std::vector<Index> own;
    std::vector<Index> others;
    for (Index k = 0; k < t; ++k)
      (group[static_cast<std::size_t>(k)] == one ? own : others).push_back(k);
    ASSIGN_OR_RETURN(const auto fitted, Whiten(at(others)));
    ASSIGN_OR_RETURN(const auto judged, Whiten(at(own)));
    Index best = 0;
    fitted.squares.minCoeff(&best);
    sum += judged.squares[best];
  }
  return std::sqrt(sum / static_cast<double>(t));
}

}  // namespace calib::inference
