#pragma once
// Whether a folder is fit to keep files in: what holds it, how much is free, how long it takes
// until a file is safe.

#include <string>

#include "calib/v1/campaign.pb.h"

namespace calib::messages {

/// Writes a small file into the folder, forces it to the disk, gives it its name as state files get
/// theirs, locks and removes it. Where the folder does not exist, the nearest one above it that
/// does is examined. What cannot be done stands in FolderReport::problem; nothing is left behind.
v1::FolderReport ExamineFolder(const std::string& folder);

}  // namespace calib::messages
