#pragma once
// The keys of `data` that say what form the laboratory's file has.

#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/file/text/table_layout.h"

namespace calib::campaign {

/// Reads separator, decimal, skip, header, rows, where and missing; what is left out is found in
/// the file.
TableFormat ReadTableFormat(MapReader& data);

}  // namespace calib::campaign
