#include "server/inspection/derived.h"

#include <cmath>
#include <functional>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "server/inspection/header_words.h"
#include "server/inspection/numbers.h"
#include "server/inspection/stated_sizes.h"

namespace calib::inspection {
namespace {

class Deriver {
 public:
  explicit Deriver(Inspection& inspection)
      : out_(inspection), sizes_(StatedSizesOf(inspection.table.remarks)) {}

  void Derive() {
    if (!out_.Has("axial_strain")) AxialStrain();
    if (!out_.Has("deviatoric_stress") && !out_.Has("axial_stress")) Deviator();
  }

 private:
  // "$3", or "$3 * 0.01" in SI; -1: nothing has this role, or its sign is turned.
  [[nodiscard]] int NumberOf(const std::string& role) const {
    for (std::size_t i = 0; i < out_.columns.size(); ++i) {
      const ColumnMeaning& column = out_.columns[i];
      if (column.role == role && !column.open && column.sign > 0) return static_cast<int>(i) + 1;
    }
    return -1;
  }
  [[nodiscard]] std::string InSi(const std::string& role) const {
    const double factor = out_.Find(role)->factor;
    const std::string number = absl::StrCat("$", NumberOf(role));
    return factor == 1 ? number : absl::StrFormat("%s * %.12g", number, factor);
  }

  void Add(const std::string& role, const std::string& name, const std::string& formula,
           const std::string& unit, double factor, const std::string& how,
           const std::function<double(std::size_t, std::size_t)>& value) {
    DerivedQuantity derived{
        .role = role, .name = name, .formula = formula, .unit = unit, .factor = factor};
    for (std::size_t test = 0; test < out_.table.parts.size(); ++test) {
      std::vector<double> values;
      values.reserve(out_.table.parts[test].lines.size());
      for (std::size_t i = 0; i < out_.table.parts[test].lines.size(); ++i) {
        values.push_back(value(test, i));
      }
      derived.values.push_back(std::move(values));
    }
    derived.how = how;
    out_.derived.push_back(std::move(derived));
    out_.findings.push_back({FindingKind::kStressPath, false, std::nullopt,
                             absl::StrCat(role, " has no column: it is computed as ", how)});
  }

  void AxialStrain() {
    if (NumberOf("volumetric_strain") > 0 && NumberOf("lateral_strain") > 0 &&
        out_.Find("volumetric_strain")->unit == out_.Find("lateral_strain")->unit) {
      std::vector<std::vector<double>> ev;
      std::vector<std::vector<double>> er;
      for (std::size_t test = 0; test < out_.table.parts.size(); ++test) {
        ev.push_back(out_.Values(test, "volumetric_strain"));
        er.push_back(out_.Values(test, "lateral_strain"));
      }
      const ColumnMeaning& volume = *out_.Find("volumetric_strain");
      Add("axial_strain", "derived_axial_strain",
          absl::StrCat("$", NumberOf("volumetric_strain"), " - 2 * $", NumberOf("lateral_strain")),
          volume.unit, volume.factor, "volumetric - 2 lateral strain",
          [&](std::size_t test, std::size_t i) { return ev[test][i] - 2 * er[test][i]; });
      return;
    }
    if (NumberOf(kDisplacement) < 0 || !(sizes_.height > 0)) return;
    if (out_.Find(kDisplacement)->unit.empty()) return;
    std::vector<std::vector<double>> way;
    way.reserve(out_.table.parts.size());
    for (std::size_t test = 0; test < out_.table.parts.size(); ++test) {
      way.push_back(out_.Values(test, kDisplacement));
    }
    Add("axial_strain", "derived_axial_strain",
        absl::StrFormat("%s / %.12g", InSi(kDisplacement), sizes_.height), "1", 1,
        absl::StrCat("displacement over the stated height of ", Short(sizes_.height * 1e3), " mm"),
        [&](std::size_t test, std::size_t i) { return way[test][i] / sizes_.height; });
  }

  void Deviator() {
    if (NumberOf(kLoad) < 0 || !(sizes_.diameter > 0) || out_.Find(kLoad)->unit.empty()) return;
    if (!out_.Has("axial_strain")) return;
    const Extent load = ExtentOf(out_.Values(0, kLoad));
    constexpr double kNearZero = 0.1;  // of the range: a ram that touches
    if (std::abs(load.first) > kNearZero * load.range()) return;
    const double area = std::numbers::pi / 4 * sizes_.diameter * sizes_.diameter;
    const bool with_volume = NumberOf("volumetric_strain") > 0;
    std::string strain;
    if (out_.Find("axial_strain") != nullptr) {
      if (NumberOf("axial_strain") < 0) return;
      strain = InSi("axial_strain");
    } else {
      const DerivedQuantity& derived = out_.derived.front();
      strain = absl::StrFormat("(%s) * %.12g", derived.formula, derived.factor);
    }
    std::vector<std::vector<double>> force;
    std::vector<std::vector<double>> ea;
    std::vector<std::vector<double>> ev;
    for (std::size_t test = 0; test < out_.table.parts.size(); ++test) {
      force.push_back(out_.Values(test, kLoad));
      ea.push_back(out_.Values(test, "axial_strain"));
      ev.push_back(with_volume ? out_.Values(test, "volumetric_strain")
                               : std::vector<double>(force.back().size(), 0.0));
    }
    std::string formula = absl::StrFormat("%s / %.12g * (1 - %s)", InSi(kLoad), area, strain);
    if (with_volume) absl::StrAppend(&formula, " / (1 - ", InSi("volumetric_strain"), ")");
    Add("deviatoric_stress", "derived_deviatoric_stress", formula, "Pa", 1,
        absl::StrCat("load over the area of the stated diameter of ", Short(sizes_.diameter * 1e3),
                     " mm, which grows as the specimen shortens",
                     with_volume ? "" : " at constant volume"),
        [&](std::size_t test, std::size_t i) {
          return force[test][i] / area * (1 - ea[test][i]) / (1 - ev[test][i]);
        });
  }

  Inspection& out_;
  StatedSizes sizes_;
};

}  // namespace

void DeriveQuantities(Inspection& inspection) { Deriver(inspection).Derive(); }

}  // namespace calib::inspection
