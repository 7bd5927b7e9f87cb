#include "dem/dynamics/flow.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

namespace calib::dem {
namespace {

/// Steps between two looks at stiffness, finiteness and escaped grains [-]. Chosen: the step of a
/// flow is that of its fastest impact already.
constexpr std::int64_t kInspection = 50;

/// sqrt(m/K) of two of the smallest grains that meet at a speed: the overlap u = v sqrt(m/K) and
/// the stiffness at u belong together, whatever the law.
double StepOfImpact(const Assembly& assembly, double speed) {
  const ParticleArrays& p = assembly.particles();
  const double r = *std::min_element(p.radius.begin(), p.radius.end());
  double overlap = 1e-3;  // radii
  for (int k = 0; k < 20; ++k) {
    overlap = std::clamp(speed * assembly.CriticalStepAt(overlap) / r, 1e-5, 0.3);
  }
  return assembly.CriticalStepAt(overlap);
}

}  // namespace

Flow::Flow(Assembly& assembly, const FlowOptions& options, std::stop_token stop)
    : assembly_(&assembly), options_(options), stop_(std::move(stop)) {
  const double g = Length(assembly.gravity());
  largest_dt_ = kSafety * StepOfImpact(assembly, std::sqrt(2 * g * options.drop_height)) /
                std::sqrt(assembly.model().Stiffening());
  dt_ = largest_dt_;
}

StageEnd Flow::Diverge(std::string reason) {
  reason_ = std::move(reason);
  return StageEnd::kDiverged;
}

StageEnd Flow::Inspect() {
  since_inspection_ = 0;
  if (std::string bad = assembly_->FirstNotFinite(); !bad.empty()) {
    return Diverge(absl::StrCat(bad, " at ", time_, " s"));
  }
  const ParticleArrays& p = assembly_->particles();
  const Vec3& low = options_.low;
  const Vec3& high = options_.high;
  for (std::size_t g = 0; g < p.x.size(); ++g) {
    const bool inside = p.x[g] > low.x && p.x[g] < high.x && p.y[g] > low.y && p.y[g] < high.y &&
                        p.z[g] > low.z && p.z[g] < high.z;
    if (!inside) {
      return Diverge(absl::StrCat("grain ", p.id[g], " escaped to (", p.x[g], ", ", p.y[g], ", ",
                                  p.z[g], ") m at ", time_, " s"));
    }
  }
  StiffnessEstimate estimate;
  if (auto s = assembly_->EstimateStiffness(estimate); !s.ok()) {
    return Diverge(absl::StrCat(std::string(s.message()), " at ", time_, " s"));
  }
  if (assembly_->MomentDelay(estimate) > Assembly::kLongestMomentDelay) {
    return Diverge(assembly_->MomentStepText(estimate));
  }
  dt_ = estimate.critical_step > 0 ? std::min(largest_dt_, kSafety * 2 * estimate.critical_step)
                                   : largest_dt_;
  return StageEnd::kDone;
}

void Flow::TakeOut() {
  const ParticleArrays& p = assembly_->particles();
  std::vector<int> out;
  for (int g = 0; g < p.size(); ++g) {
    const auto q = static_cast<std::size_t>(g);
    if (!p.body.empty() && p.body[q] >= 0) {
      const Clump& body = assembly_->clumps().all()[static_cast<std::size_t>(p.body[q])];
      if (body.centre[2] < drain_) {
        out.push_back(g);
        if (body.members.front() == g) {
          drained_.push_back({.time = time_, .mass = body.mass, .y = body.centre[1]});
        }
      }
    } else if (p.z[q] < drain_) {
      out.push_back(g);
      drained_.push_back({.time = time_, .mass = 1.0 / p.inverse_mass[q], .y = p.y[q]});
    }
  }
  if (!out.empty()) {
    assembly_->Remove(out);
  }
}

StageEnd Flow::Step(double damping) {
  if (stop_.stop_requested()) {
    return StageEnd::kStopped;
  }
  if (!begun_) {
    begun_ = true;
    if (before_) {
      before_(time_, dt_);
    }
    if (auto s = assembly_->EvaluateForces(); !s.ok()) {
      return Diverge(absl::StrCat(std::string(s.message()), " at the start"));
    }
    if (const StageEnd end = Inspect(); end != StageEnd::kDone) {
      return end;
    }
  }
  assembly_->Move({.dt = dt_, .damping = damping, .drag = options_.drag});
  time_ += dt_;
  TakeOut();
  if (before_) {
    before_(time_, dt_);
  }
  if (assembly_->particles().size() > 0) {
    if (auto s = assembly_->EvaluateForces(); !s.ok()) {
      return Diverge(absl::StrCat(std::string(s.message()), " at ", time_, " s"));
    }
  }
  return ++since_inspection_ >= kInspection ? Inspect() : StageEnd::kDone;
}

StageEnd Flow::Advance(double duration) {
  const double end_time = time_ + duration;
  while (time_ < end_time) {
    if (const StageEnd end = Step(options_.damping); end != StageEnd::kDone) {
      return end;
    }
  }
  return StageEnd::kDone;
}

double Flow::MeanSquareSpeed() const {
  const ParticleArrays& p = assembly_->particles();
  double sum = 0;
  for (std::size_t g = 0; g < p.x.size(); ++g) {
    sum += p.vx[g] * p.vx[g] + p.vy[g] * p.vy[g] + p.vz[g] * p.vz[g];
  }
  return p.x.empty() ? 0.0 : sum / static_cast<double>(p.x.size());
}

StageEnd Flow::Settle(double longest, double damping) {
  const double d = assembly_->mean_diameter();
  const double g = Length(assembly_->gravity());
  const double still2 = options_.still * options_.still * g * d;
  const double look = std::sqrt(d / g);
  const double end_time = time_ + longest;
  int still = 0;
  double next = time_ + look;
  while (time_ < end_time && still < 3) {
    if (const StageEnd end = Step(damping); end != StageEnd::kDone) {
      return end;
    }
    if (time_ >= next) {
      next += look;
      still = MeanSquareSpeed() < still2 ? still + 1 : 0;
    }
  }
  return StageEnd::kDone;
}

}  // namespace calib::dem
