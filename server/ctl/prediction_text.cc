// A prediction as JSON and as text.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "server/ctl/prediction.h"
#include "server/report/text/people_units.h"
#include "server/report/text/text_table.h"

namespace calib::ctl {
namespace {

using Eigen::Index;
using Json = nlohmann::json;

Json At(const Eigen::VectorXd& values, Index k) {
  return k < values.size() ? Json(values[k]) : Json(nullptr);
}

// Probabilities at which the distribution of a quantity is told.
constexpr std::array kQuantiles = {0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99};
constexpr int kStepsOfCdf = 20;  // from 0.025 to 0.975

struct Distribution {
  std::vector<Eigen::VectorXd> quantiles;               // by kQuantiles, at each reading
  std::vector<std::pair<double, Eigen::VectorXd>> cdf;  // probability, values at each reading
};

Distribution DistributionOf(const inference::QuantityPrediction& quantity) {
  Distribution distribution;
  for (const double p : kQuantiles)
    distribution.quantiles.push_back(inference::QuantileOf(quantity, p));
  for (int i = 0; i < kStepsOfCdf; ++i) {
    const double p = (i + 0.5) / kStepsOfCdf;
    distribution.cdf.emplace_back(p, inference::QuantileOf(quantity, p));
  }
  return distribution;
}

Json QuantilesAt(const Distribution& distribution, Index k) {
  Json quantiles = Json::object();
  for (std::size_t i = 0; i < kQuantiles.size(); ++i)
    quantiles[fmt::format("{}", kQuantiles[i])] = distribution.quantiles[i][k];
  return quantiles;
}

Json CdfAt(const Distribution& distribution, Index k) {
  Json cdf = Json::array();
  for (const auto& [p, values] : distribution.cdf) cdf.push_back({values[k], p});
  return cdf;
}

Json Numbers(const Eigen::VectorXd& values) {
  Json list = Json::array();
  for (const double value : values) list.push_back(std::isfinite(value) ? Json(value) : nullptr);
  return list;
}

Json OrNull(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

}  // namespace

std::string PredictionJson(const Prediction& prediction) {
  Json observables = Json::array();
  for (const PredictedObservable& o : prediction.observables) {
    const Distribution distribution = DistributionOf(o.quantity);
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
                        {"quantiles", QuantilesAt(distribution, k)},
                        {"cdf", CdfAt(distribution, k)},
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
           {"parameter_part", Numbers(e.parts.parameters)},
           {"model_part", Numbers(e.parts.model)},
           {"anywhere", e.anywhere}});
    }
    observables.push_back({{"experiment", o.experiment},
                           {"observable", o.observable},
                           {"unit", o.unit},
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
    const std::string& unit = o.unit;
    const auto shown = [&](double value) {
      return std::isfinite(value) ? report::NumberWithUnit(value, o.observable, unit, 4) : "–";
    };
    for (std::size_t i = 0; i < o.control.size(); ++i) {
      const auto k = static_cast<Index>(i);
      table.AddRow({report::NumberWithUnit(o.control[i], o.control_name, o.control_unit, 4),
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
