#include "dem/particles/grading.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "dem/elementary/functions.h"

namespace calib::dem {
namespace {

/// Where a log-normal curve is cut off, to either side, in standard deviations [-]. Chosen: 4.6 %
/// of the mass lies beyond.
constexpr double kCutOff = 2;
/// Points of a log-normal curve [-]. Chosen: a tenth of a standard deviation apart.
constexpr int kLogNormalPoints = 41;

double Cube(double r) { return r * r * r; }

// Between two points of the curve, from the coarse end: with the mass even in ln r the number of
// grains coarser than r is (r^-3 - coarse^-3) per_ln / 3 (a grain of radius r has the mass r^3).
struct Segment {
  double fine = 0, coarse = 0;  // radii
  double per_ln = 0;            // mass per ln r
  double number = 0, mass = 0;  // within
};

std::vector<Segment> FromCoarseEnd(const Grading& curve) {
  std::vector<Segment> segments;
  for (std::size_t k = curve.size() - 1; k > 0; --k) {
    const GradingPoint& fine = curve[k - 1];
    const GradingPoint& coarse = curve[k];
    const double mass = coarse.finer - fine.finer;
    if (!(mass > 0)) {
      continue;
    }
    const double per_ln = mass / Log(coarse.radius / fine.radius);
    segments.push_back({.fine = fine.radius,
                        .coarse = coarse.radius,
                        .per_ln = per_ln,
                        .number = per_ln / 3 * (1 / Cube(fine.radius) - 1 / Cube(coarse.radius)),
                        .mass = mass});
  }
  return segments;
}

// Mass of the `number` coarsest grains of a segment.
double MassOfCoarsest(const Segment& s, double number) {
  const double radius = 1 / CubeRoot(1 / Cube(s.coarse) + 3 * number / s.per_ln);
  return s.per_ln * Log(s.coarse / radius);
}

}  // namespace

bool IsGrading(const Grading& curve) {
  if (curve.size() < 2 || !(curve.front().radius > 0) || curve.front().finer != 0 ||
      curve.back().finer != 1 || !std::isfinite(curve.back().radius)) {
    return false;
  }
  for (std::size_t k = 1; k < curve.size(); ++k) {
    if (!(curve[k].radius > curve[k - 1].radius) || !(curve[k].finer >= curve[k - 1].finer)) {
      return false;
    }
  }
  return true;
}

std::vector<double> GradedRadii(const Grading& curve, int particles) {
  const std::vector<Segment> segments = FromCoarseEnd(curve);
  double total = 0;
  for (const Segment& s : segments) {
    total += s.number;
  }
  std::vector<double> radii;
  std::size_t at = 0;  // segment in which a stratum ends
  double number_before = 0;
  double mass_before = 0;
  double last_mass = 0;
  for (int k = 1; k <= particles; ++k) {
    const double number = total * k / particles;
    while (at + 1 < segments.size() && number > number_before + segments[at].number) {
      number_before += segments[at].number;
      mass_before += segments[at].mass;
      ++at;
    }
    const double within = std::min(number - number_before, segments[at].number);
    const double mass = mass_before + MassOfCoarsest(segments[at], within);
    const double radius = CubeRoot((mass - last_mass) * particles / total);
    radii.push_back(std::clamp(radius, curve.front().radius, curve.back().radius));
    last_mass = mass;
  }
  return radii;
}

double LargestShare(const std::vector<double>& radii) {
  double sum = 0;
  double largest = 0;
  for (const double r : radii) {
    sum += Cube(r);
    largest = std::max(largest, Cube(r));
  }
  return largest / sum;
}

Grading LogNormalGrading(double median, double log_sd) {
  const auto finer = [](double z) { return 0.5 * (1 + ErrorFunction(z / std::numbers::sqrt2)); };
  Grading curve;
  for (int k = 0; k < kLogNormalPoints; ++k) {
    const double z = kCutOff * (2.0 * k / (kLogNormalPoints - 1) - 1);
    curve.push_back({.radius = median * Exp(log_sd * z),
                     .finer = (finer(z) - finer(-kCutOff)) / (finer(kCutOff) - finer(-kCutOff))});
  }
  curve.front().finer = 0;
  curve.back().finer = 1;
  return curve;
}

}  // namespace calib::dem
