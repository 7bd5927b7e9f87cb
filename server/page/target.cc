#include "server/page/target.h"

#include <optional>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"

namespace calib::page {
namespace {

std::optional<int> HexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return std::nullopt;
}

/// Percent codes as the bytes that they stand for [RFC 3986, sec. 2.1].
absl::StatusOr<std::string> Decoded(std::string_view text) {
  constexpr int kBase = 16;
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '%') {
      const auto high = i + 2 < text.size() ? HexDigit(text[i + 1]) : std::nullopt;
      const auto low = i + 2 < text.size() ? HexDigit(text[i + 2]) : std::nullopt;
      if (!high || !low) {
        return absl::InvalidArgumentError("the address holds a percent sign without two digits");
      }
      c = static_cast<char>(kBase * *high + *low);
      i += 2;
    }
    if (absl::ascii_iscntrl(static_cast<unsigned char>(c))) {
      return absl::InvalidArgumentError("the address holds a control character");
    }
    decoded += c;
  }
  return decoded;
}

/// The part before the first `mark`, which goes from `rest` with it.
std::string_view Cut(std::string_view& rest, char mark) {
  const std::size_t end = rest.find(mark);
  const std::string_view part = rest.substr(0, end);
  rest = end == std::string_view::npos ? std::string_view() : rest.substr(end + 1);
  return part;
}

}  // namespace

absl::StatusOr<Target> ParseTarget(std::string_view text) {
  if (text.empty() || text.front() != '/') {
    return absl::InvalidArgumentError("the address does not begin with a slash");
  }
  if (text.size() > kLongestTarget) {
    return absl::InvalidArgumentError(
        absl::StrCat("the address is longer than ", kLongestTarget, " bytes"));
  }
  Target target;
  std::string_view query = text.substr(1);
  std::string_view path = Cut(query, '?');
  while (!path.empty()) {
    ASSIGN_OR_RETURN(auto piece, Decoded(Cut(path, '/')));
    if (piece == "." || piece == "..") {
      return absl::InvalidArgumentError("the address goes to a folder by dots");
    }
    target.path.push_back(std::move(piece));
  }
  while (!query.empty()) {
    std::string_view value = Cut(query, '&');
    ASSIGN_OR_RETURN(auto name, Decoded(Cut(value, '=')));
    ASSIGN_OR_RETURN(auto decoded, Decoded(value));
    target.query.emplace(std::move(name), std::move(decoded));
  }
  return target;
}

std::string CookieIn(std::string_view header, std::string_view name) {
  while (!header.empty()) {
    std::string_view value = Cut(header, ';');
    while (value.starts_with(' ')) value.remove_prefix(1);
    while (value.ends_with(' ')) value.remove_suffix(1);
    if (Cut(value, '=') == name) return std::string(value);
  }
  return "";
}

std::string HostIn(std::string_view header) {
  const std::size_t bracket = header.find(']');
  const std::size_t colon = header.find(':', bracket == std::string_view::npos ? 0 : bracket);
  return absl::AsciiStrToLower(std::string(header.substr(0, colon)));
}

}  // namespace calib::page
