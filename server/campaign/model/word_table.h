#pragma once
// Enumerations that are words outside of the program: one table of words for both ways.

#include <array>
#include <cassert>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace calib::campaign {

template <typename Enum>
struct Word {
  Enum value;
  const char* text;
};
template <typename Enum>
Word(Enum, const char*) -> Word<Enum>;

/// All words of an enumeration, in the order in which they are listed to users.
template <typename Enum, std::size_t N>
using WordTable = std::array<Word<Enum>, N>;

/// The word of a value, which is in the table.
template <typename Enum, std::size_t N>
constexpr const char* WordOf(const WordTable<Enum, N>& table, Enum value) {
  for (const Word<Enum>& word : table) {
    if (word.value == value) return word.text;
  }
  assert(false);
  return "";
}

/// The value of a word; empty for a text that is none of the table.
template <typename Enum, std::size_t N>
constexpr std::optional<Enum> ValueOf(const WordTable<Enum, N>& table, std::string_view text) {
  for (const Word<Enum>& word : table) {
    if (text == word.text) return word.value;
  }
  return std::nullopt;
}

template <typename Enum, std::size_t N>
std::vector<std::string> AllWords(const WordTable<Enum, N>& table) {
  std::vector<std::string> words;
  for (const Word<Enum>& word : table) words.emplace_back(word.text);
  return words;
}

}  // namespace calib::campaign
