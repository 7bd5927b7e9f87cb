#include <algorithm>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "server/campaign/keys/bounds.h"
#include "server/campaign/keys/sections.h"
#include "server/campaign/model/words.h"

namespace calib::campaign {
namespace {

std::vector<std::string> TestNames() {
  std::vector<std::string> names;
  for (const dem::TestInfo& test : dem::Tests()) names.push_back(test.name);
  return names;
}

// The settings of all tests, each with the tests that have it.
std::vector<Offered> Settings() {
  std::vector<Offered> offered;
  for (const dem::TestInfo& test : dem::Tests()) {
    for (const dem::ParameterInfo& setting : test.settings) {
      const auto same = [&](const Offered& one) { return one.name == setting.name; };
      const auto known = std::find_if(offered.begin(), offered.end(), same);
      if (known != offered.end()) {
        absl::StrAppend(&known->meaning, ", ", test.name);
        continue;
      }
      offered.push_back(
          {setting.name,
           absl::StrCat(setting.description, setting.unit == "1" ? "" : " [" + setting.unit + "]",
                        "; setting of ", test.name)});
    }
  }
  return offered;
}

Section ExperimentKeys() {
  return {
      "experiment",
      "experiments[]",
      {
          {"name", Text(), kRequired, "short word for tables and file names",
           "letters, digits, `_ - . +`; at most 64, the first none of `- . +`"},
          {"test", OneWord(TestNames()), "required but with `precomputed`, `command`",
           "lab test (`calibctl tests`)"},
          {"SETTING", NumberOfCatalogue(), "as `calibctl tests` says",
           "a setting of the test, e.g. `confining_pressure`"},
          {"role", OneWord(kRoleWords), WordOf(kRoleWords, Role::kCalibrate),
           "`validate` is never fitted, reported as held-out error"},
          {"batch", Text(), "none", "what its specimen was made with, for parameters `per: batch`",
           "letters, digits, `_ - . +`"},
          {"as_stated", OneOrMore(Text()), "nothing",
           "settings that no parameter changes here; `predict` writes what stands in its test"},
          {"packing", MapOf("packing"), "required where the test needs one", "the specimen"},
          {"settings", MapOf("told_settings"), "none", "what a program (`command`) is told"},
          {"realizations", AnyOf({Whole(1, 1000), MapOf("told_realizations")}),
           "number of files; 1 with a recipe", "packings the samples are spread over",
           "1 to 1000; with `command` also a map of settings to lists of values"},
          {"specimen_grains", Number("1", {.min = 1}), "as the model",
           "grains of the measured specimen: the more, the less of the scatter of packings it "
           "shares"},
          {"meshes", MapOf("meshes"), "the test's own", "pieces of the apparatus as STL files"},
          {"materials", MapOf("bodies"), "the model's own", "who is of which material"},
          {"control", AnyOf({Text(), MapOf("control")}),
           "required but with `precomputed`, `command`",
           "what drives the loading: the test's control, or what `calibctl tests` allows besides"},
          {"consolidation", MapOf("consolidation"), "the model's friction",
           "how the specimen is compressed"},
          {"initial_stress", MapOf("initial_stress"), "isotropic", "replaces the isotropic start"},
          {"loading_rate", Number("1/s", kPositive), "staged",
           "loading at a real rate; goes without `staging`"},
          {"staging", MapOf("staging"), "the engine's", "of the quasi-static path"},
          {"data", MapOf("data"), kRequired, "the table of measured values"},
          {"observables", AnyOf({OneOrMore(Text()), MapOf("observables")}), kRequired,
           "what is compared; names are enough where no noise is needed"},
      },
      Settings(),
      true};
}

Section PackingKeys() {
  return {"packing",
          "experiments[].packing",
          {
              {"file", OneOrMore(Text()), "one of three", "packing file, 20 grains or more"},
              {"files", OneOrMore(Text()), "one of three", "one per realization"},
              {"generate", MapOf("recipe"), "one of three",
               "recipe; realizations have seeds `seed`, `seed` + 1, ..."},
          }};
}

Section Recipe() {
  return {
      "recipe",
      "experiments[].packing.generate",
      {
          {"particles", Whole(kFewestGrains, kMostGrains), "1000", "number of grains"},
          {"porosity", Number("1", kRecipePorosity), "required, or `void_ratio`",
           "not where the test pours"},
          {"void_ratio", Number("1", {.min = 0.25, .max = 1.5, .min_open = true, .max_open = true}),
           "required, or `porosity`", "not where the test pours"},
          {"radii", MapOf("sizes"), "required, or `diameters`", "sizes"},
          {"diameters", MapOf("sizes"), "required, or `radii`", "sizes"},
          {"aspect", Number("1", kRecipeAspect), "1", "height over width of the cell"},
          {"pressure", Number("Pa", kPositive), "10 kPa", "during generation"},
          {"seed", Seed(), "1", "of the places"},
      }};
}

Section Sizes() {
  return {
      "sizes",
      "experiments[].packing.generate.radii",
      {
          {"mean", Number("m", kGrainSize), "one of three forms",
           "uniform by number within mean x (1 -+ `spread`), drawn by the seed"},
          {"spread", Number("1", {.min = 0, .max = 1, .max_open = true}), "0.3", "beside `mean`"},
          {"cumulative",
           ListOf(ListOf(AnyOf({Number("m", kGrainSize), Number("1", {.min = 0, .max = 1})}))),
           "one of three forms",
           "grading curve: size, share of the *mass* that is finer; straight over log size",
           "`[[0.5 mm, 0], [1 mm, 40 percent], [2 mm, 1]]`"},
          {"median", Number("m", kGrainSize), "one of three forms",
           "log-normal by mass, cut off at two `log_sd` to either side"},
          {"log_sd", Number("1", kShare), "required with `median`", "that of ln size"},
      }};
}

Section ToldSettings() {
  return {"told_settings",
          "experiments[].settings",
          {{"NAME", AnyOf({Text(), ListOf(Text())}), "",
            "any; quantities are sent in SI, the name of a file of `model.files` is that file"}}};
}

Section ToldRealizations() {
  return {"told_realizations",
          "experiments[].realizations",
          {{"NAME", ListOf(Text()), "", "a setting, one value per realization"}}};
}

Section ProgramNext() {
  return {"program_next",
          "model.next[]",
          {
              {"name", Text(), kRequired, "of the experiment that it would be"},
              {"test", OneWord(TestNames()), "none", "lab test (`calibctl tests`)"},
              {"settings", MapOf("told_settings"), "none", "what the program is told"},
              {"realizations", AnyOf({Whole(1, 1000), MapOf("told_realizations")}),
               "of the first calibrated experiment", "as there"},
              {"control", Text(), kRequired, "the column that drives it"},
              {"values", ListOf(Text()), kRequired, "of the control, with their unit"},
              {"observables", MapOf("observables"), "of the first calibrated experiment",
               "with their errors, `relative` or `absolute`"},
          }};
}

Section MeshesKeys() {
  return {"meshes",
          "experiments[].meshes",
          {{"PIECE", MapOf("mesh"), "the test's own", "a piece that `calibctl tests` names"}}};
}

Section MeshKeys() {
  return {"mesh",
          "experiments[].meshes.PIECE",
          {
              {"file", Text(), kRequired, "STL file, text or binary"},
              {"unit", Text(), kRequired, "of its lengths, e.g. mm"},
          }};
}

Section Bodies() {
  return {"bodies",
          "experiments[].materials",
          {
              {"grains", MapOf("shares"), "none", "shares of the number of grains"},
              {"BODY", Text(), "the model's own", "material of walls, intruder, partner, ..."},
          }};
}

Section Shares() {
  return {"shares",
          "experiments[].materials.grains",
          {{"NAME", Number("1", kShare), "", "share of grains of this material, by number"}}};
}

Section ControlKeys() {
  return {"control",
          "experiments[].control",
          {
              {"column", Text(), kRequired, "name of the control"},
              {"noise", NumberOfCatalogue(), "found",
               "standard deviation of its readings, from which turning points are told"},
          }};
}

Section Consolidation() {
  return {"consolidation",
          "experiments[].consolidation",
          {
              {"friction_coefficient", Number("1", {.min = 0, .max = 10}), "one of two",
               "friction while compressing, restored before loading"},
              {"porosity", Number("1", kRecipePorosity), "one of two",
               "met by lowering friction until it holds"},
          }};
}

Section InitialStressKeys() {
  return {"initial_stress",
          "experiments[].initial_stress",
          {
              {"axial", Number("Pa", kPositive), kRequired, "principal stress"},
              {"lateral", Number("Pa", kPositive), kRequired, "principal stress"},
          }};
}

Section StagingKeys() {
  return {"staging",
          "experiments[].staging",
          {
              {"rate", Number("1/s", kPositive), "the engine's",
               "straining rate of the quasi-static path"},
              {"step", Number("1", {.min = 0, .max = 0.1, .min_open = true}), "the engine's",
               "largest axial strain between two settlings"},
              {"damping", ListOf(Number("1", {.min = 0, .max = 1, .max_open = true})),
               "`[0.2, 0.9]`", "local damping", "`[loading, settling]`, 0 to 1"},
              {"unbalanced", Number("1", kShare), "the engine's",
               "unbalanced over contact force that ends a settling"},
              {"adaptive", TrueOrFalse(), "false",
               "fewer steps; the curve moves no more than at twice the rate"},
          }};
}

}  // namespace

std::vector<Section> SectionsOfExperiments() {
  return {ExperimentKeys(), ToldSettings(), ToldRealizations(), ProgramNext(),       PackingKeys(),
          Recipe(),         Sizes(),        MeshesKeys(),       MeshKeys(),          Bodies(),
          Shares(),         ControlKeys(),  Consolidation(),    InitialStressKeys(), StagingKeys()};
}

}  // namespace calib::campaign
