#include "tests/simulation/ledger.h"

#include <sqlite3.h>

#include <algorithm>

#include "absl/strings/str_cat.h"

namespace calib::simulation {
namespace {

std::string Where(std::int64_t campaign, std::int64_t sample, std::int64_t experiment) {
  return absl::StrCat(" WHERE campaign = ", campaign, " AND sample = ", sample,
                      " AND experiment = ", experiment);
}

}  // namespace

void Ledger::Open(const std::string& path) {
  Close();
  disk_.spares_watchers = true;
  sqlite3_open_v2(path.c_str(), &database_, SQLITE_OPEN_READWRITE, nullptr);
  disk_.spares_watchers = false;
}

void Ledger::Close() {
  if (database_ == nullptr) return;
  disk_.spares_watchers = true;
  sqlite3_close(database_);
  disk_.spares_watchers = false;
  database_ = nullptr;
}

std::vector<Ledger::Row> Ledger::Query(const std::string& sql) {
  std::vector<Row> rows;
  if (database_ == nullptr) return rows;
  disk_.spares_watchers = true;
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(database_, sql.c_str(), -1, &statement, nullptr) == SQLITE_OK) {
    while (sqlite3_step(statement) == SQLITE_ROW) {
      Row& row = rows.emplace_back();
      for (int i = 0; i < sqlite3_column_count(statement); ++i) {
        const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement, i));
        row.emplace_back(text == nullptr ? "" : text);
      }
    }
  } else {
    rows.push_back({absl::StrCat("error: ", sqlite3_errmsg(database_))});
  }
  sqlite3_finalize(statement);
  disk_.spares_watchers = false;
  return rows;
}

std::int64_t Ledger::Number(const std::string& sql) {
  const auto rows = Query(sql);
  return rows.empty() || rows[0][0].empty() || rows[0][0][0] == 'e' ? -1 : std::stoll(rows[0][0]);
}

Ledger::Attempt Ledger::Find(std::int64_t attempt) {
  const auto rows = Query(absl::StrCat(
      "SELECT campaign, sample, experiment, worker, outcome FROM attempt WHERE id = ", attempt));
  if (rows.empty() || rows[0].size() < 5) return {};
  return {.key = {std::stoll(rows[0][0]), std::stoll(rows[0][1]), std::stoll(rows[0][2])},
          .worker = rows[0][3],
          .outcome = rows[0][4]};
}

void Ledger::Takes(const v1::WorkerMessage& message) {
  const auto take = [this](const v1::StateBatch& batch) {
    const Attempt attempt = Find(batch.attempt());
    if (attempt.key.campaign < 0 || !attempt.outcome.empty()) return;
    std::int64_t& said = said_[batch.attempt()];
    said = std::max<std::int64_t>(said, batch.first() + batch.states_size());
  };
  if (message.has_states()) take(message.states());
  for (const v1::StateBatch& batch : message.gathered().batches()) take(batch);
  if (message.has_finished()) {
    const std::string outcome = Find(message.finished().attempt()).outcome;
    if (outcome == "lost" || outcome == "failed" || outcome == "stopped" ||
        outcome == "cancelled" || outcome == "stopped_early") {
      stale_.insert(message.finished().attempt());
    }
  }
}

