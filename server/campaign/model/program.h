#pragma once
// A program of the user's own in the place of this tree's DEM: what the campaign file says of it.

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace calib::campaign {

/// A file that the campaign brings along.
struct ProgramFile {
  std::string path;    ///< as the campaign names it, or below a folder that it names
  std::string name;    ///< below the scratch folder
  std::string digest;  ///< SHA-256 of the content
  bool executable = false;
  bool is_template = false;  ///< {NAME} is replaced in its text
};

/// A table of the scratch folder that grows by a row per load step, read in place of standard
/// output.
struct ProgramTable {
  std::string file;
  std::map<std::string, std::string> columns{};  ///< by our name
  std::map<std::string, double> factors{};       ///< SI per unit of the table, by our name; 1
};

/// What a run may take at most; empty: any.
struct ProgramLimits {
  std::optional<double> wall;     ///< [s]
  std::optional<double> memory;   ///< resident, of all its processes [bytes]
  std::optional<double> disk;     ///< of its scratch folder [bytes]
  std::optional<double> silence;  ///< between two states [s]
};

/// A setting of the code that should not matter: what a diagnosis may change to see that it does
/// not.
struct ProgramNumerics {
  double null = 0;  ///< as the campaign runs it
  double sd = 1;    ///< of what else it might be, > 0
};

struct Program {
  std::vector<std::string> command;  ///< program and arguments, {NAME} not yet replaced
  std::vector<ProgramFile> files;
  std::vector<std::string> keep;  ///< files of the scratch folder that stay with the run
  bool checkpoint = false;        ///< it understands checkpoints
  bool persistent = false;        ///< one process per slot, one request per line
  std::optional<ProgramTable> states;
  ProgramLimits limits;
  bool limit_diverges = false;  ///< a run at a limit has diverged; false: it has failed
  std::string version;          ///< part of what a run is, for what the files do not show
  std::map<std::string, ProgramNumerics> numerics{};
};

/// What an experiment tells the program: names and their values as JSON, quantities in SI.
using ProgramSettings = std::map<std::string, std::string>;

}  // namespace calib::campaign
