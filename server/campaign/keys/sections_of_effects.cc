#include "dem/formula/user_effect.h"
#include "server/campaign/keys/sections.h"
#include "server/campaign/keys/words.h"

namespace calib::campaign {
namespace {

std::vector<std::string> Targets() {
  std::vector<std::string> names;
  for (const auto& list : {dem::ContactTargets(), dem::ReadingTargets()}) {
    for (const dem::FormulaQuantity& quantity : list) names.push_back(quantity.name);
  }
  return names;
}

Section UserEffects() {
  return {"user_effects",
          "model.user_effects",
          {{"NAME", MapOf("user_effect"), "", "an effect of your own"}}};
}

Section UserEffect() {
  return {"user_effect",
          "model.user_effects.NAME",
          {
              {"adds", OneWord(Targets()), "required, or `scales`", "what the formula adds to"},
              {"scales", OneWord(Targets()), "required, or `adds`", "what the formula multiplies"},
              {"formula", Text(), kRequired, "of the quantities and parameters it acts with",
               "`+ - * / ^`, comparisons, `&&` `\\|\\|`, `a ? b : c`, `pi`; `abs cos exp log max "
               "min sign sin sqrt tanh`, `log` natural"},
              {"unit", Text(), "that of the target", "of what the formula gives, checked"},
              {"contacts", OneOrMore(Text()), "all", "contact laws it can join"},
              {"tests", OneOrMore(Text()), "all", "tests whose curves it can change"},
              {"parameters", MapOf("effect_parameters"), kRequired, "of the formula"},
              {"description", Text(), "", "for listings"},
              {"source", Text(), "", "for listings"},
          }};
}

Section EffectParameters() {
  return {"effect_parameters",
          "model.user_effects.NAME.parameters",
          {{"NAME", MapOf("effect_parameter"), "", "a parameter of the effect"}}};
}

Section EffectParameter() {
  return {"effect_parameter",
          "model.user_effects.NAME.parameters.NAME",
          {
              {"unit", Text(), "that of its prior's numbers", "of its values"},
              {"null", NumberOfCatalogue(), "",
               "value at which the effect vanishes; one parameter at least has it"},
              {"default", NumberOfCatalogue(), "", "where nothing is said of it"},
              {"prior", MapOf("prior"), "required with `null`", "`uniform` or `log_uniform`"},
              {"sign", OneWord(kSignWords), "as the prior says",
               "where a strength may lie from its null; one- or two-sided follows"},
              {"steps", OneOrMore(NumberOfCatalogue()), "quantiles of the prior",
               "two strengths that `diagnose` tries first, neither the null"},
              {"description", Text(), "", "for listings"},
          }};
}

}  // namespace

std::vector<Section> SectionsOfEffects() {
  return {UserEffects(), UserEffect(), EffectParameters(), EffectParameter()};
}

}  // namespace calib::campaign
