#include "server/inspection/relations.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/inspection/header_words.h"
#include "server/inspection/meanings.h"
#include "server/inspection/numbers.h"
#include "server/inspection/stated_sizes.h"

namespace calib::inspection {
namespace {

using campaign::Quoted;

// Of the range, up to which two columns tell the same [-]. Chosen: readings have three digits.
constexpr double kHolds = 0.02;
// By which a slope may differ from the one of a law [-]: zeros drift, cells creep.
constexpr double kSlopeHolds = 0.05;
constexpr double kPathSlopeHolds = 0.1;
constexpr double kLineHolds = 0.05;   // rms off a line over the range [-]
constexpr double kStatedHolds = 0.1;  // of a stated confining pressure
constexpr double kDrifts = 0.05;      // of a held stress, worth a word

class Relations {
 public:
  explicit Relations(Inspection& inspection)
      : out_(inspection), test_(LargestTest(inspection.table)) {}

  void Check() {
    SignsOfStresses();
    SignOfStrain();
    VoidRatio();
    VolumeOfStrains();
    SignOfVolume();
    Deviator();
    Path();
    PorePressure();
    LateralStress();
    Gauges();
  }

 private:
  std::vector<double> Of(const std::string& role) const { return out_.Values(test_, role); }
  ColumnMeaning* Column(const std::string& role) {
    for (ColumnMeaning& column : out_.columns) {
      if (column.role == role && !column.open) return &column;
    }
    return nullptr;
  }
  void Say(FindingKind kind, bool odd, const std::string& text,
           std::optional<int> line = std::nullopt) {
    out_.findings.push_back({kind, odd, line, text});
  }
  void Open(ColumnMeaning& column, const std::vector<std::string>& options,
            const std::string& text) {
    column.open = true;
    column.options = options;
    Say(FindingKind::kAmbiguous, true,
        absl::StrCat(text, "; say which, e.g. --meaning \"", column.name, "=", options.front(),
                     "\""));
  }
  bool Said(const ColumnMeaning& column) const {
    return !column.evidence.empty() && column.evidence.front() == "as --meaning says";
  }
  void Turn(ColumnMeaning& column, const std::string& why) {
    column.sign = -1;
    column.evidence.push_back(why);
    Say(FindingKind::kSign, true,
        absl::StrCat("column ", Quoted(column.name), ": compression is negative (", why,
                     "); read with sign: {", column.role, ": -1}"));
  }

  void SignsOfStresses() {
    for (const char* role : {"lateral_stress", "axial_stress", "mean_stress"}) {
      ColumnMeaning* column = Column(role);
      if (column == nullptr || column->sign_said) continue;
      const Extent e = ExtentOf(Of(role));
      if (e.max <= 0 && e.min < 0) Turn(*column, "grains carry no tension, and all are negative");
    }
  }

  // What resists the axial strain, zero or nearly where it begins.
  std::vector<double> Strength(std::string& name) const {
    for (const char* role : {"deviatoric_stress", "q_over_p", "stress_ratio", "axial_stress"}) {
      std::vector<double> values = Of(role);
      if (values.empty()) continue;
      name = role;
      const double first = ExtentOf(values).first;
      const std::string word = role;
      if (word == "stress_ratio" || word == "axial_stress") {
        for (double& v : values) v -= word == "stress_ratio" ? 1 : first;
      }
      return values;
    }
    return {};
  }

  void SignOfStrain() {
    ColumnMeaning* column = Column("axial_strain");
    if (column == nullptr) return;
    std::string by;
    const std::vector<double> strength = Strength(by);
    const std::vector<double> strain = Of("axial_strain");
    double with = 0;
    double all = 0;
    double pushed = 0;
    for (std::size_t i = 0; i < strength.size(); ++i) {
      if (std::isnan(strength[i]) || std::isnan(strain[i])) continue;
      with += strain[i] * strength[i];
      all += std::abs(strain[i] * strength[i]);
      pushed += strength[i];
    }
    constexpr double kOpposite = -0.5;  // of the work that the two do together [-]
    if (!(all > 0) || with > kOpposite * all) {
      if (all > 0 && with > -kOpposite * all) {
        column->evidence.push_back(absl::StrCat("goes with ", by));
      }
      return;
    }
    if (column->sign_said) return;
    if (pushed > 0) {
      Turn(*column, absl::StrCat("it falls while ", by, " rises"));
    } else {
      Open(*column, {"-axial_strain", "+axial_strain"},
           absl::StrCat("strain ", Quoted(column->name), " rises while ", by,
                        " is negative: one of the two has the other sign"));
    }
  }

