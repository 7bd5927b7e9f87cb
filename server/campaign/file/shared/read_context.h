#pragma once
// What the readers of a campaign's sections share: the files it names and the problems found so
// far.

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/campaign/checks/warning.h"
#include "server/campaign/file/shared/map_reader.h"
#include "server/campaign/file/shared/reading.h"
#include "server/campaign/file/text/data_file.h"
#include "server/campaign/model/campaign.h"

namespace calib::campaign {

class ReadContext {
 public:
  ReadContext(const FileReader& reader, ProblemList& problems, CampaignIs is,
              const ReadLimits& limits)
      : reader_(reader), problems_(problems), is_(is), limits_(limits) {}

  /// Not accepted before.
  bool is_new() const { return is_ == CampaignIs::kNew; }
  /// By which its measurements are read.
  bool by_first_rules() const { return is_ == CampaignIs::kStoredByFirstRules; }
  const ReadLimits& limits() const { return limits_; }

  ProblemList& problems() { return problems_; }

  /// What is odd about the files themselves; a finished campaign does not show it any more.
  std::vector<Warning>& warnings() { return warnings_; }

  /// Content of the file named at `key` of `map`, or nullptr after a problem. Each file is read
  /// once.
  const std::string* ReadNamedFile(const MapReader& map, const std::string& key,
                                   const std::string& path);

  /// Whether there is such a file; it does not become one of the campaign's.
  bool IsFile(const std::string& path) const { return reader_(path).ok(); }

  /// Moves what was found in a table into the problem list.
  void AddTableProblems(const std::string& path, const std::vector<TableProblem>& found);

  /// Paths that could be read, as written, in order of first mention.
  const std::vector<std::string>& files() const { return files_; }

 private:
  const FileReader& reader_;
  ProblemList& problems_;
  CampaignIs is_;
  const ReadLimits limits_;
  std::vector<Warning> warnings_;
  std::map<std::string, std::optional<std::string>> contents_;  // empty: could not be read
  std::vector<std::string> files_;
};

/// Whether it is one to 64 letters, digits and _ - . +, as stands in tables, file names and on the
/// command line.
bool IsShortWord(const std::string& name);

/// The key `name` of an experiment, which stands in tables, file names and on the command line.
/// is_new: as ReadContext.
std::string ReadShortName(MapReader& map, bool is_new);

}  // namespace calib::campaign
