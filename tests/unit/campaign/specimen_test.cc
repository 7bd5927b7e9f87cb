// The keys `packing` and `realizations`: which packings a campaign runs on, and how those are made
// that nobody gave.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_replace.h"
#include "dem/particles/packing.h"
#include "server/campaign/model/replicates.h"
#include "server/campaign/model/specimen_notes.h"
#include "server/methods/registry.h"
#include "tests/unit/campaign/good_campaign.h"

namespace calib::campaign {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using testing::GoodFiles;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using testing::ProblemsOf;
using testing::ReaderOf;
using ::testing::SizeIs;
using testing::Spoiled;

// 20 grains of half a millimetre on a lattice in a cube.
std::string TwentyGrains(double length, int clump = -1) {
  dem::Packing packing;
  std::fill_n(packing.length, 3, length);
  for (int i = 0; i < 20; ++i) {
    packing.x.push_back(length * (i % 3 + 0.5) / 3);
    packing.y.push_back(length * (i / 3 % 3 + 0.5) / 3);
    packing.z.push_back(length * (i / 9 + 0.5) / 3);
    packing.radius.push_back(0.5e-3);
    packing.clump.push_back(clump);
  }
  return dem::FormatPacking(packing);
}
// The same with every second grain of a material.
std::string OfMaterials(const std::string& text, const std::string& material) {
  std::vector<dem::PackingProblem> problems;
  dem::Packing packing = dem::ParsePacking(text, problems);
  packing.material.assign(packing.x.size(), "");
  for (std::size_t i = 0; i < packing.x.size(); i += 2) packing.material[i] = material;
  return dem::FormatPacking(packing);
}
constexpr double kDense = 2.594e-3;  // porosity 0.4

std::string WithRealizations(const std::string& packing, int count) {
  return Spoiled(
      "    packing: {file: packing.txt}\n",
      "    packing: {" + packing + "}\n    realizations: " + std::to_string(count) + "\n");
}

ReadOutcome Read(const std::string& yaml, const std::map<std::string, std::string>& files) {
  ReadOutcome outcome = ReadCampaign(methods::All(), yaml, "c.yaml", ReaderOf(files));
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  return outcome;
}

TEST(Realizations, BeyondTheFileAreOtherPackingsOfItsGrains) {
  auto files = GoodFiles();
  files["packing.txt"] = TwentyGrains(kDense);
  const Campaign c = Read(WithRealizations("file: packing.txt", 4), files).campaign;
  const auto& specimens = c.experiments[0].specimens;
  ASSERT_THAT(specimens, SizeIs(4));
  const auto& file = std::get<PackingFile>(specimens[0]);
  std::set<std::uint64_t> seeds;
  for (std::size_t i = 1; i < 4; ++i) {
    const auto& like = std::get<PackingLike>(specimens[i]);
    EXPECT_EQ(like.digest, file.digest);
    EXPECT_EQ(like.recipe.particles, 20);
    EXPECT_NEAR(like.recipe.porosity, 0.4, 1e-3);
    EXPECT_DOUBLE_EQ(like.recipe.mean_radius, 0.5e-3);
    EXPECT_DOUBLE_EQ(like.recipe.aspect, 1);
    EXPECT_THAT(like.recipe.radii, IsEmpty());
    seeds.insert(like.recipe.seed);
  }
  EXPECT_THAT(seeds, SizeIs(3));
  EXPECT_THAT(SpecimenNotes(c),
              ElementsAre("tx02: realizations 2 to 4 are other packings of the 20 grains of "
                          "packing.txt, generated at its porosity of 0.4."));
  // They follow from the file and their number alone.
  const Campaign more =
      Read(absl::StrReplaceAll(WithRealizations("file: packing.txt", 6), {{"seed: 7", "seed: 8"}}),
           files)
          .campaign;
  EXPECT_EQ(std::get<PackingLike>(more.experiments[0].specimens[3]).recipe.seed,
            std::get<PackingLike>(specimens[3]).recipe.seed);
}

TEST(Realizations, BeyondSeveralFilesTakeThemInTurn) {
  auto files = GoodFiles();
  files["a.txt"] = TwentyGrains(kDense);
  files["b.txt"] = TwentyGrains(1.01 * kDense);
  const Campaign c = Read(WithRealizations("files: [a.txt, b.txt]", 5), files).campaign;
  std::vector<std::string> paths;
  for (std::size_t i = 2; i < 5; ++i) {
    paths.push_back(std::get<PackingLike>(c.experiments[0].specimens.at(i)).path);
  }
  EXPECT_THAT(paths, ElementsAre("a.txt", "b.txt", "a.txt"));
  EXPECT_THAT(SpecimenNotes(c),
              ElementsAre("tx02: realizations 3 to 5 are other packings of the 20 grains of a.txt "
                          "and the other file in turn, generated at their porosities."));
  const Campaign fewer = Read(WithRealizations("files: [a.txt, b.txt]", 1), files).campaign;
  EXPECT_THAT(fewer.experiments[0].specimens, SizeIs(1));
  EXPECT_THAT(SpecimenNotes(fewer), Not(Contains(HasSubstr("realization"))));
}

// Where the method has no place for what packings differ by, a reader is told before a run is made.
TEST(Realizations, WhoLeavesTheirScatterOutSaysSo) {
  Campaign c = Read(WithRealizations("file: packing.txt", 2), GoodFiles()).campaign;
  c.filter.noise = inference::NoiseMode::kGiven;
  c.method = methods::All().Find("iterative_bayesian_filter");
  EXPECT_EQ(ScatterLeftOut(c), "");
  c.filter.noise = inference::NoiseMode::kInferred;
  EXPECT_THAT(ScatterLeftOut(c), HasSubstr("With noise inferred what runs on different packings"));
  for (const char* method : {"tmcmc", "surrogate_msrs"}) {
    c.method = methods::All().Find(method);
    EXPECT_THAT(ScatterLeftOut(c),
                HasSubstr(std::string(method) + " compares runs by the stated errors"));
    EXPECT_THAT(SpecimenNotes(c), Contains(ScatterLeftOut(c)));
    Campaign one = c;
    for (Experiment& e : one.experiments) e.specimens.resize(1);
    EXPECT_THAT(ScatterLeftOut(one), HasSubstr("what twins of a run differ by"));
    one.replicates = 0;
    EXPECT_EQ(ScatterLeftOut(one), "");
  }
}

Campaign OnOnePacking() {
  Campaign c = Read(WithRealizations("file: packing.txt", 1), GoodFiles()).campaign;
  for (Experiment& e : c.experiments) e.specimens.resize(1);
  c.filter.noise = inference::NoiseMode::kGiven;
  return c;
}

// Twins by default: on one packing of given grains, as far as samples and errors allow.
TEST(Replicates, AreAsManyAsThereArePackingsOrEightTwinsOnOne) {
  Campaign c = OnOnePacking();
  ASSERT_EQ(c.samples, 20);
  EXPECT_FALSE(VariesPackings(c));
  EXPECT_EQ(ReplicatesOf(c), 8);
  c.samples = 6;
  EXPECT_EQ(ReplicatesOf(c), 6);
  c.samples = 20;
  for (const int said : {0, 2, 12}) {
    c.replicates = said;
    EXPECT_EQ(ReplicatesOf(c), said);
  }
  c.replicates.reset();
  for (const char* method : {"tmcmc", "surrogate_msrs", "sqmc"}) {
    c.method = methods::All().Find(method);
    EXPECT_EQ(ReplicatesOf(c), 8) << method;
  }
  for (const char* method : {"table", "design"}) {
    c.method = methods::All().Find(method);
    EXPECT_EQ(ReplicatesOf(c), 0) << method;
  }
  c.method = methods::All().Find("iterative_bayesian_filter");
  c.filter.noise = inference::NoiseMode::kEssTarget;
  EXPECT_EQ(ReplicatesOf(c), 0);
  Campaign four = Read(WithRealizations("file: packing.txt", 4), GoodFiles()).campaign;
  EXPECT_TRUE(VariesPackings(four));
  EXPECT_EQ(ReplicatesOf(four), 4);
  EXPECT_EQ(TwinsInWords(four), "");
}

TEST(Replicates, AreNotTwinsWhereNoPackingIsGiven) {
  Campaign c = OnOnePacking();
  Campaign collision = c;
  for (Experiment& e : collision.experiments) e.specimens = {NoPacking{}};
  EXPECT_EQ(ReplicatesOf(collision), 0);
  Campaign poured = c;
  for (Experiment& e : poured.experiments) e.test = "angle_of_repose";
  EXPECT_EQ(ReplicatesOf(poured), 0);
  EXPECT_EQ(TwinsInWords(poured), "");
  Campaign precomputed = c;
  precomputed.precomputed.emplace();
  EXPECT_EQ(ReplicatesOf(precomputed), 0);
  poured.experiments.push_back(c.experiments[0]);  // and a packing in a cell beside
  EXPECT_EQ(ReplicatesOf(poured), 8);
}

TEST(Replicates, OfOnePackingSayWhatTheyCost) {
  Campaign c = OnOnePacking();
  const auto tests = std::to_string(8 * c.experiments.size());
  EXPECT_THAT(TwinsInWords(c),
              AllOf(HasSubstr("8 times with parameters that differ by a millionth"),
                    HasSubstr(tests + " model evaluations"), HasSubstr("inference.replicates")));
  EXPECT_THAT(SpecimenNotes(c), Contains(TwinsInWords(c)));
  c.replicates = 0;
  EXPECT_EQ(TwinsInWords(c), "");
}

TEST(Realizations, ACloudGivesOtherClouds) {
  const Campaign c = Read(WithRealizations("file: packing.txt", 2), GoodFiles()).campaign;
  EXPECT_GT(std::get<PackingLike>(c.experiments[0].specimens.at(1)).recipe.porosity, 0.9);
}

TEST(Realizations, AFileOfWhichNoOtherCanBeMadeIsRefused) {
  auto files = GoodFiles();
  files["packing.txt"] = TwentyGrains(kDense, 3);
  EXPECT_EQ(ProblemsOf(WithRealizations("file: packing.txt", 4), files),
            "c.yaml:17: experiments[1].realizations: is 4, but one packing file is given, and "
            "packing.txt holds clumps, which are not thrown anew; name one file per realization in "
            "packing.files, or generate them\n");
  files["packing.txt"] = TwentyGrains(3.1e-3);
  EXPECT_EQ(ProblemsOf(WithRealizations("file: packing.txt", 4), files),
            "c.yaml:17: experiments[1].realizations: is 4, but one packing file is given, and the "
            "porosity of packing.txt is 0.648, neither that of a packing (between 0.2 (excluded) "
            "and 0.6 (excluded)) nor that of a cloud (0.7 or more); name one file per realization "
            "in packing.files, or generate them\n");
  files["packing.txt"] = OfMaterials(TwentyGrains(kDense), "soft");
  const std::string yaml = absl::StrReplaceAll(
      WithRealizations("file: packing.txt", 4),
      {{"  fixed: {", "  materials: {soft: {young_modulus: 1e8}}\n  fixed: {"}});
  EXPECT_EQ(ProblemsOf(yaml, files),
            "c.yaml:18: experiments[1].realizations: is 4, but one packing file is given, and "
            "packing.txt says which grains are of which material, which other packings would not "
            "keep; give shares of the grains instead; name one file per realization in "
            "packing.files, or generate them\n");
}

// Of every file, not of the first alone.
TEST(Realizations, WhatTheEngineRefusesIsSaidWithTheFileOnce) {
  auto files = GoodFiles();
  files["a.txt"] = TwentyGrains(kDense);
  files["b.txt"] = files["c.txt"] = OfMaterials(TwentyGrains(kDense), "soft");
  EXPECT_EQ(ProblemsOf(WithRealizations("files: [a.txt, b.txt, c.txt]", 3), files),
            "c.yaml:12: experiments: tx02: b.txt: grains of the packing are of material \"soft\"; "
            "the model has no materials besides grains\n");
}

std::string WithSizes(const std::string& sizes) {
  return Spoiled("particles: 100, void_ratio: 0.68, radii: {mean: 1 mm, spread: 0.2}",
                 "particles: 300, void_ratio: 0.68, " + sizes);
}

dem::PackingRecipe RecipeOf(const std::string& sizes) {
  const Campaign c = Read(WithSizes(sizes), GoodFiles()).campaign;
  return std::get<dem::PackingRecipe>(c.experiments.at(1).specimens.at(2));
}

TEST(Sizes, AreRadiiOrDiametersByMass) {
  const std::string curve = "{cumulative: [[1 mm, 0], [2 mm, 40 percent], [4 mm, 1]]}";
  const dem::PackingRecipe radii = RecipeOf("radii: " + curve);
  ASSERT_THAT(radii.grading, SizeIs(3));
  EXPECT_DOUBLE_EQ(radii.grading[1].radius, 2e-3);
  EXPECT_DOUBLE_EQ(radii.grading[1].finer, 0.4);
  EXPECT_GT(radii.mean_radius, 1e-3);
  EXPECT_LT(radii.mean_radius, 2e-3);  // by number
  const dem::PackingRecipe diameters = RecipeOf("diameters: " + curve);
  EXPECT_DOUBLE_EQ(diameters.grading[1].radius, 1e-3);
  EXPECT_NEAR(diameters.mean_radius, radii.mean_radius / 2, 1e-15);
  const dem::PackingRecipe even = RecipeOf("diameters: {mean: 2 mm, spread: 0.1}");
  EXPECT_DOUBLE_EQ(even.mean_radius, 1e-3);
  EXPECT_DOUBLE_EQ(even.radius_spread, 0.1);
  EXPECT_THAT(even.grading, IsEmpty());
}

TEST(Sizes, ALogNormalIsACurve) {
  const dem::PackingRecipe recipe = RecipeOf("radii: {median: 1 mm, log_sd: 0.3}");
  ASSERT_TRUE(dem::IsGrading(recipe.grading));
  EXPECT_NEAR(recipe.grading.back().radius, 1e-3 * std::exp(0.6), 1e-12);
}

// Of guide and README: what a user copies first.
constexpr const char* kCampaignOfTheGuide =
    R"(name: toyoura-0.2MPa
model:
  contact: hertz_mindlin            # hertz_mindlin | linear | tsuji | kuwabara_kono | extended_viscoelastic
  effects: [rolling_resistance]     # none, one or several names from `calibctl effects`
  density: 2650 kg/m^3
  fixed: {poisson_ratio: 0.2}       # parameters that are not calibrated
parameters:                         # calibrated; dotted names for an effect's own parameters
  young_modulus: {prior: log_uniform, min: 1e8 Pa, max: 1e11 Pa}
  friction_angle: {prior: uniform, min: 10 deg, max: 45 deg}     # or friction_coefficient
  rolling_resistance.stiffness: {prior: uniform, min: 0, max: 1}
  rolling_resistance.friction: {prior: uniform, min: 0, max: 1}
experiments:
  - name: tx02
    test: triaxial_drained          # isotropic | oedometric | triaxial_drained | triaxial_undrained | ... see `calibctl tests`
    confining_pressure: 0.2 MPa
    packing: {file: $CALIB_DATA/toyoura_triaxial/packing_1000.txt}
    data:
      file: $CALIB_DATA/toyoura_triaxial/experiment_0.2MPa.dat
      columns: {axial_strain: e_z, volumetric_strain: e_v, stress_ratio: s33_over_s11}   # our name: column in the file
      units: {axial_strain: percent, volumetric_strain: percent}
      strain: engineering            # engineering (default) | logarithmic, as the laboratory computed it; converted on reading
    control: axial_strain           # or {column: axial_strain, noise: 1e-4}: turning points are found, noise between them removed
    observables:
      stress_ratio: {noise: {relative: 0.02, floor: 0.01}}  # sd = sqrt((relative·y)² + floor²); also per point: {column: sd_q}
      volumetric_strain: {noise: {absolute: 0.1 percent, correlation_length: 0.5 percent}}
    realizations: 4                 # packings the samples are spread over; their scatter joins the error model
    role: calibrate                 # or: validate (never used for fitting; reported as held-out error)
noise: given                        # given | inferred (one factor per observable) | ess_target: 0.2 (as in Cheng 2019)
inference:
  method: iterative_bayesian_filter # sqmc | iterative_bayesian_filter | tmcmc | surrogate_msrs
  samples: 100
  max_iterations: 4
early_stopping: {discard_at_most: 1e-3}        # bound on the posterior mass that early stopping may lose
failure: {attempts: 5, pause_above: 0.25}      # infrastructure failures are redone; diverged models get weight zero
budget: {model_evaluations: 400, core_hours: 12}
seed: 7
)";

