#include "server/messages/backup_seal.h"

#include <charconv>

#include "absl/strings/str_format.h"

namespace calib::messages {
namespace {

constexpr std::string_view kBegin = "\ncalib-backup 1 ";
constexpr std::size_t kDigestDigits = 64;
constexpr std::size_t kBytesDigits = 20;
static_assert(kSealBytes == kBegin.size() + kDigestDigits + 1 + kBytesDigits + 1);

}  // namespace

std::string SealText(const BackupSeal& seal) {
  return absl::StrFormat("%s%s %020d\n", std::string(kBegin), seal.digest, seal.bytes);
}

std::optional<BackupSeal> ParseSeal(std::string_view text) {
  if (text.size() != kSealBytes || text.substr(0, kBegin.size()) != kBegin) return std::nullopt;
  BackupSeal seal{.digest = std::string(text.substr(kBegin.size(), kDigestDigits))};
  const std::string_view bytes = text.substr(kBegin.size() + kDigestDigits + 1, kBytesDigits);
  const auto [end, error] = std::from_chars(bytes.data(), bytes.data() + bytes.size(), seal.bytes);
  if (error != std::errc() || end != bytes.data() + bytes.size() || SealText(seal) != text) {
    return std::nullopt;
  }
  return seal;
}

}  // namespace calib::messages
