#pragma once
// A campaign as the program holds it: read from YAML and its files (campaign_file.h), SI inside,
// compression positive.

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "dem/model/scenario.h"
#include "inference/data/data_set.h"
#include "inference/filter/iterative_filter.h"
#include "inference/prior/joint_prior.h"
#include "server/campaign/model/method.h"
#include "server/campaign/model/population.h"
#include "server/campaign/model/program.h"
#include "server/campaign/model/tied_parameters.h"
#include "server/campaign/model/words.h"

namespace calib::campaign {

struct CalibratedParameter {
  std::string name;  ///< dotted
  std::string unit;  ///< SI, for display
  inference::Prior prior;
  bool nuisance = false;               ///< inferred, and not reported among what is wanted
  std::optional<SettingOf> setting{};  ///< empty: a parameter of the model
  bool of_population = false;          ///< a spread or a score: no run reads it (population.h)
};

/// Stated error of a reading as a function of what is read: sd = absolute, or
/// sqrt((relative y)^2 + floor^2).
struct NoiseLaw {
  double relative = 0;             ///< >= 0
  double floor = 0;                ///< >= 0, in the observable's SI unit
  std::optional<double> absolute;  ///< > 0, in the observable's SI unit; takes the place of both
};
/// Standard deviation of a reading of `value`, SI.
double ErrorOf(const NoiseLaw& law, double value);

struct MeasuredObservable {
  std::string name;
  /// One per row of the file, SI, compression positive, strains logarithmic, NaN where a reading is
  /// missing; none where the observable is only predicted (RunsRowsOnly).
  std::vector<double> values;
  /// One per row, > 0, NaN where a reading is missing (may be empty with ess_target).
  std::vector<double> sd;
  double correlation_length = 0;  ///< in the control; 0: independent
  /// Covariance of the errors of all rows, in the square of their SI unit, sd^2 its diagonal, NaN
  /// where a reading is missing; empty: sd and correlation_length say it all.
  Eigen::MatrixXd covariance = {};
  double ess_weight = 1;  ///< w_j of ess_target
  /// What sd follows from, and would where nothing is measured yet; empty: the file states no such
  /// law (a column, a covariance, nothing).
  std::optional<NoiseLaw> noise = {};
  std::string unit = "1";  ///< SI, of the catalogue or of the column
};

/// The law of its errors; where the file states none, their mean as an absolute error (0 of none).
NoiseLaw LawOf(const MeasuredObservable& observable);

/// Indices of the rows in which it was measured.
std::vector<Eigen::Index> RowsRead(const MeasuredObservable& observable);
/// How many these are.
inline std::size_t ReadingsOf(const MeasuredObservable& observable) {
  return RowsRead(observable).size();
}

/// Over which its errors fall to 1/e along the control, of a covariance along neighbouring
/// readings; 0: independent. control: one per row.
double CorrelationLengthOf(const std::vector<double>& control,
                           const MeasuredObservable& observable);

/// A specimen: the packing file's content (path as written, parsed), or a recipe.
struct PackingFile {
  std::string path;
  std::string digest;  ///< SHA-256 of the text
  dem::Packing packing;
};
/// Another packing of a packing file's grains, for realizations beyond the files.
struct PackingLike {
  std::string path;    ///< path of the packing file, as written
  std::string digest;  ///< SHA-256 of its text
  /// radii empty: the worker takes them from the file. The seed follows from the digest and the
  /// number of the realization.
  dem::PackingRecipe recipe;
};
/// The specimen of a test that makes its bodies from its settings.
struct NoPacking {};

/// What one realization tells a program otherwise than the experiment's settings do.
struct ProgramSpecimen {
  ProgramSettings settings{};
};

using Specimen =
    std::variant<PackingFile, dem::PackingRecipe, NoPacking, PackingLike, ProgramSpecimen>;

/// An STL file in place of a piece of the test's boundary.
struct MeshFile {
  std::string path;        ///< path as written
  std::string digest;      ///< SHA-256 of the content
  double scale = 1;        ///< m per unit of the file
  dem::TriangleMesh mesh;  ///< [m]
};

struct Experiment {
  std::string name;
  std::string test;     ///< may be empty when precomputed, or run by a program
  std::string batch{};  ///< whose specimens were made together; empty: not said
  std::map<std::string, double> settings;
  Role role = Role::kCalibrate;
  /// Realizations: sample i uses specimen i mod size. A PackingLike stands behind all files. Empty
  /// when precomputed.
  std::vector<Specimen> specimens;
  /// Number of grains of the specimen that was measured; empty: unknown, taken for as few as the
  /// model's.
  std::optional<double> specimen_grains;
  ProgramSettings told;                    ///< to a program; nothing else is
  std::map<std::string, MeshFile> meshes;  ///< by name of dem::TestInfo::meshes
  dem::MaterialUse materials;
  dem::Consolidation consolidation;
  std::optional<dem::InitialStress> initial_stress;
  std::optional<double> loading_rate;
  dem::Staging staging;
  /// Observable that drives the loading; empty: readings are merely counted.
  std::string control_name;
  std::string control_unit = "1";  ///< SI
  /// Where loading starts: 0 for strains, the start pressure for stresses.
  double control_start = 0;
  std::vector<dem::ControlPoint> path;  ///< load_step = index of the reading
  std::vector<double> control;   ///< measured control at each reading (as compared, logarithmic)
  int rows_without_control = 0;  ///< of the file, left out
  /// Loading stage of each reading: "initial_loading", "unload_1", "reload_1", ...
  std::vector<std::string> segment;
  std::vector<MeasuredObservable> observables;
};

/// Runs that exist already and have effects that the campaign's model lacks: they calibrate
/// nothing, a diagnosis learns from them. The effects are declared in Model::user_effects, without
/// a formula.
struct RunsWithEffects {
  /// e dotted names of the effects' parameters, in the order of the declarations.
  std::vector<std::string> names{};
  Eigen::MatrixXd parameters{};  ///< n x (d + e): the campaign's parameters, then these; SI
  std::vector<std::vector<std::vector<double>>> values{};  ///< as Precomputed::values, of the n
};

/// Runs that exist already, from any code.
struct Precomputed {
  Eigen::MatrixXd parameters;  ///< N x d, the campaign's parameters in order
  /// [experiment][sample][reading * observables + observable], the experiment's observables in
  /// order.
  std::vector<std::vector<std::vector<double>>> values;
  /// ln density from which the rows were drawn; empty: the prior.
  std::optional<Eigen::VectorXd> log_proposal;
  RunsWithEffects with_effects{};
};

/// Parameter values to run, given one by one.
struct Table {
  Eigen::MatrixXd parameters;  ///< N x d, the campaign's parameters in order
  /// Number of the sample whose specimen and seed each row takes, so that a run can be paired with
  /// one of another campaign.
  std::vector<int> like;
};

/// Rows of a batch of a design at most: sample = iteration * this + position in the batch. Chosen:
/// some times what a stage of a diagnosis asks for, and a message of them stays far below a MiB.
inline constexpr int kMostRowsOfBatch = 256;

/// Where the first iteration looks: a share of the prior, the rest independent normals about
/// `center` in the coordinate of the prior. Parameters that are not named are drawn from the width
/// of their prior.
struct FirstProposal {
  double prior_share = 0.5;
  struct Place {
    double center = 0, sd = 0;  ///< in the parameter's SI unit, sd > 0
  };
  std::map<std::string, Place> places{};
};

/// Where a campaign comes from.
struct Lineage {
  std::string parent;   ///< id of the campaign it was derived from
  std::string purpose;  ///< a word of kDerivedForWords, or a user's own
};

inline constexpr std::array kNoiseModeWords = {
    Word{inference::NoiseMode::kGiven, "given"},
    Word{inference::NoiseMode::kInferred, "inferred"},
    Word{inference::NoiseMode::kEssTarget, "ess_target"},
    Word{inference::NoiseMode::kModelError, "model_error"},
};

/// Observables that share one inferred factor of their noise.
struct SharedNoise {
  std::vector<std::pair<int, int>> members;  ///< (experiment, observable)
  inference::VarianceFactorPrior prior = {};
};

/// When a campaign decides while runs are under way (which is the next point, which run to end
/// early). kReproducible: by what follows from results in their order, whatever arrived
/// first; kImmediate: at once, by what has arrived.
enum class Decisions { kReproducible, kImmediate };
inline constexpr std::array kDecisionsWords = {
    Word{Decisions::kReproducible, "reproducible"},
    Word{Decisions::kImmediate, "immediate"},
};

struct EarlyStopping {
  double discard_at_most = 1e-3;  ///< share of the posterior mass that stopped runs may hold
  /// Shares of an experiment's load steps, increasing, within (0, 1): all samples come to the first
  /// rung, those that can still count go on to the next. Empty: every run goes to its end at once.
  std::vector<double> rungs{};
  /// Exponent of the likelihood in the weights that are bounded, (0, 1]: 1 is that of the posterior
  /// itself; empty: the one that guides proposals.
  std::optional<double> exponent{};
};
/// What happens when runs fail or diverge.
struct Failure {
  /// Failed ones of one evaluation after which the campaign is paused, or with a program the
  /// sample is set aside as unknown.
  int attempts = 5;
  /// Share of diverged and unknown samples of an iteration above which it is paused.
  double pause_above = 0.25;
};
/// What one run needs of its worker and may take of it at most.
struct Resources {
  std::optional<int> threads{};     ///< that it uses, 1 to 1024; empty: those of its slots
  std::optional<double> memory{};   ///< resident [bytes] > 0; empty: that of a slot, where known
  std::optional<double> wall{};     ///< of a run of the DEM [s]; empty: any
  std::optional<double> silence{};  ///< between two load steps of one [s]; empty: kLongestSilence
};
/// Of a run of the DEM [s], after which it hangs. Chosen: a load step of a million grains takes
/// 6e6 contacts times 1e4 time steps at 5e6 contact updates per second (tests/bench), 3.3 h; a day
/// is seven times that.
inline constexpr double kLongestSilence = 86'400;

/// No iteration begins that could exceed one of these; empty: no bound.
struct Budget {
  std::optional<std::int64_t> model_evaluations;
  std::optional<double> core_hours;
};

struct Campaign {
  std::string name;
  dem::Model model;  ///< parameters: the fixed ones
  std::optional<Precomputed> precomputed;
  /// In place of the DEM; its effects are declared in model.user_effects, without a formula.
  std::optional<Program> program;
  std::vector<CalibratedParameter> parameters;
  /// Parameters that follow from these and the fixed ones, each behind those that it follows from.
  std::vector<TiedParameter> tied{};
  /// Parameters that have a value for each experiment or batch.
  std::vector<Population> populations{};
  /// Where correlations or constraints tie them; their priors are its marginals.
  std::optional<inference::JointPrior> tied_prior;
  std::vector<Experiment> experiments;
  /// Tests that may be proposed to a program: experiments without readings, `control` as they would
  /// be driven.
  std::vector<Experiment> next{};
  /// With its options; nullptr only of a campaign that was not read.
  std::shared_ptr<const Method> method{};
  int samples = 100;
  int max_iterations = 4;
  /// Rows of the file: all there is (ChosenBy::kFile), the batch to start with (kRequest), or what
  /// comes before the method's own.
  std::optional<Table> table;
  /// With ChosenBy::kRequest: effects that a run may have or lack (race.h). None of them is part of
  /// `model`.
  std::vector<std::string> race{};
  std::optional<FirstProposal> first_proposal;
  /// How often the best estimate is run to measure the scatter of packings; empty: as its number.
  std::optional<int> replicates;
  std::optional<Lineage> lineage;
  std::vector<SharedNoise> shared_noise;
  std::vector<inference::ModelError> model_errors{};
  /// noise, ess_target and seed are of every method, the rest of those that weigh samples.
  inference::FilterOptions filter;
  Decisions decisions = Decisions::kReproducible;
  std::optional<EarlyStopping> early_stopping;
  Failure failure;
  Resources resources{};
  Budget budget;
  std::uint64_t seed = 0;
};

/// True where runs are made and nothing is inferred from them; where runs are added while it lives.
bool RunsRowsOnly(const Campaign& campaign);
bool RunsAreAdded(const Campaign& campaign);

/// Path length of the control at each reading: the distance in the correlation of errors. Readings
/// closer than 1 % of the correlation length count as that far apart, because errors of two
/// readings are never quite the same.
std::vector<double> TravelledControl(const Experiment& experiment, double correlation_length);

/// Part of the variance between packings that the measurement has as well: grains of the model over
/// grains of the measured specimen, at most 1; 1 where that is unknown.
double ScatterShare(const Experiment& experiment);

/// The fewest packings of a calibrated experiment that varies them; 0: none does.
std::size_t PackingsOfAll(const Campaign& campaign);

/// The share of each reading of MakeDataSet; -1 where the experiment has one packing only.
Eigen::VectorXd ScatterShares(const Campaign& campaign, const inference::DataSet& data);

/// Readings of the experiments of a role, flat, in processing order; experiment = index in
/// campaign.experiments.
inference::DataSet MakeDataSet(const Campaign& campaign, Role role = Role::kCalibrate);

/// The priors of the calibrated parameters in order, without and with what ties them.
std::vector<inference::Prior> MarginalPriors(const Campaign& campaign);
inference::JointPrior Priors(const Campaign& campaign);

/// The number that decides on specimen and seed of a sample that has none of its own: the sample's,
/// or the one a table's row names.
int StreamOf(const Campaign& campaign, int sample);

/// What first_proposal says, in the coordinates of the priors; the prior alone without it.
inference::Proposal FirstProposalOf(const Campaign& campaign);

/// Whether runs are of this program's own DEM: neither made elsewhere nor by a program.
bool HasOwnEngine(const Campaign& campaign);

/// Whether observables and readings are what the campaign's tables say, whatever the catalogue
/// has: runs made elsewhere, and a program's in a test that has no name here.
bool HasNamesOfItsOwn(const Campaign& campaign, const Experiment& experiment);

/// What one run of a campaign's experiments is made with.
struct RunOf {
  std::vector<double> values{};  ///< SI, finite, in the order of Campaign::parameters
  int stream = 0;                ///< decides on specimen and seed (StreamOf), >= 0
};

/// The scenario of one evaluation; of a design without the effects that stand at their null
/// (race.h), with the settings that are calibrated (run_settings.h). With a recipe the packing is
/// left empty for the worker to generate.
dem::Scenario MakeScenario(const Campaign& campaign, const Experiment& experiment,
                           const RunOf& run);

}  // namespace calib::campaign
