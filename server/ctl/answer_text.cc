#include "server/ctl/answer_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "dem/registry/catalog.h"
#include "server/client/progress.h"
#include "server/messages/read_words.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"
#include "server/report/views/residual_words.h"

namespace calib::ctl {
namespace {

using report::Number;

std::string UnitOf(const std::string& observable) {
  const dem::ObservableInfo* info = dem::FindObservable(observable);
  return info != nullptr ? info->unit : "1";
}

// What an rms of residual / sd means.
std::string Verdict(double rms, const std::optional<double>& p_value) {
  if (p_value && *p_value < 0.01) return "misses by more than the errors explain";
  if (rms > 1.5) {
    return p_value && *p_value > 0.05 ? "far off, but no rarer than the scatter allows"
                                      : "misses by more than one expects";
  }
  if (rms < 0.3) return "closer than the stated errors: are they too large?";
  return "fits within its errors";
}

// Whether halves of an emulator's runs gave a posterior each, so that they could be compared.
bool HalvesGiveOne(const v1::Posterior& posterior) {
  return std::any_of(posterior.parameters().begin(), posterior.parameters().end(),
                     [](const auto& p) { return std::isfinite(p.split_half()); });
}

// What an emulator of the runs tells of a quantity, a sentence.
std::string Explained(const report::Quantity& q) {
  if (std::isnan(q.prior.explained)) {
    return fmt::format("{} runs, which all give {}.", q.runs,
                       report::NumberWithUnit(q.prior.mean, q.name, q.unit, 4));
  }
  if (!q.prior.Explains()) {
    return fmt::format(
        "{} runs, of whose variance an emulator explains {}: what moves it cannot be told.", q.runs,
        q.prior.explained > 0 ? report::Percent(q.prior.explained, 2) : "none");
  }
  return fmt::format("{} runs, of whose variance an emulator predicts {} left out.", q.runs,
                     report::Percent(q.prior.explained, 3));
}

}  // namespace

namespace {

// Of the parameters that are wanted, or of the others; empty: there are none.
std::string ParametersText(const v1::Posterior& posterior, bool nuisance) {
  report::TextTable table({nuisance ? "<nuisance" : "<parameter", "mean", "± sd", "cov", "5 %",
                           "50 %", "95 %", "<unit", "<"});
  bool any = false;
  const auto add = [&](const v1::Posterior::Parameter& p) {
    if (p.nuisance() != nuisance || campaign::IsScoreName(p.name())) return;
    any = true;
    const report::DisplayUnit unit = report::UnitForPeople(p.name(), p.unit(), std::abs(p.mean()));
    const auto shown = [&unit](double value, int digits) {
      return Number(value * unit.factor, digits);
    };
    table.AddRow({p.name(), shown(p.mean(), 4), shown(p.sd(), 2), report::Percent(p.cov(), 2),
                  shown(p.q05(), 4), shown(p.q50(), 4), shown(p.q95(), 4), unit.label,
                  p.conditioned_on() ? "held (conditioned on)"
                  : p.at_bound()     ? "at a bound of the prior"
                                     : ""});
  };
  for (const auto& p : posterior.parameters()) add(p);
  for (const auto& p : posterior.members()) add(p);
  return any ? table.ToString() : "";
}

}  // namespace

std::string PosteriorText(const v1::Posterior& posterior,
                          const std::vector<std::string>& warnings) {
  std::string text = ParametersText(posterior, false);
  if (const std::string nuisance = ParametersText(posterior, true); !nuisance.empty()) {
    absl::StrAppend(&text, text.empty() ? "" : "\n", nuisance);
  }
  text += fmt::format(
      "\n{} after {} iteration{}; {} effective samples{}, log evidence {} ± {}{}, {} model "
      "evaluations",
      posterior.converged() ? "Converged" : "Not converged", posterior.iterations(),
      posterior.iterations() == 1 ? "" : "s", Number(posterior.ess(), 3),
      messages::SourceOf(posterior) == campaign::PosteriorSource::kEmulator
          ? ", posterior sampled on an emulator"
          : "",
      Number(posterior.log_evidence(), 5), Number(posterior.log_evidence_se(), 2),
      messages::SourceOf(posterior) != campaign::PosteriorSource::kEmulator ? ""
      : HalvesGiveOne(posterior) ? " (what halves of the emulator's runs differ by is in it)"
                                 : " (of its sampling; the emulator's own error is not known)",
      posterior.model_evaluations());
  if (posterior.stopped_early() > 0) {
    text += fmt::format(" ({} stopped early)", posterior.stopped_early());
  }
  text += ".\n";
  if (posterior.has_measured_loss()) {
    text += report::Wrapped(
        fmt::format("Stopping early may have lost {} of the posterior mass. Audit: {} stopped and "
                    "run to the end all the same might have held {}, and held {}.",
                    Number(posterior.stated_loss(), 2), posterior.audited(),
                    Number(posterior.audited_bound(), 2), Number(posterior.measured_loss(), 2)),
        "", "  ");
  }
  for (const auto& scale : posterior.noise_scale()) {
    text += report::Wrapped(
        fmt::format("Errors of {} are {} times as large as stated (5-95 %: {} to {}).",
                    fmt::join(scale.observables(), ", "), Number(scale.q50(), 2),
                    Number(scale.q05(), 2), Number(scale.q95(), 2)),
        "", "  ");
  }
  for (const auto& error : posterior.model_error()) {
    std::vector<std::string> parts;
    const auto add = [&parts](const v1::Posterior::ModelError::Size& size, double scale,
                              const char* of) {
      parts.push_back(fmt::format("{}{} (5-95 %: {} to {})", Number(scale * size.q50(), 2), of,
                                  Number(scale * size.q05(), 2), Number(scale * size.q95(), 2)));
    };
    if (error.has_relative()) add(error.relative(), 100, " % of a reading");
    if (error.has_absolute()) add(error.absolute(), 1, " in the unit of the readings, SI");
    text += report::Wrapped(
        fmt::format("Beside the stated errors the model is off in {} by {}, one "
                    "standard deviation.",
                    fmt::join(error.observables(), ", "), fmt::join(parts, " and ")),
        "", "  ");
  }
  for (const std::string& warning : warnings) text += report::Wrapped(warning, "! ", "  ");
  return text;
}

std::string TableText(const v1::CampaignStatus& status) {
  const std::string diverged =
      status.samples_diverged() > 0 ? fmt::format(" ({} diverged)", status.samples_diverged()) : "";
  return fmt::format(
      "{} rows run{}, {} model evaluations, nothing inferred.\nSee `calibctl samples {}`, "
      "`calibctl "
      "states {}` and `calibctl export {}`.\n",
      status.samples_done(), diverged, status.model_evaluations(), status.campaign(),
      status.campaign(), status.campaign());
}

std::string ComparisonText(const report::Comparison& comparison) {
  if (comparison.by_observable.empty()) {
    return "There is nothing to compare yet: no sample with weight has reached a reading.\n";
  }
  std::string text =
      fmt::format("Error of the fitted data: {} sd", Number(comparison.rms_error, 3));
  if (comparison.reduced_chi2) {
    text += fmt::format(", reduced chi-squared {}", Number(*comparison.reduced_chi2, 3));
  }
  if (comparison.p_value) text += fmt::format(" (p = {})", Number(*comparison.p_value, 2));
  if (comparison.predictive_p) {
    text += fmt::format(", posterior predictive p {}", Number(*comparison.predictive_p, 2));
  }
  text += ".\n";
  if (comparison.heldout_rms_error) {
    text += fmt::format("Error of the held-out data, never fitted: {} sd.\n",
                        Number(*comparison.heldout_rms_error, 3));
  }
  if (!comparison.note.empty()) text += report::Wrapped(comparison.note, "", "");
  for (const std::string& warning : comparison.warnings)
    text += report::Wrapped(warning, "! ", "  ");
  report::TextTable observables({"<experiment", "<observable", "readings", "error", "scatter/noise",
                                 "residual", "z", "p", "<"});
  for (const report::ObservableMisfit& m : comparison.by_observable) {
    observables.AddRow(
        {m.experiment + (m.heldout ? " (held out)" : ""), m.observable, std::to_string(m.readings),
         Number(m.rms_error, 3), m.scatter_from.empty() ? "–" : Number(m.scatter, 2),
         report::NumberWithUnit(m.rms_residual, m.observable, UnitOf(m.observable), 3),
         m.z ? Number(*m.z, 2) : "–", m.p_value ? Number(*m.p_value, 2) : "–",
         m.z ? Verdict(m.rms_error, m.p_value) : ""});
  }
  report::TextTable segments({"<experiment", "<observable", "<stage", "model − measured", "z",
                              "error", "p", "chi2", "<shape"});
  for (const report::SegmentMisfit& m : comparison.by_segment) {
    segments.AddRow(
        {m.experiment + (m.heldout ? " (held out)" : ""), m.observable, m.segment,
         report::NumberWithUnit(m.bias, m.observable, UnitOf(m.observable), 3),
         m.z ? Number(*m.z, 3) : "–", Number(m.rms_error, 3),
         m.p_value ? Number(*m.p_value, 2) : "–",
         m.chi2_share ? report::Percent(*m.chi2_share, 2) : "–",
         m.pattern.shape == report::ResidualShape::kNone ? "" : ToString(m.pattern.shape)});
  }
  text += "\n" + observables.ToString() + "\n" + segments.ToString();
  for (const std::string& line : report::WhereItFails(comparison)) {
    text += report::Wrapped(line, "\n! ", "  ");
  }
  if (comparison.parameter_drift.empty()) return text;
  report::TextTable drift({"<parameter", "<experiment", "<stage", "fitted alone", "± sd", "z"});
  for (const report::ParameterDrift& d : comparison.parameter_drift) {
    for (const report::PartialFit& fit : d.fits) {
      const report::DisplayUnit unit =
          report::UnitForPeople(d.parameter, d.unit, std::abs(fit.mean));
      drift.AddRow(
          {d.parameter, fit.experiment, fit.segment.empty() ? "all" : fit.segment,
           Number(fit.mean * unit.factor, 4) + (unit.label.empty() ? "" : " " + unit.label),
           Number(fit.sd * unit.factor, 2), Number(fit.z, 2)});
    }
  }
  return text + "\n" + drift.ToString();
}

std::string ModelsText(const report::ModelComparison& comparison) {
  report::TextTable table({"<campaign", "<name", "log evidence", "± se", "ln Bayes factor", "± se",
                           "probability", "5 %", "95 %"});
  for (const report::ComparedModel& m : comparison.models) {
    const inference::ModelProbability& p = m.probability;
    table.AddRow({m.campaign, m.name, Number(m.log_evidence, 6), Number(m.log_evidence_se, 2),
                  Number(p.log_bayes_factor, 4), Number(p.log_bayes_factor_se, 2),
                  Number(p.probability, 3), Number(p.q05, 3), Number(p.q95, 3)});
  }
  std::string text = table.ToString();
  text += "\nBayes factors are to the first; all models are equally probable before the data.\n";
  for (const std::string& warning : comparison.warnings)
    text += report::Wrapped(warning, "! ", "  ");
  return text;
}

std::string SensitivityText(const report::Sensitivity& sensitivity) {
  const auto with_error = [](const Eigen::VectorXd& values, const Eigen::VectorXd& errors, int j) {
    if (j >= values.size() || !std::isfinite(values[j])) return std::string("–");
    return fmt::format("{:.2f} ± {}", values[j],
                       std::isfinite(errors[j]) ? fmt::format("{:.2f}", errors[j]) : "–");
  };
  std::string text;
  for (const report::Quantity& q : sensitivity.quantities) {
    text += fmt::format("{}, {}: {}\n", q.experiment, report::NameForPeople(q.name), Explained(q));
    if (!q.prior.Explains()) {
      text += "\n";
      continue;
    }
    if (q.posterior.correlation.size() > 0) {
      text += fmt::format("Posterior: {} ± {}.\n",
                          report::NumberWithUnit(q.posterior.mean, q.name, q.unit, 4),
                          report::NumberWithUnit(q.posterior.sd, q.name, q.unit, 2));
    }
    if (q.prior.out_of_reach) {
      text += "The runs cover too little of the prior to say what moves it there.\n";
    }
    report::TextTable table(
        {"<parameter", "first order", "total", "rank corr., prior", "posterior"});
    for (int j = 0; j < static_cast<int>(sensitivity.parameters.size()); ++j) {
      table.AddRow({sensitivity.parameters[static_cast<std::size_t>(j)],
                    with_error(q.prior.indices.first, q.prior.indices.first_error, j),
                    with_error(q.prior.indices.total, q.prior.indices.total_error, j),
                    with_error(q.prior.correlation, q.prior.correlation_error, j),
                    with_error(q.posterior.correlation, q.posterior.correlation_error, j)});
    }
    text += table.ToString() + "\n";
  }
  if (!sensitivity.independent) {
    text += report::Wrapped(
        "Sobol indices need parameters that are independent before the data: the "
        "priors here are correlated or constrained.",
        "! ", "  ");
  }
  for (const std::string& what : sensitivity.left_out) text += report::Wrapped(what, "! ", "  ");
  for (const std::string& warning : sensitivity.warnings)
    text += report::Wrapped(warning, "! ", "  ");
  return text;
}

std::string StatusText(const v1::CampaignStatus& s) {
  return fmt::format("{}  {}{}{}\n{}\n{} model evaluations so far, {} core hours, method {}.\n",
                     s.campaign(), s.name(), s.owner().empty() ? "" : ", of " + s.owner(),
                     s.priority() == 0 ? "" : fmt::format(", priority {}", s.priority()),
                     client::ProgressText(s), s.model_evaluations(), Number(s.core_hours(), 3),
                     s.method()) +
         (s.has_kept_states()
              ? fmt::format("It was pruned: the states of {} samples are kept.\n", s.kept_states())
              : "") +
         (s.problem().empty() ? "" : report::Wrapped(s.problem(), "! ", "  ")) +
         (s.nobody_may().empty()
              ? ""
              : report::Wrapped("Nothing runs: " + s.nobody_may() + ".", "! ", "  ")) +
         (s.server_waits().empty() ? "" : report::Wrapped(s.server_waits(), "! ", "  "));
}

}  // namespace calib::ctl
