#include "server/campaign/file/text/origin.h"

#include "server/campaign/file/text/yaml_text.h"

namespace calib::campaign {

Origin OriginOf(const std::string& yaml) {
  Origin origin;
  const auto parsed = ParseYaml(yaml);
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
