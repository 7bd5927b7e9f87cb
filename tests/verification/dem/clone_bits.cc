// Prints the bits of runs that pass through every kernel and every elementary function of the
// engine. Built twice, with the copies of kernels that the CPU may choose and without: both print
// the same (test dem_clone_bits). So does a C library that takes the processor for an older one
// (test dem_other_cpu_bits).

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <map>
#include <string>

#include "dem/particles/grading.h"
#include "dem/registry/catalog.h"
#include "dem/simulate/packing_generator.h"
#include "dem/simulate/simulate.h"
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

/// Strains, angles and sizes for which libm would be at hand: a friction angle, a rig, crushing, a
/// graded packing, turned vessels, impacts. exp(-0.01568), cos(0.3338), cos(0.7291) and sin(0.1374)
/// are among those that glibc 2.36 gives with other bits where it has fused operations.
bool PrintFunctions() {
  Scenario fine = test::SmallTriaxial(test::HertzModel());
  fine.model.parameters.erase("friction_coefficient");
  fine.model.parameters["friction_angle"] = 0.47;
  fine.settings["confining_pressure"] = 1.57e5;
  fine.path = {{.target = 0, .load_step = 0},
               {.target = 0.01568, .load_step = 1},
               {.target = 0.017, .load_step = 2}};
  bool good = Print("friction_angle", fine);
  good = Print("strain_offset",
               test::With(fine, "strain_offset", {{"offset", 0.003}, {"stress", 1e5}})) &&
         good;
  const std::map<std::string, double> weak = {
      {"weakness", 0.15 / 2e5}, {"reference_diameter", 2e-3}, {"size_loss", 0.05}};
  good = Print("particle_crushing", test::With(fine, "particle_crushing", weak)) && good;
  const auto graded =
      GenerateSizes({.particles = 150, .seed = 3, .grading = LogNormalGrading(2e-3, 0.2)});
  if (!graded.ok()) {
    return false;
  }
  Scenario poured;
  poured.model = test::HertzModel();
  poured.model.density = 2650;
  poured.model.parameters["young_modulus"] = 5e6;
  poured.packing = *graded;
  poured.test = "rotating_drum";
  poured.settings = {{"turns", 0.02}};
  poured.path = {{.target = 2, .load_step = 0}};
  good = Print(poured.test, poured) && good;
  poured.test = "calibration_device";
  poured.settings = {{"slide_angle", 0.7291}};
  poured.path = {{.target = 1, .load_step = 0}};
  good = Print(poured.test, poured) && good;
  Scenario collision;
  collision.model = test::HertzModel();
  collision.test = "collision";
  collision.settings = {{"radius", 0.01}, {"impact_speed", 1}};
  for (const double angle : {0.1374, 0.1915, 0.2209, 0.3338, 0.3714, 0.7291, 1.1325}) {
    const auto step = static_cast<int>(collision.path.size());
    collision.path.push_back({.target = angle, .load_step = step});
  }
  return Print(collision.test, collision) && good;
}

int PrintAll() {
  bool good = PrintFunctions();
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
    Scenario rescaled = scenario;
    rescaled.model.shear_unloading = ShearUnloading::kRescaled;
    good = Print(base.contact + ", shear rescaled", rescaled) && good;
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
