#include "server/campaign/file/shared/map_reader.h"

#include <algorithm>
#include <cassert>
#include <charconv>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {
namespace {

template <typename Int>
std::optional<Int> ParseInteger(const std::string& text) {
  Int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc() && end == text.data() + text.size()) return value;
  // "1e3" and "400.0" are whole numbers too.
  double number = 0;
  const auto [rest, failed] = std::from_chars(text.data(), text.data() + text.size(), number);
  constexpr double kExact =
      9007199254740992.0;  // 2^53: beyond, a double no longer names one whole number
  const bool whole = failed == std::errc() && rest == text.data() + text.size() &&
                     std::abs(number) <= kExact && number == std::floor(number);
  if (!whole || (std::is_unsigned_v<Int> && number < 0)) return std::nullopt;
  return static_cast<Int>(number);
}

}  // namespace

MapReader::MapReader(const YamlNode& node, std::string path, const Section& section,
                     ProblemList& problems)
    : node_(&node),
      path_(std::move(path)),
      section_(&section),
      line_(node.line),
      problems_(&problems) {
  if (node.kind != YamlNode::Kind::kMap) {
    node_ = nullptr;
    problems_->Add(line_, path_,
                   absl::StrCat("is ", KindName(node), ", expected a map of key: value"));
  }
}

std::string MapReader::PathOf(const std::string& key) const {
  return path_.empty() ? key : path_ + "." + key;
}

const YamlEntry* MapReader::FindEntry(const std::string& key) const {
  if (node_ == nullptr) return nullptr;
  for (const YamlEntry& entry : node_->entries) {
    if (entry.key == key) return &entry;
  }
  return nullptr;
}

const Form& MapReader::FormOf(const std::string& key, Form::Kind kind) const {
  const Key* row = FindKey(*section_, key);
  const Form* form = row != nullptr ? FindForm(row->form, kind) : nullptr;
  assert(form != nullptr);
  static const Form kNone;
  return form != nullptr ? *form : kNone;
}

int MapReader::LineOf(const std::string& key) const {
  const YamlEntry* entry = FindEntry(key);
  return entry != nullptr ? entry->line : line_;
}

void MapReader::Problem(const std::string& key, const std::string& message,
                        const std::string& kind) const {
  problems_->Add(LineOf(key), PathOf(key), message, kind);
}

bool MapReader::Has(const std::string& key) const { return FindEntry(key) != nullptr; }

std::vector<std::string> MapReader::Keys() const {
  std::vector<std::string> keys;
  if (node_ == nullptr) return keys;
  for (const YamlEntry& entry : node_->entries) keys.push_back(entry.key);
  return keys;
}

const YamlNode* MapReader::Find(const std::string& key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.push_back(key);
  const YamlEntry* entry = FindEntry(key);
  return entry != nullptr ? &entry->value : nullptr;
}

const YamlNode* MapReader::Require(const std::string& key, const std::string& what) {
  const YamlNode* node = Find(key);
  if (node == nullptr && node_ != nullptr) Problem(key, "is missing; " + what);
  return node;
}

std::optional<std::string> MapReader::Text(const std::string& key) {
  const YamlNode* node = Find(key);
  if (node == nullptr) return std::nullopt;
  if (node->kind != YamlNode::Kind::kScalar) {
    Problem(key, absl::StrCat("is ", KindName(*node), ", expected a single value"));
    return std::nullopt;
  }
  return node->scalar;
}

std::optional<std::string> MapReader::RequiredText(const std::string& key,
                                                   const std::string& what) {
  return Require(key, what) != nullptr ? Text(key) : std::nullopt;
}

std::optional<double> ReadQuantity(const YamlNode& node, const std::string& path,
                                   const std::string& si_unit, const Range& range,
                                   ProblemList& problems) {
  if (node.kind != YamlNode::Kind::kScalar) {
    problems.Add(node.line, path,
                 absl::StrCat("is ", KindName(node), ", expected ", KindOfUnit(si_unit)));
    return std::nullopt;
  }
  const auto value = ParseQuantity(node.scalar, si_unit);
  if (!value.ok()) {
    problems.Add(node.line, path, std::string(value.status().message()));
    return std::nullopt;
  }
  if (std::isinf(*value) && !range.infinite_allowed) {
    problems.Add(
        node.line, path,
        absl::StrCat(Quoted(node.scalar), " is not finite; allowed: ", range.Describe(si_unit)));
    return std::nullopt;
  }
  if (!range.Contains(*value)) {
    problems.Add(node.line, path,
                 absl::StrCat(Quoted(node.scalar),
                              " is outside what is allowed: ", range.Describe(si_unit)));
    return std::nullopt;
  }
  return *value;
}

std::optional<double> MapReader::Quantity(const std::string& key) {
  const Form& form = FormOf(key, Form::Kind::kNumber);
  return Quantity(key, form.unit, form.range);
}

std::optional<double> MapReader::Quantity(const std::string& key, const std::string& si_unit,
                                          const Range& range) {
  const YamlNode* node = Find(key);
  if (node == nullptr) return std::nullopt;
  return ReadQuantity(*node, PathOf(key), si_unit, range, *problems_);
}

