#include "server/campaign/file/text/yaml_tree.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "absl/strings/str_format.h"
#include "server/campaign/file/text/utf8.h"

namespace calib::campaign {
namespace {

constexpr int kDeepest = 50;
constexpr int kMostNodes = 200'000;

// Copies yaml-cpp's graph into a tree; counts nodes because aliases can make a small text explode.
class Converter {
 public:
  std::optional<YamlError> error;

  YamlNode Convert(const YAML::Node& node, int line, int depth) {
    YamlNode tree;
    // yaml-cpp marks an empty value where the next token stands.
    tree.line = node.Mark().line >= 0 && !node.IsNull() ? node.Mark().line + 1 : line;
    if (depth > kDeepest || ++nodes_ > kMostNodes) {
      error = YamlError{tree.line, "is nested too deeply or too large for a campaign file"};
      return tree;
    }
    if (node.IsScalar()) {
      tree.kind = YamlNode::Kind::kScalar;
      tree.scalar = node.Scalar();
    } else if (node.IsSequence()) {
      tree.kind = YamlNode::Kind::kSequence;
      for (const YAML::Node& item : node) {
        if (error) break;
        tree.items.push_back(Convert(item, tree.line, depth + 1));
      }
    } else if (node.IsMap()) {
      tree.kind = YamlNode::Kind::kMap;
      for (const auto& entry : node) {
        if (error) break;
        AppendEntry(entry.first, entry.second, depth, tree);
      }
    }
    return tree;
  }

 private:
  void AppendEntry(const YAML::Node& key, const YAML::Node& value, int depth, YamlNode& tree) {
    const int line = key.Mark().line >= 0 ? key.Mark().line + 1 : tree.line;
    if (!key.IsScalar() && !key.IsNull()) {
      error = YamlError{line, "has a key that is a list or a map; keys are names"};
      return;
    }
    // The word null is a name here, as of a parameter's null value.
    tree.entries.push_back(
        {key.IsNull() ? "null" : key.Scalar(), line, Convert(value, line, depth + 1)});
  }

  int nodes_ = 0;
};

// yaml-cpp's terse remarks in words that help.
std::string Explain(const std::string& remark) {
  if (remark == "illegal map value") {
    return "is not YAML: two colons in one line (a map within a line is written {key: value}) or a "
           "wrong indentation";
  }
  if (remark.find("end of map") != std::string::npos ||
      remark.find("end of sequence") != std::string::npos) {
    return "is not YAML: " + remark +
           " (a bracket or brace is not closed, or the indentation changes)";
  }
  return "is not YAML: " + remark;
}

// line: from 0.
bool IsIndentedByTab(const std::string& text, int line) {
  std::size_t at = 0;
  for (int i = 0; i < line && at != std::string::npos; ++i) {
    at = text.find('\n', at);
    if (at != std::string::npos) ++at;
  }
  if (at == std::string::npos) return false;
  const std::size_t end = text.find_first_not_of(" \t", at);
  return text.substr(at, end == std::string::npos ? end : end - at).find('\t') != std::string::npos;
}

// What yaml-cpp would spend hundreds of bytes on each, before it finds that there are too many:
// entries, brackets within brackets, lists that begin within lists on one line.
std::optional<YamlError> TooLarge(const std::string& text) {
  int line = 1;
  int entries = 0;
  int brackets = 0;
  int lists = 0;  // begun on this line
  bool only_lists = true;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    const bool begins_list = only_lists && c == '-' && at + 1 < text.size() && text[at + 1] == ' ';
    brackets += c == '[' || c == '{' ? 1 : c == ']' || c == '}' ? -1 : 0;
    lists = c == '\n' ? 0 : lists + (begins_list ? 1 : 0);
    only_lists = c == '\n' || (only_lists && (begins_list || c == ' '));
    entries += c == ',' || c == '\n' || begins_list ? 1 : 0;
    line += c == '\n' ? 1 : 0;
    if (brackets > kDeepest || lists > kDeepest || entries > kMostNodes) {
      return YamlError{line, "is nested too deeply or too large for a campaign file"};
    }
  }
  return std::nullopt;
}

// What makes a text no YAML before its grammar is asked.
std::optional<YamlError> NotText(const std::string& text) {
  const auto line_of = [&text](std::size_t at) {
    const auto byte = text.begin() + static_cast<std::ptrdiff_t>(at);
    return 1 + static_cast<int>(std::count(text.begin(), byte, '\n'));
  };
  if (const std::size_t at = FirstByteThatIsNoUtf8(text); at != std::string::npos) {
    return YamlError{line_of(at),
                     absl::StrFormat("holds the byte 0x%02X, which is not UTF-8: save the file as "
                                     "UTF-8",
                                     static_cast<unsigned char>(text[at]))};
  }
  return std::nullopt;
}

}  // namespace

YamlParse ParseYaml(const std::string& text) {
  YamlParse parse;
  parse.error = NotText(text);
  if (!parse.error) parse.error = TooLarge(text);
  if (parse.error) return parse;
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(text);
    if (documents.empty() || documents.front().IsNull()) {
      parse.error =
          YamlError{1, "is empty; a campaign has name, model, parameters, experiments, ..."};
      return parse;
    }
    if (documents.size() > 1) {
      parse.error = YamlError{documents[1].Mark().line + 1,
                              "holds more than one document ('---'); a campaign is one document"};
      return parse;
    }
    Converter converter;
    YamlNode root = converter.Convert(documents.front(), 1, 0);
    if (converter.error) {
      parse.error = converter.error;
    } else {
      parse.root = std::move(root);
    }
  } catch (const YAML::Exception& e) {
    const int line = std::max(0, e.mark.line);
    parse.error = YamlError{line + 1, IsIndentedByTab(text, line)
                                          ? "is indented by a tab, which YAML does not allow; "
                                            "indent by blanks"
                                          : Explain(e.msg)};
  } catch (const std::exception& e) {
    parse.error = YamlError{1, std::string("is not YAML: ") + e.what()};
  }
  return parse;
}

std::string KindName(const YamlNode& node) {
  switch (node.kind) {
    case YamlNode::Kind::kScalar:
      return "a single value";
    case YamlNode::Kind::kSequence:
      return "a list";
    case YamlNode::Kind::kMap:
      return "a map";
    case YamlNode::Kind::kNull:
      break;
  }
  return "nothing";
}

}  // namespace calib::campaign