// Its files lie among the measurements, which not everybody has.
const std::string kGuidesPacking = "$CALIB_DATA/toyoura_triaxial/packing_1000.txt";
const std::string kGuidesReadings = "$CALIB_DATA/toyoura_triaxial/experiment_0.2MPa.dat";

// The note on its four realizations; every problem of the file fails the test.
std::string NoteOnTheGuides(const FileReader& reader) {
  const ReadOutcome outcome = ReadCampaign(methods::All(), kCampaignOfTheGuide, "c.yaml", reader);
  for (const Problem& problem : outcome.problems) ADD_FAILURE() << ToString(problem);
  EXPECT_THAT(outcome.campaign.experiments, SizeIs(1));
  if (::testing::Test::HasFailure()) return "";
  EXPECT_THAT(outcome.campaign.experiments[0].specimens, SizeIs(4));
  const auto notes = SpecimenNotes(outcome.campaign);
  EXPECT_THAT(notes, SizeIs(1));
  return notes.empty() ? "" : notes[0];
}

TEST(Realizations, TheCampaignOfTheGuideIsGood) {
  const std::string note = NoteOnTheGuides(ReaderOf({
      {kGuidesPacking, TwentyGrains(kDense)},
      {kGuidesReadings,
       "# e_v e_x e_y e_z s33_over_s11\n0 0 0 0 1\n0.12 -0.09 -0.09 0.37 2.1\n-0.6 -1.2 -1.2 1.8 "
       "3.9\n"},
  }));
  EXPECT_THAT(note, HasSubstr("realizations 2 to 4 are other packings of the 20 grains of"));
  EXPECT_THAT(note, HasSubstr("porosity of 0.4"));
}

TEST(Realizations, TheCampaignOfTheGuideIsGoodOnTheMeasurements) {
  const FileReader disk = DiskReader("c.yaml");
  if (!disk(kGuidesPacking).ok()) {
    GTEST_SKIP() << "left out: there is no $CALIB_DATA/toyoura_triaxial here";
  }
  const std::string note = NoteOnTheGuides(disk);
  EXPECT_THAT(note, HasSubstr("realizations 2 to 4 are other packings of the 1000 grains of"));
  EXPECT_THAT(note, HasSubstr("porosity of 0.405"));
}

}  // namespace
}  // namespace calib::campaign
