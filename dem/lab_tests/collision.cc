// `collision`: one body hits a wall or another body at rest.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/return_if_error.h"
#include "dem/dynamics/contact_model.h"
#include "dem/elementary/functions.h"
#include "dem/lab_tests/shared/test_run.h"
#include "dem/model/test_entry.h"
#include "dem/particles/particle_arrays.h"

namespace calib::dem {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

ParameterInfo Setting(const std::string& name, const std::string& unit,
                      const std::string& description) {
  ParameterInfo info;
  info.name = name;
  info.unit = unit;
  info.description = description;
  return info;
}

TestInfo Info() {
  ParameterInfo radius = Setting("radius", "m", "of the body that hits");
  radius.min_open = true;
  radius.max = 10;
  radius.default_prior = {.kind = "log_uniform", .min = 1e-4, .max = 1};
  ParameterInfo partner =
      Setting("partner_radius", "m",
              "of the body at rest, within a factor 10000 of radius; infinite: a wall");
  partner.min_open = true;
  partner.max = kInfinity;
  partner.default_prior = {.kind = "log_uniform", .min = 1e-4, .max = 1};
  partner.default_value = kInfinity;
  ParameterInfo thickness = Setting("thickness", "m", "of disks; 0: the bodies are spheres");
  thickness.max = 10;
  thickness.default_prior = {.kind = "uniform", .min = 0, .max = 1};
  thickness.default_value = 0;
  ParameterInfo angle = Setting("impact_angle", "rad", "to the normal, below 1.57");
  angle.max = 1.57;
  angle.default_prior = {.kind = "uniform", .min = 0, .max = 1.5};
  angle.default_value = 0;
  ParameterInfo speed = Setting("impact_speed", "m/s", "of the body that hits");
  speed.min_open = true;
  speed.max = 1e4;
  speed.default_prior = {.kind = "log_uniform", .min = 1e-3, .max = 1e2};
  ParameterInfo spin = Setting("impact_spin", "rad/s", "of the body, positive: adds to the slip");
  spin.min = -1e6;
  spin.max = 1e6;
  spin.default_prior = {.kind = "uniform", .min = -1e3, .max = 1e3};
  spin.default_value = 0;
  return {.name = "collision",
          .description =
              "A sphere (or disk) hits a wall or another at rest, without gravity: impact_angle, "
              "impact_speed or impact_spin driven through the control path, one collision each. "
              "Needs no packing. Fails when the bodies stick together, overlap by more than half "
              "the smaller radius, or gain energy that neither the law nor a user's formula gives",
          .settings = {radius, partner, thickness, angle, speed, spin},
          .observables = {"impact_angle", "impact_speed", "impact_spin", "normal_restitution",
                          "tangential_restitution", "energy_restitution", "rebound_angle",
                          "rebound_spin", "contact_duration", "peak_overlap"},
          .control = "impact_angle",
          .other_controls = {"impact_speed", "impact_spin"},
          .needs_packing = false,
          .may_reverse = true,
          .reference =
              "Hadjidoukas et al. 2014, sec. 4; Chung & Ooi, Granular Matter 13 (2011) "
              "643",
          .has_walls = true,
          .planar = true,
          .bodies = {"partner"}};
}

/// Smallest angle that a collision is computed at [rad]. Chosen: tangential restitution at normal
/// incidence is its limit for small angles.
constexpr double kSmallestImpactAngle = 1e-6;

/// Steps in half a period of the elastic contact [-]. Measured: errors in dem/VERIFICATION.md,
/// collisions; fewer move friction by 2.4e-4 (dem/DECISIONS.md, a collision begins and ends between
/// two steps).
constexpr double kStepsPerHalfPeriod = 5000;
/// Steps in the time constant of the fastest motion that a dashpot slows [-]. Chosen: Collision.*
/// holds that no energy is gained (dem/DECISIONS.md, the step of a collision follows its dashpots
/// too).
constexpr double kStepsPerRelaxation = 200;
/// Most steps of a block of collisions [-]. Chosen: a bound for strong dashpots.
constexpr double kMostSteps = 2e6;
/// Share of the energy that steps may add to what the law gives before a collision counts as
/// diverged [-]. Chosen.
constexpr double kRoundedEnergy = 1e-3;
/// Half periods of the elastic contact after which bodies that still touch count as stuck [-].
/// Chosen.
constexpr int kLongestInHalfPeriods = 200;
/// Largest overlap in smaller radii [-]. Chosen: as between grains of a specimen,
/// Assembly::EstimateStiffness().
constexpr double kDeepest = 0.5;
/// Overlap over the radius [-] beyond which no deeper one is tried for the step. Chosen.
constexpr double kDeepestGuess = 0.5 * kDeepest;
/// Largest ratio of the two radii [-]. Chosen: beyond it overlaps drown in rounding.
constexpr double kLargestRatio = 1e4;

struct Body {
  double radius = 0;
  double inverse_mass = 0;     ///< 0: a wall
  double inverse_inertia = 0;  ///< about the axis normal to the plane of motion
};

Body MakeBody(double radius, double thickness, double density) {
  if (!std::isfinite(radius)) {
    return {};
  }
  const Inertia inertia = InertiaOf(radius, density, thickness);
  return {.radius = radius,
          .inverse_mass = 1.0 / inertia.mass,
          .inverse_inertia = 1.0 / inertia.moment};
}

struct Impact {
  double angle = 0, speed = 0, spin = 0;
  int load_step = -1;
};

/// A spring of the contact as the last step left it; zero: it holds nothing.
struct Spring {
  double load = 0;       ///< force [N] or moment [N m]
  double stiffness = 0;  ///< [N/m] or [N m/rad]
};

/// Energy that a spring gains where its stiffness changes while its load stays, as that of a shear
/// force as published does: load^2/2 (1/new - 1/old); where a falling stiffness takes the load
/// along, load^2/2 (new/old^2 - 1/old). What Coulomb's limit cuts off is lost before. Below zero
/// where the stiffness grows or the load is rescaled [J].
/// [Elata & Berryman, Mech. Mater. 24 (1996) 229]
double GivenTo(const Spring& spring, double stiffness, double limit, ShearUnloading unloading) {
  if (!(spring.stiffness > 0) || !(stiffness > 0)) {
    return 0;  // nothing was held, or nothing is any more
  }
  const double load = std::min(std::abs(spring.load), limit);
  if (unloading == ShearUnloading::kRescaled && stiffness < spring.stiffness) {
    const double share = stiffness / spring.stiffness;
    return 0.5 * load * load / spring.stiffness * (share - 1.0);
  }
  return 0.5 * load * load * (1.0 / stiffness - 1.0 / spring.stiffness);
}

/// One collision in the plane x, y: the body (i) flies along +x and +y into its partner (j).
struct Flight {
  double dx = 0, dy = 0;            ///< centre of j, or foot on the wall, minus centre of i [m]
  double vix = 0, viy = 0, wi = 0;  ///< of the body
  double vjx = 0, vjy = 0, wj = 0;  ///< of the partner
  double peak = 0, begun = 0, ended = 0;
  double overlap = 0;               ///< of the last step in which they touched [m]
  std::array<double, 6> changes{};  ///< what that step changed of vix, viy, vjx, vjy, wi, wj
  double too_deep = 0;              ///< overlap that ended it [m]
  Spring shear, rolling;
  double given = 0;  ///< energy that the law has given, friction and dashpots aside [J]
  bool touched = false, done = false;
};

double SettingOf(const Scenario& scenario, const std::string& name) {
  const auto it = scenario.settings.find(name);
  if (it != scenario.settings.end()) {
    return it->second;
  }
  static const std::vector<ParameterInfo> settings = Info().settings;
  for (const ParameterInfo& info : settings) {
    if (info.name == name && info.default_value) {
      return *info.default_value;
    }
  }
  return 0;
}

std::vector<Impact> ImpactsOf(const Scenario& scenario) {
  static const TestInfo info = Info();
  const std::string control = ControlOf(info, scenario.settings);
  std::vector<Impact> impacts;
  for (const ControlPoint& point : scenario.path) {
    if (point.load_step < 0) {
      continue;
    }
    const auto value = [&](const std::string& name) {
      return name == control ? point.target : SettingOf(scenario, name);
    };
    impacts.push_back({.angle = std::max(value("impact_angle"), kSmallestImpactAngle),
                       .speed = value("impact_speed"),
                       .spin = value("impact_spin"),
                       .load_step = point.load_step});
  }
  return impacts;
}

class CollisionRun {
 public:
  CollisionRun(const Scenario& scenario, const ModelEntries& entries, std::stop_token stop)
      : model_(scenario.model, entries, SettingOf(scenario, "thickness")),
        unloading_(scenario.model.shear_unloading),
        stop_(std::move(stop)) {
    const double thickness = SettingOf(scenario, "thickness");
    body_ = MakeBody(SettingOf(scenario, "radius"), thickness, scenario.model.density);
    const Materials* materials = model_.materials();
    const auto named = scenario.materials.bodies.find("partner");
    const int made_of = materials != nullptr && named != scenario.materials.bodies.end()
                            ? materials->IndexOf(named->second)
                            : 0;
    partner_ = MakeBody(SettingOf(scenario, "partner_radius"), thickness,
                        made_of > 0 ? materials->density(made_of) : scenario.model.density);
    block_.sliding_friction = IsWall() ? model_.wall_friction() : model_.sliding_friction();
    block_.wall = IsWall();
    block_.mass_factor = IsWall() ? 2.0 : 1.0;
    if (materials != nullptr) {
      block_.mixed = true;
      const int pair = materials->Pair(0, made_of);
      std::fill(std::begin(block_.materials), std::end(block_.materials), pair);
      std::fill(std::begin(block_.friction), std::end(block_.friction), materials->friction(pair));
    }
  }

