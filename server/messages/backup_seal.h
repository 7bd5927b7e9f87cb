#pragma once
// What stands at the end of a backup, so that whoever restores it knows that all of it is there and
// as it was taken. What stands before it is the SQLite file, which reads as one with its seal.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace calib::messages {

struct BackupSeal {
  std::string digest{};    ///< SHA-256 of all that stands before the seal
  std::int64_t bytes = 0;  ///< of that, >= 0

  friend bool operator==(const BackupSeal&, const BackupSeal&) = default;
};

/// Length of every seal [bytes].
inline constexpr std::int64_t kSealBytes = 102;

/// Pure.
std::string SealText(const BackupSeal& seal);
/// The seal that a text is; empty: it is none. Pure.
std::optional<BackupSeal> ParseSeal(std::string_view text);

}  // namespace calib::messages
