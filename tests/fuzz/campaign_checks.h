#pragma once
// What campaign_file.h promises of every text, held against what came out of one.

#include <map>
#include <string>

#include "server/campaign/file/campaign_file.h"

namespace calib::fuzz {

/// Packing, measurements, tables and a mesh of a few lines each, by the names under which the
/// corpora speak of them.
const std::map<std::string, std::string>& SmallFiles();

/// A campaign of one triaxial test. model: further lines under `model`, four blanks deep;
/// experiment: what is measured and on which packing, each line six blanks deep.
std::string TriaxialCampaign(const std::string& model, const std::string& experiment);

/// Lines, each behind so many blanks.
std::string Indented(const std::string& text, int blanks);

/// Reads a campaign over SmallFiles(), some of them replaced. Ends the program where a problem is
/// no sentence of one line, or a campaign without problems holds a number that is none, cannot be
/// made into data and runs, or would be refused once it is stored.
campaign::ReadOutcome ReadAndCheck(const std::string& yaml,
                                   const std::map<std::string, std::string>& replaced = {});

}  // namespace calib::fuzz
