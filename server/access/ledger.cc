#include "server/access/ledger.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/time.h"
#include "calib/return_if_error.h"
#include "server/access/files.h"
#include "server/access/x509.h"

namespace calib::access {
namespace {

constexpr const char* kLedgerColumns = "serial,name,role,not_after,revoked";

std::string InstantText(std::int64_t unix_s) {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%SZ", absl::FromUnixSeconds(unix_s), absl::UTCTimeZone());
}

std::optional<std::int64_t> ReadInstant(const std::string& text) {
  absl::Time time;
  if (!absl::ParseTime(absl::RFC3339_full, text, &time, nullptr)) return std::nullopt;
  return absl::ToUnixSeconds(time);
}

bool IsHex(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
  });
}

std::optional<IssuedCertificate> ReadRow(const std::string& line) {
  const std::vector<std::string> cells = absl::StrSplit(line, ',');
  if (cells.size() != 5 || !IsHex(cells[0]) || !IsName(cells[1])) return std::nullopt;
  const auto role = RoleOf(cells[2]);
  const auto not_after = ReadInstant(cells[3]);
  const auto revoked = ReadInstant(cells[4]);
  if (!role || !not_after || (!revoked && !cells[4].empty())) return std::nullopt;
  return IssuedCertificate{.serial = cells[0],
                           .name = cells[1],
                           .role = *role,
                           .not_after_unix_s = *not_after,
                           .revoked_unix_s = revoked};
}

}  // namespace

absl::StatusOr<Ledger> ReadLedger(const std::string& path) {
  ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  std::vector<std::string> lines = absl::StrSplit(text, '\n');
  if (lines.size() > 1 && lines.back().empty()) lines.pop_back();
  Ledger ledger;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const auto row = i == 0 ? std::nullopt : ReadRow(lines[i]);
    if (row) {
      ledger.push_back(*row);
    } else if (i > 0 || lines[i] != kLedgerColumns) {
      return absl::FailedPreconditionError(
          absl::StrCat(path, ":", i + 1, ": is no row of ", kLedgerColumns,
                       ", with times like 2026-11-01T12:00:00Z: put the file back from a copy"));
    }
  }
  return ledger;
}

absl::Status WriteLedger(const std::string& path, const Ledger& ledger) {
  std::string text = absl::StrCat(kLedgerColumns, "\n");
  for (const IssuedCertificate& row : ledger) {
    absl::StrAppend(&text, row.serial, ",", row.name, ",", NameOf(row.role), ",",
                    InstantText(row.not_after_unix_s), ",",
                    row.revoked_unix_s ? InstantText(*row.revoked_unix_s) : "", "\n");
  }
  return ReplaceFile(path, text, kSecretFile);
}

}  // namespace calib::access
