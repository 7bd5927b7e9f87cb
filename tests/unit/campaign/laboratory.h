#pragma once
// A laboratory's file in a small campaign, for tests of how it is read.

#include <string>

#include "server/campaign/file/campaign_file.h"

namespace calib::campaign {

/// What varies between the files here; the rest is a small drained test of 64 grains.
struct Laboratory {
  std::string file{};
  std::string data{};         // keys of `data` beside the file
  std::string observables{};  // a map
  std::string test = "triaxial_drained";
  std::string settings = "confining_pressure: 200 kPa";
  std::string control = "axial_strain";
  std::string grains = "particles: 64, porosity: 0.40, radii: {mean: 1.5 mm, spread: 0.3}, seed: 1";
};

ReadOutcome Read(const Laboratory& lab, CampaignIs is = CampaignIs::kNew);

/// A line for each.
std::string ProblemsIn(const ReadOutcome& outcome);
/// A line for each, its kind in front.
std::string WarningsIn(const ReadOutcome& outcome);
/// Kind and name of the only warning; all of them otherwise.
std::string OnlyWarning(const ReadOutcome& outcome);
/// Of the only problem; all of them otherwise.
std::string KindOfProblem(const ReadOutcome& outcome);
/// The first observable of the first experiment.
const MeasuredObservable& First(const ReadOutcome& outcome);

inline constexpr const char* kPercent = "units: {axial_strain: percent}, strain: logarithmic";
inline constexpr const char* kRatio = "{stress_ratio: {noise: {relative: 0.03}}}";

}  // namespace calib::campaign
