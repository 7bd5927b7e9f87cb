#include "server/campaign/file/text/yaml_text.h"

#include <algorithm>
#include <charconv>
#include <utility>

namespace calib::campaign {
namespace {

using Kind = YamlNode::Kind;

bool IsPlain(const std::string& text) {
  const auto safe = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '.' || c == '/' || c == '+' || c == '-' || c == '^' || c == '$' || c == ' ';
  };
  return !text.empty() && std::all_of(text.begin(), text.end(), safe) && text.front() != ' ' &&
         text.back() != ' ' && text.front() != '-' && text != "null" && text != "Null" &&
         text != "NULL";
}

std::string Scalar(const std::string& text) {
  if (IsPlain(text)) return text;
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    if (c == '\n') {
      quoted += "\\n";
    } else if (c == '\t') {
      quoted += "\\t";
    } else {
      quoted += c;
    }
  }
  return quoted + "\"";
}

std::string Flow(const YamlNode& node) {
  std::string text;
  switch (node.kind) {
    case Kind::kNull:
      return "null";
    case Kind::kScalar:
      return Scalar(node.scalar);
    case Kind::kSequence:
      for (const YamlNode& item : node.items) text += (text.empty() ? "" : ", ") + Flow(item);
      return "[" + text + "]";
    case Kind::kMap:
      for (const YamlEntry& entry : node.entries) {
        text += (text.empty() ? "" : ", ") + Scalar(entry.key) + ": " + Flow(entry.value);
      }
      return "{" + text + "}";
  }
  return text;
}

constexpr std::size_t kLine = 90;

void Block(const YamlNode& node, const std::string& indent, std::string& out);

// After "key:" or "-": on the same line where it is short, indented below otherwise.
void Value(const YamlNode& node, const std::string& indent, std::string& out) {
  const std::string flow = Flow(node);
  const bool below = (node.kind == Kind::kMap && !node.entries.empty()) ||
                     (node.kind == Kind::kSequence && !node.items.empty());
  if (!below || indent.size() + flow.size() < kLine) {
    out += " " + flow + "\n";
    return;
  }
  out += "\n";
  Block(node, indent + "  ", out);
}

void Block(const YamlNode& node, const std::string& indent, std::string& out) {
  for (const YamlEntry& entry : node.entries) {
    out += indent + Scalar(entry.key) + ":";
    Value(entry.value, indent, out);
  }
  for (const YamlNode& item : node.items) {
    out += indent + "-";
    Value(item, indent, out);
  }
}

}  // namespace

std::string ToYaml(const YamlNode& root) {
  std::string out;
  Block(root, "", out);
  return out;
}

YamlNode YamlScalar(const std::string& text) {
  YamlNode node;
  node.kind = Kind::kScalar;
  node.scalar = text;
  return node;
}

YamlNode YamlNumber(double value) {
  char buffer[32];
  const auto [end, error] = std::to_chars(std::begin(buffer), std::end(buffer), value);
  return YamlScalar(std::string(std::begin(buffer), end));
}

YamlNode YamlMap(const std::vector<std::pair<std::string, YamlNode>>& entries) {
  YamlNode node;
  node.kind = Kind::kMap;
  for (const auto& [key, value] : entries) node.entries.push_back({key, 0, value});
  return node;
}

YamlNode YamlList(std::vector<YamlNode> items) {
  YamlNode node;
  node.kind = Kind::kSequence;
  node.items = std::move(items);
  return node;
}

const YamlNode* YamlFind(const YamlNode& map, const std::string& key) {
  for (const YamlEntry& entry : map.entries) {
    if (entry.key == key) return &entry.value;
  }
  return nullptr;
}

YamlNode& YamlAt(YamlNode& map, const std::string& key) {
  if (map.kind != Kind::kMap) map = YamlMap();
  for (YamlEntry& entry : map.entries) {
    if (entry.key == key) return entry.value;
  }
  map.entries.push_back({key, 0, YamlNode{}});
  return map.entries.back().value;
}

void YamlErase(YamlNode& map, const std::string& key) {
  std::erase_if(map.entries, [&key](const YamlEntry& entry) { return entry.key == key; });
}

}  // namespace calib::campaign