  void VoidRatio() {
    ColumnMeaning* volume = Column("volumetric_strain");
    ColumnMeaning* voids = Column("void_ratio");
    if (voids == nullptr) voids = Column("porosity");
    if (voids == nullptr) return;
    std::vector<double> e = Of(voids->role);
    if (voids->role == "porosity") {
      for (double& n : e) n = n / (1 - n);
    }
    const bool oedometer = volume == nullptr;
    if (oedometer) volume = Column("axial_strain");
    if (volume == nullptr) return;
    const std::vector<double> ev = Of(volume->role);
    const Line line = LineThrough(ev, e);
    if (line.count < 3 || line.left > kLineHolds || ExtentOf(ev).range() < 1e-4) return;
    const double slope = -line.slope / (1 + line.at_zero);
    const auto is = [slope](double value) {
      return std::abs(slope - value) < 2 * kSlopeHolds * std::abs(value);
    };
    if (is(1)) {
      volume->evidence.emplace_back("the voids change by (1 + e0) times as much");
      voids->evidence.push_back(absl::StrCat("e0 = ", Short(line.at_zero)));
      Say(FindingKind::kVoidRatio, false,
          absl::StrCat(voids->name, " and ", volume->name, " agree: -de/d", volume->name,
                       " is 1 + e0 with e0 = ", Short(line.at_zero)));
      StrainMeasure(ev, e);
      no_lateral_strain_ = oedometer;
    } else if (oedometer) {
      return;  // lateral strain is free, and nothing is known of it
    } else if (is(-1)) {
      if (!volume->sign_said) Turn(*volume, "the voids grow while it rises");
    } else if (is(100) || is(0.01)) {
      const std::string other = is(100) ? "1" : "percent";
      Say(FindingKind::kUnits, true,
          absl::StrCat("column ", Quoted(volume->name), " is headed ", volume->unit,
                       ", but the voids change as if its numbers were ",
                       other == "1" ? "a plain ratio" : "percent"));
      if (!Said(*volume)) {
        Open(*volume,
             {absl::StrCat(volume->role, "[", other, "]"),
              absl::StrCat(volume->role, "[", volume->unit, "]")},
             absl::StrCat("the unit of ", Quoted(volume->name), " is in doubt"));
      }
    } else {
      Say(FindingKind::kVoidRatio, true,
          absl::StrCat(voids->name, " changes by ", Short(slope), " times what ", volume->name,
                       " and e0 = ", Short(line.at_zero), " say"));
    }
  }

  // e = (1 + e0)(1 - ev) - 1 of engineering strains, (1 + e0) exp(-ev) - 1 of logarithmic ones.
  void StrainMeasure(const std::vector<double>& ev, const std::vector<double>& e) {
    const double e0 = ExtentOf(e).first;
    const double ev0 = ExtentOf(ev).first;
    std::vector<double> engineering;
    std::vector<double> logarithmic;
    for (const double v : ev) {
      engineering.push_back((1 + e0) * (1 - (v - ev0)) - 1);
      logarithmic.push_back((1 + e0) * std::exp(-(v - ev0)) - 1);
    }
    constexpr double kClearly = 5;  // times nearer
    const double a = Apart(e, engineering);
    const double b = Apart(e, logarithmic);
    out_.logarithmic = a > kClearly * b && a > 1e-4;
    if (out_.logarithmic) {
      Say(FindingKind::kVoidRatio, false, "strains are logarithmic, by the void ratio");
    }
  }

  void VolumeOfStrains() {
    ColumnMeaning* volume = Column("volumetric_strain");
    ColumnMeaning* axial = Column("axial_strain");
    ColumnMeaning* lateral = Column("lateral_strain");
    if (volume == nullptr || lateral == nullptr) return;
    const std::vector<double> ev = Of("volumetric_strain");
    const std::vector<double> er = Of("lateral_strain");
    if (axial == nullptr) return;
    const std::vector<double> ea = Of("axial_strain");
    std::vector<double> sum(ev.size());
    std::vector<double> other(ev.size());
    for (std::size_t i = 0; i < ev.size(); ++i) {
      sum[i] = ea[i] + 2 * er[i];
      other[i] = -sum[i];
    }
    // Off by little of what the sum is made of: it is a small difference of large strains.
    const double scale = ExtentOf(ea).range() / std::max(ExtentOf(ev).range(), 1e-300);
    if (Apart(ev, sum) < kHolds * std::max(1.0, scale)) {
      volume->evidence.push_back(absl::StrCat("is ", axial->name, " + 2 ", lateral->name));
      lateral->evidence.push_back(absl::StrCat("(", volume->name, " - ", axial->name, ")/2"));
      volume_known_ = true;
    } else if (Apart(ev, other) < kHolds * std::max(1.0, scale) && !volume->sign_said) {
      Turn(*volume, absl::StrCat("it is -(", axial->name, " + 2 ", lateral->name, ")"));
      volume_known_ = true;
    }
  }

