#include "server/diagnosis/base_misfit.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "calib/return_if_error.h"
#include "inference/diagnosis/diagnosis_set.h"
#include "inference/numerics/special_functions.h"

namespace calib::diagnosis {
namespace {

using Eigen::Index;

// Root mean square of each observable beyond one, the part of the noise.
std::map<std::string, double> MissedOf(const HistoryScale& scale,
                                       const Eigen::RowVectorXd& history) {
  std::map<std::string, std::pair<double, double>> squares;  // sum, number
  Index column = 0;
  for (std::size_t c = 0; c < scale.curves().size(); ++c) {
    const Index n = scale.curves()[c].path.size();
    auto& [sum, number] = squares[scale.names()[c].second];
    sum += history.segment(column, n).squaredNorm();
    number += static_cast<double>(n);
    column += n;
  }
  std::map<std::string, double> missed;
  for (const auto& [observable, of] : squares)
    missed[observable] = std::sqrt(std::max(0.0, of.first / of.second - 1));
  return missed;
}

}  // namespace

double RmsOf(const BaseRuns& base, const Eigen::RowVectorXd& history) {
  return std::sqrt(history.cwiseQuotient(base.sd.transpose()).cwiseAbs2().mean());
}

absl::StatusOr<BaseMisfit> MisfitOfBase(const KnownBefore& before, const DesignRows& rows,
                                        const std::vector<EndedBatch>& batches) {
  ASSIGN_OR_RETURN(const Knowledge known, LearnBase(before, rows, batches));
  ASSIGN_OR_RETURN(const Asked asked, AskEvidences(before, known, Effort::kToChoose));
  const inference::DesignPoints& draws = asked.evidence[0].front().draws;  // of the base model
  if (draws.rows() == 0) {
    return absl::FailedPreconditionError(
        "no point of the model has a density that the readings could be judged by");
  }
  BaseMisfit misfit;
  const auto parameters = static_cast<int>(rows.race().base.size());
  const inference::SpecimenErrors& errors = known.set->errors();
  const inference::DesignPoints best = BestDraw(known, draws);
  const Eigen::RowVectorXd history = known.set->coordinates()->HistoriesAt(best).row(0);
  misfit.chance = ChanceOfMisfit(*known.set, Eigen::VectorXd::Zero(before.base.histories.cols()),
                                 draws, parameters);
  misfit.square = SquaresOfMisfit(*known.set, known.z, draws).minCoeff();
  misfit.degrees = static_cast<double>(std::max<Index>(1, known.z.size() - parameters));
  misfit.chance_of_square =
      inference::FisherLaw{.numerator = misfit.degrees, .denominator = errors.freedom}.Tail(
          misfit.square / misfit.degrees);
  misfit.rms = RmsOf(before.base, history);
  misfit.missed = MissedOf(before.base.scale, history);
  misfit.scatter = std::sqrt(errors.specimen.sum() / errors.noise.sum());
  return misfit;
}

}  // namespace calib::diagnosis
