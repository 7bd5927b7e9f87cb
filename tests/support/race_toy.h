#pragma once
// A campaign of two tests whose simulator is a closed form, with effects of its own, packings and
// chance: a diagnosis gets its base, its measurement and its runs from here.

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dem/registry/catalog.h"
#include "inference/sampling/philox.h"
#include "inference/sampling/sobol.h"
#include "server/diagnosis/race_list.h"
#include "server/diagnosis/run_maker.h"
#include "server/report/views/campaign_view.h"

namespace calib::diagnosis {

/// What is hidden in a measurement: base parameters as parts of their ranges, an effect or none.
struct HiddenTruth {
  double x = 0.5, y = 0.5;
  int effect = -1;
  double units = 0;  ///< strength, of either sign where the effect has both
  int second = -1;   ///< another one
  double second_units = 0;
};

/// Two curves of each of two tests, 24 readings each: loaded, unloaded, loaded again. A stress with
/// a relative error and a strain with an absolute one.
/// Effects: 1 is alike 0 (15 degrees), 2 has both signs, 3 has a form and saturates, 4 is never
/// excited, 5 excludes 1, others are what chance makes of them; runs with the last one diverge
/// beyond eight units. The catalogue's steps are off by up to four.
class RaceToy {
 public:
  static constexpr int kReadings = 24, kPackings = 8;
  static constexpr double kNoise = 0.008, kScatter = 0.012, kEffect = 0.03;

  RaceToy(int effects, unsigned seed, int base_runs = 96) : seed_(seed) {
    MakePath();
    for (int k = 0; k < effects; ++k) signatures_.push_back(SignatureOf(k));
    MakeCampaign(effects);
    const Eigen::MatrixXd net = inference::ScrambledSobol(base_runs, 2, seed);
    for (int i = 0; i < base_runs; ++i) {
      v1::Sample& sample = view_.samples.emplace_back();
      sample.set_index(i);
      std::vector<double> values;
      for (int j = 0; j < 2; ++j) {
        values.push_back(
            view_.campaign.parameters[static_cast<std::size_t>(j)].prior.Quantile(net(i, j)));
        sample.add_parameters(values.back());
      }
      base_.push_back(Run(values, {}, {}, i));
    }
  }

  int effects() const { return static_cast<int>(signatures_.size()); }
  static std::string NameOf(int effect) { return "e" + std::to_string(effect); }
  /// Effects of the build: they stay out.
  static std::vector<std::string> Without() {
    std::vector<std::string> names;
    for (const dem::EffectInfo& effect : dem::Effects()) names.push_back(effect.name);
    return names;
  }

  /// The campaign with a measurement of specimen `number`.
  report::CampaignView Measured(const HiddenTruth& truth, std::uint64_t number) const {
    report::CampaignView view = view_;
    Eigen::RowVectorXd log = Mean(truth);
    inference::PhiloxStream stream({.seed = seed_, .iteration = 1, .sample = number});
    log += Departure(stream) + Departure(stream);
    for (double& value : log) value += kNoise * stream.Normal();
    const Eigen::RowVectorXd readings = Readings(log);
    for (int e = 0; e < 2; ++e) {
      for (int o = 0; o < 2; ++o) {
        campaign::MeasuredObservable& own = view.campaign.experiments[static_cast<std::size_t>(e)]
                                                .observables[static_cast<std::size_t>(o)];
        own.values.clear();
        own.sd.clear();
        for (int i = 0; i < kReadings; ++i) {
          own.values.push_back(readings[Place(e, o, i)]);
          own.sd.push_back(campaign::ErrorOf(*own.noise, own.values.back()));
        }
      }
    }
    for (std::size_t s = 0; s < base_.size(); ++s) StoreStates(base_[s], static_cast<int>(s), view);
    return view;
  }

  /// A design of the campaign's race as it is stored, with batches that were made of it.
  static report::CampaignView Stored(const report::CampaignView& base, const Race& race,
                                     const std::vector<EndedBatch>& batches) {
    report::CampaignView design;
    design.status.set_campaign("c2");
    design.campaign = CampaignOfDesign(base.campaign, race);
    for (std::size_t b = 0; b < batches.size(); ++b) {
      for (std::size_t i = 0; i < batches[b].runs.size(); ++i) {
        const EndedRun& ended = batches[b].runs[i];
        v1::Sample& sample = design.samples.emplace_back();
        sample.set_index(static_cast<int>(b) * campaign::kMostRowsOfBatch + static_cast<int>(i));
        sample.set_iteration(static_cast<int>(b));
        sample.set_purpose(campaign::ToString(batches[b].stage));
        sample.set_status(ended.readings ? "finished" : "diverged");
        sample.set_stream(ended.run.stream);
        for (const double value : ended.run.values) sample.add_parameters(value);
        if (ended.readings) StoreStates(*ended.readings, sample.index(), design);
      }
    }
    return design;
  }

