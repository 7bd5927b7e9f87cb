#pragma once
// Progress on standard error: a line that is drawn over on a terminal, now and then a plain line
// otherwise.

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

#include "calib/v1/campaign.pb.h"

namespace calib::client {

/// "iteration 2/4  [########------------]  40/100 samples  2 running  ESS 23  best misfit 1.3  3
/// min 20 s left"
std::string ProgressText(const v1::CampaignStatus& status);

/// One line of progress on standard error. Not thread-safe.
class ProgressLine {
 public:
  /// quiet: says nothing at all.
  explicit ProgressLine(bool quiet = false);
  /// Leaves the last text standing on a terminal.
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// Off a terminal a text is printed only when `milestone` differs from the last one printed and a
  /// second has passed.
  void Show(const std::string& text, int milestone);

 private:
  bool quiet_;
  bool terminal_;
  bool drawn_ = false;
  int last_milestone_ = -1;
  std::chrono::steady_clock::time_point last_{};
};

/// While it lives a terminal is told what is being computed and for how long, from the third second
/// on; then the line is erased. Off a terminal nothing is said. Nothing else may be written to
/// standard error meanwhile. Not thread-safe.
class BusyLine {
 public:
  explicit BusyLine(std::string what);
  ~BusyLine();
  BusyLine(const BusyLine&) = delete;
  BusyLine& operator=(const BusyLine&) = delete;

 private:
  void Draw(const std::string& what);

  std::mutex mutex_;
  std::condition_variable ended_;
  bool over_ = false;
  std::thread drawer_;
};

}  // namespace calib::client
