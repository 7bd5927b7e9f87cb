#include "server/methods/iterative_bayesian_filter/filter.h"

#include "absl/strings/str_cat.h"
#include "inference/filter/iterative_filter.h"
#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/keys/bounds.h"

namespace calib::methods {
namespace {

using campaign::Word;

constexpr std::array kFirstDesignWords = {
    Word{inference::Design::kHalton, "halton"},
    Word{inference::Design::kSobol, "sobol"},
    Word{inference::Design::kLatinHypercube, "latin_hypercube"},
    Word{inference::Design::kSymmetricLatinHypercube, "symmetric_latin_hypercube"},
};

constexpr std::array kMixtureWords = {
    Word{inference::MixtureOver::kParameters, "parameters"},
    Word{inference::MixtureOver::kParametersAndStates, "parameters_and_states"},
};

}  // namespace

std::vector<campaign::Section> Filter::Keys() const {
  const inference::FilterOptions standard;
  const auto filters = [](const char* what) { return absl::StrCat("filters: ", what); };
  return {{"inference",
           "inference",
           {
               {"tolerance", campaign::Number("1", campaign::kFraction),
                absl::StrCat(standard.tolerance),
                filters("relative change of the means that ends the iterations")},
               {"ess_target", campaign::Number("1", campaign::kFraction),
                absl::StrCat(standard.ess_target),
                filters("share of effective samples of the weights that shape the next proposal")},
               {"design", campaign::OneWord(kFirstDesignWords),
                campaign::WordOf(kFirstDesignWords, standard.design),
                filters("first iteration; the symmetric one is the maximin of 1000")},
               {"defensive_share", campaign::Number("1", {.min = 0, .max = 1, .max_open = true}),
                absl::StrCat(standard.defensive_share), filters("of the prior in a proposal")},
               {"max_components", campaign::Whole(1, 1000), absl::StrCat(standard.max_components),
                filters("of the proposal's mixture")},
               {"concentration", campaign::Number("1", {.min = 0, .min_open = true}),
                absl::StrCat(standard.concentration), filters("of the proposal's mixture")},
               {"mixture", campaign::OneWord(kMixtureWords),
                campaign::WordOf(kMixtureWords, standard.mixture), filters("what it is fitted to")},
               {"reversed_path", campaign::TrueOrFalse(), "false",
                filters("also the posterior along the path from the last reading to the first")},
           }}};
}

void Filter::ReadFilterKeys(campaign::MapReader& inference, campaign::Campaign& campaign) {
  inference::FilterOptions& filter = campaign.filter;
  filter.tolerance = inference.Quantity("tolerance").value_or(filter.tolerance);
  filter.defensive_share = inference.Quantity("defensive_share").value_or(filter.defensive_share);
  filter.max_components =
      static_cast<int>(inference.Integer("max_components").value_or(filter.max_components));
  filter.concentration = inference.Quantity("concentration").value_or(filter.concentration);
  filter.mixture = inference.Choice("mixture", kMixtureWords).value_or(filter.mixture);
  filter.design = inference.Choice("design", kFirstDesignWords).value_or(filter.design);
  filter.reversed_path = inference.TrueOrFalse("reversed_path").value_or(filter.reversed_path);
  if (filter.noise != inference::NoiseMode::kEssTarget) {
    filter.ess_target = inference.Quantity("ess_target").value_or(filter.ess_target);
  } else if (inference.Has("ess_target")) {
    inference.Ignore({"ess_target"});
    inference.Problem("ess_target", "is given by noise: {ess_target: ...} already; remove it here");
  }
}

std::string Filter::ScatterLeftOut(const campaign::Campaign& campaign,
                                   const std::string& what) const {
  if (campaign.filter.noise != inference::NoiseMode::kInferred) return "";
  return absl::StrCat("With noise inferred ", what,
                      " is in no error of a posterior from weights: the factors take it for "
                      "noise of the readings. One from the emulator contains it, and with "
                      "noise: given it is measured and taken in.");
}

}  // namespace calib::methods