  [[nodiscard]] std::optional<ContactFault> Fault() const { return model_.Fault(); }

  /// Runs up to kBlock impacts to their ends; false: stopped, or a formula is not finite.
  bool Run(const Impact* impacts, int count) {
    impacts_ = count;
    for (int k = 0; k < kBlock; ++k) {
      const Impact& impact = impacts[std::min(k, count - 1)];
      flights_[k] = {};
      flights_[k].dx = body_.radius + partner_.radius;
      flights_[k].vix = impact.speed * Cosine(impact.angle);
      flights_[k].viy = impact.speed * Sine(impact.angle);
      flights_[k].wi = impact.spin;
    }
    for (auto& column : block_.own_history) {
      std::fill(std::begin(column), std::end(column), 0.0);
    }
    const Rates rates = FastestRates();
    const double half_period = std::numbers::pi / rates.elastic;
    dt_ = std::min(half_period / kStepsPerHalfPeriod, 1 / (kStepsPerRelaxation * rates.damped));
    const auto longest =
        static_cast<std::int64_t>(std::min(kMostSteps, kLongestInHalfPeriods * half_period / dt_));
    Touch();
    block_.dt = dt_;
    followed_ = static_cast<double>(longest) * dt_ / half_period;
    for (std::int64_t step = 0; step < longest; ++step) {
      if (step % 1024 == 0 && stop_.stop_requested()) {
        return false;
      }
      Drift();
      LoadBlock();
      model_.Evaluate(block_);
      ++steps_;
      if (Fault()) {
        return false;
      }
      if (!Kick(static_cast<double>(step) * dt_)) {
        break;
      }
    }
    return true;
  }

