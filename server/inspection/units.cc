#include "server/inspection/units.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/inspection/header_words.h"
#include "server/inspection/meanings.h"
#include "server/inspection/numbers.h"

namespace calib::inspection {
namespace {

using campaign::Quoted;

constexpr double kVoidsHold = 0.1;  // rms off a line over the range [-]
// Largest stresses of a laboratory test on grains [Pa]: of triaxial tests at 2 kPa [Fukushima &
// Tatsuoka, Soils Found. 24 (1984) 30], and of those that crush sand [Yamamuro & Lade, J. Geotech.
// Eng. 122 (1996) 109].
constexpr double kLeastStress = 5e3;
constexpr double kMostStress = 1e8;

bool IsStrainRole(const std::string& role) {
  return role == "axial_strain" || role == "volumetric_strain" || role == "lateral_strain" ||
         role == "shear_strain" || role == kDeviatoricStrain;
}

bool IsStressRole(const std::string& role) { return SiUnitOf(role) == "Pa"; }

class Units {
 public:
  explicit Units(Inspection& inspection)
      : out_(inspection), part_(inspection.table.parts[LargestTest(inspection.table)]) {}

  void Decide() {
    for (std::size_t i = 0; i < out_.columns.size(); ++i) {
      if (!out_.columns[i].role.empty() && !out_.columns[i].unit.empty()) TakeHeaded(i);
    }
    DecideStrains();
    DecideStresses();
    for (std::size_t i = 0; i < out_.columns.size(); ++i) DecideOther(i);
  }

 private:
  ColumnMeaning& Column(std::size_t i) { return out_.columns[i]; }
  const std::vector<double>& Numbers(std::size_t i) const { return part_.columns[i].values; }

  void Take(std::size_t i, const std::string& unit, const std::string& why) {
    const auto parsed = campaign::ParseUnit(unit);
    Column(i).unit = unit;
    Column(i).factor = parsed.ok() ? parsed->factor : 1;
    if (!why.empty()) Column(i).evidence.push_back(why);
  }

  void Odd(FindingKind kind, const std::string& text) {
    out_.findings.push_back({kind, true, std::nullopt, text});
  }

  // Several units are possible and nothing tells which.
  void LeaveOpen(const std::vector<std::size_t>& columns, const std::vector<std::string>& units,
                 const std::string& why) {
    std::vector<std::string> names;
    for (const std::size_t i : columns) {
      ColumnMeaning& column = Column(i);
      if (!IsObservable(column.role)) continue;
      column.open = true;
      for (const std::string& unit : units) {
        column.options.push_back(absl::StrCat(column.role, "[", unit, "]"));
      }
      names.push_back(Quoted(column.name));
    }
    if (names.empty()) return;
    const ColumnMeaning& first = Column(columns.front());
    out_.findings.push_back(
        {FindingKind::kAmbiguous, false, std::nullopt,
         absl::StrCat("no unit is said of ", absl::StrJoin(names, ", "), " and ", why, ": ",
                      absl::StrJoin(units, " or "), " are possible; say which, e.g. --meaning \"",
                      first.name, "=", first.role, "[", units.front(), "]\"")});
  }

