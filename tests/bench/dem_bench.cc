// Speed of the step loop on dense packings: contact updates/s and particle-steps/s by law, grains
// and threads.
#include <benchmark/benchmark.h>
#include <malloc.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <string>

#include "dem/dynamics/quasi_static.h"
#include "dem/lab_tests/shared/shape_change.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

enum class Law { kHertz, kHertzRolling, kLinearMoments };

Model BenchModel(Law law) {
  if (law == Law::kHertz) {
    return test::HertzModel();
  }
  Model model = law == Law::kHertzRolling ? test::HertzModel() : test::LinearModel();
  if (law == Law::kHertzRolling) {  // as deploy/bench/peers gives it to other codes
    model.parameters = {
        {"young_modulus", 7e9}, {"poisson_ratio", 0.2}, {"friction_coefficient", 0.5}};
    model.effects = {"rolling_resistance"};
    model.parameters["rolling_resistance.stiffness_ratio"] = 0.7;
    model.parameters["rolling_resistance.friction"] = 0.13;
    return model;
  }
  model.parameters = {
      {"young_modulus", 1e9}, {"poisson_ratio", 0.25}, {"friction_coefficient", 0.5}};
  model.effects = {"rolling_resistance", "twisting_resistance"};
  for (const std::string& effect : model.effects) {
    model.parameters[effect + ".stiffness"] = 0.13;
    model.parameters[effect + ".friction"] = 0.13;
  }
  return model;
}

/// The published packing where $CALIB_DATA has it, else a generated one.
const Packing& PackingOf(int grains) {
  static std::map<int, Packing> packings;
  if (const auto it = packings.find(grains); it != packings.end()) {
    return it->second;
  }
  const char* folder = std::getenv("CALIB_DATA");
  const std::string path = std::string(folder == nullptr ? "" : folder) +
                           "/toyoura_triaxial/packing_" + std::to_string(grains) + ".txt";
  Packing packing = folder != nullptr && !test::ReadFile(path).empty() ? test::LoadPacking(path)
                                                                       : test::SmallPacking(grains);
  return packings.emplace(grains, std::move(packing)).first->second;
}

/// Settles under 0.5 MPa on all axes; the time step to go on with, 0: diverged.
double SettleAt500kPa(Assembly& assembly, benchmark::State& state) {
  StageOptions options;
  options.unbalanced = 5e-3;
  QuasiStatic stages(assembly, options, {});
  const AxisTarget axis{.mode = AxisTarget::Mode::kStress, .value = 5e5};
  if (stages.MoveTo({axis, axis, axis}) != StageEnd::kDone) {
    state.SkipWithError(stages.reason().c_str());
    return 0;
  }
  return stages.time_step();
}

/// Compression along z at 0.1/s: every iteration is one step of the engine.
void Compress(Assembly& assembly, double dt, benchmark::State& state) {
  const Motion motion{.stretch = {0.05, 0.05, -0.1}, .dt = dt, .damping = 0.2};
  while (state.KeepRunning()) {
    assembly.Move(motion);
    if (!assembly.EvaluateForces().ok()) {
      state.SkipWithError("diverged");
      return;
    }
  }
}

/// Dense at 0.5 MPa, then compressed.
void SettleAndCompress(Assembly& assembly, benchmark::State& state) {
  const double dt = SettleAt500kPa(assembly, state);
  if (dt == 0) {
    return;
  }
  const std::int64_t updates = assembly.contact_updates();
  const std::int64_t steps = assembly.steps();
  Compress(assembly, dt, state);
  const auto rate = [](std::int64_t count) {
    return benchmark::Counter(static_cast<double>(count), benchmark::Counter::kIsRate);
  };
  state.counters["contact_updates/s"] = rate(assembly.contact_updates() - updates);
  state.counters["particle_steps/s"] =
      rate((assembly.steps() - steps) * assembly.particles().size());
  state.counters["contacts"] = static_cast<double>(assembly.contacts());
}