  // Sheared grains contract before they dilate.
  void SignOfVolume() {
    ColumnMeaning* volume = Column("volumetric_strain");
    if (volume == nullptr || volume->sign < 0 || volume_known_ || volume->sign_said) return;
    if (Column("void_ratio") != nullptr || Column("porosity") != nullptr) return;
    if (Column("pore_pressure") != nullptr) return;
    const std::vector<double> ev = Of("volumetric_strain");
    const std::vector<double> ea = Of("axial_strain");
    if (ea.empty()) return;
    const Extent extent = ExtentOf(ev);
    if (!(extent.range() > 1e-4)) return;  // held: an undrained test
    // The first extreme of either sign beyond a hundredth of the range.
    constexpr double kBeyond = 0.01;
    double least = 0;
    double most = 0;
    for (const double v : ev) {
      if (std::isnan(v)) continue;
      least = std::min(least, v - extent.first);
      most = std::max(most, v - extent.first);
      const bool fell = least < -kBeyond * extent.range();
      const bool rose = most > kBeyond * extent.range();
      if (rose) return;
      if (fell) break;
    }
    const bool rises_later = most <= 0 && extent.max - extent.first > 0.1 * extent.range();
    Open(*volume, {"-volumetric_strain", "+volumetric_strain"},
         absl::StrCat("column ", Quoted(volume->name),
                      rises_later
                          ? " falls first and rises then: sheared grains contract first, so "
                            "compression seems to be negative"
                          : " is negative from its beginning: either grains dilate at once, or "
                            "compression is negative"));
  }

  void Deviator() {
    const std::vector<double> sa = Of("axial_stress");
    const std::vector<double> sr = Of("lateral_stress");
    if (sa.empty() || sr.empty()) return;
    std::vector<double> difference(sa.size());
    std::vector<double> mean(sa.size());
    std::vector<double> half(sa.size());
    for (std::size_t i = 0; i < sa.size(); ++i) {
      difference[i] = sa[i] - sr[i];
      mean[i] = (sa[i] + 2 * sr[i]) / 3;
      half[i] = (sa[i] + sr[i]) / 2;
    }
    if (ColumnMeaning* q = Column("deviatoric_stress")) {
      const Line line = LineThrough(difference, Of("deviatoric_stress"));
      Compare(*q, line, "axial - lateral stress", kHalfDifference, "(axial - lateral)/2");
    }
    if (ColumnMeaning* p = Column("mean_stress")) {
      const std::vector<double> value = Of("mean_stress");
      if (Apart(value, mean) < kHolds) {
        p->evidence.emplace_back("is (axial + 2 lateral stress)/3");
        path_known_ = true;
      } else if (Apart(value, half) < kHolds) {
        p->role = kHalfSum;
        p->evidence.emplace_back("is (axial + lateral stress)/2");
        Say(FindingKind::kStressPath, false,
            absl::StrCat("column ", Quoted(p->name),
                         " is (axial + lateral stress)/2, not the mean stress"));
        path_known_ = true;
      }
    }
  }

  void Compare(ColumnMeaning& q, const Line& line, const std::string& what, const char* halved,
               const std::string& halved_words) {
    if (line.count < 3 || line.left > kLineHolds) return;
    const auto is = [&line](double value) {
      return std::abs(line.slope - value) < kSlopeHolds * value;
    };
    if (is(1)) {
      q.evidence.push_back(absl::StrCat("is ", what));
    } else if (is(0.5)) {
      q.role = halved;
      q.evidence.push_back(absl::StrCat("is ", halved_words));
      Say(FindingKind::kStressPath, false,
          absl::StrCat("column ", Quoted(q.name), " is ", halved_words));
    } else if (is(1e3) || is(1e-3)) {
      Say(FindingKind::kUnits, true,
          absl::StrCat("column ", Quoted(q.name), " in ", q.unit, " is ", Short(line.slope),
                       " times ", what, ": one of their headings says a wrong unit"));
      Open(q,
           {absl::StrCat(q.role, "[", q.unit == "kPa" ? "MPa" : "kPa", "]"),
            absl::StrCat(q.role, "[", q.unit, "]")},
           absl::StrCat("the unit of ", Quoted(q.name), " is in doubt"));
    } else {
      Say(FindingKind::kStressPath, true,
          absl::StrCat("column ", Quoted(q.name), " is ", Short(line.slope), " times ", what));
    }
  }

