#include <iterator>
#include <map>

#include "absl/strings/str_cat.h"
#include "server/campaign/keys/bounds.h"
#include "server/campaign/keys/sections.h"
#include "server/campaign/keys/words.h"
#include "server/campaign/model/campaign.h"
#include "server/campaign/model/words.h"

namespace calib::campaign {
namespace {

// "4; NAME, NAME: 1; NAME: 100"
std::string IterationsInWords(const MethodList& methods) {
  const int usual = methods.standard()->standard_iterations();
  std::map<int, std::string> others;
  for (const auto& method : methods.all()) {
    const int own = method->standard_iterations();
    if (own == usual || own == 0 || method->chosen_by() == ChosenBy::kRequest) continue;
    absl::StrAppend(&others[own], others[own].empty() ? "" : ", ", method->name());
  }
  std::string text = absl::StrCat(usual);
  for (const auto& [number, names] : others) absl::StrAppend(&text, "; ", names, ": ", number);
  return text;
}

// Of every method. Those that some do without say so where they are read.
std::vector<Key> CommonKeys(const MethodList& methods) {
  const Campaign standard;
  return {
      {"method", OneWord(methods.Names()), std::string(methods.standard()->name()),
       "how parameters are found"},
      {"samples", Whole(2, kMostSamples), absl::StrCat(standard.samples),
       "of an iteration; chains; points that a search starts from"},
      {"max_iterations", Whole(1, 1000), IterationsInWords(methods), "iterations, or stages"},
      {"replicates", Whole(0, 1000), "`realizations`, at most 16; one packing: 8",
       "how often the best estimate is run to measure scatter; 0: not"},
      {"first_proposal", MapOf("first_proposal"), "the prior", "where the first iteration looks"},
      {"decisions", OneWord(kDecisionsWords), WordOf(kDecisionsWords, standard.decisions),
       "with `early_stopping`, and where a method chooses while runs are under way: by what "
       "follows "
       "from results in their order, or by what has arrived"},
  };
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

Section InferenceSection(const MethodList& methods) {
  Section section{"inference", "inference", CommonKeys(methods)};
  for (const auto& method : methods.all()) {
    std::vector<Section> own = method->Keys();
    if (own.empty()) continue;
    for (Key& key : own.front().keys) {  // methods of one family have keys in common
      if (FindKey(section, key.name) == nullptr) section.keys.push_back(std::move(key));
    }
    std::move(own.begin() + 1, own.end(), std::back_inserter(section.of_keys));
  }
  return section;
}

std::vector<Section> SectionsOfInference() { return {FirstProposalKeys(), PlaceKeys(), Row()}; }

}  // namespace calib::campaign
