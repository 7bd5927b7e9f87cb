#pragma once
// A YAML document as a plain tree with line numbers. The only file pair that knows yaml-cpp.

#include <optional>
#include <string>
#include <vector>

namespace calib::campaign {

struct YamlEntry;

struct YamlNode {
  enum class Kind { kNull, kScalar, kSequence, kMap };
  Kind kind = Kind::kNull;
  int line = 0;                    ///< 1-based
  std::string scalar;              ///< kScalar
  std::vector<YamlNode> items;     ///< kSequence
  std::vector<YamlEntry> entries;  ///< kMap, in file order; a key written twice stands here twice
};

struct YamlEntry {
  std::string key;
  int line = 0;  ///< 1-based line of the key
  YamlNode value;
};

/// What makes a text unreadable: one sentence and the line it points to.
struct YamlError {
  int line = 0;
  std::string message;
};

/// Exactly one of the two is set. Aliases are expanded; documents nested deeper than 50 levels or
/// of more than 200 000 nodes are refused. Never throws.
struct YamlParse {
  std::optional<YamlNode> root;
  std::optional<YamlError> error;
};
YamlParse ParseYaml(const std::string& text);

/// "a number or a text", "a list", "a map", "nothing".
std::string KindName(const YamlNode& node);

}  // namespace calib::campaign