  /// One run of a design by the names of its parameters.
  EndedRun Made(const campaign::RunOf& run, const std::vector<std::string>& names) const {
    EndedRun ended{.run = run};
    std::vector<double> base(run.values.begin(), run.values.begin() + 2);
    std::vector<double> units(signatures_.size(), 0), forms(signatures_.size(), 1);
    std::vector<double> numerics(3, 1);
    for (std::size_t j = 2; j < names.size(); ++j) {
      const std::string& name = names[j];
      const double value = run.values[j];
      if (name == "numerics.rate") numerics[0] = value;
      if (name == "numerics.step") numerics[1] = value;
      if (name == "numerics.damping") numerics[2] = value;
      if (name[0] != 'e') continue;
      const auto k = static_cast<std::size_t>(std::stoi(name.substr(1)));
      if (name.find(".strength") != std::string::npos) units[k] = value / Unit(static_cast<int>(k));
      if (name.find(".form") != std::string::npos) forms[k] = value;
    }
    if (std::abs(units.back()) > 8) {
      ended.reason = "a grain left the cell";
      return ended;
    }
    ended.readings = Run(base, units, forms, run.stream, numerics);
    return ended;
  }

  static double Unit(int effect) { return 0.1 * (1 + effect); }
  static bool HasBothSigns(int effect) { return effect == 2 || effect == 8; }
  static double PowerOf(int effect) { return effect % 4 == 1 ? 0.75 : 1; }

 private:
  static void StoreStates(const Eigen::RowVectorXd& readings, int sample,
                          report::CampaignView& view) {
    for (int e = 0; e < 2; ++e) {
      report::StateHistory& history = view.states[{e == 0 ? "low" : "high", sample}];
      history.observables = {"deviatoric_stress", "volumetric_strain"};
      for (int i = 0; i < kReadings; ++i) {
        v1::State& state = history.states.emplace_back();
        state.set_load_step(i);
        for (int o = 0; o < 2; ++o) state.add_values(readings[Place(e, o, i)]);
      }
    }
  }

  static Eigen::Index Place(int experiment, int observable, int i) {
    // Of MakeDataSet: by experiment, load step, observable.
    return 2 * (kReadings * experiment + i) + observable;
  }

  void MakePath() {
    for (int i = 0; i < kReadings; ++i) {
      stage_.push_back(i < 12 ? 0 : i < 16 ? 1 : 2);
      strain_.push_back(i < 12   ? 0.05 * (i + 1)
                        : i < 16 ? 0.6 - 0.03 * (i - 11)
                                 : 0.48 + (i - 15) / 15.0);
    }
  }

  // Smooth functions of the path of one curve, of size one.
  static constexpr int kShapes = 6;
  double Shape(int m, int i) const {
    const double e = strain_[static_cast<std::size_t>(i)];
    switch (m) {
      case 0:
        return std::sin(4 * e);
      case 1:
        return e * e;
      case 2:
        return 10 * e * std::exp(-8 * e);
      case 3:
        return stage_[static_cast<std::size_t>(i)] == 1 ? 0.7 : 0;
      case 4:
        return e;
      default:
        return std::sin(9 * e);
    }
  }

  Eigen::RowVectorXd ByChance(std::uint64_t number) const {
    inference::PhiloxStream stream({.seed = seed_, .iteration = 2, .sample = number});
    Eigen::RowVectorXd result = Eigen::RowVectorXd::Zero(4 * kReadings);
    for (int c = 0; c < 4; ++c) {
      for (int m = 0; m < kShapes; ++m) {
        const double size = stream.Normal() / std::sqrt(kShapes);
        for (int i = 0; i < kReadings; ++i) result[Place(c / 2, c % 2, i)] += size * Shape(m, i);
      }
    }
    return result / result.norm();
  }

  Eigen::RowVectorXd SignatureOf(int effect) const {
    if (effect == 4) return Eigen::RowVectorXd::Zero(4 * kReadings);
    const double size = kEffect * std::sqrt(4 * kReadings) / 2;
    if (effect != 1) return size * ByChance(static_cast<std::uint64_t>(effect));
    const double angle = 15 * M_PI / 180;
    const Eigen::RowVectorXd first = ByChance(0);
    Eigen::RowVectorXd other = ByChance(1);
    other -= other.dot(first) * first;
    return size * (std::cos(angle) * first + std::sin(angle) * other / other.norm());
  }

