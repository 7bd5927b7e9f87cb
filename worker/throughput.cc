#include "worker/throughput.h"

#include <stop_token>
#include <thread>

#include "dem/model/scenario.h"
#include "dem/model/state.h"
#include "dem/registry/catalog.h"
#include "dem/simulate/simulate.h"

namespace calib::worker {
namespace {

constexpr int kGrainsPerEdge = 6;
constexpr double kRadius = 1e-3;   // m
constexpr double kSpacing = 1.99;  // radii: just in contact

/// A simple cubic lattice: nothing to fetch, nothing to generate.
dem::Packing Lattice() {
  dem::Packing packing;
  for (double& length : packing.length) {
    length = kGrainsPerEdge * kSpacing * kRadius;
  }
  for (int i = 0; i < kGrainsPerEdge * kGrainsPerEdge * kGrainsPerEdge; ++i) {
    const int x = i % kGrainsPerEdge;
    const int y = i / kGrainsPerEdge % kGrainsPerEdge;
    const int z = i / (kGrainsPerEdge * kGrainsPerEdge);
    packing.x.push_back((x + 0.5) * kSpacing * kRadius);
    packing.y.push_back((y + 0.5) * kSpacing * kRadius);
    packing.z.push_back((z + 0.5) * kSpacing * kRadius);
    packing.radius.push_back(kRadius);
    packing.clump.push_back(-1);
  }
  return packing;
}

}  // namespace

double MeasureThroughput(std::chrono::milliseconds duration) {
  dem::Scenario scenario;
  scenario.model.contact = "hertz_mindlin";
  scenario.model.parameters = {
      {"young_modulus", 1e9}, {"poisson_ratio", 0.2}, {"friction_coefficient", 0.5}};
  scenario.test = "triaxial_drained";
  scenario.settings = {{"confining_pressure", 1e5}};
  scenario.packing = Lattice();
  // Far enough that the clock ends it, not the path.
  scenario.path = {{.target = 0.5, .load_step = 0}};

  const auto start = std::chrono::steady_clock::now();
  std::stop_source stop;
  const std::jthread timer([&stop, duration](std::stop_token early) {
    const auto end = std::chrono::steady_clock::now() + duration;
    while (!early.stop_requested() && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    stop.request_stop();
  });
  const auto summary = dem::Simulate(
      scenario, [](const dem::State&) {}, stop.get_token());
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  return summary.ok() && elapsed.count() > 0
             ? static_cast<double>(summary->contact_updates) / elapsed.count()
             : 0;
}

}  // namespace calib::worker
