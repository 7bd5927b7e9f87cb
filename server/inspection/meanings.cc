#include "server/inspection/meanings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <set>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "server/campaign/file/text/suggestion.h"
#include "server/inspection/header_words.h"
#include "server/inspection/numbers.h"
#include "server/inspection/relations.h"
#include "server/inspection/units.h"

namespace calib::inspection {
namespace {

using campaign::Quoted;

// Columns are the same when they differ by less than this of their range [-]: the last digits.
constexpr double kSame = 1e-6;
// Of its range, by which a strain may be off zero where it begins [-]. Chosen: what a gauge is
// zeroed to in a laboratory; void ratios begin far beyond.
constexpr double kNearZero = 0.1;

// Why numbers cannot be a quantity; empty: they can.
std::string Against(const std::string& role, const std::vector<double>& values,
                    const std::string& unit) {
  const Extent e = ExtentOf(values);
  if (e.count == 0) return "holds no number";
  const double scale = unit == "percent" ? 0.01 : 1;
  if (role == "void_ratio") {
    if (e.min <= 0 || std::abs(e.first) < kNearZero * e.range()) return "begins at zero";
    if (e.max > 20 && unit != "percent") return "exceeds 20";
  } else if (role == "porosity") {
    if (e.min <= 0) return "is not above zero";
    if (e.max * scale >= 1 && (unit == "1" || e.max >= 100)) return "exceeds one";
  } else if (role == kNumber) {
    if (!IsWhole(values) || !NeverFalls(values) || !(e.range() > 0)) return "does not count";
  } else if (role == kTime) {
    if (!NeverFalls(values)) return "falls";
  } else if (role == "axial_strain" || role == "lateral_strain" || role == "volumetric_strain" ||
             role == "shear_strain") {
    if (std::abs(e.first) > kNearZero * e.range() && e.count > 2 && e.min * e.max > 0 &&
        std::abs(e.first) > e.range()) {
      return "begins far from zero";
    }
  } else if (role == "q_over_p") {
    if (e.min * scale < -1.6 || e.max * scale > 3.1) return "leaves -1.5 to 3";
  } else if (role == "stress_ratio") {
    if (e.min < -0.1) return "is negative";
    if (std::abs(e.first) < 0.1 && e.max > 0.3) return "begins at 0, where a ratio begins at 1";
  }
  return "";
}

class Resolver {
 public:
  Resolver(const std::vector<SaidMeaning>& said, Inspection& inspection)
      : said_(said),
        out_(inspection),
        part_(inspection.table.parts[LargestTest(inspection.table)]) {}

  void Resolve() {
    for (const InspectedColumn& column : part_.columns) Begin(column);
    for (const InspectedPart& part : out_.table.parts) {
      for (std::size_t i = 0; i < part.columns.size() && i < out_.columns.size(); ++i) {
        out_.columns[i].missing += part.columns[i].missing;
      }
    }
    RefuseDoubledNames();
    DecideByHeadings();
    TotalStresses();
    KeepOneOfEach();
  }

 private:
  void Begin(const InspectedColumn& column) {
    ColumnMeaning meaning{.name = column.name, .header = column.header};
    HeaderReading reading = ReadHeader(column.name, column.unit);
    meaning.unit = reading.unit;
    if (!column.unit.empty() && reading.unit.empty() && column.texts == 0) {
      meaning.evidence.push_back(
          absl::StrCat("its unit ", Quoted(column.unit), " is not known here"));
    }
    if (column.dates > 0) {
      meaning.evidence.push_back("its cells are dates");
      reading.candidates.clear();
    } else if (column.texts > 0 && ExtentOf(column.values).count == 0) {
      meaning.role =
          column.name == out_.table.naming_column && !out_.table.names_stages ? kTestName : "";
      meaning.evidence.push_back("its cells are words");
      reading.candidates.clear();
    }
    readings_.push_back(std::move(reading));
    out_.columns.push_back(std::move(meaning));
    decided_.push_back(column.dates > 0 || ExtentOf(column.values).count == 0);
  }

  // Columns that no campaign can tell apart.
  void RefuseDoubledNames() {
    std::set<std::string> told;
    for (std::size_t i = 0; i < out_.columns.size(); ++i) {
      ColumnMeaning& column = out_.columns[i];
      std::vector<std::string> places;
      for (std::size_t k = 0; k < out_.columns.size(); ++k) {
        if (out_.columns[k].header == column.header) places.push_back(absl::StrCat(k + 1));
      }
      if (places.size() < 2) continue;
      decided_[i] = true;
      column.evidence.emplace_back("more than one column has this name");
      const SaidMeaning* said = SaidOf(column);
      if (said != nullptr && said->name == "nothing") continue;
      if (!told.insert(column.header).second) continue;
      out_.findings.push_back(
          {FindingKind::kAmbiguous, true, HeaderLine(),
           absl::StrCat("columns ", absl::StrJoin(places, " and "), " are both called ",
                        Quoted(column.header),
                        ": none of them is used; give one another name, or leave them out: "
                        "--meaning \"",
                        column.name, "=nothing\"")});
    }
  }

