#include "server/inspection/inspection.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/registry/catalog.h"
#include "server/campaign/file/text/quantity.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/campaign/model/control_path.h"
#include "server/inspection/derived.h"
#include "server/inspection/header_words.h"
#include "server/inspection/meanings.h"
#include "server/inspection/numbers.h"
#include "server/inspection/series.h"
#include "server/inspection/stated_sizes.h"

namespace calib::inspection {
namespace {

using campaign::Quoted;

// Share of readings that repeat the one before, from which a column stands on plateaus. Chosen: a
// curve repeats a number where it is flat, and hardly elsewhere.
constexpr double kPlateau = 0.2;
constexpr double kWorthAWord = 1e-3;  // of a range: what is less off zero nobody sees
constexpr double kAnOffset = 0.1;     // of a range: what is more off is none of a gauge

// What drives a test, the first that the file has.
constexpr const char* kControls[] = {"axial_strain", "shear_strain", kDisplacement,
                                     "impact_angle", "opening",      "repetition",
                                     "axial_stress", "mean_stress",  kTime};

std::string ControlRole(const Inspection& inspection) {
  for (const char* role : kControls) {
    if (inspection.Has(role)) return role;
  }
  return "";
}

bool IsStrainControl(const std::string& role) {
  return role == "axial_strain" || role == "shear_strain" || role == kDisplacement;
}

class TestSeries {
 public:
  TestSeries(std::size_t test, Inspection& inspection)
      : out_(inspection), part_(inspection.table.parts[test]), test_(test) {}

  InspectedTest Read() {
    InspectedTest result{.name = part_.name};
    result.control =
        out_.control.empty() ? std::vector<double>{} : out_.Values(test_, out_.control);
    const bool driven = !result.control.empty();
    if (!driven) {
      for (std::size_t i = 0; i < part_.lines.size(); ++i) {
        result.control.push_back(static_cast<double>(i));
      }
    }
    if (driven) {
      result.turning = TurningOf(result.control);
      RepeatedControl(result);
      Unloading(result);
      Start(result);
    }
    std::vector<double> independent;
    for (std::size_t i = 0; i < out_.columns.size() && i < part_.columns.size(); ++i) {
      const ColumnMeaning& meaning = out_.columns[i];
      const InspectedColumn& column = part_.columns[i];
      const Extent extent = ExtentOf(column.values);
      if (extent.count == 0 || !(extent.range() > 0)) continue;
      const Curve curve{result.control, column.values, result.turning};
      const bool counts = meaning.role == kTime || meaning.role == kNumber;
      if (!counts && meaning.role != out_.control) {
        const double noise = NoiseOf(curve);
        if (std::isfinite(noise)) result.noise[column.name] = noise;
      }
      if (counts || !IsObservable(meaning.role) || meaning.role == out_.control) continue;
      Plateau(column);
      if (driven && IsStrainControl(out_.control))
        Pauses(meaning, curve, result.noise[column.name]);
      independent.push_back(IndependentReadings(curve));
    }
    if (independent.empty()) independent.push_back(static_cast<double>(part_.lines.size()));
    // The middle one: a column that is computed of others counts once more, not for the worst.
    std::nth_element(independent.begin(),
                     independent.begin() + static_cast<std::ptrdiff_t>(independent.size() / 2),
                     independent.end());
    result.independent_readings = independent[independent.size() / 2];
    SetCorrelation(result, driven);
    return result;
  }

 private:
  void Say(FindingKind kind, bool odd, std::size_t row, const std::string& text) {
    const std::string where = part_.name.empty() ? "" : absl::StrCat(part_.name, ": ");
    out_.findings.push_back({kind, odd, part_.lines[row], where + text});
  }

  // exp(-distance / length) has an integrated autocorrelation of 2 length over the spacing.
  void SetCorrelation(InspectedTest& result, bool driven) const {
    const auto n = static_cast<double>(part_.lines.size());
    if (!driven || !(result.independent_readings < n / 2)) return;
    double travelled = 0;
    for (std::size_t i = 1; i < result.control.size(); ++i) {
      const double step = std::abs(result.control[i] - result.control[i - 1]);
      if (std::isfinite(step)) travelled += step;
    }
    result.correlation_length = travelled / result.independent_readings / 2;
  }

