#include "server/report/views/residual_words.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dem/registry/catalog.h"
#include "server/report/text/people_units.h"

namespace calib::report {
namespace {

constexpr double kDrifts = 0.01;   // p of equal parameters
constexpr double kLargeRms = 1.5;  // residual / sd
constexpr double kStays = 0.95;    // probability of a discrepancy
constexpr double kAlike = 0.7;

std::string Shown(double value, const std::string& observable) {
  const dem::ObservableInfo* info = dem::FindObservable(observable);
  return NumberWithUnit(value, observable, info != nullptr ? info->unit : "1", 2);
}

std::string ShapeInWords(const SegmentMisfit& m) {
  const ResidualPattern& p = m.pattern;
  if (p.shape == ResidualShape::kOffset) return "a constant offset";
  if (p.shape == ResidualShape::kSlope) {
    const bool grows = (p.size > 0) == (m.to > m.from);
    return fmt::format("model minus measurement {} along the stage", grows ? "grows" : "falls");
  }
  if (p.shape == ResidualShape::kAmplitude) {
    // residual = model - measurement = size * model, so that model / measurement = 1 / (1 - size).
    const double factor = 1 / (1 - p.size);
    if (factor < 0) return "the model goes the other way than the measurement throughout";
    return fmt::format("the model is {} by the factor {} throughout",
                       factor > 1 ? "too large" : "too small", Number(factor, 3));
  }
  if (p.shape == ResidualShape::kLag)
    return fmt::format("the model answers too {}", p.size > 0 ? "late" : "early");
  if (p.shape == ResidualShape::kIrregular) return "no simple shape";
  return "";
}

bool StandsOut(const SegmentMisfit& m) {
  return m.z && (std::abs(*m.z) > kClear ||
                 (m.pattern.shape != ResidualShape::kNone && m.rms_error > kLargeRms));
}

std::string StageSentence(const SegmentMisfit& m) {
  std::string text = fmt::format(
      "{}, {}, {}: the model is too {} by {} on average ({} sd; error {} sd", m.experiment,
      NameForPeople(m.observable), NameForPeople(m.segment), m.bias > 0 ? "high" : "low",
      Shown(std::abs(m.bias), m.observable), Number(std::abs(*m.z), 2), Number(m.rms_error, 2));
  if (m.chi2_share) {
    text += fmt::format(", {} of {} misfit", Percent(*m.chi2_share, 2),
                        m.heldout ? "the held-out" : "the");
  }
  const std::string shape = ShapeInWords(m);
  return text + ")" + (shape.empty() ? "." : "; " + shape + ".");
}

std::string DriftSentence(const ParameterDrift& d) {
  const bool between = d.p_experiments && *d.p_experiments < kDrifts;
  const double p = between ? *d.p_experiments : *d.p_segments;
  std::string text =
      fmt::format("{} would have to change between {} (p = {})", NameForPeople(d.parameter),
                  between ? "the experiments" : "the stages of loading", Number(p, 2));
  if (between && !d.trend_with.empty()) {
    text += fmt::format(": it {} with {} by {} per factor ten", d.trend > 0 ? "grows" : "falls",
                        NameForPeople(d.trend_with),
                        NumberWithUnit(std::abs(d.trend), d.parameter, d.unit, 2));
  }
  return text + ", the mark of missing physics.";
}

std::string DiscrepancySentence(const ObservableDiscrepancy& d) {
  const dem::ObservableInfo* control = dem::FindObservable(d.control_name);
  const auto along = [&](double value) {
    return NumberWithUnit(value, d.control_name, control != nullptr ? control->unit : "1", 2);
  };
  const std::string way = d.throughout ? "is much the same along the whole path"
                                       : fmt::format("changes over about {} of {}", along(d.length),
                                                     NameForPeople(d.control_name));
  std::string text = fmt::format(
      "{}, {}: beyond noise and scatter a smooth misfit of about {} stays, which {}; it is largest "
      "at {} ({}), where the model is too {} by {} ± {}",
      d.experiment, NameForPeople(d.observable), Shown(d.amplitude, d.observable), way,
      along(d.largest_at), NameForPeople(d.segment), d.mean[d.largest] > 0 ? "high" : "low",
      Shown(std::abs(d.mean[d.largest]), d.observable), Shown(d.sd[d.largest], d.observable));
  if (d.experiments > 1 && d.alike > kAlike) text += ", much the same in all experiments";
  if (d.experiments > 1 && d.alike < 1 - kAlike) text += ", another in each experiment";
  return text + ".";
}

}  // namespace

std::vector<std::string> WhereItFails(const Comparison& comparison) {
  std::vector<const SegmentMisfit*> bad;
  for (const SegmentMisfit& m : comparison.by_segment) {
    if (StandsOut(m)) bad.push_back(&m);
  }
  std::stable_sort(bad.begin(), bad.end(), [](const SegmentMisfit* a, const SegmentMisfit* b) {
    return a->heldout != b->heldout ? b->heldout
                                    : a->chi2_share.value_or(0) > b->chi2_share.value_or(0);
  });
  if (bad.size() > static_cast<std::size_t>(kMostStages)) bad.resize(kMostStages);
  std::vector<std::string> sentences;
  sentences.reserve(comparison.prior_conflicts.size());
  for (const PriorConflict& conflict : comparison.prior_conflicts) {
    sentences.push_back(InWords(conflict));
  }
  for (const SegmentMisfit* m : bad) sentences.push_back(StageSentence(*m));
  std::vector<const ObservableDiscrepancy*> smooth;
  for (const ObservableDiscrepancy& d : comparison.discrepancies) {
    if (!d.heldout && d.probability > kStays) smooth.push_back(&d);
  }
  std::stable_sort(smooth.begin(), smooth.end(), [](const auto* a, const auto* b) {
    return a->log_bayes_factor > b->log_bayes_factor;
  });
  if (smooth.size() > static_cast<std::size_t>(kMostStages)) smooth.resize(kMostStages);
  for (const ObservableDiscrepancy* d : smooth) sentences.push_back(DiscrepancySentence(*d));
  for (const BiasTrend& t : comparison.trends) {
    sentences.push_back(
        fmt::format("{}, {}: model minus measurement {} with {}, by {} per factor ten ({} sd).",
                    NameForPeople(t.observable), NameForPeople(t.segment),
                    t.per_decade > 0 ? "grows" : "falls", NameForPeople(t.with),
                    Shown(std::abs(t.per_decade), t.observable), Number(std::abs(t.z), 2)));
  }
  for (const std::string& name : comparison.at_bound) {
    sentences.push_back(
        fmt::format("{} is pressed against a bound of its prior.", NameForPeople(name)));
  }
  for (const ParameterDrift& d : comparison.parameter_drift) {
    if ((d.p_experiments && *d.p_experiments < kDrifts) ||
        (d.p_segments && *d.p_segments < kDrifts)) {
      sentences.push_back(DriftSentence(d));
    }
  }
  return sentences;
}

}  // namespace calib::report
