#include "tests/support/small_campaign.h"

#include <fmt/format.h>

namespace calib::testing {
namespace {

/// A cubic lattice of grains of several sizes, a little apart and a little out of place: loading
/// shears it, so that friction matters.
std::string Packing(unsigned seed) {
  constexpr int kEdge = 4;
  constexpr double kSpacing = 2.3e-3;
  std::string text = fmt::format("##PERIODIC:: {0} {0} {0}\n", kEdge * kSpacing);
  unsigned random = 12345 + 1000 * seed;
  const auto share = [&random] {  // any fixed sequence will do
    random = random * 1664525U + 1013904223U;
    return static_cast<double>(random >> 8) / static_cast<double>(1U << 24);
  };
  for (int i = 0; i < kEdge * kEdge * kEdge; ++i) {
    const auto place = [&](int k) { return (k + 0.5 + 0.12 * (share() - 0.5)) * kSpacing; };
    const double x = place(i % kEdge);
    const double y = place(i / kEdge % kEdge);
    const double z = place(i / (kEdge * kEdge));
    text += fmt::format("{:.9g} {:.9g} {:.9g} {:.9g} -1\n", x, y, z, 0.85e-3 + 0.25e-3 * share());
  }
  return text;
}

std::string Data(int load_steps) {
  std::string text = "# axial ratio\n";
  for (int i = 0; i < load_steps; ++i) {
    const double strain = 0.4 * i;  // percent
    text += fmt::format("{} {}\n", strain, 1 + 1.2 * strain / (0.5 + strain));
  }
  return text;
}

std::string Experiment(const std::string& name, const std::string& pressure, double noise,
                       bool validate, int packings) {
  std::string files = "file: packing.txt";
  for (int i = 1; i < packings; ++i) {
    files += i == 1 ? "" : ", ";
    if (i == 1) files = "files: [packing.txt, ";
    files += fmt::format("packing{}.txt", i);
  }
  if (packings > 1) files += "]";
  return fmt::format(R"(  - name: {0}
    test: triaxial_drained
    confining_pressure: {1}
    packing: {{{4}}}
    data:
      file: data.txt
      columns: {{axial_strain: axial, stress_ratio: ratio}}
      units: {{axial_strain: percent}}
    control: axial_strain
    staging: {{rate: 5 1/s, step: 0.004, damping: [0.4, 0.9], unbalanced: 0.05}}
    observables:
      stress_ratio: {{noise: {{relative: {2}, floor: {2}}}}}
    role: {3}
)",
                     name, pressure, noise, validate ? "validate" : "calibrate", files);
}

}  // namespace

SmallCampaign MakeSmallCampaign(const SmallCampaignOptions& options) {
  SmallCampaign campaign;
  campaign.files = {{"packing.txt", Packing(0)}, {"data.txt", Data(options.load_steps)}};
  for (int i = 1; i < options.packings; ++i) {
    campaign.files[fmt::format("packing{}.txt", i)] = Packing(static_cast<unsigned>(i));
  }
  campaign.yaml = fmt::format(
      R"(name: small
model:
  contact: hertz_mindlin
  density: 2650 kg/m^3
  fixed: {{poisson_ratio: 0.2}}
parameters:
  young_modulus: {{prior: log_uniform, min: 5e7 Pa, max: 5e8 Pa}}
  friction_angle: {{prior: uniform, min: 10 deg, max: 40 deg}}
experiments:
{}{}noise: given
inference:
  method: {}
{}{}failure: {{attempts: {}, pause_above: 0.5}}
seed: 7
{})",
      Experiment("tx", "0.1 MPa", options.relative_noise, false, options.packings),
      options.with_validation || options.with_second
          ? Experiment("tx2", "0.2 MPa", options.relative_noise, !options.with_second,
                       options.packings)
          : "",
      options.method,
      options.samples > 0 ? fmt::format("  samples: {}\n  max_iterations: {}\n", options.samples,
                                        options.max_iterations)
                          : "",
      options.inference, options.failure_attempts, options.extra);
  return campaign;
}

SmallCampaign MakeSmallDesign(const SmallCampaignOptions& options, const std::string& parameters,
                              const std::string& inference) {
  SmallCampaignOptions of_design = options;
  of_design.method = "design";
  SmallCampaign campaign = MakeSmallCampaign(of_design);
  std::string& yaml = campaign.yaml;
  yaml.insert(yaml.find("experiments:"), parameters);
  const std::size_t from = yaml.find("  samples:");
  yaml.replace(from, yaml.find("failure:") - from, inference);
  return campaign;
}

}  // namespace calib::testing