  std::vector<std::size_t> TurningOf(const std::vector<double>& control) const {
    std::vector<double> readings;
    std::vector<std::size_t> rows;
    for (std::size_t i = 0; i < control.size(); ++i) {
      if (std::isnan(control[i])) continue;
      readings.push_back(control[i]);
      rows.push_back(i);
    }
    if (readings.size() < 3) return {};
    std::vector<std::size_t> turning;
    const double start = IsStrainControl(out_.control) ? 0 : readings.front();
    for (const std::size_t at : campaign::CleanControl(readings, start, std::nullopt).turning) {
      turning.push_back(rows[at]);
    }
    return turning;
  }

  void RepeatedControl(const InspectedTest& test) {
    std::vector<std::size_t> repeated;
    for (std::size_t i = 1; i < test.control.size(); ++i) {
      if (test.control[i] == test.control[i - 1]) repeated.push_back(i);
    }
    if (repeated.empty()) return;
    std::size_t at_turns = 0;
    for (const std::size_t turn : test.turning) {
      const auto beside = [&repeated](std::size_t row) {
        return std::find(repeated.begin(), repeated.end(), row) != repeated.end();
      };
      at_turns += beside(turn) || beside(turn + 1) ? 1 : 0;
    }
    Say(FindingKind::kDuplicateControl, false, repeated.front(),
        absl::StrCat(repeated.size(), " of ", test.control.size(), " rows repeat the ",
                     ControlName(), " of the row before", at_turns > 0 ? ", " : "",
                     at_turns > 0 ? absl::StrCat(at_turns, " of them where the path turns") : ""));
  }

  std::string ControlName() const {
    const ColumnMeaning* column = out_.Find(out_.control);
    return Quoted(column != nullptr ? column->name : out_.control);
  }

  void Unloading(const InspectedTest& test) {
    if (test.turning.empty()) return;
    std::vector<std::string> lines;
    constexpr std::size_t kShown = 6;
    for (const std::size_t row : test.turning) {
      if (lines.size() < kShown) lines.push_back(absl::StrCat(part_.lines[row]));
    }
    if (test.turning.size() > kShown) lines.emplace_back("...");
    Say(FindingKind::kUnloading, false, test.turning.front(),
        absl::StrCat("the path of ", ControlName(), " turns back ", test.turning.size(),
                     test.turning.size() == 1 ? " time (line " : " times (lines ",
                     absl::StrJoin(lines, ", "), ")"));
  }

  // Whether the first row stands where a test begins: what resists is at its start there. A test
  // whose first rows are not in the file has no zero to be found.
  [[nodiscard]] bool BeginsAtStart(const InspectedTest& test) const {
    const Extent control = ExtentOf(test.control);
    if (!IsStrainControl(out_.control)) return false;
    if (std::abs(control.first) > kAnOffset * control.largest) return false;
    for (const char* role : {"deviatoric_stress", "q_over_p", "stress_ratio", "shear_stress"}) {
      const Extent e = ExtentOf(out_.Values(test_, role));
      if (e.count == 0) continue;
      const double start = std::string(role) == "stress_ratio" ? 1 : 0;
      return std::abs(e.first - start) <= kAnOffset * std::max(e.range(), std::abs(e.max - start));
    }
    return true;
  }

  // Strains and deviators begin at zero, ratios at one.
  void Start(const InspectedTest& test) {
    if (!BeginsAtStart(test)) return;
    for (const ColumnMeaning& column : out_.columns) {
      const std::string& role = column.role;
      const bool strain = role == "axial_strain" || role == "volumetric_strain" ||
                          role == "lateral_strain" || role == "shear_strain";
      const bool zero =
          strain || role == "deviatoric_stress" || role == "q_over_p" || role == "shear_stress";
      const double start = role == "stress_ratio" ? 1 : 0;
      if (!zero && start == 0) continue;
      const Extent e = ExtentOf(out_.Values(test_, role));
      if (e.count < 3 || !(e.range() > 0)) continue;
      const double share = std::abs(e.first - start) / e.range();
      if (share < kWorthAWord || share > kAnOffset) continue;
      const std::string unit =
          column.unit.empty() || column.unit == "1" ? "" : absl::StrCat(" ", column.unit);
      Say(FindingKind::kOffset, false, 0,
          absl::StrCat(Quoted(column.name), " begins at ",
                       Short(column.sign * e.first / column.factor), unit, " instead of ", start,
                       ", ", Short(100 * share), " % of its range: ",
                       strain ? "zero: first takes it off"
                              : "an offset of the gauge, or it was loaded before"));
    }
  }

