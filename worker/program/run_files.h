#pragma once
// What a program writes into its folder and the worker reads. POSIX.

#include <sys/types.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "worker/program/table_reader.h"

namespace calib::worker {

/// A table that grows, looked at now and then: what it has got since goes to a reader. Not
/// thread-safe.
class TableFile {
 public:
  /// reader: outlives it.
  TableFile(const std::string& folder, std::string name, TableReader& reader);

  /// Reads a few MiB at most; false: there may be more. A table that is no regular file or becomes
  /// shorter fails the run; one that is not there may still come.
  bool Poll();
  /// Whether it was there at the last look.
  bool is_there() const { return is_there_; }

 private:
  std::string name_;
  std::string path_;
  TableReader& reader_;
  off_t at_ = 0;
  bool is_there_ = false;
};

struct KeptContent {
  std::string name{};     ///< as in ProgramRun.keep
  std::string content{};  ///< of the file when the run had ended
};

constexpr std::int64_t kMostKeptBytes = std::int64_t{256} << 20;  ///< of one file that is kept

/// Adds the regular files of a folder that have these names to `kept`, and for each of the others
/// why not, in a clause, to `not_kept`.
void ReadKeptFiles(const std::vector<std::string>& names, const std::string& folder,
                   std::vector<KeptContent>& kept, std::map<std::string, std::string>& not_kept);

}  // namespace calib::worker