std::optional<double> MapReader::QuantityIn(const std::string& key, const YamlNode& node) const {
  const Form& form = FormOf(key, Form::Kind::kNumber);
  return ReadQuantity(node, PathOf(key), form.unit, form.range, *problems_);
}

std::optional<std::int64_t> MapReader::Integer(const std::string& key) {
  const Form& form = FormOf(key, Form::Kind::kWhole);
  return Integer(key, form.least, static_cast<std::int64_t>(form.most));
}

std::optional<std::int64_t> MapReader::Integer(const std::string& key, std::int64_t min,
                                               std::int64_t max) {
  const auto text = Text(key);
  if (!text) return std::nullopt;
  const auto value = ParseInteger<std::int64_t>(*text);
  if (!value || *value < min || *value > max) {
    Problem(key, absl::StrCat(Quoted(*text), " is not a whole number from ", min, " to ", max));
    return std::nullopt;
  }
  return value;
}

std::optional<std::uint64_t> MapReader::Seed(const std::string& key) {
  const auto text = Text(key);
  if (!text) return std::nullopt;
  const auto value = ParseInteger<std::uint64_t>(*text);
  if (!value) Problem(key, absl::StrCat(Quoted(*text), " is not a whole number of at least 0"));
  return value;
}

const std::vector<std::string>& MapReader::WordsOf(const std::string& key) const {
  return FormOf(key, Form::Kind::kWord).words;
}

std::optional<std::string> MapReader::Choice(const std::string& key) {
  return Choice(key, WordsOf(key));
}

std::optional<std::string> MapReader::Choice(const std::string& key,
                                             const std::vector<std::string>& allowed) {
  auto text = Text(key);
  if (!text) return std::nullopt;
  if (std::find(allowed.begin(), allowed.end(), *text) == allowed.end()) {
    Problem(key, absl::StrCat(Quoted(*text), " is unknown; ", Suggestion(*text, allowed)));
    return std::nullopt;
  }
  return text;
}

std::optional<bool> MapReader::TrueOrFalse(const std::string& key) {
  const auto word = Choice(key, std::vector<std::string>{"true", "false"});
  if (!word) return std::nullopt;
  return *word == "true";
}

std::optional<std::vector<std::string>> MapReader::TextList(const std::string& key) {
  const YamlNode* node = Find(key);
  if (node == nullptr) return std::nullopt;
  if (node->kind == YamlNode::Kind::kScalar) return std::vector<std::string>{node->scalar};
  std::vector<std::string> texts;
  if (node->kind == YamlNode::Kind::kSequence) {
    for (const YamlNode& item : node->items) {
      if (item.kind != YamlNode::Kind::kScalar) {
        problems_->Add(item.line, PathOf(key),
                       absl::StrCat("holds ", KindName(item), ", expected names only"));
        return std::nullopt;
      }
      texts.push_back(item.scalar);
    }
    return texts;
  }
  Problem(key, absl::StrCat("is ", KindName(*node), ", expected a list [a, b]"));
  return std::nullopt;
}

std::optional<std::vector<std::pair<std::string, std::string>>> MapReader::TextMap(
    const std::string& key) {
  auto map = Map(key);
  if (!map) return std::nullopt;
  std::vector<std::pair<std::string, std::string>> texts;
  for (const std::string& name : map->Keys()) {
    if (const auto text = map->Text(name)) texts.emplace_back(name, *text);
  }
  map->Finish();
  return texts;
}

const Section& MapReader::SectionBelow(const std::string& name) const {
  for (const Section& section : section_->of_keys) {
    if (section.name == name) return section;
  }
  return SectionOf(name);
}

std::optional<MapReader> MapReader::Map(const std::string& key) {
  if (Find(key) == nullptr) return std::nullopt;
  return Map(key, SectionBelow(FormOf(key, Form::Kind::kMap).section));
}

std::optional<MapReader> MapReader::Map(const std::string& key, const Section& section) {
  const YamlNode* node = Find(key);
  if (node == nullptr) return std::nullopt;
  MapReader map(*node, PathOf(key), section, *problems_);
  if (map.node_ == nullptr) return std::nullopt;
  map.line_ = LineOf(key);
  return map;
}

void MapReader::Ignore(const std::vector<std::string>& keys) {
  for (const std::string& key : keys) Find(key);
}

void MapReader::Finish() {
  if (node_ == nullptr) return;
  std::vector<std::string> seen;
  for (const YamlEntry& entry : node_->entries) {
    const bool asked = std::find(known_.begin(), known_.end(), entry.key) != known_.end();
    if (!asked || FindKey(*section_, entry.key) == nullptr) {
      problems_->Add(entry.line, PathOf(entry.key),
                     absl::StrCat("is an unknown key; ", Suggestion(entry.key, known_)));
    } else if (std::find(seen.begin(), seen.end(), entry.key) != seen.end()) {
      problems_->Add(entry.line, PathOf(entry.key), "stands here twice; keep one");
    }
    seen.push_back(entry.key);
  }
}

}  // namespace calib::campaign