  void TakeHeaded(std::size_t i) {
    ColumnMeaning& column = Column(i);
    const auto unit = campaign::ParseUnit(column.unit);
    const auto si = campaign::ParseUnit(SiUnitOf(column.role));
    if (!unit.ok() || !si.ok()) return;
    if (!campaign::SameKind(unit->dimension, si->dimension)) {
      if (!IsObservable(column.role)) return;
      Odd(FindingKind::kUnits,
          absl::StrCat("column ", Quoted(column.name), " is headed ", Quoted(column.unit), ", ",
                       campaign::KindOfUnit(column.unit), ", but its name says ", column.role));
      column.open = true;
      column.options = {absl::StrCat(column.role, "[", SiUnitOf(column.role), "]"), "nothing"};
      return;
    }
    const Extent e = ExtentOf(Numbers(i));
    const bool ratio = column.role == "void_ratio" || column.role == "porosity";
    // No packing is denser than a void ratio of a few hundredths; strains stay below one.
    constexpr double kLeastVoids = 0.1;
    if (ratio && column.unit == "percent" && e.max < 20 && e.min > kLeastVoids) {
      Odd(FindingKind::kUnits,
          absl::StrCat("column ", Quoted(column.name), " is headed percent, but ", Short(e.first),
                       " is a ", column.role, " as a plain number"));
      return Take(i, "1", "its numbers are no percent");
    }
    if (IsStrainRole(column.role) && column.unit == "1" && e.largest > 1) {
      Odd(FindingKind::kUnits,
          absl::StrCat("column ", Quoted(column.name), " is headed as a plain number, but reaches ",
                       Short(e.largest), ", which no strain does: it is percent"));
      return Take(i, "percent", "it exceeds one");
    }
    if (IsStressRole(column.role) && e.largest * unit->factor > kMostStress) {
      Odd(FindingKind::kUnits,
          absl::StrCat("column ", Quoted(column.name), " is headed ", column.unit, " and reaches ",
                       Short(e.largest * unit->factor / 1e6),
                       " MPa, beyond any laboratory test on grains"));
      column.open = IsObservable(column.role);
      column.options = {absl::StrCat(column.role, "[kPa]"), absl::StrCat(column.role, "[MPa]")};
    }
    Take(i, column.unit, column.unit == "1" ? "" : absl::StrCat("in ", column.unit));
  }

  // Slope of the void ratio over a strain in its numbers, over -(1 + e0): 1 for plain numbers,
  // 0.01 for percent; 0: not to be told.
  double VoidRatioSlope(std::size_t strain) {
    for (std::size_t i = 0; i < out_.columns.size(); ++i) {
      if (out_.columns[i].role != "void_ratio" && out_.columns[i].role != "porosity") continue;
      std::vector<double> e = Numbers(i);
      if (out_.columns[i].role == "porosity") {
        const double scale = ExtentOf(e).max > 1 ? 0.01 : 1;
        for (double& n : e) n = n * scale / (1 - n * scale);
      }
      const Line line = LineThrough(Numbers(strain), e);
      if (line.count < 3 || line.left > kVoidsHold || !(1 + line.at_zero > 0)) continue;
      return -line.slope / (1 + line.at_zero);
    }
    return 0;
  }

  void DecideStrains() {
    std::vector<std::size_t> bare;
    std::string beside;  // unit of the strains that have one; "?": several
    for (std::size_t i = 0; i < out_.columns.size(); ++i) {
      if (!IsStrainRole(Column(i).role)) continue;
      if (Column(i).unit.empty()) {
        bare.push_back(i);
      } else if (beside.empty() || beside == Column(i).unit) {
        beside = Column(i).unit;
      } else {
        beside = "?";
      }
    }
    if (bare.empty()) return;
    std::string unit;
    std::string why;
    for (const std::size_t i : bare) {
      const double largest = ExtentOf(Numbers(i)).largest;
      if (largest <= 1) continue;
      unit = "percent";
      why = absl::StrCat(Quoted(Column(i).name), " reaches ", Short(largest),
                         ", which is possible in percent only");
      break;
    }
    const auto volume = std::find_if(bare.begin(), bare.end(), [this](std::size_t i) {
      return Column(i).role == "volumetric_strain";
    });
    const bool has_volume =
        std::any_of(out_.columns.begin(), out_.columns.end(),
                    [](const auto& c) { return c.role == "volumetric_strain"; });
    // Without a column of volume the axial strain is that of an oedometer, or nothing fits.
    const std::size_t tied = volume != bare.end() ? *volume : bare.front();
    if (unit.empty() && (volume != bare.end() || !has_volume)) {
      const double slope = std::abs(VoidRatioSlope(tied));
      constexpr double kWithin = 0.15;  // a factor of a hundred is to be told
      if (std::abs(slope - 1) < kWithin) unit = "1";
      if (std::abs(slope * 100 - 1) < kWithin) unit = "percent";
      why = "its voids change by as much";
    }
    if (unit.empty() && !beside.empty() && beside != "?") {
      unit = beside;
      why = "as the other strains of the file";
    }
    if (!unit.empty()) {
      for (const std::size_t i : bare) Take(i, unit, why);
      return;
    }
    LeaveOpen(bare, {"percent", "1"}, "none exceeds 1");
  }

