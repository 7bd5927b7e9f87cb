// Reads of a Reader that are about the file itself: copies, what nobody names, its checks.
#include <sqlite3.h>

#include <condition_variable>
#include <mutex>
#include <thread>

#include "absl/strings/str_cat.h"
#include "server/store/connection.h"
#include "server/store/reader.h"
#include "server/store/reader_guard.h"
#include "server/store/removal.h"
#include "server/store/whole_copy.h"

namespace calib::store {

absl::Status Reader::CopyTo(const std::string& path, const std::function<bool()>& goes_on) {
  const auto copied = Guard([&] {
    connection_->Bind("SELECT count(*) FROM sqlite_schema")
        .executeStep();  // from now on one picture
    return CopyWhole(connection_->database(), path, goes_on);
  });
  return copied.ok() ? *copied : copied.status();
}

absl::StatusOr<std::int64_t> Reader::LastBackupUnixMs() {
  return Guard([&] {
    SQLite::Statement& row = connection_->Bind(
        "SELECT coalesce(max(unix_ms), 0) FROM event WHERE campaign IS NULL AND what = ?",
        kBackupEvent);
    return row.executeStep() ? row.getColumn(0).getInt64() : std::int64_t{0};
  });
}

absl::StatusOr<std::vector<std::pair<std::string, std::int64_t>>> Reader::Unnamed(
    std::int64_t put_before_unix_s, int most) {
  static const std::string kSome = absl::StrCat("SELECT digest, length(content) FROM blob WHERE ",
                                                kUnnamed, " ORDER BY digest LIMIT ?");
  return Guard([&] {
    std::vector<std::pair<std::string, std::int64_t>> contents;
    SQLite::Statement& row = connection_->Bind(kSome, put_before_unix_s, most);
    while (row.executeStep()) {
      contents.emplace_back(row.getColumn(0).getString(), row.getColumn(1).getInt64());
    }
    return contents;
  });
}

absl::StatusOr<Reader::Upkeep> Reader::UpkeepOf() {
  return Guard([&] {
    const auto number = [this](const char* sql) {
      return connection_->database().execAndGet(sql).getInt64();
    };
    return Upkeep{.leaving = static_cast<int>(number("SELECT count(*) FROM leaving")),
                  .empty_bytes = number("PRAGMA freelist_count") * number("PRAGMA page_size"),
                  .gives_back = number("PRAGMA auto_vacuum") != 0};
  });
}

absl::StatusOr<Reader::FileCheck> Reader::CheckFile(std::chrono::milliseconds at_most) {
  // SQLite looks at interrupts on every page, at a progress handler between instructions only, of
  // which the whole of a large table may be one.
  std::mutex mutex;
  std::condition_variable change;
  bool ended = false;
  std::thread alarm([&, file = connection_->database().getHandle()] {
    std::unique_lock lock(mutex);
    if (!change.wait_for(lock, at_most, [&] { return ended; })) {
      sqlite3_interrupt(file);
    }
  });
  auto check = Guard([&] {
    FileCheck found;
    try {
      SQLite::Statement& row = connection_->Bind("PRAGMA quick_check(1)");
      found.fault = row.executeStep() ? row.getColumn(0).getString() : "";
      row.reset();
      found.in_full = true;
    } catch (const SQLite::Exception& error) {
      if (error.getErrorCode() != SQLITE_INTERRUPT) {
        throw;
      }
    }
    if (found.fault == "ok") {
      found.fault.clear();
    }
    return found;
  });
  {
    const std::lock_guard lock(mutex);
    ended = true;
  }
  change.notify_one();
  alarm.join();
  return check;
}

}  // namespace calib::store
