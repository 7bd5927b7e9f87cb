#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "server/campaign/keys/sections.h"
#include "server/campaign/keys/words.h"
#include "server/campaign/model/population.h"
#include "server/campaign/model/words.h"

namespace calib::campaign {
namespace {

std::string MeaningOf(const dem::ParameterInfo& parameter, const std::string& contact) {
  const std::string& unit = contact.empty() ? parameter.unit : dem::UnitFor(parameter, contact);
  const Range range = AdmissibleRange(parameter);
  return absl::StrCat(parameter.description, unit == "1" ? "" : " [" + unit + "]", "; ",
                      range.Describe(unit));
}

// Every parameter of every contact law and effect of this build, by its dotted name.
std::vector<Offered> ParametersOffered() {
  std::vector<Offered> offered;
  for (const dem::ContactInfo& contact : dem::Contacts()) {
    for (const dem::ParameterInfo& parameter : contact.parameters) {
      const auto same = [&](const Offered& one) { return one.name == parameter.name; };
      if (std::any_of(offered.begin(), offered.end(), same)) continue;
      offered.push_back({parameter.name, MeaningOf(parameter, contact.name)});
    }
  }
  for (const dem::EffectInfo& effect : dem::Effects()) {
    for (const dem::ParameterInfo& parameter : effect.parameters) {
      offered.push_back({absl::StrCat(effect.name, ".", parameter.name), MeaningOf(parameter, "")});
    }
  }
  return offered;
}

std::vector<std::string> ContactNames() {
  std::vector<std::string> names;
  for (const dem::ContactInfo& contact : dem::Contacts()) names.push_back(contact.name);
  return names;
}

std::vector<std::string> EffectNames() {
  std::vector<std::string> names = {"none"};
  for (const dem::EffectInfo& effect : dem::Effects()) names.push_back(effect.name);
  return names;
}

Section Model() {
  return {
      "model",
      "model",
      {
          {"contact", OneWord(ContactNames()), "required but with `precomputed`, `command`",
           "contact law (`calibctl contacts`)"},
          {"effects",
           AnyOf({OneOrMore(AnyOf({OneWord(EffectNames()), Text()})), MapOf("held_effects")}),
           "none", "added physics; with `command` what the program may switch on",
           "names of `calibctl effects`, or `none`; with `command` a map as of "
           "`model.precomputed.effects`"},
          {"density", Number("kg/m^3", kPositive), "2650 kg/m^3", "of the grains"},
          {"fixed", MapOf("fixed"), "", "parameters that are not calibrated"},
          {"shear_unloading", OneWord(kShearUnloadingWords), "as_published",
           "as the normal force falls, the elastic shear force stays, and closed cycles can "
           "give work; or falls with its stiffness, and none does"},
          {"user_effects", MapOf("user_effects"), "none", "effects written as formulas"},
          {"materials", MapOf("materials"), "none", "materials besides the model's own"},
          {"pairs", MapOf("pairs"), "none", "values of two materials that touch"},
          {"precomputed", MapOf("precomputed"), "none",
           "runs that exist already; takes the place of all the others"},
          {"command", OneOrMore(Text()), "none",
           "a program of yours as the model, with its arguments; takes the place of the DEM",
           "a list of texts; `{scratch}`, `{threads}`, `{seed}`, `{PARAMETER}`, `{SETTING}` "
           "are replaced"},
          {"files", OneOrMore(Text()), "none",
           "files and folders that it needs, brought into its scratch folder"},
          {"templates", OneOrMore(Text()), "none", "the same, with names replaced in the text"},
          {"keep", OneOrMore(Text()), "none", "files of the scratch folder that stay with the run"},
          {"checkpoint", TrueOrFalse(), "false", "it understands checkpoints"},
          {"states", MapOf("program_states"), "standard output",
           "a table that grows, read in its place"},
          {"persistent", TrueOrFalse(), "false",
           "one process per slot, a request per line on standard input"},
          {"limits", MapOf("program_limits"), "none", "what a run may take"},
          {"version", Text(), "", "part of what a run is, for what the files do not show"},
          {"numerics", MapOf("program_numerics"), "none",
           "settings of the code that should not matter"},
          {"next", ListOf(MapOf("program_next")), "none", "tests that may be proposed"},
      }};
}

Section Fixed() {
  return {"fixed",
          "model.fixed",
          {{"NAME", NumberOfCatalogue(), "", "value of a parameter of the model"}},
          ParametersOffered()};
}

Section Materials() {
  return {"materials",
          "model.materials",
          {{"NAME", MapOf("material"), "", "a material: letters, digits and _"}}};
}

Section Material() {
  return {"material",
          "model.materials.NAME",
          {{"NAME", NumberOfCatalogue(), "that of `grains`, the model's own material",
            "a parameter of the contact law, or `density`"}}};
}

Section Pairs() {
  return {"pairs",
          "model.pairs",
          {{"A-B", MapOf("pair"), "", "two materials, in either order; A-A: of effects only"}}};
}

Section Pair() {
  return {"pair",
          "model.pairs.A-B",
          {{"NAME", NumberOfCatalogue(), "as the two materials have it",
            "`friction_coefficient`; `damping` of viscoelastic laws; values of effects"}}};
}

Section Parameters() {
  return {"parameters",
          "parameters",
          {{"NAME", AnyOf({OneWord({"default"}), MapOf("parameter"), MapOf("tie")}), "",
            "prior of a parameter: NAME of the model, [EXPERIMENT.]SETTING or "
            "[EXPERIMENT.]GROUP.KEY; or what it follows from; default: the catalogue's"}},
          ParametersOffered()};
}

std::vector<Key> KeysOfPrior() {
  return {
      {"prior", OneWord(kPriorWords), kRequired, "the family"},
      {"min", NumberOfCatalogue(), "as admissible; uniform, log_uniform: required",
       "lower bound; above 0 for log_uniform"},
      {"max", NumberOfCatalogue(), "as admissible; uniform, log_uniform: required", "upper bound"},
      {"mean", NumberOfCatalogue(), "normal, log_normal: required",
       "mean of a normal; the *median*, in units, of a log_normal"},
      {"sd", NumberOfCatalogue(), "normal, log_normal: required",
       "standard deviation; of a log_normal that of ln x, a plain number"},
      {"unit", Text(), "that of the numbers", "of the numbers; with `precomputed`, `command` only"},
  };
}

Section PriorKeys() {
  return {"prior", "model.user_effects.NAME.parameters.NAME.prior", KeysOfPrior()};
}

Section ParameterKeys() {
  std::vector<Key> keys = KeysOfPrior();
  keys.push_back({"nuisance", TrueOrFalse(), "false",
                  "it is inferred, and not reported among what is wanted"});
  keys.push_back({"per", OneWord(kPerWords), "one value",
                  "it has a value for each experiment, or for each `batch`"});
  keys.push_back({"spread", MapOf("spread"), "required with `per`",
                  "prior of the sd of these values around the common one"});
  keys.push_back({"labels", OneOrMore(Text()), "of all experiments",
                  "with `per`: what has a value of its own; others have the common one"});
  return {"parameter", "parameters.NAME", std::move(keys)};
}

Section ErrorScaleKeys() {
  std::vector<Key> keys = KeysOfPrior();
  std::erase_if(keys, [](const Key& key) { return key.name == "unit"; });
  keys.push_back({"on", OneWord(kErrorScaleWords), "sd",
                  "what the numbers are of: the standard deviation, or its square"});
  return {"error_scale", "noise.model_error[].relative, absolute", std::move(keys)};
}

Section Spread() {
  return {"spread",
          "parameters.NAME.spread",
          {{"prior", OneWord({"half_normal"}), kRequired, "the family"},
           {"sd", NumberOfCatalogue(), kRequired,
            "standard deviation of the normal of which this is the half, in the parameter's "
            "unit"}}};
}

Section Tie() {
  return {"tie",
          "parameters.NAME, tied",
          {{"equal_to", Text(), kRequired,
            "another parameter, calibrated, fixed or tied, or a formula of several, in SI",
            "`NAME`, or e.g. `2 * NAME + OTHER`"}}};
}

Section PrecomputedKeys() {
  return {
      "precomputed",
      "model.precomputed",
      {
          {"parameters", Text(), kRequired, "table, one row per sample"},
          {"states", Text(), kRequired, "table, one row per sample and load step"},
          {"sample", Text(), "sample", "key column of both tables"},
          {"step", Text(), "step",
           "key column of `states`; steps count the rows of the data file from 0 or 1"},
          {"experiment", Text(), "there is one",
           "column of `states` that tells several experiments apart"},
          {"log_proposal", Text(), "drawn from the prior",
           "column of `parameters` with ln of the density the samples were drawn from"},
          {"parameter_columns", MapOf("columns"), "names that agree", "of `parameters`"},
          {"parameter_units", MapOf("units"), "SI", "of `parameters`"},
          {"state_columns", MapOf("columns"), "names that agree", "of `states`"},
          {"state_units", MapOf("units"), "SI", "of `states`"},
          {"absolute", OneOrMore(Text()), "none", "parameters whose sign the simulation ignored"},
          {"effects", MapOf("held_effects"), "none", "effects that some rows have"},
      }};
}

Section HeldEffects() {
  return {"held_effects",
          "model.precomputed.effects",
          {{"NAME", MapOf("held_effect"), "", "an effect that some rows have, by its name"}}};
}

Section HeldEffect() {
  return {"held_effect",
          "model.precomputed.effects.NAME",
          {
              {"parameters", MapOf("effect_parameters"), kRequired,
               "its strengths, with the values at which it vanishes"},
              {"excludes", OneOrMore(Text()), "none", "others that no run may have beside it"},
              {"description", Text(), "", "for listings"},
              {"acts", TrueOrFalse(), "false", "it is part of the model that is calibrated"},
          }};
}

Section ProgramStates() {
  return {"program_states",
          "model.states",
          {
              {"file", Text(), kRequired, "name in the scratch folder"},
              {"columns", MapOf("columns"), "names that agree", "our name: column of the table"},
              {"units", MapOf("units"), "SI", "of the columns"},
          }};
}

Section ProgramLimitKeys() {
  return {"program_limits",
          "model.limits",
          {
              {"wall", Number("s", kPositive), "none", "time of a run"},
              {"memory", Text(), "none", "resident memory of all its processes, e.g. 4 GB"},
              {"disk", Text(), "none", "size of its scratch folder, e.g. 10 GB"},
              {"silence", Number("s", kPositive), "none", "time without a state"},
          }};
}

Section ProgramNumericsKeys() {
  return {"program_numerics",
          "model.numerics",
          {{"NAME", MapOf("program_number"), "", "a parameter of the program"}}};
}

Section ProgramNumber() {
  return {"program_number",
          "model.numerics.NAME",
          {
              {"null", Number("1"), kRequired, "as it is run"},
              {"sd", Number("1", kPositive), kRequired, "of what else it might be"},
          }};
}

}  // namespace

std::vector<Section> SectionsOfModel() {
  return {Model(),
          Fixed(),
          Parameters(),
          PriorKeys(),
          ParameterKeys(),
          ErrorScaleKeys(),
          Spread(),
          Tie(),
          Materials(),
          Material(),
          Pairs(),
          Pair(),
          PrecomputedKeys(),
          HeldEffects(),
          HeldEffect(),
          ProgramStates(),
          ProgramLimitKeys(),
          ProgramNumericsKeys(),
          ProgramNumber()};
}

}  // namespace calib::campaign