  [[nodiscard]] std::optional<int> HeaderLine() const {
    if (out_.table.header_lines == 0) return std::nullopt;
    return out_.table.header_lines;
  }

  void DecideByHeadings() {
    left_.resize(out_.columns.size());
    for (std::size_t i = 0; i < out_.columns.size(); ++i) {
      const SaidMeaning* said = SaidOf(out_.columns[i]);
      if (said != nullptr && !decided_[i]) TakeSaid(i, *said);
    }
    for (std::size_t i = 0; i < out_.columns.size(); ++i) {
      if (!decided_[i]) Sift(i);
    }
    // Letters need company: in a table of strains and stresses q is what it usually is.
    bool again = true;
    while (again) {
      again = false;
      for (std::size_t i = 0; i < out_.columns.size(); ++i) {
        if (decided_[i] || left_[i].size() != 1 || !HasCompany(i)) continue;
        Take(i, left_[i].front(), "as is usual beside the other columns");
        again = true;
      }
    }
    for (std::size_t i = 0; i < out_.columns.size(); ++i) {
      if (!decided_[i] && !left_[i].empty()) LeaveOpen(i);
    }
  }

  const SaidMeaning* SaidOf(const ColumnMeaning& column) const {
    for (const SaidMeaning& said : said_) {
      if (said.column == column.name || said.column == column.header) return &said;
    }
    return nullptr;
  }

  void TakeSaid(std::size_t i, const SaidMeaning& said) {
    ColumnMeaning& column = out_.columns[i];
    column.role = said.name == "nothing" ? "" : said.name;
    if (!said.unit.empty()) column.unit = said.unit;
    if (said.sign != 0) column.sign = said.sign;
    column.sign_said = said.sign != 0;
    column.evidence = {"as --meaning says"};
    decided_[i] = true;
    said_columns_.insert(i);
  }

  // Of what the heading may mean, what the numbers allow.
  void Sift(std::size_t i) {
    ColumnMeaning& column = out_.columns[i];
    const std::vector<double>& values = part_.columns[i].values;
    std::vector<std::string> against;
    bool plain = false;
    for (const HeaderCandidate& candidate : readings_[i].candidates) {
      const std::string why = Against(candidate.role, values, column.unit);
      if (!why.empty()) {
        against.push_back(absl::StrCat("no ", candidate.role, ", since it ", why));
        continue;
      }
      left_[i].push_back(candidate.role);
      plain = plain || candidate.plain;
    }
    if (readings_[i].candidates.empty()) {
      column.evidence.push_back("its heading says nothing that is known");
      decided_[i] = true;
      return;
    }
    if (left_[i].empty()) {
      column.evidence = against;
      decided_[i] = true;
      return;
    }
    if (left_[i].size() > 1) return PreferByUnit(i);
    const bool stress_unit = !column.unit.empty() && column.unit != "1" && column.unit != "percent";
    if (plain) return Take(i, left_[i].front(), "by its heading");
    if (stress_unit) return Take(i, left_[i].front(), "its unit is one of a stress");
    if (!against.empty()) return Take(i, left_[i].front(), absl::StrJoin(against, "; "));
    if (left_[i].front() == "void_ratio" || left_[i].front() == "q_over_p") {
      Take(i, left_[i].front(), "its numbers are in the range of one");
    }
  }

  // "e (%)" beside "e (-)": percent is how strains are written.
  void PreferByUnit(std::size_t i) {
    if (out_.columns[i].unit != "percent") return;
    for (const std::string& role : left_[i]) {
      if (role == "axial_strain") return Take(i, role, "in percent, as strains are");
    }
  }

  void Take(std::size_t i, const std::string& role, const std::string& why) {
    ColumnMeaning& column = out_.columns[i];
    column.role = role;
    column.evidence.push_back(absl::StrCat("heading ", Quoted(column.header)));
    if (why != "by its heading") column.evidence.push_back(why);
    decided_[i] = true;
  }

  [[nodiscard]] bool HasCompany(std::size_t i) const {
    for (std::size_t k = 0; k < out_.columns.size(); ++k) {
      if (k != i && decided_[k] && IsObservable(out_.columns[k].role)) return true;
    }
    return false;
  }

