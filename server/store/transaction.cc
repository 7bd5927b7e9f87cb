#include "server/store/transaction.h"

#include <algorithm>
#include <bit>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/store/blob_file.h"
#include "server/store/connection.h"
#include "server/store/removal.h"

namespace calib::store {
namespace {

/// Of a content in memory at a time [bytes]; chosen: some hundred pages of the file.
constexpr std::int64_t kPieceBytes = std::int64_t{512} * 1024;

/// What is unknown is a failure in the table, and set aside there (migration 10).
bool IsAside(EvaluationStatus status) { return status == EvaluationStatus::kUnknown; }
const char* StatusInTable(EvaluationStatus status) {
  return ToString(IsAside(status) ? EvaluationStatus::kFailed : status);
}

/// A content that was put stays for a while though nothing names it yet.
constexpr const char* kHasBeenPut =
    "INSERT INTO put(digest, unix_s) VALUES(?, CAST(strftime('%s', 'now') AS INTEGER)) "
    "ON CONFLICT DO UPDATE SET unix_s = excluded.unix_s";
constexpr const char* kIsNamed = "DELETE FROM put WHERE digest = ?";

}  // namespace

template <typename F>
void Transaction::Guard(F write) {
  if (!status_.ok()) {
    return;
  }
  try {
    write();
  } catch (const SQLite::Exception& error) {
    status_ = connection_.StatusOf(error);
  }
}

void Transaction::PutBlob(const std::string& digest, const std::string& content) {
  Guard([&] {
    SQLite::Statement& insert =
        connection_.Bind("INSERT INTO blob(digest, content) VALUES(?, ?) ON CONFLICT DO NOTHING");
    insert.bind(1, digest);
    // An empty blob has no address; a zero-length one of any address is stored as such, not as
    // NULL.
    insert.bind(2, static_cast<const void*>(content.data()), static_cast<int>(content.size()));
    insert.exec();
    insert.reset();
    connection_.Run(kHasBeenPut, digest);
  });
}

void Transaction::PutBlob(const std::string& digest, std::int64_t bytes, const Piece& piece) {
  Guard([&] {
    const bool is_new = connection_.Run(
                            "INSERT INTO blob(digest, content) VALUES(?, zeroblob(?)) "
                            "ON CONFLICT DO NOTHING",
                            digest, bytes) > 0;
    const std::int64_t row = connection_.database().getLastInsertRowid();
    connection_.Run(kHasBeenPut, digest);
    if (!is_new) {
      return;
    }
    BlobFile blob(connection_.database(), row, /*writable=*/true);
    std::vector<char> buffer(static_cast<std::size_t>(std::min(bytes, kPieceBytes)));
    for (std::int64_t at = 0; at < bytes; at += kPieceBytes) {
      const std::span<char> part(buffer.data(),
                                 static_cast<std::size_t>(std::min(bytes - at, kPieceBytes)));
      if (!piece(at, part)) {
        status_ = absl::InvalidArgumentError(
            absl::StrCat("the content of ", digest, " was cut short at byte ", at));
        return;
      }
      blob.Write(at, part);
    }
  });
}

void Transaction::PutRequest(const std::string& id, const RequestRecord& request) {
  Guard([&] {
    connection_.Run("INSERT INTO request(id, digest, answer) VALUES(?, ?, ?)", id, request.digest,
                    request.answer);
  });
}

void Transaction::ForgetRequests(const std::string& answer) {
  Guard([&] { connection_.Run("DELETE FROM request WHERE answer = ?", answer); });
}

void Transaction::InsertCampaign(const NewCampaign& campaign,
                                 const std::map<std::string, std::string>& files) {
  Guard([&] {
    std::optional<std::int64_t> seed;
    if (campaign.seed.has_value()) {
      seed = std::bit_cast<std::int64_t>(*campaign.seed);
    }
    connection_.Run(
        "INSERT INTO campaign(id, name, yaml, file_name, seed, method, samples, max_iterations, "
        "created_unix_ms, reading_rules, owner, state) VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, "
        "'queued')",
        campaign.id, campaign.name, campaign.yaml, campaign.file_name, seed, campaign.method,
        campaign.samples, campaign.max_iterations, campaign.created_unix_ms, campaign.reading_rules,
        campaign.owner);
    for (const auto& [path, digest] : files) {
      connection_.Run("INSERT INTO campaign_file(campaign, path, digest) VALUES(?, ?, ?)",
                      campaign.id, path, digest);
      connection_.Run(kIsNamed, digest);
    }
  });
}

void Transaction::SetProgress(std::int64_t campaign, const CampaignProgress& progress) {
  Guard([&] {
    connection_.Run(
        "UPDATE campaign SET state = ?, reason = ?, phase = ?, iteration = ?, converged = ?, "
        "pause_waived = ? WHERE id = ?",
        ToString(progress.state), progress.reason, ToString(progress.phase), progress.iteration,
        progress.converged, progress.pause_waived, campaign);
  });
}

void Transaction::SetState(std::int64_t campaign, CampaignState state, const std::string& reason) {
  Guard([&] {
    connection_.Run("UPDATE campaign SET state = ?, reason = ? WHERE id = ?", ToString(state),
                    reason, campaign);
  });
}

void Transaction::SetPriority(std::int64_t campaign, int priority) {
  Guard([&] {
    connection_.Run("UPDATE campaign SET priority = ? WHERE id = ?", priority, campaign);
  });
}

void Transaction::SetQuota(const std::string& owner, std::optional<int> slots) {
  Guard([&] {
    if (slots.has_value()) {
      connection_.Run(
          "INSERT INTO quota(owner, slots) VALUES(?, ?) "
          "ON CONFLICT DO UPDATE SET slots = excluded.slots",
          owner, *slots);
    } else {
      connection_.Run("DELETE FROM quota WHERE owner = ?", owner);
    }
  });
}

void Transaction::Pause(std::int64_t campaign, const std::string& reason) {
  Guard([&] {
    connection_.Run("UPDATE campaign SET state = ?, reason = ? WHERE id = ?",
                    ToString(CampaignState::kPaused), reason, campaign);
  });
}

void Transaction::DeleteCampaign(std::int64_t campaign) {
  Guard([&] {
    connection_.Run(
        "INSERT INTO leaving(campaign, whole) SELECT id, 1 FROM campaign WHERE id = ? "
        "ON CONFLICT DO UPDATE SET whole = 1",
        campaign);
  });
}

bool Transaction::Prune(std::int64_t campaign, int kept) {
  bool is_less = false;
  Guard([&] {
    is_less = connection_.Run(
                  "INSERT INTO pruned(campaign, kept) SELECT id, ?2 FROM campaign WHERE id = ?1 "
                  "AND id NOT IN (SELECT campaign FROM leaving WHERE whole) "
                  "AND ?2 < (SELECT count(*) FROM sample WHERE campaign = ?1) "
                  "ON CONFLICT DO UPDATE SET kept = excluded.kept WHERE excluded.kept < kept",
                  campaign, kept) > 0;
    if (is_less) {
      connection_.Run("INSERT INTO leaving(campaign, whole) VALUES(?, 0) ON CONFLICT DO NOTHING",
                      campaign);
    }
  });
  return is_less;
}

Removed Transaction::Remove(int rows) {
  Removed removed;
  Guard([&] { removed = RemoveRows(connection_, rows); });
  return removed;
}

void Transaction::RemoveBlob(const std::string& digest, std::int64_t put_before_unix_s) {
  Guard([&] { RemoveUnnamed(connection_, digest, put_before_unix_s); });
}

Removed Transaction::ReturnPages(int pages) {
  Removed returned;
  Guard([&] { returned = store::ReturnPages(connection_, pages); });
  empties_log_ = returned.count > 0 && !returned.more;
  return returned;
}

void Transaction::InsertIteration(std::int64_t campaign, int number, const std::string& proposal) {
  Guard([&] {
    connection_.Run("INSERT INTO iteration(campaign, number, proposal) VALUES(?, ?, ?)", campaign,
                    number, proposal);
  });
}

void Transaction::SetProposal(std::int64_t campaign, int number, const std::string& proposal) {
  Guard([&] {
    connection_.Run("UPDATE iteration SET proposal = ? WHERE campaign = ? AND number = ?", proposal,
                    campaign, number);
  });
}

void Transaction::SetPosterior(std::int64_t campaign, int number, const std::string& posterior) {
  Guard([&] {
    connection_.Run("UPDATE iteration SET posterior = ? WHERE campaign = ? AND number = ?",
                    posterior, campaign, number);
  });
}

void Transaction::InsertSample(std::int64_t campaign, const SampleRecord& sample) {
  Guard([&] {
    connection_.Run(
        "INSERT INTO sample(campaign, sample, iteration, parameters, log_weight, log_likelihood, "
        "stop_below, stream) VALUES(?, ?, ?, ?, ?, ?, ?, ?)",
        campaign, sample.sample, sample.iteration, DoubleBlob{sample.parameters}, sample.log_weight,
        sample.log_likelihood, sample.stop_below, std::optional<std::int64_t>(sample.stream));
  });
}

void Transaction::SetWeight(std::int64_t campaign, int sample, double log_weight,
                            double log_likelihood) {
  Guard([&] {
    connection_.Run(
        "UPDATE sample SET log_weight = ?1, log_likelihood = ?2 WHERE campaign = ?3 AND sample = "
        "?4 "
        "AND (log_weight IS NOT ?1 OR log_likelihood IS NOT ?2)",
        log_weight, log_likelihood, campaign, sample);
  });
}

void Transaction::SetStopBelow(std::int64_t campaign, int sample, double stop_below) {
  Guard([&] {
    connection_.Run("UPDATE sample SET stop_below = ? WHERE campaign = ? AND sample = ?",
                    stop_below, campaign, sample);
  });
}

void Transaction::NeverStop(std::int64_t campaign, int sample) {
  Guard([&] {
    connection_.Run("UPDATE sample SET stop_below = NULL WHERE campaign = ? AND sample = ?",
                    campaign, sample);
  });
}

void Transaction::Audit(std::int64_t campaign, int sample, double share) {
  Guard([&] {
    connection_.Run("UPDATE sample SET audited = ? WHERE campaign = ? AND sample = ?", share,
                    campaign, sample);
  });
}

void Transaction::InsertEvaluation(const EvaluationRecord& evaluation) {
  Guard([&] {
    connection_.Run(
        "INSERT INTO evaluation(campaign, sample, experiment, status, aside, reason, failures, "
        "digest, reused) VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?)",
        evaluation.key.campaign, evaluation.key.sample, evaluation.key.experiment,
        StatusInTable(evaluation.status), IsAside(evaluation.status), evaluation.reason,
        evaluation.failures, evaluation.digest, evaluation.reused);
  });
  if (evaluation.rest_after.has_value()) {
    SetRest(evaluation.key, evaluation.rest_after);
  }
}

void Transaction::SetRest(const EvaluationKey& key, std::optional<int> rest_after) {
  Guard([&] {
    connection_.Run(
        "UPDATE evaluation SET rest_after = ? WHERE campaign = ? AND sample = ? AND experiment = ?",
        std::optional<std::int64_t>(rest_after), key.campaign, key.sample, key.experiment);
  });
}

void Transaction::SetHeldIn(const EvaluationKey& key, const std::string& folder) {
  Guard([&] {
    connection_.Run(
        "UPDATE evaluation SET held_in = ? WHERE campaign = ? AND sample = ? AND experiment = ?",
        folder, key.campaign, key.sample, key.experiment);
  });
}

void Transaction::SetEvaluation(const EvaluationKey& key, EvaluationStatus status,
                                const std::string& reason, int failures) {
  Guard([&] {
    connection_.Run(
        "UPDATE evaluation SET status = ?, aside = ?, reason = ?, failures = ? "
        "WHERE campaign = ? AND sample = ? AND experiment = ?",
        StatusInTable(status), IsAside(status), reason, failures, key.campaign, key.sample,
        key.experiment);
  });
}

void Transaction::SetLosses(const EvaluationKey& key, int losses) {
  Guard([&] {
    connection_.Run(
        "UPDATE evaluation SET losses = ? WHERE campaign = ? AND sample = ? AND experiment = ?",
        losses, key.campaign, key.sample, key.experiment);
  });
}

void Transaction::BeginAnew(const EvaluationKey& key, const std::string& digest) {
  Guard([&] {
    for (const char* table : {"state", "kept"}) {
      connection_.Run(absl::StrCat("DELETE FROM ", table,
                                   " WHERE campaign = ? AND sample = ? AND experiment = ?")
                          .c_str(),
                      key.campaign, key.sample, key.experiment);
    }
    connection_.Run(
        "UPDATE evaluation SET digest = ?, held_in = '', status = ?, aside = 0, reason = '', "
        "failures = 0, losses = 0 "
        "WHERE campaign = ? AND sample = ? AND experiment = ?",
        digest, ToString(EvaluationStatus::kWaiting), key.campaign, key.sample, key.experiment);
  });
}

void Transaction::ReuseEvaluation(const EvaluationKey& from, const EvaluationKey& to) {
  // It may have been deleted or pruned since.
  static const std::string kFrom =
      absl::StrCat("WHERE campaign = ? AND sample = ? AND experiment = ? AND ", kStaysWhole);
  static const std::string kOutcome = absl::StrCat(
      "UPDATE evaluation SET (status, reason, reused) = (SELECT status, reason, 1 "
      "FROM evaluation WHERE campaign = ? AND sample = ? AND experiment = ?) "
      "WHERE campaign = ? AND sample = ? AND experiment = ? AND EXISTS (SELECT 1 FROM evaluation ",
      kFrom, ")");
  static const std::string kStates = absl::StrCat(
      "INSERT INTO state(campaign, sample, experiment, load_step, observables, others) "
      "SELECT ?, ?, ?, load_step, observables, others FROM state ",
      kFrom, " ON CONFLICT DO NOTHING");
  static const std::string kFiles = absl::StrCat(
      "INSERT INTO kept(campaign, sample, experiment, name, digest, reason) "
      "SELECT ?, ?, ?, name, digest, reason FROM kept ",
      kFrom, " ON CONFLICT DO NOTHING");
  Guard([&] {
    connection_.Run(kOutcome, from.campaign, from.sample, from.experiment, to.campaign, to.sample,
                    to.experiment, from.campaign, from.sample, from.experiment);
    for (const std::string* copy : {&kStates, &kFiles}) {
      connection_.Run(*copy, to.campaign, to.sample, to.experiment, from.campaign, from.sample,
                      from.experiment);
    }
  });
}

void Transaction::InsertAttempt(const NewAttempt& attempt) {
  Guard([&] {
    connection_.Run(
        "INSERT INTO attempt(id, campaign, sample, experiment, worker, cpu, engine, "
        "started_unix_ms) VALUES(?, ?, ?, ?, ?, ?, ?, ?)",
        attempt.id, attempt.key.campaign, attempt.key.sample, attempt.key.experiment,
        attempt.worker, attempt.cpu, attempt.engine, attempt.started_unix_ms);
  });
}

void Transaction::EndAttempt(const AttemptEnd& end) {
  Guard([&] {
    connection_.Run(
        "UPDATE attempt SET ended_unix_ms = ?, outcome = ?, reason = ?, steps = ?, "
        "contact_updates = ?, core_seconds = ?, staging = ?, words = ? WHERE id = ?",
        end.ended_unix_ms, ToString(end.outcome), end.reason, end.steps, end.contact_updates,
        end.core_seconds, end.staging, end.words, end.id);
    ++tally_.ended[static_cast<std::size_t>(end.outcome)];
    for (const KeptFile& file : end.kept) {
      connection_.Run(
          "INSERT INTO kept(campaign, sample, experiment, name, digest, reason) "
          "SELECT campaign, sample, experiment, ?, (SELECT digest FROM blob WHERE digest = ?), ? "
          "FROM attempt WHERE id = ? "
          "ON CONFLICT DO UPDATE SET digest = excluded.digest, reason = excluded.reason",
          file.name, file.digest, file.reason, end.id);
      connection_.Run(kIsNamed, file.digest);
    }
  });
}

void Transaction::EndOpenAttempts(std::int64_t campaign, const AttemptEnd& end) {
  Guard([&] {
    const int ended = connection_.Run(
        "UPDATE attempt SET ended_unix_ms = ?, outcome = ?, reason = ? "
        "WHERE campaign = ? AND outcome IS NULL",
        end.ended_unix_ms, ToString(end.outcome), end.reason, campaign);
    tally_.ended[static_cast<std::size_t>(end.outcome)] += static_cast<std::uint64_t>(ended);
  });
}

void Transaction::PutState(const StateRecord& state, std::int64_t unix_ms) {
  Guard([&] {
    const EvaluationKey& key = state.key;
    if (state.observables.empty()) {  // joins the state of this step
      connection_.Run(
          "UPDATE state SET others = json_patch(CASE others WHEN '' THEN '{}' ELSE others END, ?) "
          "WHERE campaign = ? AND sample = ? AND experiment = ? AND load_step = ?",
          state.others, key.campaign, key.sample, key.experiment, state.load_step);
      return;
    }
    const DoubleBlob blob{state.observables};
    const int inserted = connection_.Run(
        "INSERT INTO state(campaign, sample, experiment, load_step, observables, others) "
        "VALUES(?, ?, ?, ?, ?, ?) ON CONFLICT DO NOTHING",
        key.campaign, key.sample, key.experiment, state.load_step, blob, state.others);
    if (inserted > 0) {
      ++tally_.states;
      return;
    }
    SQLite::Statement& same = connection_.Bind(
        "SELECT observables = ? FROM state "
        "WHERE campaign = ? AND sample = ? AND experiment = ? AND load_step = ?",
        blob, key.campaign, key.sample, key.experiment, state.load_step);
    const bool differs = same.executeStep() && same.getColumn(0).getInt() == 0;
    same.reset();
    if (differs) {
      Log(key.campaign, unix_ms,
          absl::StrCat("nondeterminism: sample ", key.sample, " experiment ", key.experiment,
                       " load step ", state.load_step,
                       " was computed again with other bits; the first result is kept"));
    }
  });
}

void Transaction::PutFinding(std::int64_t campaign, const FindingRecord& finding) {
  Guard([&] {
    connection_.Run(
        "INSERT INTO finding(campaign, kind, digest, created_unix_ms) "
        "SELECT campaign.id, ?, blob.digest, ? FROM campaign, blob "
        "WHERE campaign.id = ? AND blob.digest = ? "
        "ON CONFLICT DO UPDATE SET id = 1 + (SELECT max(id) FROM finding)",
        finding.kind, finding.created_unix_ms, campaign, finding.digest);
    connection_.Run(kIsNamed, finding.digest);
  });
}

void Transaction::Log(std::int64_t campaign, std::int64_t unix_ms, const std::string& what) {
  Guard([&] {
    std::optional<std::int64_t> owner;
    if (campaign != 0) {
      owner = campaign;
    }
    connection_.Run("INSERT INTO event(unix_ms, campaign, what) VALUES(?, ?, ?)", unix_ms, owner,
                    what);
  });
}

}  // namespace calib::store
