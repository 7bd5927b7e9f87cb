#include "server/campaign/file/program/read_told.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {
namespace {

using Json = nlohmann::json;

// Text that is no UTF-8 has its bytes replaced.
std::string ToText(const Json& value) {
  return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

/// A number that begins a text which is none as a whole was meant as a quantity.
bool LooksLikeQuantity(const Quantity& written) {
  return !written.unit.empty() && written.unit.find(' ') == std::string::npos;
}

// One value: a quantity in SI, the file that it names, a truth value, a text as it is.
std::optional<Json> ValueOf(const MapReader& map, const std::string& key, const YamlNode& node,
                            const Program& program) {
  const std::string& text = node.scalar;
  for (const ProgramFile& file : program.files) {
    if (file.path == text || file.name == text) return Json(file.name);
  }
  if (text == "true" || text == "false") return Json(text == "true");
  const auto written = SplitQuantity(text);
  if (!written.ok() || !std::isfinite(written->value)) return Json(text);
  if (written->unit.empty()) {
    const bool whole = text.find_first_of(".eE") == std::string::npos &&
                       std::abs(written->value) < 9e15;  // what it stands for in a command line
    return whole ? Json(static_cast<std::int64_t>(written->value)) : Json(written->value);
  }
  const auto unit = ParseUnit(written->unit);
  if (unit.ok()) return Json(written->value * unit->factor);
  if (!LooksLikeQuantity(*written)) return Json(text);
  map.Problem(key,
              absl::StrCat(Quoted(text), " begins as a quantity, but ", unit.status().message()));
  return std::nullopt;
}

std::optional<Json> JsonOf(const MapReader& map, const std::string& key, const YamlNode& node,
                           const Program& program) {
  if (node.kind == YamlNode::Kind::kScalar) return ValueOf(map, key, node, program);
  if (node.kind == YamlNode::Kind::kNull) return Json(nullptr);
  if (node.kind == YamlNode::Kind::kSequence) {
    Json list = Json::array();
    for (const YamlNode& item : node.items) {
      const auto value = JsonOf(map, key, item, program);
      if (!value) return std::nullopt;
      list.push_back(*value);
    }
    return list;
  }
  map.Problem(key, "is a map; a setting is a value or a list of values");
  return std::nullopt;
}

// A setting that the test knows has its unit and range.
void HoldToTest(const MapReader& map, const std::string& key, const YamlNode& node,
                const dem::TestInfo* test, Experiment& experiment) {
  if (test == nullptr) return;
  for (const dem::ParameterInfo& setting : test->settings) {
    if (setting.name != key) continue;
    const Range range{
        .min = setting.min,
        .max = setting.max,
        .min_open = setting.min_open,
        .infinite_allowed = setting.default_value && std::isinf(*setting.default_value)};
    if (const auto value =
            ReadQuantity(node, map.PathOf(key), setting.unit, range, map.problems())) {
      experiment.settings[key] = *value;
    }
  }
}

void RefuseOwnKeys(MapReader& map, const dem::TestInfo* test) {
  std::vector<std::string> own = {"packing", "consolidation", "initial_stress", "loading_rate",
                                  "staging", "meshes",        "materials"};
  if (test != nullptr) {
    for (const dem::ParameterInfo& setting : test->settings) own.push_back(setting.name);
  }
  for (const std::string& key : own) {
    map.Ignore({key});
    if (map.Has(key)) {
      map.Problem(key, "what a program is told stands under settings; move it there");
    }
  }
}

// The realizations that a map of lists gives, all of one length.
std::vector<Specimen> ReadRealizations(MapReader& map, const Program& program) {
  std::vector<Specimen> all;
  for (const std::string& key : map.Keys()) {
    const YamlNode* node = map.Find(key);
    if (node == nullptr) continue;
    if (node->kind != YamlNode::Kind::kSequence || node->items.empty()) {
      map.Problem(key, "has to be a list, one value per realization: [a.txt, b.txt]");
      continue;
    }
    if (all.empty()) all.resize(node->items.size(), ProgramSpecimen{});
    if (all.size() != node->items.size()) {
      map.Problem(key, absl::StrCat("has ", node->items.size(), " values, and the setting before ",
                                    all.size(), "; a realization has one of each"));
      continue;
    }
    for (std::size_t k = 0; k < all.size(); ++k) {
      if (const auto value = JsonOf(map, key, node->items[k], program)) {
        std::get<ProgramSpecimen>(all[k]).settings[key] = ToText(*value);
      }
    }
  }
  map.Finish();
  return all;
}

}  // namespace

void ReadTold(MapReader& map, const dem::TestInfo* test, const Campaign& campaign,
              Experiment& experiment) {
  const Program& program = *campaign.program;
  RefuseOwnKeys(map, test);
  if (auto settings = map.Map("settings")) {
    for (const std::string& key : settings->Keys()) {
      const YamlNode* node = settings->Find(key);
      if (node == nullptr) continue;
      if (const auto value = JsonOf(*settings, key, *node, program)) {
        experiment.told[key] = ToText(*value);
        HoldToTest(*settings, key, *node, test, experiment);
      }
    }
    settings->Finish();
  }
  const YamlNode* realizations = map.Find("realizations");
  if (realizations != nullptr && realizations->kind == YamlNode::Kind::kMap) {
    if (auto lists = map.Map("realizations")) {
      experiment.specimens = ReadRealizations(*lists, program);
      for (const Specimen& specimen : experiment.specimens) {
        for (const auto& [name, value] : std::get<ProgramSpecimen>(specimen).settings) {
          if (experiment.told.erase(name) > 0) {
            map.Problem("realizations", absl::StrCat(name,
                                                     " stands under settings as well; keep "
                                                     "one of them"));
          }
        }
      }
    }
  } else if (const auto count = map.Integer("realizations")) {
    experiment.specimens.assign(static_cast<std::size_t>(*count), ProgramSpecimen{});
  }
  if (experiment.specimens.empty()) experiment.specimens = {ProgramSpecimen{}};
}

}  // namespace calib::campaign