  void DecideStresses() {
    std::vector<std::size_t> bare;
    std::string beside;
    for (std::size_t i = 0; i < out_.columns.size(); ++i) {
      if (!IsStressRole(Column(i).role)) continue;
      if (Column(i).unit.empty()) {
        bare.push_back(i);
      } else {
        beside = beside.empty() || beside == Column(i).unit ? Column(i).unit : "?";
      }
    }
    if (bare.empty()) return;
    if (!beside.empty() && beside != "?") {
      for (const std::size_t i : bare) Take(i, beside, "as the other stresses of the file");
      return;
    }
    double largest = 0;
    double start = 0;
    for (const std::size_t i : bare) {
      const Extent e = ExtentOf(Numbers(i));
      largest = std::max(largest, e.largest);
      const std::string& role = Column(i).role;
      if (role == "lateral_stress" || role == "mean_stress" || role == "axial_stress") {
        start = std::abs(e.first);
      }
    }
    std::vector<std::string> possible;
    for (const auto& [unit, factor] :
         {std::pair<const char*, double>{"kPa", 1e3}, {"MPa", 1e6}, {"Pa", 1}}) {
      const double top = largest * factor;
      if (top < kLeastStress || top > kMostStress) continue;
      constexpr double kNear = 0.3;
      const bool contradicts =
          out_.stated_pressure > 0 && start > 0 &&
          std::abs(start * factor - out_.stated_pressure) > kNear * out_.stated_pressure;
      if (!contradicts) possible.emplace_back(unit);
    }
    if (possible.size() == 1) {
      const std::string why =
          out_.stated_pressure > 0 && start > 0
              ? absl::StrCat("it begins at the stated ", Short(out_.stated_pressure / 1e3), " kPa")
              : absl::StrCat("a largest stress of ", Short(largest),
                             " is in the reach of "
                             "laboratories in ",
                             possible.front(), " only");
      for (const std::size_t i : bare) Take(i, possible.front(), why);
      return;
    }
    if (possible.empty()) possible = {"kPa", "MPa", "Pa"};
    LeaveOpen(bare, possible, absl::StrCat("the largest number is ", Short(largest)));
  }

  void DecideOther(std::size_t i) {
    ColumnMeaning& column = Column(i);
    if (column.role.empty() || !column.unit.empty() || column.open) return;
    if (IsStrainRole(column.role) || IsStressRole(column.role)) return;
    const std::string si = SiUnitOf(column.role);
    const Extent e = ExtentOf(Numbers(i));
    if (column.role == "porosity") {
      return Take(i, e.max > 1 ? "percent" : "1", e.max > 1 ? "it exceeds one" : "");
    }
    if (si == "1") return Take(i, "1", "");
    if (si == "rad" && e.largest > std::numbers::pi / 2) {
      return Take(i, "deg", "it exceeds a right angle in radians");
    }
    if (!IsObservable(column.role)) return;
    LeaveOpen({i},
              si == "rad" ? std::vector<std::string>{"deg", "rad"}
              : si == "m" ? std::vector<std::string>{"mm", "m"}
                          : std::vector<std::string>{si},
              "nothing tells it");
  }

  Inspection& out_;
  const InspectedPart& part_;
};

}  // namespace

void DecideUnits(Inspection& inspection) { Units(inspection).Decide(); }

}  // namespace calib::inspection