std::string Ledger::Acknowledges(const v1::Ack& ack) {
  if (ack.refused()) return "";
  const Attempt attempt = Find(ack.attempt());
  const Key& key = attempt.key;
  if (key.campaign < 0) {
    return deleted_.empty()
               ? absl::StrCat("attempt ", ack.attempt(), " is acknowledged and is not in the store")
               : "";
  }
  if (deleted_.count(key.campaign) > 0) return "";
  if (ack.finished()) {
    if (attempt.outcome != "completed" && attempt.outcome != "resting" &&
        attempt.outcome != "diverged" && attempt.outcome != "model_failed") {
      return absl::StrCat("the end of attempt ", ack.attempt(),
                          " is acknowledged, and in the store it is ",
                          attempt.outcome.empty() ? "running" : attempt.outcome);
    }
    if (stale_.count(ack.attempt()) > 0) {
      return absl::StrCat("attempt ", ack.attempt(), " had ended when its worker's end was taken");
    }
    ended_[ack.attempt()] = key;
    return "";
  }
  if (ack.up_to() > reached_[ack.attempt()]) {
    return absl::StrCat("states of attempt ", ack.attempt(), " are acknowledged up to ",
                        ack.up_to(), ", and its worker has computed ", reached_[ack.attempt()]);
  }
  if (ack.up_to() > said_[ack.attempt()]) {
    return absl::StrCat("states of attempt ", ack.attempt(), " were taken up to ", ack.up_to(),
                        " when it had ended");
  }
  std::int64_t& acknowledged = states_[key];
  acknowledged = std::max<std::int64_t>(acknowledged, ack.up_to());
  const std::int64_t stored = Number(absl::StrCat("SELECT count(*) FROM state",
                                                  Where(key.campaign, key.sample, key.experiment),
                                                  " AND load_step < ", ack.up_to()));
  return stored == ack.up_to()
             ? ""
             : absl::StrCat(ack.up_to(), " states of attempt ", ack.attempt(),
                            " are acknowledged and ", stored, " are in the store");
}

std::string Ledger::Sends(const std::string& worker, const v1::ServerMessage& message) {
  if (message.has_ack()) return Acknowledges(message.ack());
  for (const v1::Ack& ack : message.acks().acks()) {
    if (std::string wrong = Acknowledges(ack); !wrong.empty()) return wrong;
  }
  if (!message.has_lease()) return "";
  const Attempt attempt = Find(message.lease().attempt());
  const Key& key = attempt.key;
  if (key.campaign < 0 && !deleted_.empty()) return "";
  if (key.campaign < 0 || attempt.worker != worker) {
    return absl::StrCat("attempt ", message.lease().attempt(), " is leased to ", worker,
                        " and is not so in the store");
  }
  const std::int64_t open =
      Number(absl::StrCat("SELECT count(*) FROM attempt",
                          Where(key.campaign, key.sample, key.experiment), " AND outcome IS NULL"));
  return open <= 1 ? ""
                   : absl::StrCat("a run has ", open, " open attempts, ", message.lease().attempt(),
                                  " among them");
}

std::string Ledger::Check() {
  if (const auto rows = Query("PRAGMA quick_check"); rows.empty() || rows[0][0] != "ok") {
    return absl::StrCat("the file is damaged: ", rows.empty() ? "cannot be read" : rows[0][0]);
  }
  for (const std::string& key : requests_) {
    if (Number("SELECT count(*) FROM request WHERE id = '" + key + "'") != 1) {
      return "request " + key + " was answered and is not in the store";
    }
  }
  for (const std::int64_t campaign : campaigns_) {
    if (deleted_.count(campaign) > 0) continue;
    const std::string state = StateOf(campaign);
    if (state.empty() || (cancelled_.count(campaign) > 0 && state != "cancelled")) {
      return absl::StrCat(
          "campaign c", campaign, " is ", state.empty() ? "not in the store" : state,
          cancelled_.count(campaign) > 0 ? ", and its cancelling was answered" : "");
    }
  }
  for (const auto& [key, up_to] : states_) {
    if (deleted_.count(key.campaign) > 0) continue;
    const std::int64_t stored = Number(absl::StrCat("SELECT count(*) FROM state",
                                                    Where(key.campaign, key.sample, key.experiment),
                                                    " AND load_step < ", up_to));
    if (stored != up_to) {
      return absl::StrCat("of sample ", key.sample, " experiment ", key.experiment, " of c",
                          key.campaign, " ", up_to, " states were acknowledged and ", stored,
                          " are there");
    }
  }
  for (const auto& [id, key] : ended_) {
    if (deleted_.count(key.campaign) > 0) continue;
    if (Find(id).outcome.empty()) {
      return absl::StrCat("the end of attempt ", id, " was acknowledged and is not there");
    }
  }
  const auto twice = Query(
      "SELECT campaign, sample, experiment, count(*) FROM attempt WHERE outcome IS NULL "
      "GROUP BY campaign, sample, experiment HAVING count(*) > 1");
  return twice.empty() ? ""
                       : absl::StrCat("c", twice[0][0], " sample ", twice[0][1], " experiment ",
                                      twice[0][2], " has ", twice[0][3], " open attempts");
}