void ContactUpdates(benchmark::State& state, Law law) {
  const Model model = BenchModel(law);
  Assembly assembly(PackingOf(static_cast<int>(state.range(0))), model.density,
                    ContactModelOf(model), static_cast<int>(state.range(1)));
  SettleAndCompress(assembly, state);
}

/// Rigid bodies of the packing's volume, aspect 1.2, one thread.
void Clumps(benchmark::State& state) {
  const Model model = BenchModel(Law::kHertz);
  const auto packing = Elongate(PackingOf(static_cast<int>(state.range(0))), 1.2, 1, {});
  if (!packing.ok()) {
    state.SkipWithError(std::string(packing.status().message()).c_str());
    return;
  }
  Assembly assembly(*packing, model.density, ContactModelOf(model), 1);
  SettleAndCompress(assembly, state);
}

void Arguments(benchmark::internal::Benchmark* bench) {
  for (const int grains : {1000, 5000, 10000}) {
    for (const int threads : {1, 2}) {
      bench->Args({grains, threads});
    }
  }
  bench->UseRealTime();
}

/// The settled grains again and again along the axes of their cell.
Packing Tiled(const Assembly& settled, const std::array<int, 3>& times) {
  const ParticleArrays& p = settled.particles();
  const double* const length = settled.cell().length;
  Packing tiled;
  for (int k = 0; k < times[0] * times[1] * times[2]; ++k) {
    const int at[3] = {k % times[0], k / times[0] % times[1], k / times[0] / times[1]};
    for (std::size_t g = 0; g < p.x.size(); ++g) {
      tiled.x.push_back(p.x[g] + at[0] * length[0]);
      tiled.y.push_back(p.y[g] + at[1] * length[1]);
      tiled.z.push_back(p.z[g] + at[2] * length[2]);
      tiled.radius.push_back(p.radius[g]);
      tiled.clump.push_back(-1);
    }
  }
  for (std::size_t a = 0; a < 3; ++a) {
    tiled.length[a] = times[a] * length[a];
  }
  return tiled;
}

/// One thread, 1000 grains at 0.5 MPa put side by side until they are so many: what a contact and a
/// grain cost when caches are left.
void CostAgainstSize(benchmark::State& state) {
  static const std::map<std::int64_t, std::array<int, 3>> kTimes = {
      {1000, {1, 1, 1}}, {5000, {5, 1, 1}}, {20'000, {5, 2, 2}}, {100'000, {5, 5, 4}}};
  const Model model = BenchModel(Law::kHertzRolling);
  Assembly one(PackingOf(1000), model.density, ContactModelOf(model), 1);
  const double dt = SettleAt500kPa(one, state);
  if (dt == 0) {
    return;
  }
  Assembly assembly(Tiled(one, kTimes.at(state.range(0))), model.density, ContactModelOf(model), 1);
  if (!assembly.EvaluateForces().ok()) {
    state.SkipWithError("diverged");
    return;
  }
  const std::int64_t updates = assembly.contact_updates();
  Compress(assembly, dt, state);
  const auto cost = [](std::int64_t count) {
    return benchmark::Counter(static_cast<double>(count),
                              benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
  };
  state.counters["s/contact_update"] = cost(assembly.contact_updates() - updates);
  state.counters["s/particle_step"] = cost(assembly.steps() * assembly.particles().size());
  state.counters["contacts/particle"] =
      static_cast<double>(assembly.contacts()) / assembly.particles().size();
}

BENCHMARK(CostAgainstSize)->Arg(1000)->Arg(5000)->Arg(20'000)->Arg(100'000);
BENCHMARK_CAPTURE(ContactUpdates, hertz, Law::kHertz)->Apply(Arguments);
BENCHMARK_CAPTURE(ContactUpdates, hertz_rolling, Law::kHertzRolling)->Apply(Arguments);
BENCHMARK_CAPTURE(ContactUpdates, linear_moments, Law::kLinearMoments)->Apply(Arguments);
BENCHMARK(Clumps)->Arg(1000);

}  // namespace
}  // namespace calib::dem

int main(int argc, char** argv) {
  mallopt(M_MMAP_THRESHOLD, 64 * 1024);  // as calib-worker does
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) {
    return 1;
  }
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
}
