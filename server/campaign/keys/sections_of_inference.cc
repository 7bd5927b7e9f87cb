#include "absl/strings/str_cat.h"
#include "server/campaign/keys/bounds.h"
#include "server/campaign/keys/sections.h"
#include "server/campaign/keys/words.h"
#include "server/campaign/model/campaign.h"
#include "server/campaign/model/words.h"

namespace calib::campaign {
namespace {

constexpr const char* kFilters = "filters: ";
constexpr const char* kChains = "tmcmc: ";
constexpr const char* kSearch = "surrogate_msrs: ";

Section Inference() {
  const Campaign standard;
  const auto text = [](auto number) { return absl::StrCat(number); };
  const auto filters = [](const char* what) { return absl::StrCat(kFilters, what); };
  const auto chains = [](const char* what) { return absl::StrCat(kChains, what); };
  const auto search = [](const char* what) { return absl::StrCat(kSearch, what); };
  return {
      "inference",
      "inference",
      {
          {"method", OneWord(kMethodWords), WordOf(kMethodWords, standard.method),
           "how parameters are found"},
          {"samples", Whole(2, kMostSamples), text(standard.samples),
           "of an iteration; chains (20 or more); points of the design (2 d + 1 or more of d "
           "parameters)"},
          {"max_iterations", Whole(1, 1000), absl::StrCat(standard.max_iterations, "; tmcmc 100"),
           "iterations, or stages; sqmc: 1"},
          {"replicates", Whole(0, 1000), "`realizations`, at most 16; one packing: 8",
           "how often the best estimate is run to measure scatter; 0: not"},
          {"first_proposal", MapOf("first_proposal"), "the prior",
           "where the first iteration looks"},
          {"tolerance", Number("1", kFraction), text(standard.filter.tolerance),
           filters("relative change of the means that ends the iterations")},
          {"ess_target", Number("1", kFraction), text(standard.filter.ess_target),
           filters("share of effective samples of the weights that shape the next proposal")},
          {"design", OneWord(kDesignWords), WordOf(kDesignWords, standard.filter.design),
           filters("first iteration; the symmetric one is the maximin of 1000")},
          {"defensive_share", Number("1", {.min = 0, .max = 1, .max_open = true}),
           text(standard.filter.defensive_share), filters("of the prior in a proposal")},
          {"max_components", Whole(1, 1000), text(standard.filter.max_components),
           filters("of the proposal's mixture")},
          {"concentration", Number("1", kPositive), text(standard.filter.concentration),
           filters("of the proposal's mixture")},
          {"mixture", OneWord(kMixtureWords), WordOf(kMixtureWords, standard.filter.mixture),
           filters("what it is fitted to")},
          {"reversed_path", TrueOrFalse(), "false",
           filters("also the posterior along the path from the last reading to the first")},
          {"freeze", MapOf("freeze"), "nothing", "iterative filter: what iterations hold"},
          {"decisions", OneWord(kDecisionsWords), WordOf(kDecisionsWords, standard.decisions),
           "with `early_stopping`, and of surrogate_msrs: by what follows from results in their "
           "order, or by what has arrived"},
          {"steps", Whole(1, 1000), "three a parameter, at least 10",
           chains("Metropolis steps per stage")},
          {"target_cv", Number("1", {.min = 0, .max = 2, .min_open = true}),
           text(standard.tmcmc.target_cv), chains("variation of a stage's weights")},
          {"surrogate", OneWord(kSurrogateModelWords),
           WordOf(kSurrogateModelWords, standard.surrogate),
           search("what predicts the misfit; the second by expected improvement")},
          {"termination", AnyOf({Number("1", {.min = 4, .max = 1e6}), OneWord({"off"})}),
           text(*standard.termination),
           search("a run ends when its misfit exceeds this times the best run's")},
          {"in_flight", Whole(1, 1000), text(standard.in_flight), search("runs under way at most")},
          {"race", OneOrMore(Text()), "none",
           "design: effects that a run may have, none of them in `model.effects`"},
          {"rows", ListOf(MapOf("row")), "table: required; else none",
           absl::StrCat("table, design (at most ", kMostRowsOfBatch,
                        "), iterative filter: runs to be made")},
      }};
}

Section FirstProposalKeys() {
  return {"first_proposal",
          "inference.first_proposal",
          {
              {"prior_share", Number("1", {.min = 0, .max = 1}),
               absl::StrCat(FirstProposal{}.prior_share),
               "share of the prior in the first "
               "iteration"},
              {"NAME", MapOf("place"), "the prior's width", "where a parameter is looked for"},
          }};
}

Section PlaceKeys() {
  return {"place",
          "inference.first_proposal.NAME",
          {
              {"center", NumberOfCatalogue(), kRequired, "where samples are drawn"},
              {"sd", NumberOfCatalogue(), kRequired, "how widely"},
          }};
}

Section FreezeKeys() {
  return {"freeze",
          "inference.freeze",
          {{"ITERATION", OneOrMore(Text()), "",
            "parameters held from this iteration on; `converged`: those whose mean the iteration "
            "before left alone"}}};
}

Section Row() {
  return {"row",
          "inference.rows[]",
          {
              {"like", Whole(0, 1'000'000), "own number",
               "the sample whose specimen and seed the run takes"},
              {"NAME", NumberOfCatalogue(), kRequired, "value of a parameter, every one"},
          }};
}

}  // namespace

std::vector<Section> SectionsOfInference() {
  return {Inference(), FirstProposalKeys(), PlaceKeys(), FreezeKeys(), Row()};
}

}  // namespace calib::campaign