  void Plateau(const InspectedColumn& column) {
    std::size_t repeats = 0;
    std::size_t first = 0;
    std::size_t count = 0;
    double last = std::nan("");
    for (std::size_t i = 0; i < column.values.size(); ++i) {
      const double v = column.values[i];
      if (std::isnan(v)) continue;
      ++count;
      if (v == last && ++repeats == 1) first = i;
      last = v;
    }
    const auto quantum = QuantumOf(column.values);
    if (!quantum || static_cast<double>(repeats) < kPlateau * static_cast<double>(count)) return;
    Say(FindingKind::kPlateau, false, first,
        absl::StrCat(Quoted(column.name), " stands in steps of ", Short(*quantum), ": ", repeats,
                     " of ", count, " readings repeat the one before"));
  }

  void Pauses(const ColumnMeaning& meaning, const Curve& curve, double noise) {
    if (meaning.role != "deviatoric_stress" && meaning.role != "axial_stress" &&
        meaning.role != "shear_stress" &&
        !(meaning.role == "q_over_p" && out_.Find("deviatoric_stress") == nullptr) &&
        !(meaning.role == "stress_ratio" && out_.Find("deviatoric_stress") == nullptr)) {
      return;
    }
    if (meaning.role == "axial_stress" && out_.Find("deviatoric_stress") != nullptr) return;
    const std::vector<std::size_t> dips = DipsOf(curve, noise);
    if (dips.empty()) return;
    std::vector<std::string> lines;
    constexpr std::size_t kShown = 6;
    for (const std::size_t row : dips) {
      if (lines.size() < kShown) lines.push_back(absl::StrCat(part_.lines[row]));
    }
    if (dips.size() > kShown) lines.emplace_back("...");
    Say(FindingKind::kPause, false, dips.front(),
        absl::StrCat(Quoted(meaning.name), " drops and is back within three readings, ",
                     dips.size(), dips.size() == 1 ? " time (line " : " times (lines ",
                     absl::StrJoin(lines, ", "), "): the test paused"));
  }

