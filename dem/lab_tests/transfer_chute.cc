// `transfer_chute`: a belt feeds a funnel above a ridge; what falls to either side.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "dem/elementary/functions.h"
#include "dem/lab_tests/shared/gravity_run.h"
#include "dem/lab_tests/shared/gravity_test.h"
#include "dem/particles/clump_template.h"
#include "dem/particles/random_numbers.h"

namespace calib::dem {

namespace {

// Sizes of the chute that the test chooses, in largest grain diameters [-]. Chosen.
constexpr double kBeltWidth = 10;    ///< along y
constexpr double kBeltLength = 12;   ///< along the belt
constexpr double kPlate = 6;         ///< from the belt's end to the plate
constexpr double kFunnelTop = 7;     ///< radius at its top
constexpr double kFunnelBottom = 3;  ///< radius at its bottom
constexpr double kFunnelHeight = 7;
constexpr double kRidge = 6;           ///< height of the ridge
constexpr double kRidgeHalfWidth = 5;  ///< at its foot: 50 degrees steep
constexpr double kGap = 2;             ///< between ridge and funnel
constexpr double kWidth = 40;          ///< of the whole, along y
constexpr int kFunnel = 2;             ///< index of the funnel among the walls

/// Distance of the places of a row that is fed, in largest diameters [-]. Chosen: grains do not
/// touch.
constexpr double kPitch = 1.1;
/// Way of the belt until a row has made room for the next, in grain lengths [-]. Chosen: grains do
/// not touch.
constexpr double kRowLength = 1.2;
/// Largest angle of elongated grains to the belt [rad]. Chosen.
constexpr double kAskew = 5 * std::numbers::pi / 180;
/// Places of a row [-].
constexpr auto kPlaces = static_cast<std::size_t>((kBeltWidth - 1) / kPitch);

/// Turns a mesh about the line through `pivot` along x.
void TurnAboutX(double angle, const Vec3& pivot, TriangleMesh& mesh) {
  const double c = Cosine(angle);
  const double s = Sine(angle);
  for (Vec3& v : mesh.vertex) {
    const double y = v.y - pivot.y;
    const double z = v.z - pivot.z;
    v.y = pivot.y + c * y - s * z;
    v.z = pivot.z + s * y + c * z;
  }
}

struct Chute {
  double d = 0;
  double belt_z = 0;    ///< height of the belt's surface
  double belt_end = 0;  ///< x
  double middle = 0;    ///< y of ridge and belt
  std::vector<Wall> walls;
};

Chute Build(const GravityRun& run, double speed) {
  const double d = run.largest_diameter();
  Chute chute;
  chute.d = d;
  chute.middle = 0.5 * kWidth * d;
  const double m = chute.middle;
  const double shift_z = run.Setting("funnel_shift_z");
  chute.belt_end = kBeltLength * d;
  const TriangleMesh* own = run.Mesh("funnel");
  const double height = own != nullptr ? BoundsOf(*own).high.z / d : kFunnelHeight;
  chute.belt_z = (kRidge + kGap + height + 3) * d;
  const double half = 0.5 * kBeltWidth * d;

  TriangleMesh belt;
  AddQuad({0, m - half, chute.belt_z}, {chute.belt_end, m - half, chute.belt_z},
          {chute.belt_end, m + half, chute.belt_z}, {0, m + half, chute.belt_z}, belt);
  Wall belt_wall = MakeMeshWall("belt", belt);
  belt_wall.surface_velocity = {speed, 0, 0};
  belt_wall.friction = run.Setting("belt_friction");
  chute.walls.push_back(belt_wall);

  TriangleMesh guards;
  const double plate_x = chute.belt_end + kPlate * d;
  const double high = chute.belt_z + 20 * d;
  for (const double side : {-1.0, 1.0}) {
    const double y = m + side * half;
    AddQuad({0, y, chute.belt_z}, {plate_x, y, chute.belt_z}, {plate_x, y, high}, {0, y, high},
            guards);
  }
  AddQuad({0, m - half, chute.belt_z}, {0, m + half, chute.belt_z}, {0, m + half, high},
          {0, m - half, high}, guards);
  AddQuad({plate_x, m - half, chute.belt_z - d}, {plate_x, m + half, chute.belt_z - d},
          {plate_x, m + half, high}, {plate_x, m - half, high}, guards);
  chute.walls.push_back(MakeMeshWall("guards", guards));

  const Vec3 foot{plate_x - 0.5 * kPlate * d, m + run.Setting("funnel_shift_y"),
                  (kRidge + kGap) * d + shift_z};
  TriangleMesh funnel;
  if (own != nullptr) {
    funnel = Shifted(*own, foot);
  } else {
    AddFrustum({.centre = foot,
                .height = height * d,
                .lower_radius = kFunnelBottom * d,
                .upper_radius = kFunnelTop * d,
                .sides = 16},
               funnel);
  }
  TurnAboutX(run.Setting("funnel_angle"), {foot.x, foot.y, foot.z + height * d}, funnel);
  chute.walls.push_back(MakeMeshWall("funnel", funnel));

  TriangleMesh ridge;
  for (const double side : {-1.0, 1.0}) {
    const double foot_y = m + side * kRidgeHalfWidth * d;
    AddQuad({-kWidth * d, m, kRidge * d}, {2 * kWidth * d, m, kRidge * d},
            {2 * kWidth * d, foot_y, 0}, {-kWidth * d, foot_y, 0}, ridge);
  }
  chute.walls.push_back(MakeMeshWall("ridge", ridge));
  return chute;
}

/// Sets grains onto the belt's beginning in rows, at the feed rate, with the belt's speed.
class Feed {
 public:
  Feed(const GravityRun& run, const Chute& chute, double speed, double rate)
      : radii_(run.radii()),
        shape_(run.shape()),
        row_length_(kRowLength * run.largest_length()),
        chute_(chute),
        speed_(speed),
        density_(run.density()),
        rate_(rate),
        seed_(run.seed()) {}