  void MakeCampaign(int effects) {
    campaign::Campaign& campaign = view_.campaign;
    view_.status.set_campaign("c1");
    campaign.name = "toy";
    campaign.seed = seed_;
    campaign.model.contact = "hertz_mindlin";
    campaign.parameters = {
        {.name = "young_modulus",
         .unit = "Pa",
         .prior = {.kind = inference::PriorKind::kLogUniform, .min = 0.4e9, .max = 1.8e9}},
        {.name = "friction_angle", .unit = "rad", .prior = {.min = 0.2, .max = 0.8}}};
    for (int k = 0; k < effects; ++k) {
      dem::UserEffect& own = campaign.model.user_effects.emplace_back();
      own.info.name = NameOf(k);
      own.info.kind = "contact";
      own.info.two_sided = HasBothSigns(k);
      dem::ParameterInfo strength;
      strength.name = "strength";
      strength.unit = "1";
      strength.min = own.info.two_sided ? -100 : 0;
      strength.max = 100;
      strength.null_value = 0;
      const double most = (k == 6 ? 3 : 25) * Unit(k);
      strength.default_prior = {
          .kind = "uniform", .min = own.info.two_sided ? -most : 0, .max = most};
      own.info.parameters = {strength};
      if (k == 3) {
        dem::ParameterInfo form;
        form.name = "form";
        form.unit = "1";
        form.max = 10;
        form.default_prior = {.kind = "uniform", .min = 0.5, .max = 1.5};
        own.info.parameters.push_back(form);
      }
      // The guess is off by up to four.
      const double off = std::pow(4.0, std::cos(2.3 * k + 1));
      dem::StrengthRay ray{.parameter = "strength", .order = PowerOf(k)};
      ray.steps = {std::min(0.7 * off * Unit(k), 0.4 * most), std::min(2 * off * Unit(k), most)};
      own.info.rays = {ray};
      if (k == 5) own.info.excludes = {NameOf(1)};
    }
    for (const char* name : {"low", "high"}) {
      campaign::Experiment& e = campaign.experiments.emplace_back();
      e.name = name;
      e.test = "triaxial_drained";
      e.settings["confining_pressure"] = e.name == "low" ? 1e5 : 4e5;
      e.specimens.resize(kPackings);
      e.control_name = "axial_strain";
      e.control = strain_;
      for (int i = 0; i < kReadings; ++i)
        e.path.push_back({.target = strain_[static_cast<std::size_t>(i)], .load_step = i});
      for (const int stage : stage_) {
        e.segment.emplace_back(stage == 0   ? "initial_loading"
                               : stage == 1 ? "unload_1"
                                            : "reload_1");
      }
      e.observables.resize(2);
      e.observables[0].name = "deviatoric_stress";
      e.observables[0].noise =
          campaign::NoiseLaw{.relative = kNoise, .floor = 0, .absolute = std::nullopt};
      e.observables[1].name = "volumetric_strain";
      e.observables[1].noise = campaign::NoiseLaw{.relative = 0, .floor = 0, .absolute = kNoise};
    }
  }

  // Logarithm of the stress, and strain.
  Eigen::RowVectorXd MeanOf(double x, double y, const std::vector<double>& units,
                            const std::vector<double>& forms,
                            const std::vector<double>& numerics) const {
    Eigen::RowVectorXd result(4 * kReadings);
    for (int e = 0; e < 2; ++e) {
      for (int i = 0; i < kReadings; ++i) {
        const double strain = strain_[static_cast<std::size_t>(i)];
        const double b = 5 * std::exp(0.3 * y - 0.2 * e);
        const double a = 1 + 0.3 * x + 0.05 * x * y + 0.1 * e;
        result[Place(e, 0, i)] = std::log(0.3 + a * std::tanh(b * strain));
        result[Place(e, 1, i)] =
            0.3 * (1 + 0.2 * x * e) * strain + (0.3 + 0.2 * y) * strain * strain;
      }
    }
    for (std::size_t k = 0; k < units.size(); ++k) {
      double s = units[k];
      if (s == 0) continue;
      if (k == 3) s = 6 * std::tanh(s / 6) * forms[k];
      const double f = std::copysign(std::pow(std::abs(s), PowerOf(static_cast<int>(k))), s);
      result += f * (1 + 0.3 * (k % 2 == 0 ? x : y)) * signatures_[k];
      // What goes together a little beyond the sum.
      for (std::size_t l = 0; l < k; ++l) result += 0.01 * s * units[l] * signatures_[(k + l) % 3];
    }
    for (std::size_t c = 0; c < numerics.size(); ++c) {
      for (int p = 0; p < 4 * kReadings && numerics[c] != 1; ++p) {
        result[p] += 0.003 * static_cast<double>(c + 1) *
                     strain_[static_cast<std::size_t>(p / 2 % kReadings)];
      }
    }
    return result;
  }

