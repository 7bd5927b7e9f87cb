#pragma once
// How often the best estimate of a campaign is run again after its calibration, to see what runs of
// one parameter vector differ by.

#include <string>

#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Whether an experiment has two packings. Where none has, replicates are twins: runs on the one
/// packing there is, whose parameters differ by a millionth.
bool VariesPackings(const Campaign& campaign);

/// Whether every run of the experiment is on one packing of given grains: neither poured, where
/// runs differ by their seeds, nor of bodies that its settings make.
bool HasOnePacking(const Experiment& experiment);

/// As the campaign says, at most its samples; else once for each of the most realizations of an
/// experiment, up to 16, or where no experiment has two, 8 where a fitted one HasOnePacking: the
/// scatter of eight is known to 27 % [standard error of an sd, 1 / sqrt(2 (R - 1))]. 0 where runs
/// are given or follow from no posterior, and where errors are not stated (ess_target).
int ReplicatesOf(const Campaign& campaign);

/// One sentence on what twins are and how many evaluations they take; empty where there are none.
std::string TwinsInWords(const Campaign& campaign);

}  // namespace calib::campaign
