#include "server/campaign/keys/bounds.h"
#include "server/campaign/keys/sections.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {
namespace {

Section File() {
  return {
      "campaign",
      "the file",
      {
          {"name", Text(), kRequired, "of the campaign", "one line, 1 to 200 characters"},
          {"model", MapOf("model"), kRequired,
           "contact, effects, fixed parameters; or runs made elsewhere"},
          {"parameters", MapOf("parameters"), kRequired, "what is calibrated, one at least"},
          {"prior_correlation", ListOf(ListOf(AnyOf({Text(), Number("1")}))), "independent",
           "ties between priors: correlations of normal scores",
           "list of `[NAME, NAME, number]`, number between -1 and 1"},
          {"constraints", ListOf(Text()), "none", "ties between priors",
           "list of inequalities between sums of `NAME`, `NUMBER * NAME`, `NUMBER`"},
          {"experiments", ListOf(MapOf("experiment")), kRequired,
           "measurements and the lab tests that reproduce them; one at least with `role: "
           "calibrate`"},
          {"noise", AnyOf({OneWord({"given", "inferred"}), MapOf("noise")}), "given",
           "how errors of readings are treated"},
          {"inference", MapOf("inference"), "filter, 100 samples, 4 iterations",
           "method and its options"},
          {"early_stopping", AnyOf({OneWord({"off", "none", "false"}), MapOf("early_stopping")}),
           "off", "when runs that cannot count end"},
          {"failure", MapOf("failure"), "", "what becomes of runs that fail"},
          {"resources", MapOf("resources"), "a slot of its worker",
           "what one run needs, and may take at most"},
          {"budget", MapOf("budget"), "none", "what the campaign may cost"},
          {"seed", Seed(), "0", "of everything random"},
          {"lineage", MapOf("lineage"), "none",
           "where a derived campaign comes from; written by `diagnose`, `extend`, `improve`"},
      }};
}

Section Noise() {
  return {"noise",
          "noise",
          {
              {"inferred", ListOf(MapOf("noise_group")), "",
               "one factor on the errors of each group; what stands in no group has its own"},
              {"model_error", ListOf(MapOf("model_error")), "",
               "what the model is off by, inferred beside the stated errors [Hadjidoukas 2014]"},
              {"ess_target", Number("1", kFraction), "",
               "errors scale with the reading until this share of the samples is effective "
               "[Cheng 2019]"},
          }};
}

Section NoiseGroup() {
  return {"noise_group",
          "noise.inferred[]",
          {
              {"observables", OneOrMore(Text()), kRequired,
               "whose errors share one factor: NAME of every fitted experiment, or "
               "EXPERIMENT.NAME"},
              {"shape", Number("1", kPositive), "0.5",
               "a of the factor's prior, f^(-a-1) exp(-b/f) [Hadjidoukas 2014]"},
              {"rate", Number("1", kPositive), "0.5", "b of it"},
          }};
}

Section ModelErrorKeys() {
  return {"model_error",
          "noise.model_error[]",
          {
              {"observables", OneOrMore(Text()), kRequired,
               "what the model is off in by the same: NAME of every fitted experiment, or "
               "EXPERIMENT.NAME"},
              {"relative", MapOf("error_scale"), "none",
               "standard deviation over the size of a reading"},
              {"absolute", MapOf("error_scale"), "none",
               "standard deviation in the unit of the readings"},
          }};
}

Section EarlyStoppingKeys() {
  return {"early_stopping",
          "early_stopping",
          {
              {"discard_at_most", AnyOf({Number("1", kFraction), OneWord({"off"})}), kRequired,
               "posterior mass that stopping early may lose"},
              {"exponent", Number("1", kShare), "that which guides proposals",
               "of the likelihood whose mass is meant; 1: the posterior's own"},
              {"rungs", ListOf(Number("1", kFraction)), "none",
               "rising shares of load steps where all samples rest until those that still count "
               "go on; filters"},
          }};
}

Section FailureKeys() {
  return {"failure",
          "failure",
          {
              {"attempts", Whole(1, 100), "5",
               "tries of a run whose worker was lost, or whose program failed"},
              {"pause_above", Number("1", kShare), "0.25",
               "share of diverged and unknown samples that pauses the campaign"},
              {"at_limit", OneWord({"failed", "diverged"}), "failed",
               "what a program is that comes to one of `model.limits`"},
          }};
}

Section ResourceKeys() {
  return {"resources",
          "resources",
          {
              {"threads", Whole(1, kMostThreadsOfRun), "those of a slot", "that a run uses"},
              {"memory", Text(), "that of a slot",
               "resident, e.g. 1 GB; a run that comes to have more is ended"},
              {"wall", Number("s", kPositive), "none",
               "time of a run of the DEM; a program has `model.limits`"},
              {"silence", Number("s", kPositive), "24 h", "time without a load step, likewise"},
          }};
}

Section BudgetKeys() {
  return {"budget",
          "budget",
          {
              {"model_evaluations", Whole(1, 1'000'000'000), "none",
               "has to allow the first iteration"},
              {"core_hours", Number("1", kPositive), "none", "processor time of all runs"},
          }};
}

Section LineageKeys() {
  return {"lineage",
          "lineage",
          {
              {"parent", Text(), kRequired, "id of the campaign this one comes from"},
              {"purpose", Text(), kRequired, "why it was derived"},
          }};
}

}  // namespace

std::vector<Section> SectionsOfCampaign() {
  return {File(),        Noise(),        NoiseGroup(), ModelErrorKeys(), EarlyStoppingKeys(),
          FailureKeys(), ResourceKeys(), BudgetKeys(), LineageKeys()};
}

}  // namespace calib::campaign