  void LeaveOpen(std::size_t i) {
    ColumnMeaning& column = out_.columns[i];
    const bool matters = std::any_of(left_[i].begin(), left_[i].end(), &IsObservable);
    column.evidence.push_back(absl::StrCat("heading ", Quoted(column.header), " may be ",
                                           absl::StrJoin(left_[i], " or ")));
    if (!matters) return;
    column.open = true;
    column.options = left_[i];
    out_.findings.push_back(
        {FindingKind::kAmbiguous, false, HeaderLine(),
         absl::StrCat("column ", Quoted(column.name), " may be ", absl::StrJoin(left_[i], " or "),
                      "; say which, e.g. --meaning ", column.name, "=", left_[i].front(),
                      ", or --meaning ", column.name, "=nothing")});
  }

  // Of two stresses of one direction the one without a prime is total, if the other has one.
  void TotalStresses() {
    for (const auto& [role, total] :
         {std::pair<const char*, const char*>{"lateral_stress", kTotalLateral},
          {"axial_stress", kTotalAxial}}) {
      bool effective = false;
      for (std::size_t i = 0; i < out_.columns.size(); ++i) {
        effective = effective || (out_.columns[i].role == role && readings_[i].effective);
      }
      if (!effective) continue;
      for (std::size_t i = 0; i < out_.columns.size(); ++i) {
        ColumnMeaning& column = out_.columns[i];
        if (column.role != role || readings_[i].effective || said_columns_.contains(i)) continue;
        column.role = total;
        column.evidence.emplace_back("another column is the effective one");
      }
    }
    // A cell pressure is the lateral stress where no other column is and nothing is said of water.
    bool lateral = false;
    bool water = false;
    for (const ColumnMeaning& column : out_.columns) {
      lateral = lateral || column.role == "lateral_stress";
      water = water || column.role == "pore_pressure";
    }
    if (lateral || water) return;
    for (ColumnMeaning& column : out_.columns) {
      if (column.role != kTotalLateral) continue;
      column.role = "lateral_stress";
      column.evidence.emplace_back("no pore pressure stands beside it");
      return;
    }
  }

  void KeepOneOfEach() {
    for (std::size_t i = 0; i < out_.columns.size(); ++i) {
      if (!IsObservable(out_.columns[i].role)) continue;
      for (std::size_t k = i + 1; k < out_.columns.size(); ++k) {
        if (out_.columns[k].role == out_.columns[i].role) Keep(i, k);
        if (out_.columns[i].role.empty()) break;
      }
    }
  }

  void Drop(std::size_t i, const std::string& why) {
    out_.columns[i].role.clear();
    out_.columns[i].evidence.push_back(why);
  }

  void Keep(std::size_t i, std::size_t k) {
    ColumnMeaning& a = out_.columns[i];
    ColumnMeaning& b = out_.columns[k];
    if (said_columns_.contains(i) != said_columns_.contains(k)) {
      return said_columns_.contains(i) ? Drop(k, "--meaning says another is")
                                       : Drop(i, "--meaning says another is");
    }
    if (Apart(part_.columns[i].values, part_.columns[k].values) < kSame) {
      return Drop(k, absl::StrCat("the same numbers as ", Quoted(a.name)));
    }
    const bool plain_a = readings_[i].candidates.front().plain;
    const bool plain_b = readings_[k].candidates.front().plain;
    if (plain_a != plain_b) {
      return plain_a ? Drop(k, absl::StrCat(Quoted(a.name), " says so in a word"))
                     : Drop(i, absl::StrCat(Quoted(b.name), " says so in a word"));
    }
    const std::string role = a.role;
    out_.findings.push_back(
        {FindingKind::kAmbiguous, false, HeaderLine(),
         absl::StrCat("columns ", Quoted(a.name), " and ", Quoted(b.name), " both seem to be ",
                      role, " and differ; say which is meant: --meaning ", a.name, "=", role)});
    for (ColumnMeaning* column : {&a, &b}) {
      column->open = true;
      column->options = {role, "nothing"};
      column->role.clear();
      column->evidence.push_back(absl::StrCat("another column seems to be ", role, " too"));
    }
  }

  const std::vector<SaidMeaning>& said_;
  Inspection& out_;
  const InspectedPart& part_;
  std::vector<HeaderReading> readings_;
  std::vector<std::vector<std::string>> left_;  // roles that are still possible
  std::vector<bool> decided_;
  std::set<std::size_t> said_columns_;
};

}  // namespace

std::size_t LargestTest(const InspectedTable& table) {
  std::size_t largest = 0;
  for (std::size_t i = 0; i < table.parts.size(); ++i) {
    if (table.parts[i].lines.size() > table.parts[largest].lines.size()) largest = i;
  }
  return largest;
}

void DecideMeanings(const std::vector<SaidMeaning>& said, Inspection& inspection) {
  Resolver(said, inspection).Resolve();
  DecideUnits(inspection);
  CheckRelations(inspection);
}

}  // namespace calib::inspection
