#include "server/diagnosis/screen_strengths.h"

#include <algorithm>
#include <cmath>

namespace calib::diagnosis {
namespace {

// A second strength is to change three times what two runs differ by chance: of what a measurement
// scatters, in square.
constexpr double kWanted = 18;
constexpr double kMostRatio = 16;  // of the second strength to the first
constexpr double kGrades = 4;      // of an octave: the last bits of a history change no run

// The last step within the default prior, or the catalogue's second.
double LastStep(const dem::EffectInfo& effect, const dem::StrengthRay& ray,
                const std::string& contact, const dem::ReferenceState& state) {
  const auto parameter = std::find_if(effect.parameters.begin(), effect.parameters.end(),
                                      [&ray](const auto& p) { return p.name == ray.parameter; });
  const double end = dem::PriorOf(*parameter, contact, state).max;
  const double reach = end - dem::NullValueOf(*parameter, contact).value_or(0);
  return std::max(ray.steps[1], reach / dem::ScaleOf(*parameter, contact, state));
}

}  // namespace

double StepFor(const dem::StrengthRay& ray, double share) {
  return std::copysign(std::pow(std::abs(share), 1 / ray.order), share);
}

double ShareAt(const dem::StrengthRay& ray, double step) {
  return std::copysign(std::pow(std::abs(step), ray.order), step);
}

double SecondStep(const dem::EffectInfo& effect, const dem::StrengthRay& ray, double square,
                  const std::string& contact, const dem::ReferenceState& state) {
  if (!(square > 0)) return ray.steps[1];
  const double grade =
      std::round(kGrades * std::log2(StepFor(ray, std::sqrt(kWanted / square)))) / kGrades;
  const double wanted = std::max(ray.steps[1], std::exp2(grade) * ray.steps[0]);
  const double step = std::min({wanted, std::max(ray.steps[1], kMostRatio * ray.steps[0]),
                                LastStep(effect, ray, contact, state)});
  return dem::RayAdmits(effect, ray, step, contact, state) ? step : ray.steps[1];
}

}  // namespace calib::diagnosis
