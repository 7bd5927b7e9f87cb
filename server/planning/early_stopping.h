#pragma once
// Early stopping with a bound: an evaluation ends as soon as even perfect agreement with every
// reading to come could not give its sample a weight that counts.
//
// Thresholds are fixed when an iteration starts, from the complete iterations before it. A sample's
// experiments run one after the other, each judged by its own states and those of the ones before
// it; once one is stopped, those behind it are not run. The same states are stored whatever arrives
// first.
// A campaign that decides at once (decisions.h) takes them again whenever a run ends, with the mass
// that has finished by then, its own iteration's among it.
// Weights are those that guide the campaign (inference::GuidingExponent): the plain ones where they
// carry the posterior, otherwise tempered until a fifth of the samples count. A posterior sampled
// on an emulator needs those samples' states: a run's own likelihood is a lottery of tens of nats,
// so that untempered weights would stop runs in the very middle of the posterior. A campaign may
// give the exponent itself (`early_stopping.exponent`, 1: the posterior's own weights), where it is
// to save what it can and its weights or a narrow emulator are to answer.
//
// When an iteration ends the bounds are taken again with the weights as they are then, and samples
// are resumed, largest bound first, until what the others may lose together is within
// `discard_at_most` of the finished mass. Of those that stay stopped a fiftieth is run to the end
// all the same: the audit.

#include <map>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "inference/data/gaussian_likelihood.h"
#include "server/planning/definition.h"
#include "server/planning/history.h"

namespace calib::planning {

/// Whether a campaign may stop samples at all: it asks for it, and its noise is fixed in advance.
bool StopsEarly(const Definition& definition);

/// Samples that have to finish before the guiding exponent is known: twice as many as it leaves
/// effective. An exponent that the campaign gives asks for none effective but 2 d.
double FinishedWanted(const Definition& definition);

/// Per new sample, the largest LogLikelihoodBound with which it is stopped:
///   [ln(finished weight) + ln(discard_at_most / N) - ln(prior / proposals)_i] / exponent
/// where exponent is the guiding one and the proposals are those of all iterations and the new one.
/// While no sample has finished NaN (never stopped) for all, with decisions at once -inf (not yet).
absl::StatusOr<std::vector<double>> StopThresholds(const Definition& definition,
                                                   const History& history,
                                                   const inference::Iteration& next);

/// (sample, threshold as above) of the samples of the last iteration that are under way and may be
/// stopped, where it is another than the one they have; next: the last iteration itself. None
/// before FinishedWanted samples have finished, unless the campaign gives the exponent: of fewer
/// the guiding one is too sharp, and would stop runs in the middle of the posterior.
absl::StatusOr<std::vector<std::pair<int, double>>> ThresholdsNow(const Definition& definition,
                                                                  const History& history);

struct Loss {
  double stated = 0;             ///< of those that stay stopped, relative to the finished mass
  std::map<int, double> bounds;  ///< of each of those samples: its part of `stated`
  std::vector<store::EvaluationKey> resume;  ///< to be run to their ends, in order
};

/// What the samples stopped in all iterations may have lost.
absl::StatusOr<Loss> StatedLoss(const Definition& definition, const History& history);

/// Samples to be run to their ends to see what stopping them would have lost: of those that stay
/// stopped the ones that the seed chooses, until a fiftieth of all that were ever stopped (at least
/// one) is audited. Empty: enough are.
std::vector<int> ToAudit(const Definition& definition, const History& history, const Loss& loss);

/// What the samples set aside as unknown (History::unknown) could hold, relative to the finished
/// mass: each as likely as the best sample that finished, or as its states so far allow, whichever
/// is less. No bound where one of them would fit better than all that finished. NaN where that
/// cannot be told: no sample has a weight, or errors are found by ess_target.
absl::StatusOr<double> UnknownMass(const Definition& definition, const History& history);

struct Audit {
  int samples = 0;
  double bound = 0;     ///< what they might have held of the finished mass when they were chosen
  double measured = 0;  ///< what they hold
};

/// Of the audited samples that have finished. definition: with the errors by which they were
/// chosen, those stated, so that bound and measured share can be held against each other: scatter
/// that joins the errors later changes both.
absl::StatusOr<Audit> AuditOf(const Definition& definition, const History& history);

/// The largest log likelihood that a sample can still reach: `predictions` holds its readings so
/// far, NaN everywhere else.
double BestPossible(const inference::GaussianLikelihood& likelihood,
                    const Eigen::RowVectorXd& predictions);

}  // namespace calib::planning
