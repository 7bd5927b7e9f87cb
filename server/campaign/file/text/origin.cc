#include "server/campaign/file/text/origin.h"

#include <string_view>

#include "server/campaign/file/text/yaml_text.h"

namespace calib::campaign {
namespace {

/// A key at the left margin with all that belongs to it, as lines; empty: it is not there.
std::string BlockOf(std::string_view yaml, std::string_view key) {
  std::string block;
  bool inside = false;
  while (!yaml.empty()) {
    const std::size_t end = yaml.find('\n');
    const std::string_view line = yaml.substr(0, end);
    yaml.remove_prefix(end == std::string_view::npos ? yaml.size() : end + 1);
    constexpr std::string_view kContinues = " \t#-]}";
    const bool begins = !line.empty() && kContinues.find(line[0]) == std::string_view::npos;
    if (begins) {
      inside = line.substr(0, key.size()) == key && line.substr(key.size(), 1) == ":";
    }
    if (inside) block.append(line).append("\n");
  }
  return block;
}

/// The parts that tell where it comes from: campaigns are listed by the hundred, and to parse whole
/// texts for that takes most of the time. Of a text that may mean something else in parts (aliases,
/// braces, quoted keys) all of it.
std::string TellingPart(const std::string& yaml) {
  const bool is_plain = yaml.find_first_of("&*%") == std::string::npos &&
                        yaml.find("---") == std::string::npos && yaml.find('{') != 0 &&
                        yaml.find("\n{") == std::string::npos;
  const std::string lineage = BlockOf(yaml, "lineage");
  const std::string model = BlockOf(yaml, "model");
  const bool is_found =
      !model.empty() && (!lineage.empty() || yaml.find("lineage") == std::string::npos);
  return is_plain && is_found ? lineage + model : yaml;
}

}  // namespace

Origin OriginOf(const std::string& yaml) {
  Origin origin;
  const auto parsed = ParseYaml(TellingPart(yaml));
  if (!parsed.root) return origin;
  if (const auto* lineage = YamlFind(*parsed.root, "lineage"); lineage != nullptr) {
    if (const auto* parent = YamlFind(*lineage, "parent")) origin.parent = parent->scalar;
    if (const auto* purpose = YamlFind(*lineage, "purpose")) origin.purpose = purpose->scalar;
  }
  const auto* model = YamlFind(*parsed.root, "model");
  const auto* effects = model == nullptr ? nullptr : YamlFind(*model, "effects");
  if (effects == nullptr) return origin;
  for (const auto& item : effects->items) origin.effects.push_back(item.scalar);
  if (effects->items.empty() && !effects->scalar.empty() && effects->scalar != "none") {
    origin.effects.push_back(effects->scalar);
  }
  return origin;
}

}  // namespace calib::campaign
