#include "server/campaign/checks/start_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "dem/model/readings.h"
#include "dem/registry/catalog.h"
#include "server/campaign/checks/in_words.h"
#include "server/campaign/checks/test_start.h"

namespace calib::campaign {
namespace {

/// Factor by which a stress read at the start may differ from that of consolidation [-]. Chosen:
/// cell pressures are set and read within a few percent, seating loads add some.
constexpr double kFactorAtStart = 1.25;
/// The same where the first reading was taken later. Chosen: by then stresses may have risen to
/// several times the start, units differ by factors of 100 and more (bar beside kPa).
constexpr double kFactorLater = 30;
/// Factor by which porosity or void ratio may differ from the packing's [-]. Chosen: packings of
/// spheres (void ratio 0.55 to 0.85) stand for sands up to 1.2; percent differ by 100.
constexpr double kFactorOfDensity = 2;
/// A deviatoric stress that the test begins with, over that of consolidation [-]. Chosen: seating
/// loads and weights of pistons stay below.
constexpr double kSeatingStress = 0.1;
/// Largest deviatoric stress over that of consolidation between which its unit is not doubted [-].
/// Chosen: loops of small strain reach a hundredth, cemented sands at low pressure thirty times.
constexpr double kLeastDeviator = 5e-3;
constexpr double kMostDeviator = 200;
/// Strain of a specimen over the way that the driving strain has gone [-]. Chosen: dense packings
/// dilate by about the strain that drives them; percent differ by 100.
constexpr double kMostStrain = 10;
double FirstOf(const MeasuredObservable& observable, std::size_t& at) {
  for (at = 0; at < observable.values.size(); ++at) {
    if (std::isfinite(observable.values[at])) return observable.values[at];
  }
  return std::numeric_limits<double>::quiet_NaN();
}

// +1 where the control grows first, -1 where it falls, 0 where it stays.
int DirectionOf(const Experiment& experiment) {
  for (const dem::ControlPoint& point : experiment.path) {
    if (point.target != experiment.control_start) {
      return point.target > experiment.control_start ? 1 : -1;
    }
  }
  return 0;
}

std::string UnitAdvice(const std::string& name, double factor) {
  struct Usual {
    double factor;
    const char* unit;
  };
  constexpr double kNear = 0.1;  // of the factor: a reading at the start is about its value
  const dem::ObservableInfo* info = dem::FindObservable(name);
  const bool stress = info != nullptr && info->unit == "Pa";
  constexpr std::array kStresses = {Usual{1e3, "kPa"},      Usual{1e6, "MPa"},
                                    Usual{6894.757, "psi"}, Usual{1e5, "bar"},
                                    Usual{47880.26, "ksf"}, Usual{98066.5, "kgf/cm^2"}};
  for (const Usual& usual : kStresses) {
    if (stress && std::abs(factor / usual.factor - 1) < kNear) {
      return absl::StrCat("; if the column is in ", usual.unit,
                          " and is read in Pa, say so: units: {", name, ": ", usual.unit, "}");
    }
  }
  if (!stress && std::abs(factor * 100 - 1) < kNear) {
    return absl::StrCat("; if the column is in percent, say so: units: {", name, ": percent}");
  }
  return absl::StrCat("; see to the unit of the column",
                      stress ? " and to confining_pressure" : "");
}

class Checker {
 public:
  explicit Checker(const Experiment& experiment)
      : experiment_(experiment), way_(WayOf(experiment)), start_(KnownStartOf(experiment)) {}

  std::vector<Warning> Check() {
    if (experiment_.control.empty() || experiment_.control_name.empty()) return {};
    CheckControlsUnit();
    for (const MeasuredObservable& observable : experiment_.observables) {
      if (start_) CheckBegin(observable);
      if (start_) CheckSize(observable);
      if (start_) CheckStrain(observable);
    }
    CheckSigns();
    return std::move(warnings_);
  }

 private:
  void Warn(WarningKind kind, const std::string& name, const std::string& message) {
    warnings_.push_back({kind, experiment_.name, name, message});
  }

  [[nodiscard]] bool IsSaid(WarningKind kind, const std::string& name) const {
    return std::any_of(warnings_.begin(), warnings_.end(),
                       [&](const Warning& w) { return w.kind == kind && w.name == name; });
  }