std::string Ledger::CheckEnd(const Finished& finished) {
  const std::string of = absl::StrCat(" campaign = ", finished.campaign, " ");
  const std::string name = absl::StrCat("of c", finished.campaign, " ");
  const auto none = [&](const std::string& sql, const std::string& what) {
    const auto rows = Query(sql);
    return rows.empty() ? "" : absl::StrCat(name, what, ": sample ", rows[0][0]);
  };
  const std::string of_this =
      " FROM attempt a WHERE a.campaign = e.campaign AND a.sample = e.sample "
      "AND a.experiment = e.experiment ";
  const std::string model = "(SELECT count(*)" + of_this + "AND outcome = 'model_failed')";
  const std::string nodes = "(SELECT count(*)" + of_this + "AND outcome IN ('lost', 'failed'))";
  const std::string than = finished.resumed ? " > " : " <> ";
  const std::string failures_than = finished.resumed || finished.goes_on ? " > " : " <> ";
  const struct {
    std::string sql, what;
  } rules[] = {
      {"SELECT sample FROM evaluation WHERE" + of + "AND status IN ('waiting', 'running')",
       "a run is open though it has finished"},
      {"SELECT sample FROM attempt WHERE" + of + "AND outcome IS NULL",
       "an attempt is open though it has finished"},
      {"SELECT sample FROM evaluation e WHERE" + of +
           "AND status = 'finished' AND NOT reused AND 1 <> (SELECT count(*)" + of_this +
           "AND outcome = 'completed')",
       "a run has finished and not by one completed attempt"},
      {"SELECT sample FROM evaluation e WHERE" + of + "AND failures" + failures_than + model,
       "failures of the model are not those of its attempts"},
      {"SELECT sample FROM evaluation e WHERE" + of + "AND losses" + than + nodes,
       "losses are not those of its attempts"},
      {"SELECT what FROM event WHERE" + of + "AND what LIKE 'nondeterminism%'", "bits differ"},
      {"SELECT what FROM event WHERE" + of + "AND what LIKE '%store refuses%'",
       "rows were refused"},
  };
  for (const auto& rule : rules) {
    if (std::string wrong = none(rule.sql, rule.what); !wrong.empty()) return wrong;
  }
  return "";
}

std::string Ledger::StateOf(std::int64_t campaign) {
  const auto rows = Query(absl::StrCat("SELECT state FROM campaign WHERE id = ", campaign));
  return rows.empty() ? "" : rows[0][0];
}

std::vector<std::int64_t> Ledger::Open() {
  std::vector<std::int64_t> ids;
  for (const Row& row : Query("SELECT id FROM campaign WHERE state IN ('queued', 'running', "
                              "'paused') AND id NOT IN (SELECT campaign FROM leaving)")) {
    ids.push_back(std::stoll(row[0]));
  }
  return ids;
}

std::vector<std::int64_t> Ledger::Paused() {
  std::vector<std::int64_t> ids;
  for (const Row& row : Query("SELECT id FROM campaign WHERE state = 'paused'")) {
    ids.push_back(std::stoll(row[0]));
  }
  return ids;
}

std::string Ledger::Summary(std::int64_t campaign) {
  std::string text = absl::StrCat("c", campaign, " ", StateOf(campaign));
  for (const Row& row :
       Query(absl::StrCat("SELECT status, count(*) FROM evaluation WHERE campaign = ", campaign,
                          " GROUP BY status"))) {
    absl::StrAppend(&text, ", ", row[1], " ", row[0]);
  }
  absl::StrAppend(&text, ", ",
                  Number(absl::StrCat("SELECT count(*) FROM attempt WHERE outcome IS NULL AND "
                                      "campaign = ",
                                      campaign)),
                  " attempts open");
  return text;
}

void Ledger::EmptyLog() { Query("PRAGMA wal_checkpoint(PASSIVE)"); }

}  // namespace calib::simulation
