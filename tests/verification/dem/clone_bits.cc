// Prints the bits of runs that pass through every kernel. Built twice, with the copies of kernels
// that the CPU may choose and without: both print the same (test dem_clone_bits).

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <string>

#include "dem/catalog/catalog.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

/// Some value inside the range of a parameter: a power of ten or a tenth, so that effects are felt.
double SomeValue(const ParameterInfo& parameter) {
  if (parameter.default_value) return *parameter.default_value;
  const DefaultPrior& prior = parameter.default_prior;
  return std::clamp(0.7 * prior.min + 0.3 * std::min(prior.max, 2.0), parameter.min, parameter.max);
}

bool Print(const std::string& title, const Scenario& scenario) {
  std::string text;
  const auto summary =
      Simulate(scenario,
               [&text](const State& state) {
                 for (const double value : state.values) {
                   char word[20];
                   std::snprintf(word, sizeof word, " %016jx",
                                 static_cast<std::uintmax_t>(std::bit_cast<std::uint64_t>(value)));
                   text += word;
                 }
               },
               {});
  if (!summary.ok()) {
    std::fprintf(stderr, "%s: %s\n", title.c_str(),
                 std::string(summary.status().message()).c_str());
    return false;
  }
  std::printf("%s: %ju steps%s\n", title.c_str(), static_cast<std::uintmax_t>(summary->steps),
              text.c_str());
  return true;
}

int PrintAll() {
  bool good = true;
  for (const char* law : {"tsuji", "kuwabara_kono", "extended_viscoelastic"}) {
    Scenario scenario = test::SmallTriaxial(test::HertzModel());
    scenario.path = {{.target = 0, .load_step = 0}, {.target = 0.002, .load_step = 1}};
    scenario.model.contact = law;
    scenario.model.parameters["tangential_stiffness"] = 5e5;
    scenario.model.parameters["damping"] = 1;
    if (std::string(law) == "extended_viscoelastic") {
      scenario.model.parameters["damping_exponent"] = 0.3;
    }
    good = Print(law, scenario) && good;
  }
  for (const Model& base : {test::HertzModel(), test::LinearModel()}) {
    Scenario scenario = test::SmallTriaxial(base);
    scenario.path = {{.target = 0, .load_step = 0}, {.target = 0.002, .load_step = 1}};
    good = Print(base.contact, scenario) && good;
    for (const EffectInfo& effect : Effects()) {
      const auto& laws = effect.contacts;
      const bool joins = laws.empty() || std::ranges::count(laws, base.contact) > 0;
      if (effect.kind != "contact" || !joins) continue;
      Scenario with = scenario;
      with.model.effects = {effect.name};
      for (const ParameterInfo& parameter : effect.parameters) {
        if (!parameter.alternative_to.empty()) continue;
        with.model.parameters[effect.name + "." + parameter.name] = SomeValue(parameter);
      }
      good = Print(base.contact + " + " + effect.name, with) && good;
    }
  }
  return good ? 0 : 1;
}

}  // namespace
}  // namespace calib::dem

int main() { return calib::dem::PrintAll(); }
