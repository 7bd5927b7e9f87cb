#pragma once
// One run of a campaign's experiments on this machine, by calib-worker processes, as many at a time
// as cores.

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "server/campaign/model/campaign.h"
#include "server/client/progress.h"
#include "server/ctl/evaluation.h"

namespace calib::ctl {

/// Whether grains of the experiment can be drawn. A collision is one contact, of bodies that its
/// settings make.
bool HasPictures(const campaign::Experiment& experiment);

/// Not thread-safe.
class Simulation {
 public:
  struct Options {
    campaign::RunOf run;
    std::vector<int> experiments{};  ///< which, by their place in the campaign
    std::string vtk{};               ///< folder, one below it per experiment; empty: no pictures
    std::optional<int> load_step{};  ///< runs end there, and no other is drawn; empty: all
    std::string checkpoint{};        ///< folder; empty: none
  };
  /// contents: of the files that the campaign names, by their paths as written. Campaign and
  /// contents must outlive it.
  Simulation(const campaign::Campaign& campaign, const std::map<std::string, std::string>& contents,
             Options options)
      : campaign_(campaign), contents_(contents), options_(std::move(options)) {}

  /// Runs all, with progress on standard error, and waits. program: calib-worker; folder: an
  /// existing one for the files in between. The first failure to start, or checkpoint of another
  /// run, ends it; CANCELLED on Ctrl-C.
  absl::Status RunAll(const std::string& program, const std::string& folder);

  /// Those that were started, in the order in which they were wanted.
  std::size_t size() const { return runs_.size(); }
  const campaign::Experiment& experiment(std::size_t e) const {
    return campaign_.experiments[static_cast<std::size_t>(options_.experiments[e])];
  }
  Evaluation& run(std::size_t e) { return runs_[e]; }
  const Evaluation& run(std::size_t e) const { return runs_[e]; }

 private:
  absl::Status StartProgram(const std::string& program, const std::string& own);
  absl::Status StartNext(const std::string& program, const std::string& folder);
  void ShowProgress(client::ProgressLine& line) const;

  const campaign::Campaign& campaign_;
  const std::map<std::string, std::string>& contents_;
  const Options options_;
  std::vector<Evaluation> runs_;
};

}  // namespace calib::ctl