  [[nodiscard]] State Observe(const Impact& impact, int lane) const {
    const Flight& f = flights_[static_cast<std::size_t>(lane)];
    const double vx = f.vix - f.vjx;
    const double vy = f.viy - f.vjy;
    double nx = 1;
    double ny = 0;
    if (!IsWall()) {  // each velocity is taken along the line of centres of its own moment
      const double distance = std::sqrt(f.dx * f.dx + f.dy * f.dy);
      nx = f.dx / distance;
      ny = f.dy / distance;
    }
    const double normal = -(vx * nx + vy * ny);
    const double tangential = vy * nx - vx * ny;
    const double mass = 1.0 / (body_.inverse_mass + partner_.inverse_mass);
    const auto spin_energy = [&](double wi, double wj) {
      return wi * wi / body_.inverse_inertia +
             (IsWall() ? 0.0 : wj * wj / partner_.inverse_inertia);
    };
    const double before = mass * impact.speed * impact.speed + spin_energy(impact.spin, 0);
    const double after = mass * (vx * vx + vy * vy) + spin_energy(f.wi, f.wj);
    return {.load_step = impact.load_step,
            .values = {impact.angle, impact.speed, impact.spin,
                       normal / (impact.speed * Cosine(impact.angle)),
                       tangential / (impact.speed * Sine(impact.angle)), after / before,
                       Direction(tangential, normal), f.wi, f.ended - f.begun, f.peak}};
  }

