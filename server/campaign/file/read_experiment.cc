#include "server/campaign/file/read_experiment.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "server/campaign/file/program/read_told.h"
#include "server/campaign/file/read_materials.h"
#include "server/campaign/file/read_measurements.h"
#include "server/campaign/file/read_meshes.h"
#include "server/campaign/file/read_specimen.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"

namespace calib::campaign {
namespace {

std::string ReadName(MapReader& map, const ReadContext& context, const Campaign& campaign) {
  std::string name = ReadShortName(map, context.is_new());
  for (const Experiment& other : campaign.experiments) {
    if (!name.empty() && other.name == name) {
      map.Problem("name", absl::StrCat(Quoted(name), " is the name of two experiments"));
    }
  }
  return name;
}

std::string ReadBatch(MapReader& map) {
  std::string batch = map.Text("batch").value_or("");
  if (map.Has("batch") && !IsShortWord(batch)) {
    map.Problem("batch",
                absl::StrCat(Quoted(batch), " is not a short word of letters, digits and _ - . +"));
  }
  return batch;
}

// Our name of the control, as far as it can be told before the measurements are read.
std::string ControlNameOf(MapReader& map) {
  const YamlNode* node = map.Find("control");
  if (node == nullptr) return "";
  if (node->kind == YamlNode::Kind::kScalar) return node->scalar;
  for (const YamlEntry& entry : node->entries) {
    if (entry.key == "column") return entry.value.scalar;
  }
  return "";
}

// Pressures of a few Pa without a unit were meant in MPa or kPa.
void CheckUnitOf(MapReader& map, const dem::ParameterInfo& setting, double value) {
  constexpr double kFewest = 10;  // Pa
  const YamlNode* node = map.Find(setting.name);
  if (setting.unit != "Pa" || !(value > 0 && value < kFewest) || node == nullptr) return;
  const auto written = SplitQuantity(node->scalar);
  if (written.ok() && written->unit.empty()) {
    map.Problem(setting.name,
                absl::StrCat("is ", value, " Pa, for no unit stands there; write it, ", "e.g. ",
                             value, " MPa"));
  }
}

// The control says by what a test is driven that strain or stress may drive.
void ReadStressDriven(MapReader& map, const dem::TestInfo& test, Experiment& experiment) {
  if (test.stress_control.empty()) return;
  map.Ignore({dem::kStressDriven});
  if (map.Has(dem::kStressDriven)) {
    map.Problem(dem::kStressDriven,
                absl::StrCat("follows from the control: write control: ", test.stress_control));
  }
  if (ControlNameOf(map) == test.stress_control) experiment.settings[dem::kStressDriven] = 1;
}

// Runs made elsewhere need no settings; what is given is read. What the test is driven along is
// none.
void ReadSettings(MapReader& map, const dem::TestInfo& test, bool needed, Experiment& experiment) {
  ReadStressDriven(map, test, experiment);
  const std::string control = ControlNameOf(map);
  for (const dem::ParameterInfo& setting : test.settings) {
    if (setting.name == control) {
      if (map.Has(setting.name)) {
        map.Problem(setting.name, "is the control of this experiment; remove it here");
      }
      map.Ignore({setting.name});
      continue;
    }
    const Range range{
        .min = setting.min,
        .max = setting.max,
        .min_open = setting.min_open,
        .infinite_allowed = setting.default_value && std::isinf(*setting.default_value)};
    if (const auto value = map.Quantity(setting.name, setting.unit, range)) {
      CheckUnitOf(map, setting, *value);
      if (setting.whole && *value != std::round(*value)) {
        map.Problem(setting.name, absl::StrCat("is ", *value, ", allowed are whole numbers from ",
                                               setting.min, " to ", setting.max));
      }
      experiment.settings[setting.name] = *value;
    } else if (!map.Has(setting.name)) {
      if (setting.default_value) {
        experiment.settings[setting.name] = *setting.default_value;
      } else if (needed) {
        map.Problem(setting.name,
                    absl::StrCat("is missing; ", test.name, " needs it: ", setting.description));
      }
    }
  }
}

void ReadConsolidation(MapReader& map, Experiment& experiment) {
  auto consolidation = map.Map("consolidation");
  if (!consolidation) return;
  experiment.consolidation.friction_coefficient = consolidation->Quantity("friction_coefficient");
  experiment.consolidation.porosity = consolidation->Quantity("porosity");
  consolidation->Finish();
  if (consolidation->Has("friction_coefficient") == consolidation->Has("porosity")) {
    map.Problem("consolidation", "needs exactly one of friction_coefficient and porosity");
  }
}

void ReadInitialStress(MapReader& map, Experiment& experiment) {
  auto stress = map.Map("initial_stress");
  if (!stress) return;
  for (const char* key : {"axial", "lateral"}) {
    stress->Require(key, "both principal stresses are needed");
  }
  const auto axial = stress->Quantity("axial");
  const auto lateral = stress->Quantity("lateral");
  stress->Finish();
  if (axial && lateral) {
    experiment.initial_stress = dem::InitialStress{.axial = *axial, .lateral = *lateral};
  }
}

void ReadDamping(MapReader& staging, dem::Staging& out) {
  const YamlNode* damping = staging.Find("damping");
  if (damping == nullptr) return;
  if (damping->kind != YamlNode::Kind::kSequence || damping->items.size() != 2) {
    staging.Problem("damping",
                    "is a list of two: [while straining, while settling], e.g. [0.2, 0.9]");
    return;
  }
  out.damping_loading = staging.QuantityIn("damping", damping->items[0]);
  out.damping_settling = staging.QuantityIn("damping", damping->items[1]);
}

void ReadStaging(MapReader& map, Experiment& experiment) {
  experiment.loading_rate = map.Quantity("loading_rate");
  auto staging = map.Map("staging");
  if (!staging) return;
  if (map.Has("loading_rate")) {
    map.Problem(
        "staging",
        "goes without loading_rate: loading at a real rate has no stages; keep one of them");
  }
  experiment.staging.rate = staging->Quantity("rate");
  experiment.staging.step = staging->Quantity("step");
  experiment.staging.unbalanced = staging->Quantity("unbalanced");
  ReadDamping(*staging, experiment.staging);
  experiment.staging.adaptive =
      staging->TrueOrFalse("adaptive").value_or(experiment.staging.adaptive);
  staging->Finish();
}

const dem::TestInfo* ReadTest(MapReader& map, const Campaign& campaign, Experiment& experiment) {
  if (!campaign.precomputed && !campaign.program &&
      map.Require("test", "one of " + Listed(map.WordsOf("test"))) == nullptr) {
    return nullptr;
  }
  experiment.test = map.Choice("test").value_or("");
  return dem::FindTest(experiment.test);
}

constexpr std::array<const char*, 8> kSpecimenKeys = {
    "packing",        "realizations", "specimen_grains", "consolidation",
    "initial_stress", "loading_rate", "staging",         "meshes"};

// Keys that only a specimen of grains needs: all problems with them at once.
void RefuseKeys(MapReader& map, const std::string& why) {
  for (const char* key : kSpecimenKeys) {
    map.Ignore({key});
    if (map.Has(key)) map.Problem(key, why);
  }
}

// Grains that are poured are neither consolidated nor strained in stages.
void RefusePreparationKeys(MapReader& map, const dem::TestInfo& test) {
  map.Ignore({"consolidation", "initial_stress", "loading_rate", "staging"});
  for (const char* key : {"consolidation", "initial_stress", "loading_rate", "staging"}) {
    if (map.Has(key)) {
      map.Problem(key, absl::StrCat("has no meaning in ", test.name, "; remove it"));
    }
  }
}

void ReadExperiment(MapReader& map, ReadContext& context, Campaign& campaign) {
  Experiment experiment;
  experiment.name = ReadName(map, context, campaign);
  const dem::TestInfo* test = ReadTest(map, campaign, experiment);
  if (campaign.program) {
    ReadTold(map, test, campaign, experiment);
    if (test != nullptr) ReadStressDriven(map, *test, experiment);
  } else {
    if (test != nullptr) ReadSettings(map, *test, !campaign.precomputed, experiment);
    map.Ignore({"settings"});
    if (map.Has("settings")) {
      map.Problem("settings", "is what a program (model.command) is told; remove it");
    }
  }
  experiment.role = map.Choice("role", kRoleWords).value_or(Role::kCalibrate);
  map.TextList("as_stated");  // read with the parameters
  experiment.batch = ReadBatch(map);
  if (campaign.program) {
    experiment.specimen_grains = map.Quantity("specimen_grains");
  } else if (campaign.precomputed) {
    if (test == nullptr) map.Ignore({"confining_pressure"});
    RefuseKeys(map, "has no meaning with precomputed runs; remove it");
    map.Ignore({"materials"});
    if (map.Has("materials")) {
      map.Problem("materials", "has no meaning with precomputed runs; remove it");
    }
  } else {
    if (test != nullptr) experiment.materials = ReadMaterialUse(map, *test, campaign.model);
    const bool poured = test != nullptr && test->poured;
    const bool bodiless = test != nullptr && !test->needs_packing;
    if (bodiless) {
      experiment.specimens = {NoPacking{}};
      RefuseKeys(map, absl::StrCat("has no meaning in ", test->name,
                                   ", which makes its bodies from its settings; remove it"));
    } else {
      experiment.specimens = ReadSpecimens(map, poured, context);
      experiment.specimen_grains = map.Quantity("specimen_grains");
      if (test != nullptr) experiment.meshes = ReadMeshes(map, *test, context);
    }
    if (poured) {
      RefusePreparationKeys(map, *test);
    } else if (!bodiless) {
      ReadConsolidation(map, experiment);
      ReadInitialStress(map, experiment);
      ReadStaging(map, experiment);
    }
  }
  const MeasurementRules rules{
      .free_names = HasNamesOfItsOwn(campaign, experiment),
      .by_unit_only = campaign.program.has_value() && test == nullptr,
      .noise_needed = campaign.filter.noise != inference::NoiseMode::kEssTarget,
      .measured = !RunsRowsOnly(campaign)};
  const bool wrong_test = test == nullptr && map.Has("test");
  if (campaign.precomputed || test != nullptr || (campaign.program && !wrong_test)) {
    ReadMeasurements(map, rules, context, experiment);
    map.Finish();
  }  // with an unknown test neither its settings nor its observables can be told from mistakes
  campaign.experiments.push_back(std::move(experiment));
}

}  // namespace

void ReadExperiments(MapReader& campaign_map, ReadContext& context, Campaign& campaign) {
  const YamlNode* node = campaign_map.Require(
      "experiments", "a list of measurements and the lab tests that reproduce them");
  if (node == nullptr) return;
  if (node->kind != YamlNode::Kind::kSequence || node->items.empty()) {
    campaign_map.Problem(
        "experiments",
        "has to be a list with at least one experiment, each beginning with '- name: ...'");
    return;
  }
  for (std::size_t i = 0; i < node->items.size(); ++i) {
    MapReader map(node->items[i], absl::StrCat("experiments[", i + 1, "]"), SectionOf("experiment"),
                  context.problems());
    if (node->items[i].kind == YamlNode::Kind::kMap) ReadExperiment(map, context, campaign);
  }
  const auto calibrates = [](const Experiment& experiment) {
    return experiment.role == Role::kCalibrate;
  };
  if (!campaign.experiments.empty() &&
      std::none_of(campaign.experiments.begin(), campaign.experiments.end(), calibrates)) {
    campaign_map.Problem("experiments",
                         "are all for validation; at least one needs role: calibrate");
  }
}

}  // namespace calib::campaign
