#pragma once
// Where a verb has further campaigns run: it hands over their text and waits. A campaign is
// recognised by its text, so that a verb that is issued again finds what it has run already.

#include <map>
#include <string>

#include "absl/status/statusor.h"
#include "server/client/server_choice.h"
#include "server/client/session.h"
#include "server/report/views/campaign_view.h"

namespace calib::client {

/// Not thread-safe.
class Laboratory {
 public:
  /// Session and choice must outlive it. Starts local workers when there is something to run and
  /// the state folder is this process's own.
  Laboratory(Session& session, const ServerChoice& choice) : session_(session), choice_(choice) {}

  /// A finished calibration. FAILED_PRECONDITION with a sentence when it is not finished, or a
  /// trial that diagnose made for another one.
  absl::StatusOr<report::CampaignView> Finished(const std::string& campaign);

  /// A design and the campaign that it was derived from. FAILED_PRECONDITION with a sentence where
  /// it is no design that diagnose made.
  struct DesignWithBase {
    report::CampaignView design, base;
  };
  absl::StatusOr<DesignWithBase> DesignNamed(const std::string& campaign);

  /// Submits the text with the parent's files and does not wait, so that several campaigns keep all
  /// workers busy; returns the campaign's id. Submitted again it is the same campaign.
  /// OUT_OF_RANGE: it is more than the server takes.
  absl::StatusOr<std::string> Submit(const report::CampaignView& parent, const std::string& yaml,
                                     const std::string& what,
                                     const std::map<std::string, std::string>& further = {});

  /// Submits the text with the parent's files and waits for the end, progress on standard error.
  /// further: files by the path that the text names them by, in addition to the parent's.
  /// ABORTED when the campaign failed, FAILED_PRECONDITION when somebody paused or cancelled it,
  /// OUT_OF_RANGE when it is more than the server takes, CANCELLED on Ctrl-C (nothing is lost).
  absl::StatusOr<report::CampaignView> Run(const report::CampaignView& parent,
                                           const std::string& yaml, const std::string& what,
                                           const std::map<std::string, std::string>& further = {});

  /// Submits the text of a design (`method: design`) with the parent's files; waits for the runs
  /// that it has, which are none at first. Errors: as Run().
  absl::StatusOr<report::CampaignView> Design(
      const report::CampaignView& parent, const std::string& yaml, const std::string& what,
      const std::map<std::string, std::string>& further = {});

  /// Adds a batch of runs to a design and waits for their end, progress on standard error; a batch
  /// that is there already is waited for alone. Errors: those of the rpc AddRuns, and as Run().
  absl::StatusOr<report::CampaignView> Grow(const v1::AddRunsRequest& batch,
                                            const std::string& what);

  /// The campaign that the text is, without a server's knowing; files as for Run().
  /// INVALID_ARGUMENT with its first problem.
  absl::StatusOr<campaign::Campaign> Read(const report::CampaignView& parent,
                                          const std::string& yaml,
                                          const std::map<std::string, std::string>& further);

 private:
  /// Of a campaign that is not over: resumes it if it was paused, and starts local workers.
  absl::Status GoOn(const v1::CampaignStatus& status);
  absl::Status Wait(const std::string& campaign, const std::string& what);

  Session& session_;
  const ServerChoice& choice_;
  bool workers_started_ = false;
};

}  // namespace calib::client