  // Rows of loading up to the largest deviator.
  void Path() {
    ColumnMeaning* p = Column("mean_stress");
    ColumnMeaning* q = Column("deviatoric_stress");
    if (p == nullptr || q == nullptr) return;
    std::vector<double> mean = Of("mean_stress");
    std::vector<double> deviator = Of("deviatoric_stress");
    const std::vector<double> eta = Of("q_over_p");
    if (!eta.empty()) {
      std::vector<double> ratio(mean.size());
      for (std::size_t i = 0; i < mean.size(); ++i) ratio[i] = deviator[i] / mean[i];
      if (Apart(eta, ratio) < kHolds) {
        Column("q_over_p")->evidence.push_back(absl::StrCat("is ", q->name, "/", p->name));
      }
    }
    if (path_known_) return;
    const std::vector<double> ea = Of("axial_strain");
    const std::vector<double> ev = Of("volumetric_strain");
    if (!ea.empty() && !ev.empty() && Apart(ea, ev) < kHolds) no_lateral_strain_ = true;
    if (no_lateral_strain_) {
      p->evidence.emplace_back("by its name; without lateral strain the path tells nothing of it");
      return;
    }
    const Line whole = LineThrough(mean, deviator);
    std::size_t peak = 0;
    for (std::size_t i = 0; i < deviator.size(); ++i) {
      if (std::isnan(deviator[i])) continue;
      if (std::abs(deviator[i]) > std::abs(deviator[peak]) || std::isnan(deviator[peak])) peak = i;
    }
    mean.resize(peak + 1);
    deviator.resize(peak + 1);
    const Line line = LineThrough(mean, deviator);
    if (line.count < 3 || line.left > kLineHolds) {
      p->evidence.emplace_back("by its name; the path does not tell it from a half sum");
      return;
    }
    const auto is = [&line](double value) {
      return std::abs(line.slope - value) < kPathSlopeHolds * value;
    };
    if (is(3)) {
      p->evidence.push_back(
          absl::StrCat("dq/dp = ", Short(line.slope), ", 3 of a mean stress at constant lateral"));
      Say(FindingKind::kStressPath, false,
          absl::StrCat("dq/dp = ", Short(line.slope), ": ", Quoted(p->name),
                       " is the mean stress, the lateral stress is held"));
      path_known_ = true;
    } else if (is(2) && !Said(*p)) {
      p->role = kHalfSum;
      p->evidence.push_back(absl::StrCat("dq/dp = ", Short(line.slope)));
      Say(FindingKind::kStressPath, false,
          absl::StrCat("dq/dp = ", Short(line.slope), ": ", Quoted(p->name),
                       " is (axial + lateral stress)/2, not the mean stress"));
    } else if (is(1) && whole.left < kHolds && !Said(*p)) {
      // With a held lateral stress unloading goes back along the same line.
      Open(
          *p, {"axial_stress", "nothing"},
          absl::StrCat("d", q->name, "/d", p->name, " = ", Short(line.slope), ": ", Quoted(p->name),
                       " is the axial stress, or both are halved ((axial +- lateral)/2)"));
    } else {
      p->evidence.push_back(absl::StrCat("dq/dp = ", Short(line.slope),
                                         ", which no held lateral stress gives; by its name"));
    }
  }

  void PorePressure() {
    const std::vector<double> u = Of("pore_pressure");
    const std::vector<double> total = Of(kTotalLateral);
    const std::vector<double> effective = Of("lateral_stress");
    if (u.empty() || total.empty() || effective.empty()) return;
    std::vector<double> difference(u.size());
    for (std::size_t i = 0; i < u.size(); ++i) difference[i] = total[i] - u[i];
    if (Apart(effective, difference) < kHolds) {
      Column("lateral_stress")->evidence.emplace_back("is the total one less the pore pressure");
    }
  }