  /// Why bodies that have not parted are given up.
  [[nodiscard]] std::string StillTouching() const {
    constexpr double kRounding = 0.99;  // [-], chosen: longest is a whole number of steps
    return followed_ > kRounding * kLongestInHalfPeriods
               ? "the bodies stick together"
               : absl::StrCat("the bodies still touch after ", followed_,
                              " half periods of their elastic contact, as long as so strong a "
                              "dashpot is followed");
  }
  [[nodiscard]] static double EnergyRestitution(const State& state) { return state.values[5]; }
  /// Energy that the law has given, over the energy before [-]. Shear and rolling springs keep
  /// their load while the overlap changes their stiffness; between two bodies torques act with arms
  /// to the middle of the overlap, slip is that of rigid arms (dem/DECISIONS.md).
  [[nodiscard]] double GivenShare(const Impact& impact, int lane) const {
    const double mass = 1.0 / (body_.inverse_mass + partner_.inverse_mass);
    const double before = 0.5 * (mass * impact.speed * impact.speed +
                                 impact.spin * impact.spin / body_.inverse_inertia);
    return flights_[static_cast<std::size_t>(lane)].given / before;
  }
  [[nodiscard]] bool separated(int lane) const {
    return flights_[static_cast<std::size_t>(lane)].done;
  }
  /// Why a collision cannot be told, in a sentence; empty: it can.
  [[nodiscard]] std::string DepthProblem(int lane) const {
    const double overlap = flights_[static_cast<std::size_t>(lane)].too_deep;
    if (!(overlap > 0)) {
      return "";
    }
    return IsWall() ? absl::StrCat("the body overlaps the wall by ", overlap,
                                   " m, more than half its radius")
                    : absl::StrCat("the bodies overlap by ", overlap,
                                   " m, more than half the smaller radius");
  }
  [[nodiscard]] double time_step() const { return dt_; }
  [[nodiscard]] std::int64_t steps() const { return steps_; }

 private:
  [[nodiscard]] bool IsWall() const { return partner_.inverse_mass == 0; }
  [[nodiscard]] double SmallerRadius() const {
    return IsWall() ? body_.radius : std::min(body_.radius, partner_.radius);
  }

  void Drift() {
    for (Flight& f : flights_) {
      f.dx += dt_ * (f.vjx - f.vix);
      // A flat wall has its nearest point always straight ahead.
      f.dy += IsWall() ? 0.0 : dt_ * (f.vjy - f.viy);
    }
  }

  void LoadBlock() {
    block_.count = kBlock;
    for (int k = 0; k < kBlock; ++k) {
      const Flight& f = flights_[k];
      block_.pair[k] = std::min(k, impacts_ - 1);
      block_.dx[k] = f.dx;
      block_.dy[k] = f.dy;
      block_.dz[k] = 0;
      block_.radius_i[k] = body_.radius;
      block_.radius_j[k] = IsWall() ? body_.radius : partner_.radius;
      block_.vx[k] = f.vjx - f.vix;
      block_.vy[k] = f.vjy - f.viy;
      block_.vz[k] = 0;
      block_.wix[k] = block_.wiy[k] = block_.wjx[k] = block_.wjy[k] = 0;
      block_.wiz[k] = f.wi;
      block_.wjz[k] = f.wj;
    }
  }

