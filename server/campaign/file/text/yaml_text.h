#pragma once
// A YAML tree back as text, and small changes to it, for campaigns derived from others.

#include <string>
#include <vector>

#include "server/campaign/file/text/yaml_tree.h"

namespace calib::campaign {

/// Reading the text again gives the same tree (line numbers apart). Comments of the original are
/// not part of a tree.
std::string ToYaml(const YamlNode& root);

YamlNode YamlScalar(const std::string& text);
/// Shortest text that reads back to the same number.
YamlNode YamlNumber(double value);
YamlNode YamlMap(const std::vector<std::pair<std::string, YamlNode>>& entries = {});
YamlNode YamlList(std::vector<YamlNode> items);

/// Value of a key, made (null) if need be; a node that is no map becomes an empty one.
YamlNode& YamlAt(YamlNode& map, const std::string& key);
void YamlErase(YamlNode& map, const std::string& key);
const YamlNode* YamlFind(const YamlNode& map, const std::string& key);

}  // namespace calib::campaign
