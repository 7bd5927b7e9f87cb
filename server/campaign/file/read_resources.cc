#include "server/campaign/file/read_resources.h"

#include "absl/strings/str_cat.h"
#include "server/campaign/file/shared/read_bytes.h"

namespace calib::campaign {

void ReadResources(MapReader& campaign_map, Campaign& campaign) {
  auto map = campaign_map.Map("resources");
  if (!map) return;
  Resources& resources = campaign.resources;
  if (const auto threads = map->Integer("threads")) resources.threads = static_cast<int>(*threads);
  resources.memory = ReadBytes(*map, "memory");
  resources.wall = map->Quantity("wall");
  resources.silence = map->Quantity("silence");
  map->Finish();
  if (campaign.precomputed) {
    campaign_map.Problem("resources", "is of runs, and these exist already; remove it");
  }
  if (!campaign.program) return;
  for (const char* key : {"wall", "silence"}) {
    if (map->Has(key)) {
      map->Problem(key, absl::StrCat("is of this program's own DEM; that of a command is "
                                     "model.limits.",
                                     key));
    }
  }
  const auto& limit = campaign.program->limits.memory;
  if (limit && resources.memory && *limit > *resources.memory) {
    map->Problem("memory",
                 "is less than model.limits.memory, which a run may take; make it as "
                 "much, or lower that");
  }
}

}  // namespace calib::campaign