  [[nodiscard]] bool AtStart(std::size_t reading) const {
    return std::abs(experiment_.control[reading] - experiment_.control_start) <= kAtStart * way_;
  }

  // A stress that drives the test begins about where consolidation ends.
  void CheckControlsUnit() {
    const std::string& name = experiment_.control_name;
    const dem::ObservableInfo* info = dem::FindObservable(name);
    if (!start_ || info == nullptr || info->unit != "Pa") return;
    CheckFactor(name, experiment_.control.front(), experiment_.control_start, false);
  }

  void CheckBegin(const MeasuredObservable& observable) {
    std::size_t at = 0;
    const double first = FirstOf(observable, at);
    double dem::Measurement::*const member = dem::MemberNamed(observable.name);
    if (!std::isfinite(first) || member == nullptr) return;
    const double start = (*start_).*member;
    if (!std::isfinite(start) || std::abs(first - start) <= kErrors * SdAt(observable, at)) return;
    if (start == 0) {
      if (AtStart(at)) CheckZero(observable, first);
    } else if (observable.name != "coordination_number") {
      CheckFactor(observable.name, first, start, AtStart(at));
    }
  }

  void CheckFactor(const std::string& name, double first, double start, bool at_start) {
    const bool density = name == "porosity" || name == "void_ratio";
    const double allowed = density ? kFactorOfDensity : at_start ? kFactorAtStart : kFactorLater;
    const double factor = start / first;
    const auto void_ratio = [](double porosity) { return porosity / (1 - porosity); };
    const double apart = name == "porosity" && first > 0 && first < 1
                             ? void_ratio(start) / void_ratio(first)
                             : factor;
    const std::string where =
        absl::StrCat("begins at ", InWords(name, first), ", where ",
                     density ? "the specimen has " : "the test begins at ", InWords(name, start));
    if (factor < 0) {
      Warn(WarningKind::kSign, name,
           absl::StrCat(where,
                        ": compression is positive; if it is negative in the file, say so: "
                        "sign: {",
                        name, ": -1}"));
    } else if (apart > allowed || apart < 1 / allowed) {
      Warn(WarningKind::kUnit, name,
           absl::StrCat(where, ", the factor ", absl::StrFormat("%.4g", factor),
                        UnitAdvice(name, factor)));
    }
  }

  void CheckZero(const MeasuredObservable& observable, double first) {
    const std::string& name = observable.name;
    const bool strain = name.ends_with("_strain");
    const double scale = strain               ? LargestSizeOf(observable.values)
                         : name == "q_over_p" ? 1
                                              : start_->lateral_stress;
    if (std::abs(first) <= (strain ? kSeatingStrain : kSeatingStress) * scale) return;
    Warn(WarningKind::kOffset, name,
         absl::StrCat("begins at ", InWords(name, first), ", where the test begins at 0",
                      "; an offset of the gauge? ", strain ? "zero: first or " : "", "offset: {",
                      name, ": ...} takes it off",
                      strain ? "" : ", initial_stress says where else the test begins"));
  }

  // A strain that the test does not drive is of the size of the one it does.
  void CheckStrain(const MeasuredObservable& observable) {
    const std::string& name = observable.name;
    const std::vector<double> travelled = TravelledControl(experiment_, 0);
    if (!name.ends_with("_strain") || !experiment_.control_name.ends_with("_strain")) return;
    const double largest = LargestSizeOf(observable.values);
    if (travelled.empty() || !(travelled.back() > 0) || largest <= kMostStrain * travelled.back()) {
      return;
    }
    Warn(WarningKind::kUnit, name,
         absl::StrCat("comes to ", InWords(name, largest), ", where ", experiment_.control_name,
                      " has gone ", InWords(name, travelled.back()), " in all, a factor of ",
                      absl::StrFormat("%.2g", largest / travelled.back()),
                      "; if the column is in percent, say so: units: {", name, ": percent}"));
  }

