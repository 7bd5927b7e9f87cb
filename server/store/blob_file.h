#pragma once
// A content read and written in pieces, in the place where it is stored. Private to this folder.

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include <cstdint>
#include <span>

namespace calib::store {

/// The column `content` of one row of the table `blob`. Throws SQLite::Exception. Not thread-safe.
class BlobFile {
 public:
  BlobFile(SQLite::Database& database, std::int64_t row, bool writable) : database_(database) {
    Expect(sqlite3_blob_open(database.getHandle(), "main", "blob", "content", row, writable ? 1 : 0,
                             &blob_));
  }
  ~BlobFile() { sqlite3_blob_close(blob_); }
  BlobFile(const BlobFile&) = delete;
  BlobFile& operator=(const BlobFile&) = delete;

  /// All of the span, from this byte of the content on; the content has as many.
  void Read(std::int64_t from, std::span<char> to) {
    Expect(
        sqlite3_blob_read(blob_, to.data(), static_cast<int>(to.size()), static_cast<int>(from)));
  }
  void Write(std::int64_t to, std::span<const char> from) {
    Expect(sqlite3_blob_write(blob_, from.data(), static_cast<int>(from.size()),
                              static_cast<int>(to)));
  }

 private:
  void Expect(int result) {
    if (result != SQLITE_OK) {
      throw SQLite::Exception(database_.getHandle(), result);
    }
  }

  SQLite::Database& database_;
  sqlite3_blob* blob_ = nullptr;
};

}  // namespace calib::store
