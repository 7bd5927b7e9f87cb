#pragma once
// What an experiment tells a program: the keys `settings` and `realizations`.

#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/file/shared/read_context.h"

namespace calib::campaign {

/// Reads both into experiment.told and experiment.specimens, one ProgramSpecimen per realization;
/// the settings that the experiment's test knows also into experiment.settings, held to their unit
/// and range. Keys of the DEM's own are refused. test: nullptr where none is named.
void ReadTold(MapReader& map, const dem::TestInfo* test, const Campaign& campaign,
              Experiment& experiment);

}  // namespace calib::campaign
