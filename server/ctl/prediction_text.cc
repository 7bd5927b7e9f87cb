// A prediction as JSON and as text.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "dem/registry/catalog.h"
#include "server/ctl/prediction.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

using Eigen::Index;
using Json = nlohmann::json;

std::string UnitOf(const std::string& observable) {
  const dem::ObservableInfo* info = dem::FindObservable(observable);
  return info != nullptr ? info->unit : "1";
}

Json At(const Eigen::VectorXd& values, Index k) {
  return k < values.size() ? Json(values[k]) : Json(nullptr);
}

Json OrNull(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

}  // namespace

std::string PredictionJson(const Prediction& prediction) {
  Json observables = Json::array();
  for (const PredictedObservable& o : prediction.observables) {
    Json points = Json::array();
    for (std::size_t i = 0; i < o.control.size(); ++i) {
      const auto k = static_cast<Index>(i);
      points.push_back({{"load_step", i},
                        {"control", o.control[i]},
                        {"mean", o.quantity.mean[k]},
                        {"sd", o.quantity.sd[k]},
                        {"q05", o.quantity.q05[k]},
                        {"q50", o.quantity.q50[k]},
                        {"q95", o.quantity.q95[k]},
                        {"sd_parameters", OrNull(o.quantity.sd_parameters[k])},
                        {"sd_model_error", OrNull(o.quantity.sd_model[k])},
                        {"sd_noise", At(o.sd_noise, k)},
                        {"sd_discrepancy", At(o.discrepancy.rms, k)},
                        {"discrepancy_mean", At(o.discrepancy.mean, k)},
                        {"measured", o.measured.empty() ? Json(nullptr) : Json(o.measured[i])}});
    }
    Json exceedance = Json::array();
    for (const auto& e : o.exceedance) {
      exceedance.push_back(
          {{"level", e.level},
           {"probability", std::vector<double>(e.probability.begin(), e.probability.end())},
           {"anywhere", e.anywhere}});
    }
    observables.push_back({{"experiment", o.experiment},
                           {"observable", o.observable},
                           {"unit", UnitOf(o.observable)},
                           {"control", o.control_name},
                           {"points", points},
                           {"exceedance", exceedance}});
  }
  return Json{{"campaign", prediction.parent},
              {"prediction", prediction.campaign},
              {"runs", prediction.runs},
              {"predictions", observables},
              {"notes", prediction.notes}}
             .dump(2) +
         "\n";
}

std::string PredictionText(const Prediction& prediction) {
  std::string text = fmt::format("Prediction {} from the posterior of {}: {} runs.\n",
                                 prediction.campaign, prediction.parent, prediction.runs);
  for (const PredictedObservable& o : prediction.observables) {
    report::TextTable table(
        {o.control_name, "mean", "5 %", "95 %", "± parameters", "± model", "± noise", "measured"});
    const std::string unit = UnitOf(o.observable);
    const auto shown = [&](double value) {
      return std::isfinite(value) ? report::NumberWithUnit(value, o.observable, unit, 4) : "–";
    };
    for (std::size_t i = 0; i < o.control.size(); ++i) {
      const auto k = static_cast<Index>(i);
      table.AddRow({report::NumberWithUnit(o.control[i], o.control_name, UnitOf(o.control_name), 4),
                    shown(o.quantity.mean[k]), shown(o.quantity.q05[k]), shown(o.quantity.q95[k]),
                    shown(o.quantity.sd_parameters[k]), shown(o.quantity.sd_model[k]),
                    i < static_cast<std::size_t>(o.sd_noise.size()) ? shown(o.sd_noise[k]) : "–",
                    o.measured.empty() || std::isnan(o.measured[i]) ? "–" : shown(o.measured[i])});
    }
    text += fmt::format("\n{}, {}\n{}", o.experiment, o.observable, table.ToString());
    for (const auto& e : o.exceedance) {
      text += fmt::format("Probability to exceed {}: at most {} at a reading, {} of the runs do.\n",
                          shown(e.level), report::Number(e.probability.maxCoeff(), 3),
                          report::Percent(e.anywhere, 3));
    }
  }
  const bool noisy = std::any_of(prediction.observables.begin(), prediction.observables.end(),
                                 [](const auto& o) { return o.sd_noise.size() > 0; });
  if (noisy) {
    text +=
        "\nThe band and the probability at a reading are those of a measurement with its noise.\n";
  }
  for (const std::string& note : prediction.notes) text += report::Wrapped(note, "! ", "  ");
  return text;
}

}  // namespace calib::ctl
