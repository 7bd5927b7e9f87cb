#include "tests/unit/report/example_diagnosis.h"

#include <cmath>
#include <nlohmann/json.hpp>

namespace calib::report::testing {
namespace {

using Json = nlohmann::json;

// A softening beyond 4 % strain and its mirror image before.
Json Curves(const CampaignView& view, double strength) {
  const campaign::Experiment& fitted = view.campaign.experiments.front();
  Json ratio = Json::array(), volume = Json::array();
  for (const double strain : fitted.control) {
    ratio.push_back(-strength * 0.08 * std::tanh((strain - 0.04) / 0.02));
    volume.push_back(strength * 0.02 * strain);
  }
  return {{{"experiment", fitted.name}, {"observable", "q_over_p"}, {"change", ratio}},
          {{"experiment", fitted.name}, {"observable", "volumetric_strain"}, {"change", volume}}};
}

Json Candidate(const char* effect, double probability, const Json& curves) {
  return {{"effect", effect},
          {"probability", probability},
          {"alone", false},
          {"p_value", 0.0004},
          {"explained_fraction", 0.83},
          {"predicted_rms_error", 1.07},
          {"amplitude", {{std::string(effect) + ".strength", 0.31}}},
          {"confusable_with", {"twisting_resistance"}},
          {"curves", curves}};
}

}  // namespace

std::string ExampleDiagnosis(const CampaignView& view) {
  const Json document = {
      {"campaign", "c1"},
      {"verdict", "ambiguous"},
      {"effect", nullptr},
      {"sentence",
       "One of these two, 97 %: contact_plasticity or twisting_resistance; which of them, these "
       "tests cannot tell."},
      {"probabilities",
       {{{"effects", {"contact_plasticity"}}, {"probability", 0.61}},
        {{"effects", {"twisting_resistance"}}, {"probability", 0.36}},
        {{"effects", Json::array()}, {"probability", 0.011}},
        {{"effects", {"contact_plasticity", "membrane"}}, {"probability", 0.004}},
        {{"effects", {"other"}}, {"probability", 0.005}}}},
      {"none_of_these", 0.01},
      {"credible_set",
       Json::array({Json::array({"contact_plasticity"}), Json::array({"twisting_resistance"})})},
      {"families",
       {{{"effects", {"contact_plasticity", "twisting_resistance"}}, {"probability", 0.974}}}},
      {"specimens", {{"repeat_names_alone", 0.8}}},
      {"candidates",
       {Candidate("contact_plasticity", 0.614, Curves(view, 1)),
        Candidate("twisting_resistance", 0.36, Curves(view, 0.8)),
        Candidate("<b>membrane", 0.004, Json::array())}},
      {"adequacy", {{"chi2", 431}, {"degrees", 76}, {"p_value", 1e-9}, {"rms", 2.4}}},
      {"units", {{"contact_plasticity.strength", "1"}}},
      {"only_adequacy", false},
      {"warnings", Json::array()}};
  return document.dump();
}

}  // namespace calib::report::testing
