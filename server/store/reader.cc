#include "server/store/reader.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "server/store/blob_file.h"
#include "server/store/connection.h"
#include "server/store/reader_guard.h"
#include "server/store/removal.h"

namespace calib::store {
namespace {

double ToDouble(const SQLite::Column& column) {
  return column.isNull() ? kUnknown : column.getDouble();
}

// The schema allows no other words than those of the tables. aside: see migration 10.
EvaluationStatus ToEvaluationStatus(const std::string& text, bool aside) {
  if (aside) return EvaluationStatus::kUnknown;
  return campaign::ValueOf(campaign::kEvaluationStatusWords, text)
      .value_or(EvaluationStatus::kFailed);
}

CampaignState ToCampaignState(const std::string& text) {
  return campaign::ToCampaignState(text).value_or(CampaignState::kFailed);
}

Phase ToPhase(const std::string& text) {
  return campaign::ValueOf(campaign::kPhaseWords, text).value_or(Phase::kDone);
}

CampaignRecord ToCampaign(SQLite::Statement& row) {
  CampaignRecord record;
  NewCampaign& submitted = record.submitted;
  submitted.id = row.getColumn(0).getInt64();
  submitted.name = row.getColumn(1).getString();
  submitted.yaml = row.getColumn(2).getString();
  submitted.file_name = row.getColumn(3).getString();
  if (!row.isColumnNull(4)) {
    submitted.seed = std::bit_cast<std::uint64_t>(row.getColumn(4).getInt64());
  }
  submitted.method = row.getColumn(5).getString();
  submitted.samples = row.getColumn(6).getInt();
  submitted.max_iterations = row.getColumn(7).getInt();
  submitted.created_unix_ms = row.getColumn(8).getInt64();
  CampaignProgress& progress = record.progress;
  progress.state = ToCampaignState(row.getColumn(9).getString());
  progress.reason = row.getColumn(10).getString();
  progress.phase = ToPhase(row.getColumn(11).getString());
  progress.iteration = row.getColumn(12).getInt();
  progress.converged = row.getColumn(13).getInt() != 0;
  progress.pause_waived = row.getColumn(14).getInt() != 0;
  submitted.reading_rules = row.getColumn(15).getInt();
  submitted.owner = row.getColumn(16).getString();
  if (!row.isColumnNull(17)) {
    record.kept_states = row.getColumn(17).getInt();
  }
  record.priority = row.getColumn(18).getInt();
  return record;
}

std::vector<StateRecord> ToStates(std::int64_t campaign, SQLite::Statement& row) {
  std::vector<StateRecord> records;
  while (row.executeStep()) {
    records.push_back({.key = {.campaign = campaign,
                               .sample = row.getColumn(0).getInt(),
                               .experiment = row.getColumn(1).getInt()},
                       .load_step = row.getColumn(2).getInt(),
                       .observables = ToDoubles(row.getColumn(3)),
                       .others = row.getColumn(4).getString()});
  }
  return records;
}

constexpr std::string_view kCampaignsAfter =
    "SELECT id, name, yaml, file_name, seed, method, samples, max_iterations, created_unix_ms, "
    "state, reason, phase, iteration, converged, pause_waived, reading_rules, owner, "
    "(SELECT kept FROM pruned WHERE campaign = id), priority FROM campaign "
    "WHERE id > ? AND id NOT IN (SELECT campaign FROM leaving WHERE whole) ORDER BY id LIMIT ?";
constexpr std::string_view kOneCampaign =
    "SELECT id, name, yaml, file_name, seed, method, samples, max_iterations, created_unix_ms, "
    "state, reason, phase, iteration, converged, pause_waived, reading_rules, owner, "
    "(SELECT kept FROM pruned WHERE campaign = id), priority FROM campaign "
    "WHERE id = ? AND id NOT IN (SELECT campaign FROM leaving WHERE whole)";

}  // namespace

Reader::Reader(std::unique_ptr<Connection> connection) : connection_(std::move(connection)) {}
Reader::Reader(Reader&&) noexcept = default;
Reader& Reader::operator=(Reader&&) noexcept = default;
Reader::~Reader() = default;

absl::StatusOr<std::vector<CampaignRecord>> Reader::Campaigns() { return Campaigns(0, 0); }

absl::StatusOr<std::vector<CampaignRecord>> Reader::Campaigns(std::int64_t after, int most) {
  return Guard([&] {
    std::vector<CampaignRecord> records;
    SQLite::Statement& row = connection_->Bind(kCampaignsAfter, after, most > 0 ? most : -1);
    while (row.executeStep()) {
      records.push_back(ToCampaign(row));
    }
    return records;
  });
}

absl::StatusOr<std::vector<std::pair<std::int64_t, std::string>>> Reader::TextsWith(
    const std::string& word, std::int64_t after) {
  return Guard([&] {
    std::vector<std::pair<std::int64_t, std::string>> texts;
    SQLite::Statement& row = connection_->Bind(
        "SELECT id, yaml FROM campaign WHERE id > ? AND instr(yaml, ?) > 0 ORDER BY id", after,
        word);
    while (row.executeStep()) {
      texts.emplace_back(row.getColumn(0).getInt64(), row.getColumn(1).getString());
    }
    return texts;
  });
}

absl::StatusOr<CampaignRecord> Reader::Campaign(std::int64_t id) {
  auto found = Guard([&] {
    std::optional<CampaignRecord> record;
    SQLite::Statement& row = connection_->Bind(kOneCampaign, id);
    if (row.executeStep()) {
      record = ToCampaign(row);
    }
    return record;
  });
  if (!found.ok()) {
    return found.status();
  }
  if (!found->has_value()) {
    return absl::NotFoundError(absl::StrCat("there is no campaign c", id));
  }
  return **std::move(found);
}

absl::StatusOr<std::int64_t> Reader::LastCampaign() {
  return Guard([&] {
    SQLite::Statement& row = connection_->Bind(
        "SELECT coalesce(max(seq), 0) FROM sqlite_sequence WHERE name = 'campaign'");
    return row.executeStep() ? row.getColumn(0).getInt64() : std::int64_t{0};
  });
}

absl::StatusOr<std::map<std::string, std::string>> Reader::Files(std::int64_t campaign) {
  return Guard([&] {
    std::map<std::string, std::string> files;
    SQLite::Statement& row =
        connection_->Bind("SELECT path, digest FROM campaign_file WHERE campaign = ?", campaign);
    while (row.executeStep()) {
      files.emplace(row.getColumn(0).getString(), row.getColumn(1).getString());
    }
    return files;
  });
}

absl::StatusOr<std::string> Reader::Blob(const std::string& digest) {
  auto found = Guard([&] {
    std::optional<std::string> content;
    SQLite::Statement& row = connection_->Bind("SELECT content FROM blob WHERE digest = ?", digest);
    if (row.executeStep()) {
      const SQLite::Column column = row.getColumn(0);
      const void* bytes = column.getBlob();
      content.emplace(static_cast<const char*>(bytes != nullptr ? bytes : ""),
                      static_cast<std::size_t>(column.getBytes()));
    }
    return content;
  });
  if (!found.ok()) {
    return found.status();
  }
  if (!found->has_value()) {
    return absl::NotFoundError(absl::StrCat("there is no content with SHA-256 ", digest));
  }
  return **std::move(found);
}

absl::StatusOr<bool> Reader::HasBlob(const std::string& digest) {
  return Guard([&] {
    return connection_->Bind("SELECT 1 FROM blob WHERE digest = ?", digest).executeStep();
  });
}

absl::StatusOr<std::int64_t> Reader::BlobBytes(const std::string& digest) {
  ASSIGN_OR_RETURN(const auto place, FindBlob(digest));
  return place.bytes;
}

absl::StatusOr<std::string> Reader::BlobPiece(const std::string& digest, std::int64_t from,
                                              std::int64_t bytes) {
  ASSIGN_OR_RETURN(const auto place, FindBlob(digest));
  return Guard([&] {
    std::string piece(
        static_cast<std::size_t>(std::clamp(place.bytes - from, std::int64_t{0}, bytes)), '\0');
    if (!piece.empty()) {
      BlobFile(connection_->database(), place.row, /*writable=*/false).Read(from, piece);
    }
    return piece;
  });
}

absl::StatusOr<Reader::BlobPlace> Reader::FindBlob(const std::string& digest) {
  ASSIGN_OR_RETURN(const auto found, Guard([&] {
                     std::optional<BlobPlace> place;
                     SQLite::Statement& row = connection_->Bind(
                         "SELECT rowid, length(content) FROM blob WHERE digest = ?", digest);
                     if (row.executeStep()) {
                       place = BlobPlace{.row = row.getColumn(0).getInt64(),
                                         .bytes = row.getColumn(1).getInt64()};
                     }
                     return place;
                   }));
  if (!found.has_value()) {
    return absl::NotFoundError(absl::StrCat("there is no content with SHA-256 ", digest));
  }
  return *found;
}

absl::StatusOr<std::optional<RequestRecord>> Reader::Request(const std::string& id) {
  return Guard([&] {
    std::optional<RequestRecord> record;
    SQLite::Statement& row =
        connection_->Bind("SELECT digest, answer FROM request WHERE id = ?", id);
    if (row.executeStep()) {
      record = RequestRecord{.digest = row.getColumn(0).getString(),
                             .answer = row.getColumn(1).getString()};
    }
    return record;
  });
}

absl::StatusOr<std::vector<IterationRecord>> Reader::Iterations(std::int64_t campaign) {
  return Guard([&] {
    std::vector<IterationRecord> records;
    SQLite::Statement& row = connection_->Bind(
        "SELECT number, proposal, posterior FROM iteration WHERE campaign = ? ORDER BY number",
        campaign);
    while (row.executeStep()) {
      IterationRecord& record = records.emplace_back();
      record.number = row.getColumn(0).getInt();
      record.proposal = row.getColumn(1).getString();
      if (!row.isColumnNull(2)) {
        record.posterior = row.getColumn(2).getString();
      }
    }
    return records;
  });
}

absl::StatusOr<std::vector<SampleRecord>> Reader::Samples(std::int64_t campaign, int first) {
  return Guard([&] {
    std::vector<SampleRecord> records;
    SQLite::Statement& row = connection_->Bind(
        "SELECT sample, iteration, parameters, log_weight, log_likelihood, stop_below, audited, "
        "stream FROM sample "
        "WHERE campaign = ? AND sample >= ? ORDER BY sample",
        campaign, first);
    while (row.executeStep()) {
      records.push_back({.sample = row.getColumn(0).getInt(),
                         .iteration = row.getColumn(1).getInt(),
                         .parameters = ToDoubles(row.getColumn(2)),
                         .log_weight = ToDouble(row.getColumn(3)),
                         .log_likelihood = ToDouble(row.getColumn(4)),
                         .stop_below = ToDouble(row.getColumn(5)),
                         .audited = ToDouble(row.getColumn(6)),
                         .stream = row.getColumn(7).isNull()
                                       ? std::nullopt
                                       : std::optional<int>(row.getColumn(7).getInt())});
    }
    return records;
  });
}

absl::StatusOr<std::vector<EvaluationRecord>> Reader::Evaluations(std::int64_t campaign,
                                                                  int first) {
  return Guard([&] {
    std::vector<EvaluationRecord> records;
    SQLite::Statement& row = connection_->Bind(
        "SELECT sample, experiment, status, reason, failures, digest, reused, rest_after, held_in, "
        "aside, losses FROM evaluation WHERE campaign = ? AND sample >= ? "
        "ORDER BY sample, experiment",
        campaign, first);
    while (row.executeStep()) {
      records.push_back(
          {.key = {.campaign = campaign,
                   .sample = row.getColumn(0).getInt(),
                   .experiment = row.getColumn(1).getInt()},
           .status =
               ToEvaluationStatus(row.getColumn(2).getString(), row.getColumn(9).getInt() != 0),
           .reason = row.getColumn(3).getString(),
           .failures = row.getColumn(4).getInt(),
           .losses = row.getColumn(10).getInt(),
           .digest = row.getColumn(5).getString(),
           .reused = row.getColumn(6).getInt() != 0,
           .rest_after = row.getColumn(7).isNull() ? std::nullopt
                                                   : std::optional<int>(row.getColumn(7).getInt()),
           .held_in = row.getColumn(8).getString()});
    }
    return records;
  });
}

absl::Status Reader::EachStatus(
    std::int64_t campaign, int first, int last,
    const std::function<void(int sample, EvaluationStatus status, bool rests)>& see) {
  return Guard([&] {
           SQLite::Statement& row = connection_->Bind(
               "SELECT sample, status, aside, rest_after IS NOT NULL FROM evaluation "
               "WHERE campaign = ? AND sample BETWEEN ? AND ? ORDER BY sample, experiment",
               campaign, first, last);
           while (row.executeStep()) {
             see(row.getColumn(0).getInt(),
                 ToEvaluationStatus(row.getColumn(1).getString(), row.getColumn(2).getInt() != 0),
                 row.getColumn(3).getInt() != 0);
           }
           return true;
         })
      .status();
}

absl::StatusOr<std::vector<StateRecord>> Reader::States(std::int64_t campaign,
                                                        std::optional<int> sample) {
  if (!sample.has_value()) {
    return StatesFrom(campaign, 0);
  }
  return Guard([&] {
    return ToStates(campaign,
                    connection_->Bind(
                        "SELECT sample, experiment, load_step, observables, others FROM state "
                        "WHERE campaign = ? AND sample = ? ORDER BY sample, experiment, load_step",
                        campaign, *sample));
  });
}

absl::Status Reader::EachState(
    std::int64_t campaign, int first, int last,
    const std::function<void(const EvaluationKey&, int, std::span<const double>)>& see) {
  return Guard([&] {
           SQLite::Statement& row = connection_->Bind(
               "SELECT sample, experiment, load_step, observables FROM state WHERE campaign = ? "
               "AND sample BETWEEN ? AND ? ORDER BY sample, experiment, load_step",
               campaign, first, last);
           std::vector<double> observables;
           while (row.executeStep()) {
             ToDoubles(row.getColumn(3), observables);
             see({.campaign = campaign,
                  .sample = row.getColumn(0).getInt(),
                  .experiment = row.getColumn(1).getInt()},
                 row.getColumn(2).getInt(), observables);
           }
           return true;
         })
      .status();
}

absl::StatusOr<std::vector<StateRecord>> Reader::StatesFrom(std::int64_t campaign, int first) {
  return Guard([&] {
    return ToStates(campaign,
                    connection_->Bind(
                        "SELECT sample, experiment, load_step, observables, others FROM state "
                        "WHERE campaign = ? AND sample >= ? ORDER BY sample, experiment, load_step",
                        campaign, first));
  });
}

absl::StatusOr<bool> Reader::KeepsStates(std::int64_t campaign, int sample) {
  static const std::string kKeeps = absl::StrCat("SELECT ?2 IN (", kKeptSamples, ")");
  return Guard([&] {
    SQLite::Statement& row = connection_->Bind(kKeeps, campaign, sample);
    return row.executeStep() && row.getColumn(0).getInt() != 0;
  });
}

absl::StatusOr<std::optional<EvaluationKey>> Reader::FindEqual(const std::string& digest) {
  static const std::string kFirst = absl::StrCat(
      "SELECT campaign, sample, experiment FROM evaluation "
      "WHERE digest = ? AND status IN ('finished', 'diverged') AND ",
      kStaysWhole, " ORDER BY campaign, sample, experiment LIMIT 1");
  return Guard([&] {
    std::optional<EvaluationKey> key;
    SQLite::Statement& row = connection_->Bind(kFirst, digest);
    if (row.executeStep()) {
      key = EvaluationKey{.campaign = row.getColumn(0).getInt64(),
                          .sample = row.getColumn(1).getInt(),
                          .experiment = row.getColumn(2).getInt()};
    }
    return key;
  });
}

absl::StatusOr<std::vector<ActiveAttempt>> Reader::ActiveAttempts() {
  return Guard([&] {
    std::vector<ActiveAttempt> attempts;
    SQLite::Statement& row = connection_->Bind(
        "SELECT id, campaign, sample, experiment, worker FROM attempt WHERE outcome IS NULL "
        "AND campaign NOT IN (SELECT campaign FROM leaving WHERE whole) ORDER BY id");
    while (row.executeStep()) {
      attempts.push_back({.id = row.getColumn(0).getInt64(),
                          .key = {.campaign = row.getColumn(1).getInt64(),
                                  .sample = row.getColumn(2).getInt(),
                                  .experiment = row.getColumn(3).getInt()},
                          .worker = row.getColumn(4).getString()});
    }
    return attempts;
  });
}

absl::StatusOr<std::int64_t> Reader::LastAttempt() {
  return Guard([&] {
    SQLite::Statement& row = connection_->Bind(
        "SELECT coalesce(max(seq), 0) FROM sqlite_sequence WHERE name = 'attempt'");
    return row.executeStep() ? row.getColumn(0).getInt64() : std::int64_t{0};
  });
}

absl::StatusOr<std::map<int, int>> Reader::AttemptsBySample(std::int64_t campaign) {
  return Guard([&] {
    std::map<int, int> attempts;
    SQLite::Statement& row = connection_->Bind(
        "SELECT sample, count(*) FROM attempt WHERE campaign = ? GROUP BY sample", campaign);
    while (row.executeStep()) {
      attempts[row.getColumn(0).getInt()] = row.getColumn(1).getInt();
    }
    return attempts;
  });
}

absl::StatusOr<std::map<int, std::string>> Reader::WordsBySample(std::int64_t campaign) {
  return Guard([&] {
    std::map<int, std::string> words;
    SQLite::Statement& row = connection_->Bind(
        "SELECT sample, words FROM attempt WHERE campaign = ? AND words <> '' ORDER BY id",
        campaign);
    while (row.executeStep()) {  // the last attempt's stay
      words[row.getColumn(0).getInt()] = row.getColumn(1).getString();
    }
    return words;
  });
}

absl::StatusOr<std::map<int, std::vector<std::pair<int, KeptFile>>>> Reader::KeptBySample(
    std::int64_t campaign) {
  return Guard([&] {
    std::map<int, std::vector<std::pair<int, KeptFile>>> kept;
    SQLite::Statement& row = connection_->Bind(
        "SELECT sample, experiment, name, coalesce(digest, ''), reason FROM kept "
        "WHERE campaign = ? ORDER BY sample, experiment, name",
        campaign);
    while (row.executeStep()) {
      kept[row.getColumn(0).getInt()].emplace_back(
          row.getColumn(1).getInt(), KeptFile{.name = row.getColumn(2).getString(),
                                              .digest = row.getColumn(3).getString(),
                                              .reason = row.getColumn(4).getString()});
    }
    return kept;
  });
}

absl::StatusOr<std::map<EvaluationKey, double>> Reader::CoreSeconds(std::int64_t campaign,
                                                                    std::optional<int> sample) {
  return Guard([&] {
    std::map<EvaluationKey, double> seconds;
    SQLite::Statement& row = connection_->Bind(
        "SELECT wanted.sample, wanted.experiment, sum(CASE WHEN attempt.core_seconds "
        "BETWEEN 0 AND 1e12 THEN attempt.core_seconds ELSE 0.0 END) AS spent "
        "FROM evaluation AS wanted JOIN evaluation AS ran "
        "ON ran.digest = wanted.digest AND NOT ran.reused AND (wanted.reused OR "
        "(ran.campaign, ran.sample, ran.experiment) = "
        "(wanted.campaign, wanted.sample, wanted.experiment)) "
        "JOIN attempt ON (attempt.campaign, attempt.sample, attempt.experiment) = "
        "(ran.campaign, ran.sample, ran.experiment) "
        "WHERE ran.campaign NOT IN (SELECT campaign FROM leaving WHERE whole) "
        "AND wanted.campaign = ? AND wanted.sample BETWEEN ? AND ? "
        "GROUP BY wanted.sample, wanted.experiment, ran.campaign, ran.sample, ran.experiment "
        "HAVING spent > 0",
        campaign, sample.value_or(0), sample.value_or(std::numeric_limits<int>::max()));
    while (row.executeStep()) {
      seconds[{campaign, row.getColumn(0).getInt(), row.getColumn(1).getInt()}] =
          row.getColumn(2).getDouble();
    }
    return seconds;
  });
}

absl::StatusOr<Effort> Reader::EffortOf(std::int64_t campaign) {
  return Guard([&] {
    Effort effort;
    SQLite::Statement& evaluations = connection_->Bind(
        "SELECT count(*) FROM evaluation WHERE campaign = ? AND NOT reused "
        "AND (status IN ('finished', 'diverged') OR (status = 'stopped_early' AND EXISTS "
        "(SELECT 1 FROM state WHERE state.campaign = evaluation.campaign AND "
        "state.sample = evaluation.sample AND state.experiment = evaluation.experiment "
        "UNION ALL SELECT 1 FROM pruned, attempt WHERE pruned.campaign = evaluation.campaign AND "
        "attempt.campaign = evaluation.campaign AND attempt.sample = evaluation.sample AND "
        "attempt.experiment = evaluation.experiment)))",
        campaign);
    if (evaluations.executeStep()) {
      effort.model_evaluations = evaluations.getColumn(0).getInt64();
    }
    SQLite::Statement& seconds = connection_->Bind(
        "SELECT coalesce(sum(core_seconds), 0.0) FROM attempt "
        "WHERE campaign = ? AND core_seconds BETWEEN 0 AND 1e12",
        campaign);
    if (seconds.executeStep()) {
      effort.core_seconds = seconds.getColumn(0).getDouble();
    }
    return effort;
  });
}

absl::StatusOr<std::vector<EventRecord>> Reader::Events(std::int64_t campaign) {
  return Guard([&] {
    std::vector<EventRecord> events;
    SQLite::Statement& row = connection_->Bind(
        "SELECT unix_ms, what FROM event WHERE campaign = ? ORDER BY id", campaign);
    while (row.executeStep()) {
      events.push_back(
          {.unix_ms = row.getColumn(0).getInt64(), .what = row.getColumn(1).getString()});
    }
    return events;
  });
}

absl::StatusOr<std::vector<FindingRecord>> Reader::Findings(std::int64_t campaign) {
  return Guard([&] {
    std::vector<FindingRecord> findings;
    SQLite::Statement& row = connection_->Bind(
        "SELECT kind, digest, created_unix_ms FROM finding WHERE campaign = ? ORDER BY id",
        campaign);
    while (row.executeStep()) {
      findings.push_back({.kind = row.getColumn(0).getString(),
                          .digest = row.getColumn(1).getString(),
                          .created_unix_ms = row.getColumn(2).getInt64()});
    }
    return findings;
  });
}

absl::StatusOr<std::map<std::string, int>> Reader::Quotas() {
  return Guard([&] {
    std::map<std::string, int> quotas;
    SQLite::Statement& row = connection_->Bind("SELECT owner, slots FROM quota");
    while (row.executeStep()) {
      quotas[row.getColumn(0).getString()] = row.getColumn(1).getInt();
    }
    return quotas;
  });
}

}  // namespace calib::store