  [[nodiscard]] bool done() const { return next_ >= radii_.size(); }

  /// Lets the grains join that are due at a time.
  void Act(double time, Assembly& assembly) {
    std::vector<NewGrain> row;
    const double d = chute_.d;
    const double pitch = kPitch * d;
    if (done() || time < ready_ || rate_ * time < fed_) {
      return;
    }
    for (std::size_t k = 0; k < kPlaces && !done(); ++k) {
      const double r = radii_[next_];
      const auto u = Uniform(seed_, kFeedDraw, static_cast<int>(next_), 0);
      const double y = chute_.middle +
                       (static_cast<double>(k) - 0.5 * static_cast<double>(kPlaces - 1)) * pitch +
                       0.04 * d * (2 * u[0] - 1);
      const Rotation along = LaidDown(kAskew * (2 * u[2] - 1));
      for (const Sphere& member : shape_.spheres) {
        const Sphere placed =
            Placed(member, along, r,
                   {1.0 * d + 0.02 * d * (2 * u[1] - 1), y, chute_.belt_z + r * member.radius});
        row.push_back({.centre = {placed.centre[0], placed.centre[1], placed.centre[2]},
                       .velocity = {speed_, 0, 0},
                       .radius = placed.radius,
                       .clump = shape_.spheres.size() > 1 ? static_cast<int>(next_) : -1});
      }
      fed_ += density_ * 4.0 / 3.0 * std::numbers::pi * r * r * r;
      ++next_;
    }
    ready_ = time + row_length_ / speed_;
    assembly.Insert(row);
  }

