#include "inference/diagnosis/visible_strength.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "inference/numerics/decompositions.h"
#include "inference/sampling/sobol.h"

namespace calib::inference {
namespace {

using Eigen::Index;

// Means of all sets side by side, in sd of a measurement, m x sum of q.
Eigen::MatrixXd WhitenedMeans(const std::vector<const DiagnosisSet*>& sets,
                              const DesignPoints& points) {
  Index total = 0;
  for (const DiagnosisSet* set : sets) total += set->emulator().coordinates();
  Eigen::MatrixXd result(points.rows(), total);
  Index column = 0;
  for (const DiagnosisSet* set : sets) {
    const SpecimenErrors& errors = set->errors();
    const Eigen::VectorXd sd = errors.OfMeasurement().cwiseSqrt();
    result.middleCols(column, sd.size()) =
        set->emulator().PredictMean(points) * sd.cwiseInverse().asDiagonal();
    column += sd.size();
  }
  return result;
}

// Derivatives of the base model's means by its d parameters at one point, sum of q x d.
Eigen::MatrixXd WhitenedSensitivities(const std::vector<const DiagnosisSet*>& sets,
                                      const Eigen::MatrixXd& base) {
  std::vector<Eigen::VectorXd> parts;
  Index total = 0;
  for (const DiagnosisSet* set : sets) total += set->emulator().coordinates();
  Eigen::MatrixXd result(total, base.cols());
  Index row = 0;
  for (const DiagnosisSet* set : sets) {
    const SpecimenErrors& errors = set->errors();
    const Eigen::ArrayXd sd = errors.OfMeasurement().cwiseSqrt();
    for (Index j = 0; j < base.cols(); ++j) {
      result.col(j).segment(row, sd.size()) =
          set->emulator().BaseDerivative(base, j).row(0).transpose().array() / sd;
    }
    row += sd.size();
  }
  return result;
}

DesignPoints BaseOnly(const DesignPoints& like, const Eigen::MatrixXd& base) {
  return {.base = base,
          .strength = Eigen::MatrixXd::Zero(base.rows(), like.strength.cols()),
          .shape = Eigen::MatrixXd::Zero(base.rows(), like.shape.cols())};
}

// Smallest squared distance from `target` on the way downhill from `base`.
double DescendTo(const std::vector<const DiagnosisSet*>& sets, const ModelSpace& space,
                 const DesignPoints& like, const Eigen::VectorXd& target, Eigen::RowVectorXd base) {
  const auto residual = [&](const Eigen::RowVectorXd& at) {
    return Eigen::VectorXd(target - WhitenedMeans(sets, BaseOnly(like, at)).row(0).transpose());
  };
  Eigen::VectorXd r = residual(base);
  for (int step = 0; step < 20; ++step) {
    const Eigen::MatrixXd j = WhitenedSensitivities(sets, base);
    const Eigen::VectorXd move =
        Solved(Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(j), Eigen::MatrixXd(r)).col(0);
    bool closer = false;
    for (double length = 1; length > 0.1 && !closer; length /= 2) {
      const Eigen::RowVectorXd next = (base + length * move.transpose())
                                          .cwiseMax(space.base_low.transpose())
                                          .cwiseMin(space.base_high.transpose());
      const Eigen::VectorXd other = residual(next);
      if (other.squaredNorm() < r.squaredNorm() * (1 - 1e-6)) {
        base = next;
        r = other;
        closer = true;
      }
    }
    if (!closer) break;
  }
  return r.squaredNorm();
}

}  // namespace

double SquaredDistanceFromBase(const std::vector<const DiagnosisSet*>& sets,
                               const ModelSpace& space, const DesignPoints& point) {
  const Eigen::VectorXd target = WhitenedMeans(sets, point).row(0);
  const Index d = point.base.cols();
  const Eigen::MatrixXd net = (ScrambledSobol(128, static_cast<int>(d), 0) *
                               (space.base_high - space.base_low).asDiagonal())
                                  .rowwise() +
                              space.base_low.transpose();
  Index nearest = 0;
  (WhitenedMeans(sets, BaseOnly(point, net)).rowwise() - target.transpose())
      .rowwise()
      .squaredNorm()
      .minCoeff(&nearest);
  return std::min(DescendTo(sets, space, point, target, point.base.row(0)),
                  DescendTo(sets, space, point, target, net.row(nearest)));
}

double StrengthOfLambda(const std::vector<const DiagnosisSet*>& sets, const ModelSpace& space,
                        const Eigen::RowVectorXd& base, const StrengthQuestion& question) {
  DesignPoints point{.base = base,
                     .strength = Eigen::MatrixXd::Zero(1, static_cast<Index>(space.effects.size())),
                     .shape = Eigen::MatrixXd::Zero(1, space.shape_low.size())};
  double last_strength = 0, last = 0;
  for (int i = 0; i <= 32; ++i) {
    const double strength = question.largest * std::pow(100.0, i / 32.0 - 1);
    point.strength(0, question.effect) = question.sign * strength;
    const double lambda = SquaredDistanceFromBase(sets, space, point);
    if (lambda >= question.lambda) {
      if (i == 0 || last <= 0) return strength;
      const double t = std::log(question.lambda / last) / std::log(lambda / last);
      return last_strength * std::pow(strength / last_strength, t);
    }
    last_strength = strength;
    last = lambda;
  }
  return question.largest;
}

Eigen::MatrixXd SignatureAngles(const std::vector<const DiagnosisSet*>& sets,
                                const Eigen::RowVectorXd& base, const Eigen::VectorXd& strength) {
  const std::vector<DesignEffect>& effects = sets[0]->emulator().features().effects();
  const auto k = static_cast<Index>(effects.size());
  const DesignPoints points{
      .base = base.replicate(k, 1),
      .strength = strength.asDiagonal(),
      .shape = Eigen::MatrixXd::Zero(k, sets[0]->emulator().features().shape_count())};
  Eigen::MatrixXd change =
      WhitenedMeans(sets, points) - WhitenedMeans(sets, WithoutEffects(points));  // K x sum of q
  const Eigen::MatrixXd along =
      OrthonormalColumns(Eigen::HouseholderQR<Eigen::MatrixXd>(WhitenedSensitivities(sets, base)));
  change -= (change * along) * along.transpose();
  const Eigen::VectorXd length = change.rowwise().norm();
  Eigen::MatrixXd result(k, k);
  for (Index a = 0; a < k; ++a) {
    for (Index b = 0; b < k; ++b) {
      double cosine = 0;
      if (length[a] > 0 && length[b] > 0)
        cosine = std::clamp(change.row(a).dot(change.row(b)) / (length[a] * length[b]), -1.0, 1.0);
      if (effects[static_cast<std::size_t>(a)].two_sided ||
          effects[static_cast<std::size_t>(b)].two_sided)
        cosine = std::abs(cosine);
      result(a, b) = a == b ? 0 : std::acos(cosine) * 180 / M_PI;
    }
  }
  return result;
}

}  // namespace calib::inference