  void LateralStress() {
    std::vector<double> lateral = Of("lateral_stress");
    std::string from = "recorded";
    if (lateral.empty() && path_known_) {
      const std::vector<double> p = Of("mean_stress");
      const std::vector<double> q = Of("deviatoric_stress");
      for (std::size_t i = 0; i < p.size() && i < q.size(); ++i) lateral.push_back(p[i] - q[i] / 3);
      from = "recorded (p - q/3)";
    }
    const Extent e = ExtentOf(lateral);
    if (e.count < 2 || !(e.first > 0)) return;
    if (out_.stated_pressure > 0 &&
        std::abs(e.first - out_.stated_pressure) > kStatedHolds * out_.stated_pressure) {
      Say(FindingKind::kStressPath, true,
          absl::StrCat("the confining pressure is stated as ", Short(out_.stated_pressure / 1e3),
                       " kPa, but ", from, " as ", Short(e.first / 1e3), " kPa"));
    }
    const bool undrained = Column("pore_pressure") != nullptr || Column(kTotalLateral) != nullptr;
    const double drift =
        e.max - e.first > e.first - e.min ? e.max / e.first - 1 : e.min / e.first - 1;
    constexpr double kStillHeld = 0.5;  // beyond, nothing was held
    if (!undrained && std::abs(drift) > kDrifts && std::abs(drift) < kStillHeld) {
      Say(FindingKind::kStressPath, false,
          absl::StrCat("the ", from, " lateral stress goes from ", Short(e.first / 1e3), " to ",
                       Short(e.first * (1 + drift) / 1e3),
                       " kPa where it is held: compare a ratio (q/p) rather than a stress"));
    }
  }

  // Displacement over length, load over area.
  void Gauges() {
    const StatedSizes sizes = StatedSizesOf(out_.table.remarks);
    const std::vector<double> strain = Of("axial_strain");
    const std::vector<double> way = Of(kDisplacement);
    if (!strain.empty() && !way.empty()) {
      const Line line = LineThrough(strain, way);
      if (line.count > 2 && line.left < kLineHolds && line.slope > 0) {
        const bool off =
            sizes.height > 0 && std::abs(line.slope - sizes.height) > kHolds * sizes.height;
        Say(FindingKind::kUnits, off,
            absl::StrCat("displacement over axial strain is a gauge length of ",
                         Short(line.slope * 1e3), " mm",
                         off ? absl::StrCat(", but the height is stated as ",
                                            Short(sizes.height * 1e3), " mm")
                             : ""));
      }
    }
    const std::vector<double> load = Of(kLoad);
    const std::vector<double> q = Of("deviatoric_stress");
    if (load.empty() || q.empty() || strain.empty()) return;
    const std::vector<double> ev = Of("volumetric_strain");
    std::vector<double> plain;
    std::vector<double> corrected;
    const double least = 0.1 * ExtentOf(q).largest;
    for (std::size_t i = 0; i < q.size(); ++i) {
      if (std::isnan(q[i]) || std::isnan(load[i]) || std::abs(q[i]) < least) continue;
      const double volume = ev.empty() || std::isnan(ev[i]) ? 0 : ev[i];
      plain.push_back(load[i] / q[i]);
      corrected.push_back(load[i] / q[i] * (1 - strain[i]) / (1 - volume));
    }
    const auto spread = [](const std::vector<double>& areas) {
      const Extent e = ExtentOf(areas);
      return e.count > 2 ? e.range() / e.largest : HUGE_VAL;
    };
    const double a = spread(plain);
    const double b = spread(corrected);
    if (std::min(a, b) > kHolds) return;
    const double area = ExtentOf(a < b ? plain : corrected).first;
    const double diameter = 2 * std::sqrt(area / std::numbers::pi);
    const bool off =
        sizes.diameter > 0 && std::abs(diameter - sizes.diameter) > kHolds * sizes.diameter;
    Say(FindingKind::kStressPath, off || a < b,
        absl::StrCat("load over ", Column("deviatoric_stress")->name, " is an area of ",
                     Short(area * 1e6), " mm^2 (diameter ", Short(diameter * 1e3), " mm)",
                     off ? absl::StrCat(", stated ", Short(sizes.diameter * 1e3), " mm") : "",
                     a < b ? "; it stays as it was at the start: the stress is not corrected for "
                             "the area, which grows as the specimen shortens"
                           : ", corrected by (1 - ev)/(1 - ea)"));
  }

  Inspection& out_;
  std::size_t test_;
  bool volume_known_ = false;
  bool path_known_ = false;
  bool no_lateral_strain_ = false;  // an oedometer, whose lateral stress is free
};

}  // namespace

void CheckRelations(Inspection& inspection) { Relations(inspection).Check(); }

}  // namespace calib::inspection
