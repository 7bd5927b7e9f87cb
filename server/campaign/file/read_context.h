#pragma once
// What the readers of a campaign's sections share: the files it names and the problems found so
// far.

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/campaign/file/campaign_file.h"
#include "server/campaign/file/map_reader.h"
#include "server/campaign/file/text/data_file.h"

namespace calib::campaign {

class ReadContext {
 public:
  /// is_new: not accepted before, see CampaignIs.
  ReadContext(const FileReader& reader, ProblemList& problems, bool is_new)
      : reader_(reader), problems_(problems), is_new_(is_new) {}

  bool is_new() const { return is_new_; }

  ProblemList& problems() { return problems_; }

  /// Content of the file named at `key` of `map`, or nullptr after a problem. Each file is read
  /// once.
  const std::string* ReadNamedFile(const MapReader& map, const std::string& key,
                                   const std::string& path);

  /// Moves what was found in a table into the problem list.
  void AddTableProblems(const std::string& path, const std::vector<TableProblem>& found);

  /// Paths that could be read, as written, in order of first mention.
  const std::vector<std::string>& files() const { return files_; }

 private:
  const FileReader& reader_;
  ProblemList& problems_;
  bool is_new_;
  std::map<std::string, std::optional<std::string>> contents_;  // empty: could not be read
  std::vector<std::string> files_;
};

}  // namespace calib::campaign
