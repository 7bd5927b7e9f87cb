#pragma once
// Where the next runs go while a model is far from its readings. Pure functions.

#include <Eigen/Core>
#include <span>

#include "inference/data/data_set.h"
#include "inference/emulator/emulated_posterior.h"
#include "inference/filter/iterative_filter.h"

namespace calib::inference {

/// By how much larger errors than the stated ones the posterior is to be sampled that proposes the
/// next runs, as a factor >= 1: half of what the closest run misses the readings by (root mean
/// square over the readings, in their sd), at least 1. A model that is far from its readings is
/// known to their own errors nowhere but at its runs; an emulated posterior by those lies beside
/// the runs, or in the corner that is known least. Rows of predictions with NaN do not count; 1
/// where no other is left.
double SearchWidening(const DataSet& data, std::span<const Iteration> iterations);

/// The tenth of the draws, at least one, whose mean histories come closest to the readings
/// (EmulatedResult::misfit), in the order of the draws. No rows where there are no draws.
Eigen::MatrixXd ClosestDraws(const EmulatedResult& emulated);

}  // namespace calib::inference