 private:
  const std::vector<double>& radii_;
  const ClumpTemplate& shape_;
  double row_length_;
  const Chute& chute_;
  double speed_, density_, rate_;
  std::uint64_t seed_;
  std::size_t next_ = 0;
  double fed_ = 0;
  double ready_ = 0;
};

/// Flow through one side between 20 and 80 % of what came through [kg/s]; empty where that came
/// all at once. The first grain begins the time in which the others follow.
std::optional<std::array<double, 2>> Sides(const std::vector<Drained>& drained, double middle) {
  const std::size_t first = drained.size() / 5;
  const std::size_t end = drained.size() - first;
  std::array<double, 2> mass = {0, 0};
  for (std::size_t k = first + 1; k < end; ++k) {
    mass[drained[k].y < middle ? 0 : 1] += drained[k].mass;
  }
  const double time = drained[end - 1].time - drained[first].time;
  if (!(time > 0)) {
    return std::nullopt;
  }
  return std::array<double, 2>{mass[0] / time, mass[1] / time};
}

StageEnd Convey(GravityRun& run, const ControlPoint& point) {
  const double speed = point.target;
  const double d = run.largest_diameter();
  if (!(speed >= std::sqrt(run.gravity() * d))) {
    return run.Fail(absl::StrCat("belt_speed is ", speed,
                                 " m/s, grains are thrown off the belt from sqrt(g d) = ",
                                 std::sqrt(run.gravity() * d), " m/s on"));
  }
  const Chute chute = Build(run, speed);
  double mean_mass = 0;
  for (const double r : run.radii()) {
    mean_mass += run.density() * 4.0 / 3.0 * std::numbers::pi * r * r * r;
  }
  mean_mass /= static_cast<double>(run.radii().size());
  const double rate = run.SettingOr("feed_rate", kBeltWidth / 3 * mean_mass * speed / d);
  const double largest_rate =
      static_cast<double>(kPlaces) * mean_mass * speed / (kRowLength * run.largest_length());
  if (rate > largest_rate) {
    return run.Fail(absl::StrCat("belt_speed ", speed, " m/s: feed_rate is ", rate,
                                 " kg/s, the belt carries at most ", largest_rate,
                                 " kg/s, a row of ", kPlaces, " grains every ", kRowLength,
                                 " of the largest grain's length"));
  }
  // The smallest and the largest grain stand far below as patterns for skin and step; they drain.
  const auto [smallest, largest] = std::minmax_element(run.radii().begin(), run.radii().end());
  Packing patterns;
  for (const auto& [r, side] : {std::pair{*smallest, -5 * d}, std::pair{*largest, 5 * d}}) {
    for (const Sphere& member : run.shape().spheres) {
      const Sphere placed = Placed(member, LaidDown(0), r, {0.0, chute.middle + side, -100 * d});
      patterns.x.push_back(placed.centre[0]);
      patterns.y.push_back(placed.centre[1]);
      patterns.z.push_back(placed.centre[2]);
      patterns.radius.push_back(placed.radius);
      patterns.clump.push_back(run.spheres_per_grain() == 1 ? -1 : side < 0 ? 0 : 1);
    }
  }
  patterns.length[0] = (kBeltLength + 2 * kPlate) * d;
  patterns.length[1] = kWidth * d;
  patterns.length[2] = chute.belt_z + 5 * d;
  Assembly assembly = run.MakeAssembly(patterns, {.walls = chute.walls});
  std::vector<int> all(patterns.x.size());
  std::iota(all.begin(), all.end(), 0);
  assembly.Remove(all);
  Feed feed(run, chute, speed, rate);
  feed.Act(0, assembly);
  const double fall = chute.belt_z + speed * speed / (2 * run.gravity());
  Flow flow = run.MakeFlow(assembly, {.drop_height = fall,
                                      .low = {-kWidth * d, -kWidth * d, -10 * d},
                                      .high = {2 * kWidth * d, 2 * kWidth * d, 10 * fall}});
  flow.SetDrain(-d);
  bool met = false;  // whether any grain has touched the funnel
  flow.SetBeforeStep([&](double time, double) {
    if (!met && time > 0) {
      const Vec3 force = assembly.walls().ForceOn(kFunnel);
      met = Dot(force, force) > 0;
    }
    feed.Act(time, assembly);
  });
  const double feeding = mean_mass * static_cast<double>(run.radii().size()) / rate;
  const double longest = 3 * feeding + 60 * std::sqrt(fall / run.gravity());
  StageEnd end = StageEnd::kDone;
  while (end == StageEnd::kDone && flow.time() < longest &&
         !(feed.done() && assembly.particles().size() == 0)) {
    end = flow.Advance(2 * run.fall_time());
    if (feed.done() && flow.drained().size() > 1 &&
        flow.time() - flow.drained().back().time > 40 * run.fall_time()) {
      break;  // what is left stays
    }
  }
  end = run.AddToSummary(end, flow, {}, absl::StrCat("belt_speed ", speed, " m/s"));
  if (end != StageEnd::kDone) {
    return end;
  }
  if (!met && run.Mesh("funnel") == nullptr) {  // a mesh may let the stream pass
    return run.Fail(absl::StrCat("belt_speed ", speed,
                                 " m/s: no grain met the funnel, which stands elsewhere: look at ",
                                 "funnel_shift_y and funnel_shift_z"));
  }
  const std::size_t through = flow.drained().size();
  if (2 * through < run.radii().size() || through < 10) {
    return run.Fail(absl::StrCat("belt_speed ", speed, " m/s: only ", through, " of ",
                                 run.radii().size(), " grains came through, the funnel blocks"));
  }
  const auto sides = Sides(flow.drained(), chute.middle);
  if (!sides) {
    return run.Fail(absl::StrCat("belt_speed ", speed,
                                 " m/s: all grains between 20 and 80 % came through in one step, "
                                 "no flow can be told"));
  }
  const auto [left, right] = *sides;
  return run.Report(point, {speed, left, right, std::abs(left - right)}, assembly);
}

StageEnd Walk(GravityRun& run) {
  return run.Walk([&](const ControlPoint& point) { return Convey(run, point); });
}

}  // namespace

TestEntry TransferChute() {
  return {
      .info =
          {.name = "transfer_chute",
           .description = "Grains are fed onto a belt that throws them against a plate; "
                          "they fall through a funnel onto a ridge that "
                          "divides them to the left (y < 0) and the right. Control: "
                          "belt_speed. The funnel can be shifted along y and z "
                          "and turned about the belt's direction. Flows are those between "
                          "20 and 80 % of the grains that came through. "
                          "Fails when a grain escapes, when none meets the funnel or when "
                          "it blocks (fewer than half of the grains come through)",
           .settings = WithCommonSettings(
               {Setting("funnel_angle", "rad", {.value = 0, .min = -0.5, .max = 0.5},
                        "of the funnel about the belt's direction"),
                Setting("funnel_shift_y", "m", {.value = 0, .min = -100, .max = 100},
                        "of the funnel to the right"),
                Setting("funnel_shift_z", "m", {.value = 0, .min = -100, .max = 100},
                        "of the funnel upwards"),
                Setting("belt_friction", "1", {.value = 0.7, .min = 0, .max = 14},
                        "coefficient of friction on the belt"),
                Chosen("feed_rate", "kg/s",
                       "onto the belt; 0: a layer that covers a third of the belt; at most 8 "
                       "grains of mean mass every 1.2 largest diameters of the belt")}),
           .observables = {"belt_speed", "mass_flow_left", "mass_flow_right",
                           "mass_flow_difference"},
           .control = "belt_speed",
           .may_reverse = true,
           .reference = "Samuelsson 2023, sec. 4.3",
           .poured = true,
           .separate_points = true,
           .control_range = ControlRange{.min = 0, .max = 100},
           .meshes = {{.name = "funnel",
                       .description =
                           "replaces the funnel (a solid, or a sheet that ends in two flat rims "
                           "and nowhere else), and the belt runs three largest grain "
                           "diameters above its highest point. Origin: the middle of the "
                           "lower opening, below which nothing reaches; x along the belt, "
                           "z upwards; the settings shift and turn it"}},
           .has_walls = true,
           .fed_in = true,
           .bodies = {"walls"}},
      .place = 100,
      .procedure = GravityProcedure(&Walk)};
}

}  // namespace calib::dem
