// Runs a small compression in the periodic cell on what the build offers and prints the catalogue's
// names and the last state, so that an extension that a script adds can be seen to act. usage:
// run_scenario CONTACT TEST [EFFECT] prints: `contact NAME`, `effect NAME: TESTS`, `test NAME`,
// then `OBSERVABLE VALUE` of the last load step
#include <cstdio>
#include <string>

#include "dem/registry/catalog.h"
#include "dem/simulate/packing_generator.h"
#include "dem/simulate/simulate.h"

namespace {

using namespace calib::dem;  // a program of one file

int Run(const Scenario& scenario) {
  State last;
  const auto summary = Simulate(scenario, [&last](const State& state) { last = state; }, {});
  if (!summary.ok() || summary->outcome != Outcome::kCompleted) {
    std::fprintf(stderr, "%s\n",
                 summary.ok() ? summary->reason.c_str() : summary.status().ToString().c_str());
    return 1;
  }
  const TestInfo& test = *FindTest(scenario.test);
  for (std::size_t v = 0; v < test.observables.size(); ++v) {
    std::printf("%s %.17g\n", test.observables[v].c_str(), last.values[v]);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fputs("usage: run_scenario CONTACT TEST [EFFECT]\n", stderr);
    return 2;
  }
  for (const ContactInfo& contact : Contacts()) std::printf("contact %s\n", contact.name.c_str());
  for (const EffectInfo& effect : Effects()) {
    std::printf("effect %s:", effect.name.c_str());
    for (const std::string& test : effect.excited_by) std::printf(" %s", test.c_str());
    std::printf("\n");
  }
  for (const TestInfo& test : Tests()) std::printf("test %s\n", test.name.c_str());
  const auto packing = GeneratePacking({.particles = 60, .porosity = 0.4, .seed = 1}, 1, {});
  if (!packing.ok()) {
    std::fprintf(stderr, "%s\n", packing.status().ToString().c_str());
    return 1;
  }
  Scenario scenario;
  scenario.model.contact = argv[1];
  scenario.model.density = 2.65e6;
  scenario.model.parameters = {{"friction_coefficient", 0.5}};
  const ContactInfo* contact = FindContact(scenario.model.contact);
  for (std::size_t p = 0; contact != nullptr && p < contact->parameters.size(); ++p) {
    const ParameterInfo& info = contact->parameters[p];
    if (info.alternative_to.empty() && !info.default_value && info.name != "friction_coefficient" &&
        info.name != "friction_angle") {
      scenario.model.parameters[info.name] = info.name == "poisson_ratio" ? 0.2
                                             : info.unit == "Pa"          ? 1e8
                                                                          : 1e5;
    }
  }
  if (argc > 3) scenario.model.effects = {argv[3]};
  scenario.test = argv[2];
  scenario.settings = {{"confining_pressure", 1e5}};
  scenario.packing = *packing;
  scenario.path = {{.target = 0.002, .load_step = 0}};
  return Run(scenario);
}