  // Differences of stresses are zero at the start, which shows no unit; their size does.
  void CheckSize(const MeasuredObservable& observable) {
    const std::string& name = observable.name;
    if (name != "deviatoric_stress" && name != "shear_stress") return;
    const double largest = LargestSizeOf(observable.values);
    const double share = largest / start_->lateral_stress;
    if (largest == 0 || (share > kLeastDeviator && share < kMostDeviator)) return;
    Warn(WarningKind::kUnit, name,
         absl::StrCat("is at most ", InWords(name, largest), " beside ",
                      InWords("mean_stress", start_->lateral_stress),
                      " of confining pressure, a factor of ", absl::StrFormat("%.2g", 1 / share),
                      "; if the column is in another unit, say so, e.g. units: {", name, ": ",
                      share < 1 ? "kPa" : "Pa", "}"));
  }

  // What resists a strain grows with it.
  void CheckSigns() {
    struct Pair {
      const char* control;
      const char* resists;
      const char* test;  // nullptr: every one
    };
    constexpr std::array kPairs = {Pair{"axial_strain", "deviatoric_stress", nullptr},
                                   Pair{"axial_strain", "q_over_p", nullptr},
                                   Pair{"axial_strain", "stress_ratio", nullptr},
                                   Pair{"axial_strain", "axial_stress", "triaxial_drained"},
                                   Pair{"axial_strain", "mean_stress", "triaxial_drained"},
                                   Pair{"axial_strain", "axial_stress", "oedometric"},
                                   Pair{"axial_strain", "mean_stress", "oedometric"},
                                   Pair{"axial_stress", "axial_strain", "oedometric"},
                                   Pair{"axial_stress", "volumetric_strain", "oedometric"},
                                   Pair{"shear_strain", "shear_stress", nullptr},
                                   Pair{"shear_strain", "shear_stress_ratio", nullptr},
                                   Pair{"mean_stress", "volumetric_strain", nullptr},
                                   Pair{"mean_stress", "axial_strain", nullptr}};
    for (const MeasuredObservable& observable : experiment_.observables) {
      const bool tied = std::any_of(kPairs.begin(), kPairs.end(), [&](const Pair& pair) {
        return experiment_.control_name == pair.control && observable.name == pair.resists &&
               (pair.test == nullptr || experiment_.test == pair.test);
      });
      if (tied && !IsSaid(WarningKind::kSign, observable.name) && GoesAgainst(observable)) return;
    }
  }

  bool GoesAgainst(const MeasuredObservable& observable) {
    if (observable.values.empty()) return false;
    const int direction = DirectionOf(experiment_);
    std::size_t at = 0;
    double from = FirstOf(observable, at);
    double dem::Measurement::*const member = dem::MemberNamed(observable.name);
    if (start_ && member != nullptr && (*start_).*member == 0) from = 0;
    std::size_t most = at;  // the reading of the first stage that is furthest from the start
    for (std::size_t i = at; i < observable.values.size() && InFirstStage(i); ++i) {
      if (std::abs(observable.values[i] - from) > std::abs(observable.values[most] - from))
        most = i;
    }
    if (most >= observable.values.size()) return false;
    const double change = observable.values[most] - from;
    const double size = std::max(LargestSizeOf(observable.values), std::abs(from));
    if (!(std::abs(change) > kErrors * SdAt(observable, most)) ||
        !(std::abs(change) > kSeatingStress * size) || change * direction >= 0) {
      return false;
    }
    const std::string& control = experiment_.control_name;
    Warn(WarningKind::kSign, control,
         absl::StrCat(direction > 0 ? "rises to " : "falls to ",
                      InWords(control, experiment_.control[most]), " while ", observable.name,
                      change > 0 ? " rises to " : " falls to ",
                      InWords(observable.name, observable.values[most]),
                      ": compression is positive; turn what is negative in the file: sign: {",
                      direction > 0 ? observable.name : control, ": -1}"));
    return true;
  }

  [[nodiscard]] bool InFirstStage(std::size_t reading) const {
    return !experiment_.segment[reading].starts_with("unload");
  }

  const Experiment& experiment_;
  double way_;
  std::optional<dem::Measurement> start_;
  std::vector<Warning> warnings_;
};

}  // namespace

std::vector<Warning> StartWarnings(const Experiment& experiment) {
  return Checker(experiment).Check();
}

}  // namespace calib::campaign
