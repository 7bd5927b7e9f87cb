#pragma once
// A step of a campaign in the making: what it follows from, and the plan that it becomes. Each
// phase adds its part.

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/planning/history.h"
#include "server/planning/plan.h"
#include "server/planning/requests.h"
#include "server/planning/scatter.h"
#include "server/store/reader.h"

namespace calib::planning {

/// Its references must outlive it. Not thread-safe.
struct Step {
  const Definition& definition;  ///< with the scatter that was measured, where it is of its errors
  const Definition& stated;      ///< without
  const store::CampaignRecord& record;
  store::Reader& reader;
  bool replicating = false;                  ///< the runs that measure the scatter have ended
  std::vector<ObservableScatter> scatter{};  ///< what they show
  History history{};
  Plan plan{};

  const campaign::Campaign& campaign() const { return definition.campaign; }
  int iterations() const { return static_cast<int>(history.iterations.size()); }
  /// Into the plan.
  Requests requests() { return {definition, record.submitted.id, reader, plan}; }

  void Finish();
  /// The plan becomes the campaign's failure, with this reason. OK.
  absl::Status Fail(const absl::Status& why);
};

}  // namespace calib::planning