  Inspection& out_;
  const InspectedPart& part_;
  std::size_t test_;
};

void SayMissing(Inspection& inspection) {
  for (const ColumnMeaning& column : inspection.columns) {
    if (column.missing == 0 || static_cast<std::size_t>(column.missing) == inspection.rows)
      continue;
    inspection.findings.push_back({FindingKind::kMissing, false, std::nullopt,
                                   absl::StrCat(Quoted(column.name), " has no number in ",
                                                column.missing, " of ", inspection.rows, " rows")});
  }
}

void SayForm(Inspection& inspection) {
  if (inspection.table.encoding != "UTF-8") {
    inspection.findings.push_back({FindingKind::kEncoding, false, std::nullopt,
                                   absl::StrCat("the text is in ", inspection.table.encoding)});
  }
  if (inspection.table.mark == campaign::DecimalMark::kComma) {
    inspection.findings.push_back(
        {FindingKind::kDecimalMark, false, std::nullopt, "numbers have a decimal comma"});
  }
}

// The noise of the reading in the middle, tests counted by their rows.
double MedianNoise(const Inspection& inspection, const std::string& column) {
  std::vector<std::pair<double, std::size_t>> noise;
  std::size_t all = 0;
  for (std::size_t i = 0; i < inspection.tests.size(); ++i) {
    const auto at = inspection.tests[i].noise.find(column);
    if (at == inspection.tests[i].noise.end()) continue;
    const std::size_t rows = inspection.table.parts[i].lines.size();
    noise.emplace_back(at->second, rows);
    all += rows;
  }
  std::sort(noise.begin(), noise.end());
  std::size_t passed = 0;
  for (const auto& [sd, rows] : noise) {
    passed += rows;
    if (2 * passed >= all) return sd;
  }
  return std::nan("");
}

}  // namespace

const ColumnMeaning* Inspection::Find(const std::string& role) const {
  for (const ColumnMeaning& column : columns) {
    if (column.role == role && !role.empty()) return &column;
  }
  return nullptr;
}

const DerivedQuantity* Inspection::FindDerived(const std::string& role) const {
  for (const DerivedQuantity& one : derived) {
    if (one.role == role) return &one;
  }
  return nullptr;
}

bool Inspection::Has(const std::string& role) const {
  return Find(role) != nullptr || FindDerived(role) != nullptr;
}

bool Inspection::IsOpen() const {
  return std::any_of(findings.begin(), findings.end(),
                     [](const Finding& f) { return f.kind == FindingKind::kAmbiguous; });
}

std::vector<double> Inspection::Values(std::size_t test, const std::string& role) const {
  for (std::size_t i = 0; i < columns.size() && i < table.parts[test].columns.size(); ++i) {
    if (columns[i].role != role || role.empty()) continue;
    std::vector<double> values = table.parts[test].columns[i].values;
    for (double& v : values) v *= columns[i].sign * columns[i].factor;
    return values;
  }
  const DerivedQuantity* const other = FindDerived(role);
  return other != nullptr ? other->values[test] : std::vector<double>{};
}

Inspection Inspect(const std::string& file, const std::string& bytes,
                   const std::vector<SaidMeaning>& said,
                   std::vector<campaign::TableProblem>& problems) {
  Inspection inspection;
  inspection.file = file;
  inspection.table = ReadInspectedTable(bytes, problems);
  if (!problems.empty()) return inspection;
  for (const InspectedPart& part : inspection.table.parts) inspection.rows += part.lines.size();
  inspection.stated_pressure = StatedSizesOf(inspection.table.remarks).pressure;
  if (inspection.stated_pressure == 0) inspection.stated_pressure = PressureInName(file);
  SayForm(inspection);
  DecideMeanings(said, inspection);
  DeriveQuantities(inspection);
  SayMissing(inspection);
  inspection.control = ControlRole(inspection);
  for (std::size_t i = 0; i < inspection.table.parts.size(); ++i) {
    inspection.tests.push_back(TestSeries(i, inspection).Read());
    inspection.independent_readings += inspection.tests.back().independent_readings;
  }
  for (const ColumnMeaning& column : inspection.columns) {
    const double noise = MedianNoise(inspection, column.name);
    if (std::isfinite(noise)) inspection.noise[column.name] = noise;
  }
  return inspection;
}

std::optional<SaidMeaning> ReadSaidMeaning(const std::string& text, std::string& problem) {
  const std::size_t equal = text.rfind('=');
  if (equal == std::string::npos || equal == 0 || equal + 1 == text.size()) {
    problem = absl::StrCat(Quoted(text),
                           " is no meaning: write COLUMN=NAME, COLUMN=-NAME where its "
                           "sign is to be turned, COLUMN=NAME[unit], or COLUMN=nothing");
    return std::nullopt;
  }
  SaidMeaning said{.column = text.substr(0, equal), .name = text.substr(equal + 1)};
  if (said.name.front() == '-' || said.name.front() == '+') {
    said.sign = said.name.front() == '-' ? -1 : 1;
    said.name.erase(0, 1);
  }
  if (said.name.ends_with(']')) {
    const std::size_t open = said.name.find('[');
    if (open != std::string::npos) {
      said.unit = PlainUnit(said.name.substr(open));
      const std::string written = said.name.substr(open);
      said.name.resize(open);
      if (said.unit.empty()) {
        problem = absl::StrCat(Quoted(written), " is no unit that is known here");
        return std::nullopt;
      }
    }
  }
  if (said.name == "nothing") return said;
  const dem::ObservableInfo* info = dem::FindObservable(said.name);
  if (info == nullptr) {
    std::vector<std::string> names = {"nothing"};
    for (const dem::ObservableInfo& one : dem::Observables()) names.push_back(one.name);
    problem = absl::StrCat(Quoted(said.name), " is not an observable; ",
                           campaign::Suggestion(said.name, names));
    return std::nullopt;
  }
  if (!said.unit.empty()) {
    const auto unit = campaign::ParseUnit(said.unit);
    const auto si = campaign::ParseUnit(info->unit);
    if (!unit.ok() || !si.ok() || !campaign::SameKind(unit->dimension, si->dimension)) {
      problem = absl::StrCat(said.unit, " is ", campaign::KindOfUnit(said.unit), ", but ",
                             said.name, " is ", campaign::KindOfUnit(info->unit));
      return std::nullopt;
    }
  }
  return said;
}

}  // namespace calib::inspection
