#include "server/campaign/checks/in_words.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "dem/registry/catalog.h"

namespace calib::campaign {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

}  // namespace

PeoplesUnit PeoplesUnitOf(const std::string& name, double largest) {
  const dem::ObservableInfo* info = dem::FindObservable(name);
  const std::string unit = info != nullptr ? info->unit : "1";
  const double size = std::abs(largest);
  if (unit == "Pa") {
    if (size >= 1e6) return {1e-6, "MPa"};
    return size >= 1e3 ? PeoplesUnit{1e-3, "kPa"} : PeoplesUnit{1, "Pa"};
  }
  if (name.ends_with("_strain")) return {100, "percent"};
  if (unit == "rad") return {1 / kDegree, "deg"};
  if (unit == "m") return {1e3, "mm"};
  return {1, unit};
}

std::string InWords(const std::string& name, double value) {
  const PeoplesUnit unit = PeoplesUnitOf(name, value);
  return absl::StrCat(absl::StrFormat("%.4g", value * unit.factor),
                      unit.label == "1" ? "" : " " + unit.label);
}

}  // namespace calib::campaign