  /// Bodies begin where they just touch. What pulls, or resists the speed itself, acts from there
  /// on: velocities of the leapfrog, which are those of half a step later, feel half a step of it.
  /// Without that attraction gave an energy of its force times half a step's way.
  void Touch() {
    constexpr double kJust = 1e-12;  // overlap over the distance [-], chosen: that rounds to 1e-16
    block_.dt = 0;                   // memories stay empty
    LoadBlock();
    for (int k = 0; k < kBlock; ++k) {
      block_.dx[k] *= 1.0 - kJust;
    }
    model_.Evaluate(block_);
    for (int k = 0; k < kBlock; ++k) {
      flights_[static_cast<std::size_t>(k)].changes = ChangesOf(k);
      Change(flights_[static_cast<std::size_t>(k)], 0.5);
    }
    for (auto& column : block_.own_history) {
      std::fill(std::begin(column), std::end(column), 0.0);
    }
  }

  /// Bodies part between two steps, where their overlap vanishes: the last loads act up to there
  /// from the middle of the last step on. Of what holds across a gap the place is not known; half a
  /// step is then right on average. Returns when.
  double Part(Flight& f, double overlap, double time) const {
    const double share = f.overlap > 0 ? f.overlap / (f.overlap - overlap) : 0.5;
    Change(f, share - 0.5);
    return time - (1.0 - share) * dt_;
  }

  /// What a step of the loads of block_ changes.
  [[nodiscard]] std::array<double, 6> ChangesOf(int k) const {
    return {-dt_ * body_.inverse_mass * block_.force_x[k],
            -dt_ * body_.inverse_mass * block_.force_y[k],
            dt_ * partner_.inverse_mass * block_.force_x[k],
            dt_ * partner_.inverse_mass * block_.force_y[k],
            dt_ * body_.inverse_inertia * TorqueOnBody(k),
            dt_ * partner_.inverse_inertia * block_.torque_jz[k]};
  }

  static void Change(Flight& f, double share) {
    f.vix += share * f.changes[0];
    f.viy += share * f.changes[1];
    f.vjx += share * f.changes[2];
    f.vjy += share * f.changes[3];
    f.wi += share * f.changes[4];
    f.wj += share * f.changes[5];
  }

  /// Velocities by the contact's loads; false: all bodies have separated. A touching contact that
  /// has come apart is over, as in Assembly.
  bool Kick(double time) {
    bool any = false;
    for (int k = 0; k < kBlock; ++k) {
      Flight& f = flights_[k];
      if (f.done) {
        continue;
      }
      const double overlap = block_.overlap[k];
      f.peak = std::max(f.peak, overlap);
      if (overlap > kDeepest * SmallerRadius()) {
        f.too_deep = overlap;
        f.done = true;
        continue;
      }
      if (!(overlap > 0) && !(f.touched && block_.holds[k] > 0)) {
        if (f.touched) {
          f.ended = Part(f, overlap, time);
          f.done = true;
          continue;
        }
        any = true;
        continue;
      }
      if (!f.touched) {
        f.touched = true;
        f.begun = time - dt_;
      }
      any = true;
      Book(k);
      f.overlap = overlap;
      f.changes = ChangesOf(k);
      Change(f, 1.0);
    }
    return any;
  }

  /// Adds what the law gives in a step of the loads of block_.
  void Book(int k) {
    Flight& f = flights_[k];
    const double no_limit = kInfinity;  // of a moment: its kernel alone knows it
    f.given +=
        GivenTo(f.shear, block_.tangential_stiffness[k], block_.sliding_limit[k], unloading_) +
        GivenTo(f.rolling, block_.rolling_stiffness[k], no_limit, ShearUnloading::kAsPublished);
    const double sx = block_.history[model_.shear_history()][k];
    const double sy = block_.history[model_.shear_history() + 1][k];
    f.shear = {.load = std::sqrt(sx * sx + sy * sy), .stiffness = block_.tangential_stiffness[k]};
    f.rolling = {.load = block_.mz[k], .stiffness = block_.rolling_stiffness[k]};
    if (!IsWall()) {
      // F v + T w less the work of slip and rolling: -u Fs (vt/distance - (wi + wj)/2 x n)
      const double nx = block_.nx[k];
      const double ny = block_.ny[k];
      const double across = block_.vy[k] * nx - block_.vx[k] * ny;
      const double force = block_.fy[k] * nx - block_.fx[k] * ny;
      const double distance = body_.radius + partner_.radius - block_.overlap[k];
      f.given -= dt_ * block_.overlap[k] * force *
                 (across / distance - 0.5 * (block_.wiz[k] + block_.wjz[k]));
    }
  }

