#pragma once
// Reads one YAML map key by key, turning every mismatch into a problem. Which keys there are and
// what they hold is said by a section of server/campaign/keys; a key that is none of them, or was
// never asked for, is unknown.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/campaign/file/text/problem_list.h"
#include "server/campaign/file/text/yaml_tree.h"
#include "server/campaign/keys/sections.h"
#include "server/campaign/model/range.h"
#include "server/campaign/model/word_table.h"

namespace calib::campaign {

/// The node, the section and the problem list must outlive the reader. A node that is no map is
/// reported once and then reads as empty.
class MapReader {
 public:
  MapReader(const YamlNode& node, std::string path, const Section& section, ProblemList& problems);

  const std::string& path() const { return path_; }
  int line() const { return line_; }
  ProblemList& problems() const { return *problems_; }

  /// "path.key"
  std::string PathOf(const std::string& key) const;
  /// Line of the key, or of the map when it is absent.
  int LineOf(const std::string& key) const;
  /// Adds a problem at a key (present or missing).
  void Problem(const std::string& key, const std::string& message,
               const std::string& kind = "") const;

  bool Has(const std::string& key) const;
  std::vector<std::string> Keys() const;

  /// The value, or nullptr. Each of these marks the key as known.
  const YamlNode* Find(const std::string& key);
  /// Like Find, but a missing key is a problem: "is missing; " + what.
  const YamlNode* Require(const std::string& key, const std::string& what);
  /// A text or a number as written. Empty optional: absent, or a problem was added.
  std::optional<std::string> Text(const std::string& key);
  std::optional<std::string> RequiredText(const std::string& key, const std::string& what);
  /// A number with an optional unit, in SI, of the unit and range of its key; or where those are
  /// the catalogue's, of these.
  std::optional<double> Quantity(const std::string& key);
  std::optional<double> Quantity(const std::string& key, const std::string& si_unit,
                                 const Range& range);
  /// The same of a node that stands somewhere below the key.
  std::optional<double> QuantityIn(const std::string& key, const YamlNode& node) const;
  /// A whole number within the bounds of its key, or these.
  std::optional<std::int64_t> Integer(const std::string& key);
  std::optional<std::int64_t> Integer(const std::string& key, std::int64_t min, std::int64_t max);
  std::optional<std::uint64_t> Seed(const std::string& key);
  /// The words that may stand at a key.
  const std::vector<std::string>& WordsOf(const std::string& key) const;
  /// One of the words of its key.
  std::optional<std::string> Choice(const std::string& key);
  /// One of a list of words.
  std::optional<std::string> Choice(const std::string& key,
                                    const std::vector<std::string>& allowed);
  template <typename Enum, std::size_t N>
  std::optional<Enum> Choice(const std::string& key, const WordTable<Enum, N>& words) {
    const auto word = Choice(key, AllWords(words));
    return word ? ValueOf(words, *word) : std::nullopt;
  }
  std::optional<bool> TrueOrFalse(const std::string& key);
  /// A list of texts; a single text counts as a list of one.
  std::optional<std::vector<std::string>> TextList(const std::string& key);
  /// A map of texts: {our_name: column}.
  std::optional<std::vector<std::pair<std::string, std::string>>> TextMap(const std::string& key);
  std::optional<MapReader> Map(const std::string& key);
  /// With the keys of this section, which must outlive what is returned.
  std::optional<MapReader> Map(const std::string& key, const Section& section);

  /// Marks keys as known without reading them.
  void Ignore(const std::vector<std::string>& keys);
  /// Reports unknown and doubled keys. Call once, when everything has been asked for.
  void Finish();

 private:
  const YamlEntry* FindEntry(const std::string& key) const;
  const Section& SectionBelow(const std::string& name) const;
  // The form of this kind that the section gives a key, which has one.
  const Form& FormOf(const std::string& key, Form::Kind kind) const;

  const YamlNode* node_;  // nullptr: was not a map
  std::string path_;
  const Section* section_;
  int line_ = 0;
  ProblemList* problems_;
  std::vector<std::string> known_;
};

/// A text or number as a quantity in SI within a range; adds a problem otherwise.
std::optional<double> ReadQuantity(const YamlNode& node, const std::string& path,
                                   const std::string& si_unit, const Range& range,
                                   ProblemList& problems);

}  // namespace calib::campaign
