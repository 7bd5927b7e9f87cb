#include "tests/support/dem/scenarios.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>

#include "dem/dynamics/assembly.h"
#include "dem/dynamics/flow.h"
#include "dem/registry/registry.h"
#include "dem/simulate/packing_generator.h"
#include "dem/simulate/simulate.h"

namespace calib::dem::test {

Model HertzModel() {
  Model model;
  model.contact = "hertz_mindlin";
  model.density = 2650e3;
  model.parameters = {
      {"young_modulus", 8e8}, {"poisson_ratio", 0.2}, {"friction_coefficient", 0.55}};
  return model;
}

Model LinearModel() {
  Model model;
  model.contact = "linear";
  model.density = 2650e3;
  model.parameters = {
      {"young_modulus", 1.2e8}, {"poisson_ratio", 0.6}, {"friction_coefficient", 0.5}};
  return model;
}

const Packing& SmallPacking(int particles) {
  static std::map<int, Packing> made;
  if (const auto it = made.find(particles); it != made.end()) {
    return it->second;
  }
  const auto packing =
      GeneratePacking({.particles = particles, .porosity = 0.42, .mean_radius = 1e-3}, 1, {});
  if (!packing.ok()) {
    std::fprintf(stderr, "%s\n", packing.status().ToString().c_str());
    std::abort();
  }
  return made.emplace(particles, *packing).first->second;
}

Scenario SmallTriaxial(const Model& model) {
  Scenario scenario;
  scenario.model = model;
  scenario.test = "triaxial_drained";
  scenario.settings = {{"confining_pressure", 2e5}};
  scenario.packing = SmallPacking();
  scenario.path = {{.target = 0, .load_step = 0},
                   {.target = 0.005, .load_step = 1},
                   {.target = 0.01, .load_step = 2}};
  return scenario;
}

Scenario With(Scenario scenario, const std::string& effect,
              const std::map<std::string, double>& values) {
  scenario.model.effects.push_back(effect);
  for (const auto& [name, value] : values) {
    scenario.model.parameters[effect + "." + name] = value;
  }
  return scenario;
}

Run RunAll(const Scenario& scenario) {
  Run run;
  const auto summary =
      Simulate(scenario, [&](const State& state) { run.states.push_back(state); }, {});
  if (!summary.ok()) {
    std::fprintf(stderr, "%s\n", summary.status().ToString().c_str());
    std::abort();
  }
  run.summary = *summary;
  return run;
}

Packing TwoSpheres(double r, double distance, const double n[3]) {
  Packing packing;
  for (double& length : packing.length) {
    length = 100 * r;
  }
  for (const double side : {-0.5, 0.5}) {
    packing.x.push_back(50 * r + side * distance * n[0]);
    packing.y.push_back(50 * r + side * distance * n[1]);
    packing.z.push_back(50 * r + side * distance * n[2]);
    packing.radius.push_back(r);
    packing.clump.push_back(-1);
  }
  return packing;
}

double AccelerationDownASlope(const Model& model, const std::string& material, double angle) {
  const double r = 0.005;
  const double g = 9.81;
  Packing packing;
  packing.length[0] = packing.length[1] = packing.length[2] = 100 * r;
  packing.x = packing.y = {0};
  packing.z = {r};
  packing.radius = {r};
  packing.clump = {-1};
  Assembly assembly(packing, model.density, ContactModelOf(model),
                    {.gravity = {g * std::sin(angle), 0, -g * std::cos(angle)},
                     .walls = {MakePlane("floor", {0, 0, 0}, {0, 0, 1})},
                     .material = material},
                    1);
  Flow flow(assembly, {.drop_height = 1e-6, .low = {-1, -1, -1}, .high = {1, 1, 1}}, {});
  if (flow.Advance(0.05) != StageEnd::kDone) return std::nan("");
  return assembly.particles().vx[0] / flow.time();
}

std::string ReadFile(const std::string& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

Packing LoadPacking(const std::string& path) {
  std::vector<PackingProblem> problems;
  Packing packing = ParsePacking(ReadFile(path), problems);
  for (const PackingProblem& problem : problems) {
    std::fprintf(stderr, "%s:%d: %s\n", path.c_str(), problem.line, problem.message.c_str());
  }
  if (!problems.empty()) {
    std::abort();
  }
  return packing;
}

}  // namespace calib::dem::test
