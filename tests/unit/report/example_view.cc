#include "tests/unit/report/example_view.h"

#include <cmath>
#include <random>

#include "server/methods/registry.h"
namespace calib::report::testing {
namespace {

constexpr int kExampleReadings = 40;
constexpr int kSamples = 120;
constexpr double kTruth[3] = {2e9, 0.5, 0.3};

// A triaxial-like response: the modulus sets the rise, friction the plateau, the third parameter
// the softening.
double Strength(const double* p, double strain) {
  const double rise = 1 - std::exp(-strain * 60 * std::sqrt(p[0] / 2e9));
  return 3 * p[1] * rise * (1 - p[2] * 0.6 * strain / 0.12);
}
double Volume(const double* p, double strain) {
  return 0.01 * (1 - std::exp(-strain * 80)) - (0.15 + 0.6 * p[1]) * strain * strain;
}

campaign::Experiment MakeExperiment(const std::string& name, campaign::Role role, double scale,
                                    std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise;
  campaign::Experiment e;
  e.name = name;
  e.test = "triaxial_drained";
  e.role = role;
  e.control_name = "axial_strain";
  e.observables = {
      {.name = "q_over_p", .values = {}, .sd = {}},
      {.name = "volumetric_strain", .values = {}, .sd = {}, .correlation_length = 0.005}};
  for (int i = 0; i < kExampleReadings; ++i) {
    const double strain = 0.12 * (i + 1) / kExampleReadings;
    e.control.push_back(strain);
    e.path.push_back({.target = strain, .load_step = i});
    e.segment.emplace_back(strain < 0.02 ? "initial_loading"
                                         : (strain < 0.05 ? "pre_peak" : "post_peak"));
    const double q = scale * Strength(kTruth, strain);
    e.observables[0].sd.push_back(0.02 * q + 0.01);
    e.observables[0].values.push_back(q + e.observables[0].sd.back() * noise(random));
    e.observables[1].sd.push_back(3e-4);
    e.observables[1].values.push_back(Volume(kTruth, strain) + 3e-4 * noise(random));
  }
  return e;
}

StateHistory MakeStates(const double* p, double scale) {
  StateHistory history{.observables = {"axial_strain", "volumetric_strain", "q_over_p"},
                       .states = {}};
  for (int i = 0; i < kExampleReadings; ++i) {
    const double strain = 0.12 * (i + 1) / kExampleReadings;
    v1::State state;
    state.set_load_step(i);
    for (const double value : {strain, Volume(p, strain), scale * Strength(p, strain)}) {
      state.add_values(value);
    }
    history.states.push_back(std::move(state));
  }
  return history;
}

void AddParameter(CampaignView& view, const std::string& name, const std::string& unit,
                  const inference::Prior& prior) {
  view.campaign.parameters.push_back({name, unit, prior});
  auto* p = view.posterior.add_parameters();
  p->set_name(name);
  p->set_unit(unit);
  p->set_prior_min(prior.min);
  p->set_prior_max(prior.max);
}

void Summarise(CampaignView& view, double shrink, v1::Posterior& posterior) {
  const double sd[3] = {2.2e8, 0.02, 0.06};
  for (int k = 0; k < 3; ++k) {
    auto* p = posterior.mutable_parameters(k);
    p->set_mean(kTruth[k] + 0.3 * sd[k] * shrink);
    p->set_sd(sd[k] * shrink);
    p->set_cov(p->sd() / p->mean());
    p->set_q05(p->mean() - 1.64 * p->sd());
    p->set_q50(p->mean());
    p->set_q95(p->mean() + 1.64 * p->sd());
    p->set_split_half(0.12 * (k + 1));
  }
  posterior.set_ess(38 / shrink);
  posterior.set_pareto_k(0.42 * shrink);
  posterior.set_log_evidence(212.4 - 3 * shrink);
  posterior.set_log_evidence_se(0.3);
  posterior.set_campaign(view.status.campaign());
  posterior.set_noise("given");
  posterior.set_predictive_p(0.38);
}

}  // namespace

CampaignView ExampleView(const std::string& name) {
  CampaignView view;
  view.campaign.name = name;
  view.campaign.model.contact = "hertz_mindlin";
  view.campaign.model.effects = {"rolling_resistance"};
  view.campaign.model.parameters = {{"poisson_ratio", 0.2}};
  view.campaign.method = methods::All().standard();
  view.campaign.samples = 60;
  view.campaign.max_iterations = 4;
  view.status.set_max_iterations(4);
  view.campaign.seed = 7;
  view.campaign.experiments = {MakeExperiment("tx02", campaign::Role::kCalibrate, 1, 1),
                               MakeExperiment("tx05", campaign::Role::kValidate, 0.97, 2)};
  view.status.set_campaign("c1");
  view.status.set_name(name);
  view.status.set_state("finished");
  view.status.set_method("iterative_bayesian_filter");
  view.status.set_created_unix_ms(1'700'000'000'000);
  using inference::PriorKind;
  AddParameter(view, "young_modulus", "Pa",
               {.kind = PriorKind::kLogUniform, .min = 1e8, .max = 1e11});
  AddParameter(view, "friction_angle", "rad",
               {.kind = PriorKind::kUniform, .min = 0.17, .max = 0.8});
  AddParameter(view, "rolling_resistance.friction", "1",
               {.kind = PriorKind::kUniform, .min = 0, .max = 1});
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  for (int s = 0; s < kSamples; ++s) {
    const bool first = s < kSamples / 2;
    const double spread = first ? 3 : 1;
    const double p[3] = {kTruth[0] * std::exp(0.15 * spread * normal(random)),
                         kTruth[1] + 0.03 * spread * normal(random),
                         first ? uniform(random) : kTruth[2] + 0.08 * normal(random)};
    v1::Sample sample;
    sample.set_index(s);
    sample.set_iteration(first ? 0 : 1);
    sample.set_status("finished");
    double misfit = 0;
    for (int k = 0; k < 3; ++k) {
      sample.add_parameters(p[k]);
      misfit += std::pow((p[k] - kTruth[k]) / (k == 0 ? 2.2e8 : (k == 1 ? 0.02 : 0.06)), 2);
    }
    sample.set_weight(std::exp(-0.5 * misfit));
    view.samples.push_back(sample);
    view.states[{"tx02", s}] = MakeStates(p, 1);
    view.states[{"tx05", s}] = MakeStates(p, 1);
  }
  view.posterior.set_iterations(2);
  view.posterior.set_converged(true);
  view.posterior.set_model_evaluations(kSamples);
  view.posterior.set_core_hours(3.2);
  for (int i = 0; i < 9; ++i) view.posterior.add_correlation(i % 4 == 0 ? 1 : 0.2);
  for (int i = 0; i < kExampleReadings; ++i) {
    auto* point = view.posterior.add_path();
    point->set_experiment("tx02");
    point->set_load_step(i);
    for (int k = 0; k < 3; ++k) {
      point->add_mean(kTruth[k] * (1 + 0.3 * std::exp(-i / 8.0)));
      point->add_cov(0.05 + 0.4 * std::exp(-i / 6.0));
    }
    point->set_ess(std::exp(-i / 15.0));
  }
  v1::Posterior before = view.posterior;
  before.set_iteration(0);
  before.set_model_evaluations(kSamples / 2);
  Summarise(view, 2.5, before);
  view.posterior.set_iteration(1);
  Summarise(view, 1, view.posterior);
  view.iterations = {before, view.posterior};
  view.source.set_campaign_file("name: " + name + "\n");
  return view;
}

}  // namespace calib::report::testing
