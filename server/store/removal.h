#pragma once
// Rows that leave, a piece at a time, so that no transaction is long. Private to this folder.

#include <cstdint>
#include <string>

#include "server/store/records.h"

namespace calib::store {

class Connection;

/// Of an evaluation: its campaign is neither on its way out nor were its states pruned.
inline constexpr const char* kStaysWhole =
    "campaign NOT IN (SELECT campaign FROM leaving UNION ALL SELECT campaign FROM pruned)";
/// Samples of campaign ?1 whose states stay when it is pruned.
inline constexpr const char* kKeptSamples =
    "SELECT sample FROM sample WHERE campaign = ?1 "
    "ORDER BY log_weight DESC, log_likelihood DESC, sample "
    "LIMIT (SELECT kept FROM pruned WHERE campaign = ?1)";
/// Of a blob: no campaign, finding or run names it, and it was not put since ?.
inline constexpr const char* kUnnamed =
    "NOT EXISTS (SELECT 1 FROM campaign_file WHERE campaign_file.digest = blob.digest) "
    "AND NOT EXISTS (SELECT 1 FROM finding WHERE finding.digest = blob.digest) "
    "AND NOT EXISTS (SELECT 1 FROM kept WHERE kept.digest = blob.digest) "
    "AND NOT EXISTS (SELECT 1 FROM put WHERE put.digest = blob.digest AND put.unix_s >= ?)";

/// Removes at most so many rows of the first campaign of which something leaves. All throw
/// SQLite::Exception.
Removed RemoveRows(Connection& connection, int rows);
/// Whether the content was there, without a name, and is not any more.
bool RemoveUnnamed(Connection& connection, const std::string& digest, std::int64_t put_before);
/// Gives at most so many empty pages of the file back to the file system.
Removed ReturnPages(Connection& connection, int pages);

}  // namespace calib::store
