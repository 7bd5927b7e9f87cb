#pragma once
// A calibration method as everything outside of its own room (server/methods) sees it.

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace calib::planning {
class Planner;
struct Definition;
}  // namespace calib::planning

namespace calib::campaign {

class MapReader;
struct Campaign;
struct Section;

/// Who says which parameter sets are run.
enum class ChosenBy {
  kMethod,   ///< the method, which infers from them
  kFile,     ///< the campaign file; nothing is inferred
  kRequest,  ///< the file and, while the campaign lives, who adds to it; nothing is inferred
};

/// What the method section of a paper says of a campaign: "NAME [references]DETAIL".
struct MethodInWords {
  std::string name;                     ///< empty: nothing was inferred
  std::vector<std::string> references;  ///< whole entries of a list
  std::string detail;                   ///< ", 4 iterations of 64 samples"
};

/// What a file says at least of its runs: a key of `inference`, and the number that stands for it
/// where it is not there.
struct LeastRuns {
  std::string key;
  int least = 0;
  int standard = 0;
};

/// A method with its options. Immutable once read; thread-safe.
class Method {
 public:
  virtual ~Method() = default;

  /// In campaign files, the store and messages.
  virtual std::string name() const = 0;

  virtual ChosenBy chosen_by() const { return ChosenBy::kMethod; }
  /// Its posterior is that of samples with weights.
  virtual bool weighs_samples() const { return false; }
  /// It chooses parameter sets one by one, while others run.
  virtual bool chooses_while_running() const { return false; }
  /// Its batches stay as they are once they have ended: nothing of them is ever run again.
  virtual bool keeps_batches() const { return false; }
  /// Runs of the campaign file's rows may come before its own.
  virtual bool takes_rows() const { return chosen_by() != ChosenBy::kMethod; }
  /// It can be told where to look first (FirstProposal).
  virtual bool takes_first_proposal() const { return chosen_by() != ChosenBy::kRequest; }
  /// It can weigh runs that exist already.
  virtual bool takes_made_runs() const { return false; }
  /// Its batches differ in size.
  virtual bool batches_vary() const { return takes_rows(); }
  /// It cannot do without the errors of the readings.
  virtual bool needs_errors() const { return false; }
  /// Runs may end early by a bound of their likelihood.
  virtual bool bounds_runs() const { return chosen_by() == ChosenBy::kMethod; }
  /// It may decide by what has arrived (Decisions::kImmediate).
  virtual bool may_decide_at_once() const { return false; }
  /// With these options some parameters are held while others go on.
  virtual bool holds_parameters() const { return false; }
  /// The method by which an extended model is calibrated after it.
  virtual std::string extended_by() const { return name(); }
  /// Of an iteration, for this many parameters.
  virtual int fewest_samples(std::size_t parameters) const;
  /// For this many parameters. said: what the file says of another key, where it is a number.
  virtual LeastRuns least_runs(
      std::size_t parameters,
      const std::function<std::optional<int>(const std::string&)>& said) const;
  /// Iterations where the file does not say; 0: it decides itself.
  virtual int standard_iterations() const { return 4; }

  /// The most batches that a campaign can come to; samples of the first, and at most of a later
  /// one.
  virtual int MostBatches(const Campaign& campaign) const;
  virtual int FirstBatch(const Campaign& campaign) const;
  virtual int LaterBatch(const Campaign& campaign) const;
  /// "100 samples in each of at most 4 iteration(s)"
  virtual std::string RunsInWords(const Campaign& campaign) const;

  /// Its keys, which join those of `inference`, and behind them the sections that these speak of.
  virtual std::vector<Section> Keys() const = 0;
  /// Reads its keys of `inference`, whose common ones are in the campaign already; gives the method
  /// with these options. The parameters are not known yet.
  virtual std::shared_ptr<const Method> Read(MapReader& inference, Campaign& campaign) const = 0;
  /// Adds problems of its keys that show once the parameters are known.
  virtual void Check(const MapReader& inference, const Campaign& campaign) const;

  /// Told before a run is made: what becomes of scatter that its errors leave out; empty: nothing
  /// to tell. what: "what runs on different packings differ by".
  virtual std::string ScatterLeftOut(const Campaign& campaign, const std::string& what) const;
  /// iterations: that it came to.
  virtual MethodInWords InWords(const Campaign& campaign, int iterations) const;

  /// What comes next for a campaign; keeps a reference to the definition, whose campaign has this
  /// method. nullptr where nothing is inferred.
  virtual std::unique_ptr<planning::Planner> MakePlanner(
      const planning::Definition& definition) const = 0;
};

/// True where runs are made and nothing is inferred from them by the server.
inline bool RunsRowsOnly(const Method& method) { return method.chosen_by() != ChosenBy::kMethod; }

/// The methods of this build, with their standard options. Immutable; thread-safe.
class MethodList {
 public:
  /// The first is that of files that name none.
  explicit MethodList(std::vector<std::shared_ptr<const Method>> methods);

  const std::vector<std::shared_ptr<const Method>>& all() const { return methods_; }
  const std::shared_ptr<const Method>& standard() const { return methods_.front(); }
  /// By name; nullptr: none is called so.
  std::shared_ptr<const Method> Find(std::string_view name) const;
  /// The first of which this holds, which one does.
  std::shared_ptr<const Method> Of(ChosenBy chosen_by) const;
  std::vector<std::string> Names() const;
  /// "a, b and c": those of which this holds.
  std::string NamesOf(bool (Method::*trait)() const) const;

 private:
  std::vector<std::shared_ptr<const Method>> methods_;
};

}  // namespace calib::campaign
