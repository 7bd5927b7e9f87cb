#include "proto/rpc/text_kinds.h"

#include <google/protobuf/descriptor.h>

#include <algorithm>

namespace calib::rpc {
namespace {

constexpr std::string_view kCut = "...";

bool IsPrintable(unsigned char c) { return c >= 0x20 && c != 0x7f; }

bool IsOfWord(unsigned char c) {
  return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
}

/// Bytes of the UTF-8 character that begins at `at`; 0: there is none [RFC 3629, sec. 4].
std::size_t CharacterAt(const std::string& text, std::size_t at) {
  const auto byte = [&text](std::size_t k) {
    return k < text.size() ? static_cast<unsigned char>(text[k]) : 0U;
  };
  const auto tail = [&byte](std::size_t k) { return (byte(k) & 0xc0U) == 0x80U; };
  const unsigned first = byte(at);
  const unsigned second = byte(at + 1);
  if (first < 0x80) return 1;
  if (first >= 0xc2 && first <= 0xdf) return tail(at + 1) ? 2 : 0;
  if (first >= 0xe0 && first <= 0xef) {
    const bool shortest = first != 0xe0 || second >= 0xa0;
    const bool no_surrogate = first != 0xed || second <= 0x9f;
    return tail(at + 1) && tail(at + 2) && shortest && no_surrogate ? 3 : 0;
  }
  if (first >= 0xf0 && first <= 0xf4) {
    const bool in_range = (first != 0xf0 || second >= 0x90) && (first != 0xf4 || second <= 0x8f);
    return tail(at + 1) && tail(at + 2) && tail(at + 3) && in_range ? 4 : 0;
  }
  return 0;
}

}  // namespace

std::size_t LongestOf(v1::Text kind) {
  return v1::Text_descriptor()->FindValueByNumber(kind)->options().GetExtension(v1::bytes);
}

bool HasForm(v1::Text kind, const std::string& text) {
  switch (kind) {
    case v1::NAME:
    case v1::REQUEST:
    case v1::PATH:
      return std::all_of(text.begin(), text.end(), IsPrintable);
    case v1::WORD:
      return std::all_of(text.begin(), text.end(), IsOfWord);
    case v1::DIGEST:
      return (text.empty() || text.size() == LongestOf(v1::DIGEST)) &&
             std::all_of(text.begin(), text.end(),
                         [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); });
    default:
      return true;
  }
}

const char* FormOf(v1::Text kind) {
  switch (kind) {
    case v1::NAME:
    case v1::REQUEST:
    case v1::PATH:
      return "no control characters";
    case v1::WORD:
      return "a-z, 0-9 and _";
    case v1::DIGEST:
      return "64 lower-case hexadecimal digits";
    default:
      return "";
  }
}

std::string Fitted(v1::Text kind, const std::string& text) {
  if (kind == v1::DIGEST) {
    return text;
  }
  const std::size_t longest = LongestOf(kind);
  std::string fitted;
  std::size_t end_if_cut = 0;  // behind the last character after which "..." has room
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t bytes = CharacterAt(text, at);
    const std::string character = text.substr(at, std::max<std::size_t>(bytes, 1));
    fitted += bytes > 0 && HasForm(kind, character) ? character : kind == v1::WORD ? "_" : "?";
    if (fitted.size() + kCut.size() <= longest) {
      end_if_cut = fitted.size();
    }
    if (fitted.size() > longest) {
      fitted.resize(end_if_cut);
      return kind == v1::WORD ? fitted : fitted + std::string(kCut);
    }
    at += character.size();
  }
  return fitted;
}

}  // namespace calib::rpc
