// Every mistake a user can make in a campaign file: one line each, with file, line, key, what is
// wrong and what is allowed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/methods/registry.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using testing::GoodFiles;
using testing::GoodYaml;
using ::testing::HasSubstr;
using testing::ProblemsOf;
using testing::ReaderOf;
using testing::Spoiled;
using ::testing::StartsWith;

struct Mistake {
  const char* name;
  const char* from;
  const char* to;
  const char* expected;  // the whole output, without the last newline
};

class BadCampaign : public ::testing::TestWithParam<Mistake> {};

TEST_P(BadCampaign, IsRefusedInOneLine) {
  const Mistake& mistake = GetParam();
  EXPECT_EQ(ProblemsOf(Spoiled(mistake.from, mistake.to)), std::string(mistake.expected) + "\n");
}

INSTANTIATE_TEST_SUITE_P(
    TiedPriors, BadCampaign,
    ::testing::Values(
        Mistake{"CorrelationOfNobody", "noise: given",
                "prior_correlation: [[young_modulus, friction, 0.5]]\nnoise: given",
                "c.yaml:35: prior_correlation: 'friction' is not calibrated here; calibrated are "
                "young_modulus, friction_angle, rolling_resistance.stiffness, "
                "rolling_resistance.friction"},
        Mistake{
            "CorrelationOfOne", "noise: given",
            "prior_correlation: [[young_modulus, friction_angle, 1]]\nnoise: given",
            "c.yaml:35: prior_correlation: '1' is outside what is allowed: between -1 (excluded) "
            "and 1 (excluded)"},
        Mistake{
            "CorrelationTwice", "noise: given",
            "prior_correlation:\n  - [young_modulus, friction_angle, 0.5]\n  - [friction_angle, "
            "young_modulus, 0.4]\nnoise: given",
            "c.yaml:37: prior_correlation: the correlation of friction_angle and young_modulus "
            "is given twice"},
        Mistake{"CorrelationsContradict", "noise: given",
                "prior_correlation: [[young_modulus, friction_angle, 0.9], [young_modulus, "
                "rolling_resistance.friction, 0.9], [friction_angle, rolling_resistance.friction, "
                "-0.9]]\nnoise: given",
                "c.yaml:35: prior_correlation: these correlations contradict each other: their "
                "matrix is not positive definite; weaken one of them"},
        Mistake{"ConstraintOnNobody", "noise: given",
                "constraints: [rolling_resistance.friction <= 2 * friction]\nnoise: given",
                "c.yaml:35: constraints: 'friction' is not calibrated here; calibrated are "
                "young_modulus, friction_angle, rolling_resistance.stiffness, "
                "rolling_resistance.friction"},
        Mistake{"ConstraintOfOtherUnits", "noise: given",
                "constraints:\n  - rolling_resistance.friction <= friction_angle\nnoise: given",
                "c.yaml:36: constraints: 'friction_angle' is in rad, what stands before it in 1; "
                "give its number the unit that is missing"},
        Mistake{"ConstraintWithoutInequality", "noise: given",
                "constraints: [rolling_resistance.friction = 0.2]\nnoise: given",
                "c.yaml:35: constraints: 'rolling_resistance.friction = 0.2' is no constraint; "
                "write one inequality, e.g. friction_angle <= 2 * other"},
        Mistake{"ConstraintsLeaveNothing", "noise: given",
                "constraints: [friction_angle >= 50 deg]\nnoise: given",
                "c.yaml:35: constraints: the constraints leave a share of 0 of the prior; at least "
                "0.0001 is needed: loosen them or move the priors."},
        Mistake{"NoiseGroupOfNobody", "noise: given",
                "noise:\n  inferred:\n    - {observables: [porosity]}",
                "c.yaml:37: noise.inferred[1].observables: 'porosity' is not fitted in any "
                "experiment; fitted are stress_ratio, volumetric_strain, alone or as "
                "EXPERIMENT.NAME"},
        Mistake{"NoiseGroupTwice", "noise: given",
                "noise:\n  inferred:\n    - {observables: [stress_ratio]}\n    - {observables: "
                "[tx02.stress_ratio]}",
                "c.yaml:38: noise.inferred[2].observables: 'tx02.stress_ratio' stands in two "
                "groups; its errors have one factor"},
        Mistake{"NoiseGroupsNoList", "noise: given", "noise: {inferred: yes}",
                "c.yaml:35: noise.inferred: has to be a list of groups, each with its observables; "
                "without groups write noise: inferred"},
        Mistake{"FreezeInTheFirstIteration", "max_iterations: 3}",
                "max_iterations: 3, freeze: {0: [young_modulus]}}",
                "c.yaml:36: inference.freeze.0: is no iteration after the first; allowed: 1 to 2 "
                "(the first is 0)"},
        Mistake{"AdaptiveStagingOften", "    control: axial_strain\n",
                "    control: axial_strain\n    staging: {adaptive: often}\n",
                "c.yaml:22: experiments[1].staging.adaptive: 'often' is unknown; allowed: true, "
                "false"},
        Mistake{"FreezeNobody", "max_iterations: 3}",
                "max_iterations: 3, freeze: {1: [youngs_modulus]}}",
                "c.yaml:36: inference.freeze: 'youngs_modulus' is not calibrated here; write names "
                "of parameters, or converged alone"},
        Mistake{"FreezeWithConstraints", "max_iterations: 3}",
                "max_iterations: 3, freeze: {1: converged}}\nconstraints: "
                "[rolling_resistance.friction <= 2 1/rad * friction_angle]",
                "c.yaml:37: constraints: does not go with inference.freeze: parameters can be held "
                "only where the priors are independent of each other"}),
    [](const auto& mistake) { return std::string(mistake.param.name); });