  Eigen::RowVectorXd Mean(const HiddenTruth& truth) const {
    std::vector<double> units(signatures_.size(), 0);
    if (truth.effect >= 0) units[static_cast<std::size_t>(truth.effect)] = truth.units;
    if (truth.second >= 0) units[static_cast<std::size_t>(truth.second)] = truth.second_units;
    return MeanOf(2 * truth.x - 1, 2 * truth.y - 1, units,
                  std::vector<double>(signatures_.size(), 1), {1, 1, 1});
  }

  Eigen::RowVectorXd Departure(inference::PhiloxStream& stream) const {
    Eigen::RowVectorXd result(4 * kReadings);
    for (int c = 0; c < 4; ++c) {
      double z[4];
      for (double& value : z) value = kScatter * stream.Normal();
      for (int i = 0; i < kReadings; ++i) {
        const double e = strain_[static_cast<std::size_t>(i)];
        result[Place(c / 2, c % 2, i)] =
            std::tanh(8 * e) * (z[0] + z[1] * std::cos(3 * e) + z[2] * std::cos(6 * e)) +
            0.5 * z[3] * (stage_[static_cast<std::size_t>(i)] == 1 ? 1 : 0);
      }
    }
    return result;
  }

  Eigen::RowVectorXd Readings(const Eigen::RowVectorXd& log) const {
    Eigen::RowVectorXd result = log;
    for (Eigen::Index p = 0; p < result.size(); p += 2) result[p] = 1e5 * std::exp(result[p]);
    return result;
  }

  // The same run whoever asks and whenever: chance goes by stream and values.
  Eigen::RowVectorXd Run(const std::vector<double>& base, const std::vector<double>& units,
                         const std::vector<double>& forms, int stream,
                         const std::vector<double>& numerics = {1, 1, 1}) const {
    const double x =
        2 * (std::log(base[0]) - std::log(0.4e9)) / (std::log(1.8e9) - std::log(0.4e9)) - 1;
    const double y = 2 * (base[1] - 0.2) / 0.6 - 1;
    Eigen::RowVectorXd log = MeanOf(x, y, units, forms, numerics);
    inference::PhiloxStream of_packing(
        {.seed = seed_, .iteration = 3, .sample = static_cast<std::uint64_t>(stream % kPackings)});
    log += Departure(of_packing);
    std::uint64_t mixed = static_cast<std::uint64_t>(stream);
    const auto mix = [&mixed](double value) {
      mixed = (mixed ^ static_cast<std::uint64_t>(std::llround(value * 1e6))) * 0x9E3779B97F4A7C15U;
    };
    mix(x);
    mix(y);
    for (std::size_t k = 0; k < units.size(); ++k) {
      if (units[k] != 0) mix(units[k] + 1000.0 * static_cast<double>(k + 1));
    }
    inference::PhiloxStream of_run({.seed = seed_, .iteration = 4, .sample = mixed});
    log += Departure(of_run);
    return Readings(log);
  }

  unsigned seed_;
  std::vector<int> stage_;
  std::vector<double> strain_;
  std::vector<Eigen::RowVectorXd> signatures_;  // K of T: of one unit
  std::vector<Eigen::RowVectorXd> base_;        // readings of the base runs
  report::CampaignView view_;
};

/// Makes batches of a toy, and may begin with some that were made before.
class ToyRunMaker : public RunMaker {
 public:
  ToyRunMaker(const RaceToy& toy, std::vector<std::string> names, std::vector<EndedBatch> made = {})
      : toy_(toy), names_(std::move(names)), batches_(std::move(made)) {}

  absl::StatusOr<std::vector<EndedBatch>> Batches() override { return batches_; }
  absl::StatusOr<EndedBatch> Make(const RunBatch& batch) override {
    if (batch.number != static_cast<int>(batches_.size()))
      return absl::FailedPreconditionError("a batch out of order");
    EndedBatch ended{.stage = batch.stage};
    for (const campaign::RunOf& run : batch.rows) ended.runs.push_back(toy_.Made(run, names_));
    batches_.push_back(ended);
    ++made_;
    return ended;
  }
  int made() const { return made_; }
  const std::vector<EndedBatch>& batches() const { return batches_; }

 private:
  const RaceToy& toy_;
  std::vector<std::string> names_;
  std::vector<EndedBatch> batches_;
  int made_ = 0;
};

}  // namespace calib::diagnosis
