#pragma once
// Where the next runs go while a model is far from its readings.

#include <Eigen/Core>
#include <span>

#include "inference/data/data_set.h"
#include "inference/emulator/emulated_posterior.h"
#include "inference/filter/iterative_filter.h"

namespace calib::inference {

/// How many times as large as those of the readings: half of what the closest run misses them by
/// (root mean square over the readings, in their sd), at least once. A model that is far from its
/// readings is known to their own errors nowhere but at its runs; an emulated posterior by those
/// lies beside them, or in the corner that is known least. Rows with NaN do not count; 1 where no
/// other is left. Predictions in the units of the readings.
double SearchWidening(const DataSet& data, std::span<const Iteration> iterations);

/// The tenth of the draws, at least one, whose mean histories come closest to the readings
/// (EmulatedResult::misfit), in the order of the draws. No rows where there are no draws.
Eigen::MatrixXd ClosestDraws(const EmulatedResult& emulated);

}  // namespace calib::inference