INSTANTIATE_TEST_SUITE_P(
    Table, BadCampaign,
    ::testing::Values(
        Mistake{"UnknownTopKey", "seed: 7", "sede: 7",
                "c.yaml:40: sede: is an unknown key; did you mean 'seed'?"},
        Mistake{"UnknownModelKey", "  density: 2650", "  densty: 2650",
                "c.yaml:5: model.densty: is an unknown key; did you mean 'density'?"},
        Mistake{"KeyTwice", "seed: 7", "seed: 7\nseed: 8",
                "c.yaml:41: seed: stands here twice; keep one"},
        Mistake{
            "NoSuchContact", "hertz_mindlin\n", "hertz_mindln\n",
            "c.yaml:3: model.contact: 'hertz_mindln' is unknown; did you mean 'hertz_mindlin'?"},
        Mistake{"ShearUnloadingIsNoWord", "  density: 2650 kg/m^3",
                "  density: 2650 kg/m^3\n  shear_unloading: rescale",
                "c.yaml:6: model.shear_unloading: 'rescale' is unknown; did you mean 'rescaled'?"},
        Mistake{"MistypedEffectIsOneProblem", "[rolling_resistance]", "[roling_resistance]",
                "c.yaml:4: model.effects: 'roling_resistance' is not an effect of this build; did "
                "you mean "
                "'rolling_resistance'?"},
        Mistake{"EffectTwice", "[rolling_resistance]", "[rolling_resistance, rolling_resistance]",
                "c.yaml:4: model.effects: rolling_resistance is named twice"},
        Mistake{"WrongUnit", "min: 1e8 Pa", "min: 1e8 deg",
                "c.yaml:8: parameters.young_modulus.min: deg is an angle (deg, rad), expected a "
                "pressure (Pa, kPa, MPa, "
                "GPa)"},
        Mistake{"UpsideDown", "min: 10 deg, max: 45 deg", "min: 45 deg, max: 10 deg",
                "c.yaml:9: parameters.friction_angle.min: the prior is upside down: min 0.785398 "
                "is not below max "
                "0.174533 rad"},
        Mistake{"LogPriorFromZero", "min: 1e8 Pa", "min: 0 Pa",
                "c.yaml:8: parameters.young_modulus.min: a log_uniform prior needs a min greater "
                "than 0; use uniform for "
                "ranges that hold 0"},
        Mistake{"NoSuchPrior", "prior: log_uniform", "prior: loguniform",
                "c.yaml:8: parameters.young_modulus.prior: 'loguniform' is unknown; did you mean "
                "'log_uniform'?"},
        Mistake{"PriorWithoutMax", ", max: 45 deg", "",
                "c.yaml:9: parameters.friction_angle.max: is missing; the prior uniform needs it"},
        Mistake{"PriorOutsideAdmissible", "max: 45 deg", "max: 95 deg",
                "c.yaml:9: parameters.friction_angle: the prior from 0.174533 to 1.65806 leaves "
                "what is admissible: "
                "between 0 and 1.5 rad"},
        Mistake{"PriorCutAway", "{prior: uniform, min: 10 deg, max: 45 deg}",
                "{prior: normal, mean: 70 deg, sd: 1 deg, max: 45 deg}",
                "c.yaml:9: parameters.friction_angle.prior: only a share of 3.1e-138 of this prior "
                "lies between -inf and 0.785398; at least 0.0001 is needed: move its mean or the "
                "bounds, or widen its sd"},
        Mistake{"PriorBeyondTheAdmissible", "{prior: uniform, min: 10 deg, max: 45 deg}",
                "{prior: normal, mean: 100 deg, sd: 1 deg}",
                "c.yaml:9: parameters.friction_angle: only a share of 3.5e-45 of this prior lies "
                "between 0 and 1.5; at least 0.0001 is needed: move its mean or the bounds, or "
                "widen its sd"},
        Mistake{"FixedOutsideAdmissible", "poisson_ratio: 0.2", "poisson_ratio: 0.7",
                "c.yaml:6: model.fixed.poisson_ratio: '0.7' is outside what is allowed: between 0 "
                "and 0.5"},
        Mistake{"NotANumber", "poisson_ratio: 0.2", "poisson_ratio: soft",
                "c.yaml:6: model.fixed.poisson_ratio: 'soft' is not a number, expected a "
                "dimensionless number (plain, or "
                "percent)"},
        Mistake{"MissingParameter",
                "  young_modulus: {prior: log_uniform, min: 1e8 Pa, max: 1e11 Pa}\n", "",
                "c.yaml:7: parameters: young_modulus has no value; calibrate it here or set it in "
                "model.fixed"},
        Mistake{"BothAlternatives", "{poisson_ratio: 0.2}",
                "{poisson_ratio: 0.2, friction_coefficient: 0.5}",
                "c.yaml:7: parameters: friction_angle and friction_coefficient say the same thing; "
                "give one of them"},
        Mistake{
            "CalibratedAndFixed", "{poisson_ratio: 0.2}",
            "{poisson_ratio: 0.2, young_modulus: 1 GPa}",
            "c.yaml:7: parameters: young_modulus is both calibrated and fixed; keep one of them"},
        Mistake{"NegativeDensity", "2650 kg/m^3", "-2650 kg/m^3",
                "c.yaml:5: model.density: '-2650 kg/m^3' is outside what is allowed: greater than "
                "0 kg/m^3"},
        Mistake{"NegativeStress", "confining_pressure: 0.2 MPa", "confining_pressure: -0.2 MPa",
                "c.yaml:15: experiments[1].confining_pressure: '-0.2 MPa' is outside what is "
                "allowed: between 0 "
                "(excluded) and 1e+10 Pa"},
        Mistake{"MissingSetting", "    confining_pressure: 0.2 MPa\n", "",
                "c.yaml:13: experiments[1].confining_pressure: is missing; triaxial_drained needs "
                "it: isotropic stress to "
                "which the packing is compressed before loading"},
        Mistake{"DataFileMissing", "file: data.txt", "file: nowhere.txt",
                "c.yaml:18: experiments[1].data.file: cannot read 'nowhere.txt': no such file; "
                "relative paths start at "
                "the folder of the campaign file"},
        Mistake{
            "PressureWithoutItsUnit", "confining_pressure: 0.2 MPa", "confining_pressure: 0.2",
            "c.yaml:15: experiments[1].confining_pressure: is 0.2 Pa, for no unit stands there; "
            "write it, e.g. 0.2 MPa"},
        Mistake{"PackingMissing", "{file: packing.txt}", "{file: no.txt}",
                "c.yaml:16: experiments[1].packing.file: cannot read 'no.txt': no such file; "
                "relative paths start at the "
                "folder of the campaign file"},
        Mistake{"NoSuchColumn", "axial_strain: e_z,", "axial_strain: ez,",
                "data.txt:2: ez: is not a column of this file; did you mean 'e_z'?"},
        Mistake{"NoSuchObservableName", "columns: {axial_strain: e_z,",
                "columns: {axial_strain: e_z, volume_strain: e_v,",
                "c.yaml:19: experiments[1].data.columns: 'volume_strain' is not an observable (our "
                "name: column in the "
                "file); did you mean 'volumetric_strain'?"},
        Mistake{"ForgottenPercent", "units: {axial_strain: percent, volumetric_strain: percent}",
                "units: {axial_strain: percent}",
                "data.txt:7: e_v: a strain of -1.9 is not possible; if the column is in percent, "
                "say so: units: "
                "{volumetric_strain: percent}"},
        Mistake{"UnitOfAnotherKind", "units: {axial_strain: percent,", "units: {axial_strain: MPa,",
                "c.yaml:20: experiments[1].data.units.axial_strain: MPa is a pressure (Pa, kPa, "
                "MPa, GPa), expected a "
                "dimensionless number (plain, or percent)"},
        Mistake{"ControlOfAnotherTest", "control: axial_strain\n", "control: volumetric_strain\n",
                "c.yaml:21: experiments[1].control: 'volumetric_strain' cannot drive "
                "triaxial_drained; it is driven by "
                "axial_strain"},
        Mistake{"ControlMissing", "    control: axial_strain\n", "",
                "c.yaml:13: experiments[1].control: is missing; the model is driven along it, e.g. "
                "control: axial_strain"},
        Mistake{"RelativeNoiseAtZero", "{absolute: 0.1 percent, correlation_length: 0.5 percent}",
                "{relative: 0.1}",
                "c.yaml:24: experiments[1].observables.volumetric_strain.noise.relative: "
                "volumetric_strain reaches zero "
                "(data.txt:3), where a relative error vanishes; add floor: ... or give absolute or "
                "per-point noise"},
        Mistake{"NoiseMissing", "{noise: {relative: 0.05}}", "{}",
                "c.yaml:33: experiments[2].observables.q_over_p.noise: is missing; e.g. {relative: "
                "0.02, floor: 0.01}, "
                "{absolute: 0.1 percent} or {column: sd}"},
        Mistake{"NoiseTwice", "{relative: 0.02, floor: 0.01}", "{relative: 0.02, absolute: 0.01}",
                "c.yaml:23: experiments[1].observables.stress_ratio.noise: needs exactly one of "
                "relative (with floor), "
                "absolute, column and "
                "covariance"},
        Mistake{"NegativeNoise", "{relative: 0.02, floor", "{relative: -0.02, floor",
                "c.yaml:23: experiments[1].observables.stress_ratio.noise.relative: '-0.02' is "
                "outside what is allowed: "
                "greater than 0"},
        Mistake{
            "NoSuchRole", "role: calibrate", "role: calibration",
            "c.yaml:25: experiments[1].role: 'calibration' is unknown; did you mean 'calibrate'?"},
        Mistake{"SameName", "name: tx05", "name: tx02",
                "c.yaml:26: experiments[2].name: 'tx02' is the name of two experiments"},
        Mistake{"SizesTwice", "radii: {mean: 1 mm, spread: 0.2}",
                "radii: {mean: 1 mm}, diameters: {mean: 2 mm}",
                "c.yaml:29: experiments[2].packing.generate.diameters: and radii say the same "
                "thing; give one of them"},
        Mistake{"SizesInTwoForms", "{mean: 1 mm, spread: 0.2}", "{mean: 1 mm, median: 1 mm}",
                "c.yaml:29: experiments[2].packing.generate.radii: needs exactly one of mean (and "
                "spread), cumulative, and median (and log_sd)"},
        Mistake{"GradingIsNoList", "{mean: 1 mm, spread: 0.2}", "{cumulative: {1 mm: 0}}",
                "c.yaml:29: experiments[2].packing.generate.radii.cumulative: is no list of two or "
                "more points [size, share of the mass that is finer], e.g. [[0.5 mm, 0], [1 mm, "
                "0.4], [2 mm, 1]]"},
        Mistake{"GradingInPercentWithoutSayingSo", "{mean: 1 mm, spread: 0.2}",
                "{cumulative: [[1 mm, 0], [2 mm, 100]]}",
                "c.yaml:29: experiments[2].packing.generate.radii.cumulative[2]: '100' is outside "
                "what is allowed: between 0 and 1"},
        Mistake{"GradingInDisorder", "{mean: 1 mm, spread: 0.2}",
                "{cumulative: [[1 mm, 0], [3 mm, 0.5], [2 mm, 1]]}",
                "c.yaml:29: experiments[2].packing.generate.radii.cumulative: point 3 is no larger "
                "than point 2; sizes have to increase"},
        Mistake{"GradingFalls", "{mean: 1 mm, spread: 0.2}",
                "{cumulative: [[1 mm, 0], [2 mm, 0.5], [3 mm, 0.4], [4 mm, 1]]}",
                "c.yaml:29: experiments[2].packing.generate.radii.cumulative: less is finer than "
                "point 3 than is finer than point 2; shares of the mass that is finer cannot fall"},
        Mistake{"GradingWithoutSmallest", "{mean: 1 mm, spread: 0.2}",
                "{cumulative: [[1 mm, 0.05], [2 mm, 1]]}",
                "c.yaml:29: experiments[2].packing.generate.radii.cumulative: has to begin at a "
                "size that nothing is finer than (0) and to end at one that all is finer than (1)"},
        Mistake{"GradingTooWide", "{mean: 1 mm, spread: 0.2}",
                "{cumulative: [[0.1 mm, 0], [2 mm, 1]]}",
                "c.yaml:29: experiments[2].packing.generate.radii: 100 grains cannot follow the "
                "curve: the largest alone would hold 49 % of the mass, allowed is 5 %; take 14538 "
                "grains or more, or cut the curve off"},
        Mistake{"LogNormalWithoutWidth", "{mean: 1 mm, spread: 0.2}", "{median: 1 mm}",
                "c.yaml:29: experiments[2].packing.generate.radii.log_sd: is missing; the standard "
                "deviation of the logarithm of the size, e.g. 0.3"},
        Mistake{"ImpossiblePorosity", "void_ratio: 0.68", "porosity: 0.9",
                "c.yaml:29: experiments[2].packing.generate.porosity: '0.9' is outside what is "
                "allowed: between 0.2 "
                "(excluded) and 0.6 (excluded)"},
        Mistake{"NoSuchNoiseMode", "noise: given", "noise: guessed",
                "c.yaml:35: noise: 'guessed' is unknown; allowed: given, inferred, ess_target, "
                "model_error"},
        Mistake{"AModelErrorOfNothing", "noise: given", "noise: model_error",
                "c.yaml:35: noise: names a model error without saying of what; write "
                "{model_error: [{observables: [NAME], relative: {prior: uniform, min: 0, max: "
                "0.2}}]}"},
        Mistake{"FewChains", "method: iterative_bayesian_filter, samples: 20",
                "method: tmcmc, samples: 10",
                "c.yaml:36: inference.samples: '10' is not a whole number from 20 to 1000000"},
        Mistake{"FewPointsToStartFrom", "method: iterative_bayesian_filter, samples: 20",
                "method: surrogate_msrs, samples: 8",
                "c.yaml:36: inference: samples is 8; surrogate_msrs starts from at least 9 for 4 "
                "parameters"},
        Mistake{"BudgetBelowOneIteration", "model_evaluations: 400", "model_evaluations: 19",
                "c.yaml:39: budget: model_evaluations is 19, but the first iteration takes 20 (20 "
                "samples, 1 "
                "fitted test); allow more, or lower inference.samples"},
        Mistake{"NoiseBelowRounding", "{relative: 0.02, floor: 0.01}", "{absolute: 1e-154}",
                "c.yaml:23: experiments[1].observables.stress_ratio.noise: is smaller than what a "
                "number holds of the readings: no run can come so close"},
        Mistake{
            "CorrelatedBeyondThePath", "correlation_length: 0.5 percent",
            "correlation_length: 1e30",
            "c.yaml:12: experiments: tx02, volumetric_strain: noise.correlation_length is 1e+30, "
            "more than a million times the path of the readings, 0.127833"},
        Mistake{"NotUtf8", "name: sand", "name: s\xfcnd",
                "c.yaml:1: holds the byte 0xFC, which is not UTF-8: save the file as UTF-8"},
        Mistake{"NoneInFlight", "method: iterative_bayesian_filter, samples: 20",
                "method: surrogate_msrs, samples: 20, in_flight: 0",
                "c.yaml:36: inference.in_flight: '0' is not a whole number from 1 to 1000"},
        Mistake{"ChainsDecideNothingAtOnce", "method: iterative_bayesian_filter",
                "method: tmcmc, decisions: immediate",
                "c.yaml:36: inference.decisions: tmcmc decides nothing while runs are under way; "
                "immediate is for iterative_bayesian_filter, sqmc and surrogate_msrs"},
        Mistake{"RungsAndAtOnce", "max_iterations: 3}\nearly_stopping: {discard_at_most: 1e-3}",
                "max_iterations: 3, decisions: immediate}\n"
                "early_stopping: {discard_at_most: 1e-3, rungs: [0.5]}",
                "c.yaml:37: early_stopping.rungs: makes samples wait for each other, which "
                "inference.decisions: immediate does not; remove one of the two"},
        Mistake{"TemperedErrorsForChains",
                "noise: given\ninference: {method: iterative_bayesian_filter",
                "noise: ess_target\ninference: {method: tmcmc",
                "c.yaml:22: experiments[1].observables.volumetric_strain: is zero in data.txt:3, "
                "but ess_target scales errors with the reading; leave the row out or use noise: "
                "given\n"
                "c.yaml:36: inference.method: tmcmc needs the errors of the readings; use noise: "
                "given or noise: inferred with it"},
        Mistake{"NoSuchDesign", "samples: 20,", "samples: 20, design: lattice,",
                "c.yaml:36: inference.design: 'lattice' is unknown; allowed: halton, sobol, "
                "latin_hypercube, symmetric_latin_hypercube"},
        Mistake{"NoSuchMethod", "method: iterative_bayesian_filter", "method: iterative_filter",
                "c.yaml:36: inference.method: 'iterative_filter' is unknown; allowed: "
                "iterative_bayesian_filter, sqmc, tmcmc, surrogate_msrs, adaptive_emulator, table, "
                "design"},
        Mistake{"HalfASample", "samples: 20", "samples: 20.5",
                "c.yaml:36: inference.samples: '20.5' is not a whole number from 2 to 1000000"},
        Mistake{"OneReplicate", "max_iterations: 3}", "max_iterations: 3, replicates: 1}",
                "c.yaml:36: inference: replicates is 1, but one run shows no scatter; allowed: 0 "
                "(not measured) or 2 to 1000"},
        Mistake{"KeyOfTheOptimiser", "max_iterations: 3}", "max_iterations: 3, in_flight: 4}",
                "c.yaml:36: inference.in_flight: belongs to method: surrogate_msrs; remove it"},
        Mistake{"KeyOfTheChains", "max_iterations: 3}", "max_iterations: 3, steps: 4}",
                "c.yaml:36: inference.steps: belongs to method: tmcmc; remove it"},
        Mistake{"KeyOfTheFilters", "iterative_bayesian_filter, samples: 20, max_iterations: 3}",
                "tmcmc, samples: 20, design: sobol}",
                "c.yaml:36: inference.design: belongs to method: iterative_bayesian_filter and "
                "sqmc; remove it"},
        Mistake{"NearlyFreeze", "max_iterations: 3}", "max_iterations: 3, freez: {}}",
                "c.yaml:36: inference.freez: is an unknown key; did you mean 'freeze'?"},
        Mistake{"NearlyConstraints", "noise: given", "constraint: [a < b]\nnoise: given",
                "c.yaml:35: constraint: is an unknown key; did you mean 'constraints'?"},
        Mistake{"NearlyACorrelation", "noise: given", "prior_corelation: []\nnoise: given",
                "c.yaml:35: prior_corelation: is an unknown key; did you mean "
                "'prior_correlation'?"},
        Mistake{"FolderAboveAsName", "name: tx05", "name: ..",
                "c.yaml:26: experiments[2].name: '..' has to begin with a letter, a digit or _"},
        Mistake{"OptionAsName", "name: tx05", "name: -o",
                "c.yaml:26: experiments[2].name: '-o' has to begin with a letter, a digit or _"},
        Mistake{"EmptyValue", "failure: {attempts: 5, pause_above: 0.25}", "failure:\n\n# none",
                "c.yaml:38: failure: is nothing, expected a map of key: value"},
        Mistake{"DecimalComma", "confining_pressure: 0.5 MPa", "confining_pressure: 0,5 MPa",
                "c.yaml:28: experiments[2].confining_pressure: '0,5 MPa' has a comma in its "
                "number: write a decimal point, expected a pressure (Pa, kPa, MPa, GPa)"},
        Mistake{"IndentedByTab", "  contact: hertz_mindlin", "\tcontact: hertz_mindlin",
                "c.yaml:3: is indented by a tab, which YAML does not allow; indent by blanks"},
        Mistake{"InfiniteCorrelation", "correlation_length: 0.5 percent",
                "correlation_length: .inf",
                "c.yaml:24: experiments[1].observables.volumetric_strain.noise.correlation_length: "
                "'.inf' is not finite; allowed: at least 0"},
        Mistake{"DiscardTooMuch", "discard_at_most: 1e-3", "discard_at_most: 2",
                "c.yaml:37: early_stopping.discard_at_most: '2' is outside what is allowed: "
                "between 0 (excluded) and 1 "
                "(excluded)"},
        Mistake{"FallingRungs", "discard_at_most: 1e-3", "discard_at_most: 1e-3, rungs: [0.5, 0.5]",
                "c.yaml:37: early_stopping.rungs: has 0.5 after 0.5; each rung has to be above the "
                "one before"},
        Mistake{"RungAtTheEnd", "discard_at_most: 1e-3", "discard_at_most: 1e-3, rungs: [0.5, 1]",
                "c.yaml:37: early_stopping.rungs: '1' is outside what is allowed: between 0 "
                "(excluded) and 1 (excluded)"},
        Mistake{"OneRung", "discard_at_most: 1e-3", "discard_at_most: 1e-3, rungs: 0.5",
                "c.yaml:37: early_stopping.rungs: has to be a list of shares of the load steps, "
                "e.g. [0.25, 0.5]"},
        Mistake{"NegativeSeed", "seed: 7", "seed: -7",
                "c.yaml:40: seed: '-7' is not a whole number of at least 0"},
        Mistake{"NoThreads", "seed: 7", "resources: {threads: 0}\nseed: 7",
                "c.yaml:40: resources.threads: '0' is not a whole number from 1 to 1024"},
        Mistake{"MemoryWithoutAUnit", "seed: 7", "resources: {memory: 4}\nseed: 7",
                "c.yaml:40: resources.memory: '4' is no size above 0 with its unit: 500 MB, 4 GB, "
                "2 GiB"},
        Mistake{"NoSuchResource", "seed: 7", "resources: {cores: 4}\nseed: 7",
                "c.yaml:40: resources.cores: is an unknown key; allowed: threads, memory, wall, "
                "silence"},
        Mistake{"NoTime", "seed: 7", "resources: {wall: 0 h}\nseed: 7",
                "c.yaml:40: resources.wall: '0 h' is outside what is allowed: greater than 0 s"},
        Mistake{"ListForAMap", "failure: {attempts: 5, pause_above: 0.25}", "failure: [5, 0.25]",
                "c.yaml:38: failure: is a list, expected a map of key: value"}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(BadCampaigns, UnknownEffectsAndParametersSayWhatThereIs) {
  EXPECT_THAT(
      ProblemsOf(Spoiled("[rolling_resistance]", "[rolling_resistance, tea]")),
      StartsWith("c.yaml:4: model.effects: 'tea' is not an effect of this build; allowed: "));
  EXPECT_EQ(
      ProblemsOf(Spoiled("  rolling_resistance.friction: {prior: uniform, min: 0, max: 1}\n",
                         "  rolling_resistance.friction: {prior: uniform, min: 0, max: 1}\n"
                         "  twisting_resistance.friction: {prior: uniform, min: 0, max: 1}\n")),
      "c.yaml:12: parameters.twisting_resistance.friction: is not a parameter of hertz_mindlin "
      "with "
      "rolling_resistance; add twisting_resistance to model.effects to use it\n");
}

TEST(BadCampaigns, ParametersOfAnEffectThatCannotJoinAreNoFurtherProblems) {
  std::string yaml = Spoiled("  contact: hertz_mindlin\n  effects: [rolling_resistance]",
                             "  contact: linear\n  effects: [rolling_resistance, adhesion_jkr]");
  const auto expect_one_line = [](const std::string& problems) {
    EXPECT_THAT(problems,
                StartsWith("c.yaml:4: model.effects: adhesion_jkr cannot join the contact linear"));
    EXPECT_EQ(std::count(problems.begin(), problems.end(), '\n'), 1) << problems;
  };
  expect_one_line(ProblemsOf(yaml));
  yaml.replace(yaml.find("poisson_ratio: 0.2"), 18,
               "poisson_ratio: 0.2, adhesion_jkr.work_of_adhesion: 0.1");
  expect_one_line(ProblemsOf(yaml));
}

TEST(BadCampaigns, OneLawOfAdhesionIsEnough) {
  std::string yaml =
      Spoiled("[rolling_resistance]", "[rolling_resistance, adhesion_dmt, adhesion_jkr]");
  yaml.replace(yaml.find("poisson_ratio: 0.2"), 18,
               "poisson_ratio: 0.2, adhesion_dmt.work_of_adhesion: 0.1, "
               "adhesion_jkr.work_of_adhesion: 0.1");
  EXPECT_EQ(ProblemsOf(yaml),
            "c.yaml:4: model.effects: adhesion_jkr is another law of what adhesion_dmt stands for: "
            "name one of them\n");
}

TEST(BadCampaigns, EveryMistakeIsReportedAtOnce) {
  std::string yaml = Spoiled("min: 1e8 Pa", "min: 1e8 deg");
  yaml.replace(yaml.find("seed: 7"), 7, "sede: 7");
  yaml.replace(yaml.find("file: data.txt"), 14, "file: nope.txt");
  const std::string problems = ProblemsOf(yaml);
  EXPECT_THAT(problems, StartsWith("c.yaml:8: parameters.young_modulus.min:"));
  EXPECT_THAT(problems, HasSubstr("c.yaml:18: experiments[1].data.file:"));
  EXPECT_THAT(problems, HasSubstr("c.yaml:40: sede:"));
  EXPECT_EQ(std::count(problems.begin(), problems.end(), '\n'), 3);
}

TEST(BadCampaigns, NotYaml) {
  EXPECT_THAT(ProblemsOf(GoodYaml() + "\n  - [}"), StartsWith("c.yaml:4"));
  EXPECT_THAT(ProblemsOf("name: a: b\n"),
              HasSubstr("c.yaml:1: is not YAML: two colons in one line"));
  EXPECT_THAT(ProblemsOf("- a\n- b\n"), HasSubstr("c.yaml:1: is a list, expected a map"));
  EXPECT_THAT(ProblemsOf(""), HasSubstr("c.yaml:1: is empty"));
  EXPECT_THAT(ProblemsOf("a: 1\n---\nb: 2\n"), HasSubstr("more than one document"));
}

TEST(BadCampaigns, NothingToCalibrate) {
  EXPECT_THAT(ProblemsOf(Spoiled("role: calibrate", "role: validate")),
              HasSubstr("experiments: are all for validation; at least one needs role: calibrate"));
  EXPECT_THAT(ProblemsOf("name: x\n"), HasSubstr("model: is missing"));
}

TEST(BadCampaigns, ObservableOfAnotherTest) {
  EXPECT_THAT(ProblemsOf(Spoiled("observables: {q_over_p:", "observables: {mass_flow_rate:")),
              HasSubstr("c.yaml:33: experiments[2].observables.mass_flow_rate: is not an "
                        "observable of triaxial_drained"));
  EXPECT_THAT(ProblemsOf(Spoiled("observables: {q_over_p:", "observables: {axial_strain:")),
              HasSubstr("is the control: the model follows it exactly"));
}

TEST(BadCampaigns, ProblemsInDataAndPackingCarryTheirOwnFileAndLine) {
  auto files = GoodFiles();
  files["data.txt"].replace(files["data.txt"].find("3.7"), 3, "x.7");
  files["packing.txt"] += "0.001 0.001 0.001 -0.0005 -1\n";
  const std::string problems = ProblemsOf(GoodYaml(), files);
  EXPECT_THAT(problems, HasSubstr("data.txt:7: ratio: 'x.7' is not a number"));
  EXPECT_THAT(problems, HasSubstr("packing.txt:22: "));
}

TEST(BadCampaigns, OverlappingOrFewGrainsInAFileAreRefused) {
  auto files = GoodFiles();
  files["packing.txt"] += "# again\n0.0012 0.001 0.001 0.0005 -1\n";
  EXPECT_EQ(ProblemsOf(GoodYaml(), files),
            "packing.txt:23: overlaps the grain of line 2 by 0.0008 m, more than half the smaller "
            "radius\n");
  files = GoodFiles();
  for (std::size_t at = 0; (at = files["packing.txt"].find("0.0005", at)) != std::string::npos;) {
    files["packing.txt"].replace(at, 6, "0.0009");
  }
  EXPECT_THAT(ProblemsOf(GoodYaml(), files), HasSubstr("more than half the smaller radius, as 30 "
                                                       "other pairs do too\n"));
  files = GoodFiles();
  files["packing.txt"].erase(files["packing.txt"].rfind("0.005"));
  EXPECT_EQ(ProblemsOf(GoodYaml(), files),
            "packing.txt: holds 19 grains, at least 20 are needed\n");
}

TEST(BadCampaigns, StressesFarBelowTheConfiningPressureAreWarnedOf) {
  auto files = GoodFiles();
  files["validation.csv"] = "axial_strain,axial_stress\n0.01,0.6\n0.02,0.8\n0.05,0.7\n";
  const std::string yaml =
      Spoiled("{q_over_p: {noise: {relative: 0.05}}}", "{axial_stress: {noise: {relative: 0.05}}}");
  EXPECT_EQ(ProblemsOf(yaml, files), "");
  const auto odd = ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(files)).warnings;
  ASSERT_EQ(odd.size(), 1U);
  EXPECT_EQ(odd[0].kind, WarningKind::kUnit);
  EXPECT_THAT(Sentence(odd[0]), HasSubstr("tx05, axial_stress: begins at 0.6 Pa, where the test "
                                          "begins at 500 kPa, the factor 8.333e+05"));
  files["validation.csv"] = "axial_strain,axial_stress\n0.01,6e5\n0.02,8e5\n0.05,7e5\n";
  EXPECT_EQ(ProblemsOf(yaml, files), "");
}

TEST(BadCampaigns, PerPointNoiseHasToBePositive) {
  auto files = GoodFiles();
  files["data.txt"].replace(files["data.txt"].find("0.03"), 4, "0.00");
  EXPECT_EQ(ProblemsOf(Spoiled("{relative: 0.02, floor: 0.01}", "{column: sd}"), files),
            "data.txt:5: sd: a standard deviation has to be greater than 0\n");
}

TEST(BadCampaigns, ClumpIdsInAPackingAreNoMistake) {
  auto files = GoodFiles();
  files["packing.txt"].replace(files["packing.txt"].rfind("-1"), 2, "1");
  EXPECT_EQ(ProblemsOf(GoodYaml(), files), "");
}

TEST(BadCampaigns, NamesCannotBreakTheOneLineRule) {
  const std::string problems = ProblemsOf("\"a\\nb\": 1\n");
  EXPECT_THAT(problems, HasSubstr("a b: is an unknown key"));
}

}  // namespace
}  // namespace calib::campaign