  /// At a wall the arm is the radius, as in the slip: what friction takes from spin is then what
  /// the slip has done, and the reference solutions agree [Hadjidoukas 2014].
  [[nodiscard]] double TorqueOnBody(int k) const {
    if (!IsWall()) {
      return block_.torque_iz[k];
    }
    return -body_.radius * (block_.nx[k] * block_.fy[k] - block_.ny[k] * block_.fx[k]) -
           block_.mz[k];
  }

  /// Of the stiffest oscillation of any lane, up to the overlap where the elastic force has taken
  /// up the energy of the normal motion.
  struct Rates {
    double elastic = 0;  ///< w = sqrt(k/m) [1/s]
    double damped = 0;   ///< c/m + sqrt((c/m)^2 + w^2), what an explicit step has to follow [1/s]
  };

  /// Memories stay empty: block.dt is zero.
  Rates FastestRates() {
    const double mass = 1.0 / (body_.inverse_mass + partner_.inverse_mass);
    double energy = 0;
    for (const Flight& f : flights_) {
      energy = std::max(energy, 0.5 * mass * f.vix * f.vix);
    }
    const double sum = body_.radius + (IsWall() ? 0.0 : partner_.radius);
    block_.dt = 0;
    double span = 1e-9 * body_.radius;  // 32 overlaps up to the span, doubled until they hold it
    for (;; span *= 2) {
      LoadBlock();
      for (int k = 0; k < kBlock; ++k) {
        block_.dx[k] = sum - span * (k + 1) / kBlock;
        block_.dy[k] = 0;
        block_.vx[k] = block_.vy[k] = block_.wiz[k] = 0;
      }
      model_.Evaluate(block_);
      double work = 0;
      for (int k = 0; k < kBlock; ++k) {
        work += block_.normal_force[k] * span / kBlock;
      }
      if (!(work < energy) || span > kDeepestGuess * body_.radius) {
        break;
      }
    }
    const double inertia = body_.radius * body_.radius * body_.inverse_inertia;
    const double across = 1.0 / mass + 2 * inertia;  // over the mass of a slip
    Rates rates;
    const auto take = [&rates](double w2, double damping) {
      rates.elastic = std::max(rates.elastic, std::sqrt(w2));
      rates.damped = std::max(rates.damped, damping + std::sqrt(damping * damping + w2));
    };
    for (int k = 0; k < kBlock; ++k) {
      take(block_.normal_stiffness[k] / mass, block_.normal_damping[k] / mass);
      take(block_.rolling_stiffness[k] * body_.inverse_inertia, 0);
      take(block_.tangential_stiffness[k] * across, block_.tangential_damping[k] * across);
    }
    for (auto& column : block_.own_history) {
      std::fill(std::begin(column), std::end(column), 0.0);
    }
    return rates;
  }

