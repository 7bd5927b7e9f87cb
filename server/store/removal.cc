#include "server/store/removal.h"

#include "absl/strings/str_cat.h"
#include "server/store/connection.h"

namespace calib::store {
namespace {

struct Table {
  const char* name;
  const char* key;
};
/// What belongs to a campaign, no row before those that refer to it.
constexpr Table kTables[] = {{"state", "campaign, sample, experiment, load_step"},
                             {"kept", "campaign, sample, experiment, name"},
                             {"attempt", "id"},
                             {"evaluation", "campaign, sample, experiment"},
                             {"sample", "campaign, sample"},
                             {"iteration", "campaign, number"},
                             {"finding", "id"},
                             {"campaign_file", "campaign, path"},
                             {"event", "id"}};

/// Statements are prepared once, under texts that stay.
const std::string& RemovalFrom(const Table& table) {
  static const std::map<std::string, std::string> texts = [] {
    std::map<std::string, std::string> all;
    for (const Table& one : kTables) {
      all[one.name] = absl::StrCat("DELETE FROM ", one.name, " WHERE (", one.key, ") IN (SELECT ",
                                   one.key, " FROM ", one.name, " WHERE campaign = ? LIMIT ?)");
    }
    return all;
  }();
  return texts.at(table.name);
}

int RemoveStates(Connection& connection, std::int64_t campaign, int rows) {
  static const std::string text = absl::StrCat(
      "DELETE FROM state WHERE (campaign, sample, experiment, load_step) IN ("
      "SELECT campaign, sample, experiment, load_step FROM state WHERE campaign = ?1 "
      "AND sample NOT IN (",
      kKeptSamples, ") LIMIT ?2)");
  return connection.Run(text, campaign, rows);
}

int RemoveCampaign(Connection& connection, std::int64_t campaign, int rows) {
  int removed = 0;
  for (const Table& table : kTables) {
    removed += connection.Run(RemovalFrom(table), campaign, rows - removed);
    if (removed >= rows) return removed;
  }
  connection.Run("DELETE FROM campaign WHERE id = ?", campaign);
  return removed;
}

}  // namespace

Removed RemoveRows(Connection& connection, int rows) {
  SQLite::Statement& first =
      connection.Bind("SELECT campaign, whole FROM leaving ORDER BY campaign LIMIT 1");
  if (!first.executeStep()) return {};
  const std::int64_t campaign = first.getColumn(0).getInt64();
  const bool whole = first.getColumn(1).getInt() != 0;
  first.reset();
  Removed removed{.count = whole ? RemoveCampaign(connection, campaign, rows)
                                 : RemoveStates(connection, campaign, rows)};
  if (removed.count < rows) connection.Run("DELETE FROM leaving WHERE campaign = ?", campaign);
  SQLite::Statement& more = connection.Bind("SELECT 1 FROM leaving LIMIT 1");
  removed.more = more.executeStep();
  more.reset();
  return removed;
}

bool RemoveUnnamed(Connection& connection, const std::string& digest, std::int64_t put_before) {
  static const std::string text = absl::StrCat("DELETE FROM blob WHERE digest = ? AND ", kUnnamed);
  return connection.Run(text, digest, put_before) > 0;
}

Removed ReturnPages(Connection& connection, int pages) {
  const auto empty = [&connection] {
    return connection.database().execAndGet("PRAGMA freelist_count").getInt();
  };
  const int before = empty();
  if (before > 0) {
    connection.database().exec(absl::StrCat("PRAGMA incremental_vacuum(", pages, ")"));
  }
  const int after = empty();
  return {.count = before - after, .more = after > 0 && after < before};
}

}  // namespace calib::store
