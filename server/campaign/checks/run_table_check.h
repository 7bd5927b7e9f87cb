#pragma once
// Runs that exist already: whether they are different runs, and whether their parameters move what
// was measured.

#include <vector>

#include "server/campaign/checks/warning.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Whether a reading differs between runs by what could be measured: by more than a tenth of its
/// error, or, where none is stated (NaN), than the digits that codes print.
bool IsMoved(double low, double high, double sd);

/// Of the kind unmoved: the observable is the same in so many runs.
Warning UnmovedWarning(const Experiment& experiment, const MeasuredObservable& observable,
                       int runs);

/// Warnings of the kinds repeated (rows of parameters that stand there more than once) and unmoved
/// (an observable that hardly differs between runs, beside the errors of its readings or, without
/// any, its size). Empty for campaigns that make their runs. Pure.
std::vector<Warning> RunTableWarnings(const Campaign& campaign);

}  // namespace calib::campaign