  ContactModel model_;
  ShearUnloading unloading_;
  std::stop_token stop_;
  Body body_, partner_;
  ContactBlock block_{};
  std::array<Flight, kBlock> flights_{};
  double dt_ = 0;
  double followed_ = 0;  ///< half periods that the bodies are given to part
  int impacts_ = 0;
  std::int64_t steps_ = 0;
};

/// Runs every reading of the path as a collision of its own, up to 32 at a time as lanes of one
/// block of contacts, with 5000 steps in half a period of the contact at its largest overlap (the
/// first order of the leapfrog's damping then stays below 1e-5 of restitution), in the order of the
/// path.
absl::StatusOr<Summary> Collide(const TestRun& test) {
  const Scenario& scenario = test.scenario;
  const std::vector<Impact> impacts = ImpactsOf(scenario);
  CollisionRun run(scenario, test.entries, test.stop);
  Summary summary;
  const auto& effects = scenario.model.effects;
  const bool formulas = std::any_of(
      scenario.model.user_effects.begin(), scenario.model.user_effects.end(),
      [&effects](const UserEffect& effect) {
        return std::find(effects.begin(), effects.end(), effect.info.name) != effects.end();
      });
  for (std::size_t first = 0; first < impacts.size(); first += kBlock) {
    const int count = static_cast<int>(std::min<std::size_t>(kBlock, impacts.size() - first));
    const bool finished = run.Run(&impacts[first], count);
    summary.steps = summary.contact_updates = run.steps();
    summary.time_step = run.time_step();
    if (const auto fault = run.Fault()) {
      const Impact& impact = impacts[first + static_cast<std::size_t>(fault->pair)];
      summary.outcome = Outcome::kDiverged;
      summary.reason = absl::StrCat("load step ", impact.load_step, " (angle ", impact.angle,
                                    ", speed ", impact.speed, "): ", fault->what);
      return summary;
    }
    if (!finished) {
      summary.outcome = Outcome::kStopped;
      return summary;
    }
    for (int k = 0; k < count; ++k) {
      const Impact& impact = impacts[first + static_cast<std::size_t>(k)];
      const State state = run.Observe(impact, k);
      const bool finite = std::all_of(state.values.begin(), state.values.end(),
                                      [](double v) { return std::isfinite(v); });
      const std::string too_deep = run.DepthProblem(k);
      const double energy = run.EnergyRestitution(state);
      const double given = run.GivenShare(impact, k);
      const bool gains = !formulas && energy > 1 + given + kRoundedEnergy;
      if (!run.separated(k) || !finite || gains || !too_deep.empty()) {
        summary.outcome = Outcome::kDiverged;
        summary.reason = absl::StrCat(
            "load step ", impact.load_step, " (angle ", impact.angle, ", speed ", impact.speed,
            ", spin ", impact.spin, "): ",
            !too_deep.empty() ? too_deep
            : !finite         ? "a velocity is not finite"
            : !run.separated(k)
                ? run.StillTouching()
                : absl::StrCat("the collision leaves ", energy,
                               " times the energy it began with, and the law gives no more than ",
                               1 + given,
                               ": its stiffness or damping is too large to be followed"));
        return summary;
      }
      RETURN_IF_ERROR(test.record.ReportLoadStep(state, nullptr));
    }
  }
  return summary;
}

/// Spin at normal incidence, bodies of too different sizes.
std::vector<std::string> Problems(const Scenario& scenario) {
  std::vector<std::string> problems;
  const double radius = SettingOf(scenario, "radius");
  const double partner = SettingOf(scenario, "partner_radius");
  if (std::isfinite(partner) && partner > kLargestRatio * radius) {
    problems.push_back(absl::StrCat("partner_radius is ", partner, " m, more than ", kLargestRatio,
                                    " times radius (", radius,
                                    " m): leave it out, the partner is then a wall"));
  } else if (radius > kLargestRatio * partner) {
    problems.push_back(absl::StrCat("partner_radius is ", partner, " m, radius ", radius,
                                    " m: allowed is at most ", kLargestRatio, " times as much"));
  }
  for (const Impact& impact : ImpactsOf(scenario)) {
    if (impact.spin != 0 && impact.angle <= kSmallestImpactAngle) {
      problems.push_back(absl::StrCat(
          "load step ", impact.load_step, ": with impact_spin the impact_angle must be above ",
          kSmallestImpactAngle,
          " rad, for tangential_restitution compares with the tangential velocity before"));
    }
  }
  return problems;
}

}  // namespace

/// A body of `radius` hits a body of the same material at rest, of `partner_radius` (infinite: a
/// flat wall that does not move), free of gravity. Spheres; with a `thickness` disks that move in
/// their plane (mass rho pi r^2 t, inertia m r^2/2) under the same law of force. Driven by
/// impact_angle, impact_speed or impact_spin: the one that is not a setting.
/// [Hadjidoukas et al. 2014, sec. 4]
TestEntry Collision() {
  return {.info = Info(), .place = 120, .procedure = &Collide, .problems = &Problems};
}

}  // namespace calib::dem
