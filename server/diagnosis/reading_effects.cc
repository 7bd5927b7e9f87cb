#include "server/diagnosis/reading_effects.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>

namespace calib::diagnosis {
namespace {

using Eigen::Index;

// Strengths at which it is asked whether an effect changes anything.
constexpr double kGain = 0.05;    // of the load
constexpr double kOffset = 0.03;  // of the largest mean stress
constexpr double kStrain = 1e-3;  // of the rig at the largest load, and of seating
constexpr double kPorosity = 0.01;
constexpr double kSeatingShare = 0.1;  // of the largest load: the stress that closes 63 % of gaps
constexpr const char* kNoStress = "the readings do not give axial and lateral stress";
constexpr const char* kNoStrain = "axial strain is not the control of any fitted test";
constexpr const char* kNoPorosity = "no fitted test reads porosity or void ratio";

// Where the readings of one calibrated experiment stand in a history.
struct Curve {
  const campaign::Experiment* experiment = nullptr;
  std::map<std::string, std::vector<Index>> at;  // observable -> index of each reading, -1: none
};

std::vector<Curve> CurvesOf(const campaign::Campaign& campaign, const inference::DataSet& data) {
  std::vector<Curve> curves;
  for (std::size_t e = 0; e < campaign.experiments.size(); ++e) {
    const campaign::Experiment& experiment = campaign.experiments[e];
    if (experiment.role != campaign::Role::kCalibrate) continue;
    Curve curve{.experiment = &experiment, .at = {}};
    for (const campaign::MeasuredObservable& observable : experiment.observables) {
      curve.at[observable.name].assign(experiment.control.size(), -1);
    }
    for (std::size_t k = 0; k < data.readings.size(); ++k) {
      const inference::Reading& reading = data.readings[k];
      if (reading.experiment != static_cast<int>(e)) continue;
      const auto& name = experiment.observables[static_cast<std::size_t>(reading.observable)].name;
      curve.at[name][static_cast<std::size_t>(reading.load_step)] = static_cast<Index>(k);
    }
    curves.push_back(std::move(curve));
  }
  return curves;
}

struct Stress {
  double axial = 0, lateral = 0;
};

double MeanStress(Stress s) { return (s.axial + 2 * s.lateral) / 3; }

// Of one reading of one history; nothing where its observables do not say.
std::optional<Stress> StressAt(const Curve& curve, std::size_t step, const Eigen::RowVectorXd& y) {
  const auto value = [&](const char* name) -> std::optional<double> {
    const auto found = curve.at.find(name);
    if (found == curve.at.end() || found->second[step] < 0) return std::nullopt;
    return y[found->second[step]];
  };
  const auto pressure = curve.experiment->settings.find("confining_pressure");
  const bool triaxial =
      curve.experiment->test == "triaxial_drained" && pressure != curve.experiment->settings.end();
  if (const auto p = value("mean_stress"), q = value("deviatoric_stress"); p && q) {
    return Stress{.axial = *p + 2 * *q / 3, .lateral = *p - *q / 3};
  }
  if (const auto a = value("axial_stress"), l = value("lateral_stress"); a && l) {
    return Stress{.axial = *a, .lateral = *l};
  }
  if (!triaxial) return std::nullopt;
  const auto& initial = curve.experiment->initial_stress;
  const double lateral = initial ? initial->lateral : pressure->second;
  if (const auto a = value("axial_stress")) return Stress{.axial = *a, .lateral = lateral};
  if (const auto q = value("deviatoric_stress")) {
    return Stress{.axial = lateral + *q, .lateral = lateral};
  }
  if (const auto r = value("stress_ratio"))
    return Stress{.axial = *r * lateral, .lateral = lateral};
  if (const auto m = value("q_over_p"); m && *m < 3) {
    return Stress{.axial = lateral * (1 + 2 * *m / 3) / (1 - *m / 3), .lateral = lateral};
  }
  return std::nullopt;
}

struct Rows {
  Eigen::RowVectorXd value, sd;  // T each, of the readings
};

Rows ReadingRows(const inference::DataSet& data) {
  const auto t = static_cast<Index>(data.readings.size());
  Rows rows{.value = Eigen::RowVectorXd(t), .sd = Eigen::RowVectorXd(t)};
  for (Index k = 0; k < t; ++k) {
    rows.value[k] = data.readings[static_cast<std::size_t>(k)].value;
    rows.sd[k] = data.readings[static_cast<std::size_t>(k)].sd;
  }
  return rows;
}

// What an observable reads at a stress; nothing for those that are no stress.
std::optional<double> Read(const std::string& observable, Stress s) {
  if (observable == "axial_stress") return s.axial;
  if (observable == "lateral_stress") return s.lateral;
  if (observable == "mean_stress") return MeanStress(s);
  if (observable == "deviatoric_stress") return s.axial - s.lateral;
  if (observable == "stress_ratio") return s.axial / s.lateral;
  if (observable == "q_over_p") return (s.axial - s.lateral) / MeanStress(s);
  return std::nullopt;
}

// Load on the rig since the start of loading: see dem/measure/apparatus.h.
double LoadOf(const Curve& curve, Stress now, Stress start) {
  return curve.experiment->test == "oedometric"
             ? now.axial - start.axial
             : (now.axial - now.lateral) - (start.axial - start.lateral);
}

// The others report stresses as they are.
bool HasLoadCell(const campaign::Experiment& experiment) {
  return experiment.test == "triaxial_drained" || experiment.test == "triaxial_undrained" ||
         experiment.test == "oedometric";
}

std::vector<std::optional<Stress>> StressPath(const Curve& curve, const Eigen::RowVectorXd& y) {
  std::vector<std::optional<Stress>> path;
  path.reserve(curve.experiment->control.size());
  for (std::size_t s = 0; s < curve.experiment->control.size(); ++s) {
    path.push_back(StressAt(curve, s, y));
  }
  return path;
}

struct Scales {
  double stress = 0;  // the largest mean stress of the readings
  double load = 0;    // the largest load
};

Scales ScalesOf(const std::vector<Curve>& curves, const Eigen::RowVectorXd& y) {
  Scales scales;
  for (const Curve& curve : curves) {
    const auto path = StressPath(curve, y);
    for (const auto& s : path) {
      if (!s || !path.front()) continue;
      scales.stress = std::max(scales.stress, MeanStress(*s));
      scales.load = std::max(scales.load, LoadOf(curve, *s, *path.front()));
    }
  }
  return scales;
}

// The axial stress is read wrongly by gain * load + offset.
void MisreadLoad(const Curve& curve, double gain, double offset, const Eigen::RowVectorXd& y,
                 Eigen::Ref<Eigen::RowVectorXd> change) {
  const auto path = StressPath(curve, y);
  for (const auto& [name, at] : curve.at) {
    for (std::size_t s = 0; s < at.size(); ++s) {
      if (at[s] < 0 || !path[s] || !path.front()) continue;
      Stress read = *path[s];
      read.axial += gain * LoadOf(curve, *path[s], *path.front()) + offset;
      const auto value = Read(name, read);
      if (value && std::isfinite(*value)) change[at[s]] = *value - y[at[s]];
    }
  }
}

// The strain is read too large by strain(load): the curve at a reading is that of an earlier
// strain, by its slope towards the neighbour on the same stage.
template <typename StrainOfLoad>
void MisreadStrain(const Curve& curve, const StrainOfLoad& strain, const Eigen::RowVectorXd& y,
                   Eigen::Ref<Eigen::RowVectorXd> change) {
  const auto path = StressPath(curve, y);
  const campaign::Experiment& experiment = *curve.experiment;
  for (const auto& observable : curve.at) {
    const std::vector<Index>& at = observable.second;
    for (std::size_t s = 0; s < at.size(); ++s) {
      if (at[s] < 0 || !path[s] || !path.front()) continue;
      const auto same_stage = [&](std::size_t other) {
        return at[other] >= 0 && experiment.segment[other] == experiment.segment[s] &&
               experiment.control[other] != experiment.control[s];
      };
      std::optional<std::size_t> neighbour;
      if (s > 0 && same_stage(s - 1)) neighbour = s - 1;
      if (!neighbour && s + 1 < at.size() && same_stage(s + 1)) neighbour = s + 1;
      if (!neighbour) continue;
      const double slope =
          (y[at[s]] - y[at[*neighbour]]) / (experiment.control[s] - experiment.control[*neighbour]);
      change[at[s]] = -slope * strain(LoadOf(curve, *path[s], *path.front()));
    }
  }
}

// A denser start, kept along the whole curve.
void ShiftPorosity(const Curve& curve, double fall, const Eigen::RowVectorXd& y,
                   Eigen::Ref<Eigen::RowVectorXd> change) {
  for (const auto& [name, at] : curve.at) {
    for (const Index k : at) {
      if (k < 0) continue;
      if (name == "porosity") change[k] = -fall;
      if (name == "void_ratio") change[k] = -fall * (1 + y[k]) * (1 + y[k]);
    }
  }
}

// One strength of an effect, and what it changes along a curve.
struct ActOnCurve {
  std::string effect, parameter;
  double unit;  // at which it is asked whether it changes anything, SI
  const char* why_not;
  std::function<void(const Curve&, double strength, const Eigen::RowVectorXd& y,
                     Eigen::Ref<Eigen::RowVectorXd> change)>
      act;
};

// Nothing is known of experiments that name no test.
bool MayHaveRig(const Curve& curve) {
  return curve.experiment->test.empty() || HasLoadCell(*curve.experiment);
}

std::vector<ActOnCurve> ActsOnCurves(const Scales& scales) {
  const double load = scales.load, seating = kSeatingShare * load;
  const char* const no_strain = load > 0 ? kNoStrain : kNoStress;
  const auto reads_strain = [load](const Curve& c) {
    return load > 0 && MayHaveRig(c) && c.experiment->control_name == "axial_strain";
  };
  using Row = Eigen::RowVectorXd;
  using Change = Eigen::Ref<Eigen::RowVectorXd>;
  return {
      {"load_cell_error", "gain", kGain, kNoStress,
       [](const Curve& c, double gain, const Row& y, const Change& change) {
         if (MayHaveRig(c)) MisreadLoad(c, gain, 0, y, change);
       }},
      {"load_cell_error", "offset", kOffset * scales.stress, kNoStress,
       [](const Curve& c, double offset, const Row& y, const Change& change) {
         if (MayHaveRig(c)) MisreadLoad(c, 0, offset, y, change);
       }},
      {"apparatus_compliance", "compliance", load > 0 ? kStrain / load : 1, no_strain,
       [reads_strain](const Curve& c, double compliance, const Row& y, const Change& change) {
         if (!reads_strain(c)) return;
         MisreadStrain(
             c, [compliance](double x) { return compliance * x; }, y, change);
       }},
      {"strain_offset", "offset", kStrain, no_strain,
       [reads_strain, seating](const Curve& c, double offset, const Row& y, const Change& change) {
         if (!reads_strain(c)) return;
         const auto closed = [offset, seating](double x) {
           return offset * (1 - std::exp(-std::max(x, 0.0) / seating));
         };
         MisreadStrain(c, closed, y, change);
       }},
      {"initial_density", "densification", kPorosity, kNoPorosity,
       [](const Curve& c, double fall, const Row& y, const Change& change) {
         ShiftPorosity(c, fall, y, change);
       }}};
}

// A campaign of its own with its curves.
struct OwnCurves {
  campaign::Campaign campaign;
  std::vector<Curve> curves;
};

}  // namespace

EffectsOnCurves EffectsOnReadings(const campaign::Campaign& campaign) {
  const auto own = std::make_shared<OwnCurves>();
  own->campaign.experiments = campaign.experiments;
  const inference::DataSet data = campaign::MakeDataSet(campaign);
  own->curves = CurvesOf(own->campaign, data);
  const Eigen::RowVectorXd value = ReadingRows(data).value;
  EffectsOnCurves found;
  std::set<std::string> possible;
  const std::vector<ActOnCurve> acts = ActsOnCurves(ScalesOf(own->curves, value));
  for (const ActOnCurve& one : acts) {
    const CurveEffect effect = [own = std::shared_ptr<const OwnCurves>(own), act = one.act](
                                   const Eigen::MatrixXd& readings, const Eigen::VectorXd& values) {
      Eigen::MatrixXd read = readings;
      Eigen::RowVectorXd change(readings.cols());
      for (Index i = 0; i < readings.rows(); ++i) {
        const Eigen::RowVectorXd y = readings.row(i);
        change.setZero();
        for (const Curve& curve : own->curves) act(curve, values[i], y, change);
        read.row(i) += change;
      }
      return read;
    };
    if (effect(value, Eigen::VectorXd::Constant(1, one.unit)) == value) continue;
    found.by_strength.emplace(one.effect + "." + one.parameter, effect);
    possible.insert(one.effect);
  }
  for (const ActOnCurve& one : acts) {
    if (possible.insert(one.effect).second) found.impossible.emplace_back(one.effect, one.why_not);
  }
  return found;
}

std::optional<Eigen::MatrixXd> MisreadLoads(const campaign::Campaign& campaign,
                                            const inference::DataSet& data,
                                            const Eigen::MatrixXd& histories,
                                            const Eigen::VectorXd& gain,
                                            const Eigen::VectorXd& offset) {
  std::vector<Curve> curves = CurvesOf(campaign, data);
  const Rows rows = ReadingRows(data);
  const Eigen::RowVectorXd& value = rows.value;
  const Eigen::RowVectorXd& sd = rows.sd;
  const Index t = value.size();
  // A formula of the user's may read anything.
  for (const dem::UserEffect& effect : campaign.model.user_effects) {
    const auto& used = campaign.model.effects;
    if (effect.info.kind == "measurement" &&
        std::find(used.begin(), used.end(), effect.info.name) != used.end()) {
      return std::nullopt;
    }
  }
  curves.erase(std::remove_if(curves.begin(), curves.end(),
                              [](const Curve& curve) { return !HasLoadCell(*curve.experiment); }),
               curves.end());
  for (const Curve& curve : curves) {
    const Stress any{.axial = 1, .lateral = 1};
    // Loads count from the start of loading, which must be among the readings.
    const campaign::Experiment& experiment = *curve.experiment;
    if (Read(experiment.control_name, any) || experiment.control.front() != 0) return std::nullopt;
    const auto path = StressPath(curve, value);
    for (const auto& [name, at] : curve.at) {
      if (!Read(name, any)) continue;
      for (std::size_t s = 0; s < at.size(); ++s) {
        if (at[s] >= 0 && !(path[s] && path.front())) return std::nullopt;
      }
    }
  }
  Eigen::MatrixXd misread = histories;
  Eigen::RowVectorXd change(t);
  for (Index i = 0; i < histories.rows(); ++i) {
    const Eigen::RowVectorXd y = value + histories.row(i).cwiseProduct(sd);
    change.setZero();
    for (const Curve& curve : curves) MisreadLoad(curve, gain[i], offset[i], y, change);
    misread.row(i) += change.cwiseQuotient(sd);
  }
  return misread;
}

}  // namespace calib::diagnosis
