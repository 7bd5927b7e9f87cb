#include "server/report/views/bulk_properties.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace calib::report {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kDeviatoricStrain = 0.01;
constexpr double kLastShare = 0.1;  // of the axial strain, for the critical state

struct Point {
  double axial_strain = kNone, volumetric_strain = kNone;
  double stress_ratio = kNone, deviatoric_stress = kNone;
};

double Find(const StateHistory& history, const v1::State& state, const std::string& name) {
  const auto at = std::find(history.observables.begin(), history.observables.end(), name);
  const auto index = static_cast<int>(at - history.observables.begin());
  return at == history.observables.end() || index >= state.values_size() ? kNone
                                                                         : state.values(index);
}

Point PointOf(const campaign::Experiment& experiment, const StateHistory& history,
              const v1::State& state) {
  Point point;
  point.axial_strain = Find(history, state, "axial_strain");
  const auto step = static_cast<std::size_t>(std::max(state.load_step(), 0));
  if (std::isnan(point.axial_strain) && experiment.control_name == "axial_strain" &&
      step < experiment.control.size()) {
    point.axial_strain = experiment.control[step];
  }
  point.volumetric_strain = Find(history, state, "volumetric_strain");
  point.stress_ratio = Find(history, state, "stress_ratio");
  if (std::isnan(point.stress_ratio)) {  // R = (1 + 2 eta / 3) / (1 - eta / 3), eta = q / p
    const double eta = Find(history, state, "q_over_p");
    point.stress_ratio = (1 + 2 * eta / 3) / (1 - eta / 3);
  }
  point.deviatoric_stress = Find(history, state, "deviatoric_stress");
  const auto confining = experiment.settings.find("confining_pressure");
  if (std::isnan(point.deviatoric_stress) && confining != experiment.settings.end()) {
    point.deviatoric_stress = (point.stress_ratio - 1) * confining->second;
  }
  return point;
}

// Up to the first unloading.
std::vector<Point> CurveOf(const campaign::Experiment& experiment, const StateHistory& history) {
  std::vector<v1::State> states = history.states;
  std::stable_sort(states.begin(), states.end(), [](const v1::State& a, const v1::State& b) {
    return a.load_step() < b.load_step();
  });
  std::vector<Point> curve;
  for (const v1::State& state : states) {
    const Point point = PointOf(experiment, history, state);
    if (!curve.empty() && point.axial_strain < curve.back().axial_strain) break;
    curve.push_back(point);
  }
  return curve;
}

double FrictionAngle(double stress_ratio) {
  return std::asin((stress_ratio - 1) / (stress_ratio + 1));
}

}  // namespace

std::vector<BulkProperty> BulkProperties(const campaign::Experiment& experiment,
                                         const StateHistory& history) {
  if (experiment.test != "triaxial_drained") return {};
  const std::vector<Point> curve = CurveOf(experiment, history);
  double modulus = kNone;
  double poisson = kNone;
  Point before{.axial_strain = 0, .volumetric_strain = 0, .deviatoric_stress = 0};
  double deviatoric_before = 0;
  for (const Point& point : curve) {
    const double deviatoric = point.axial_strain - point.volumetric_strain / 3;
    if (deviatoric >= kDeviatoricStrain && deviatoric > deviatoric_before) {
      const double share =
          (kDeviatoricStrain - deviatoric_before) / (deviatoric - deviatoric_before);
      const auto between = [share](double a, double b) { return a + share * (b - a); };
      const double axial = between(before.axial_strain, point.axial_strain);
      const double volumetric = between(before.volumetric_strain, point.volumetric_strain);
      modulus = between(before.deviatoric_stress, point.deviatoric_stress) / axial;
      poisson = 0.5 * (1 - volumetric / axial);
      break;
    }
    before = point;
    deviatoric_before = deviatoric;
  }
  double peak = kNone;
  double sum = 0;
  int count = 0;
  for (const Point& point : curve) {
    if (std::isnan(peak) || point.stress_ratio > peak) peak = point.stress_ratio;
    if (point.axial_strain >= (1 - kLastShare) * curve.back().axial_strain) {
      sum += point.stress_ratio;
      ++count;
    }
  }
  return {{"secant_modulus", "Pa", modulus},
          {"secant_poisson_ratio", "1", poisson},
          {"peak_friction_angle", "rad", FrictionAngle(peak)},
          {"critical_friction_angle", "rad", count > 0 ? FrictionAngle(sum / count) : kNone}};
}

std::string WhyNoBulkProperty(const campaign::Experiment& experiment, const StateHistory& history,
                              const std::string& name) {
  const Point last =
      history.states.empty() ? Point{} : PointOf(experiment, history, history.states.back());
  const bool secant = name == "secant_modulus" || name == "secant_poisson_ratio";
  if (std::isnan(last.axial_strain) && name != "peak_friction_angle") {
    return "no axial_strain is among its observables";
  }
  if (std::isnan(last.volumetric_strain) && secant) {
    return "no volumetric_strain is among its observables";
  }
  if (std::isnan(last.deviatoric_stress) && name != "secant_poisson_ratio") {
    return "none of deviatoric_stress, stress_ratio and q_over_p is among its observables";
  }
  return secant ? "no run reaches a deviatoric strain of 1 %" : "the curves do not tell";
}

}  // namespace calib::report
