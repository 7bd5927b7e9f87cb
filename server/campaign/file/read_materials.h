#pragma once
// Materials of a campaign file: `model.materials` and `model.pairs`, `materials` of an experiment.

#include "dem/registry/catalog.h"
#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

/// Reads `materials` and `pairs` of the map `model`: names into model.materials, values into
/// model.parameters under their dotted names. Call when contact and effects have been read, before
/// `fixed`.
void ReadMaterials(MapReader& model_map, dem::Model& model);

/// Reads `materials` of an experiment: who is made of what.
dem::MaterialUse ReadMaterialUse(MapReader& experiment_map, const dem::TestInfo& test,
                                 const dem::Model& model);

/// A material that nothing is made of, in no experiment, is a mistake; not in a table or a campaign
/// derived from another, which may have some of its experiments only. Call when the experiments
/// have been read.
void CheckMaterialsUsed(const MapReader& campaign_map, const Campaign& campaign);

}  // namespace calib::campaign
