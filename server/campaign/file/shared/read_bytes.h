#pragma once
// Sizes of files and memory.

#include <optional>
#include <string>

#include "server/campaign/file/shared/map_reader.h"

namespace calib::campaign {

/// "4 GB" in bytes, > 0; the unit has to be there. Empty: absent, or a problem was added.
std::optional<double> ReadBytes(MapReader& map, const std::string& key);

}  // namespace calib::campaign
