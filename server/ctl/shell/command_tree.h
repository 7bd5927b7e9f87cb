#pragma once
// The command line of calibctl as plain data, for whoever describes it: completions, man pages.

#include <string>
#include <vector>

namespace calib::ctl {

struct OptionEntry {
  std::vector<std::string> names{};  ///< "-o", "--output"; of a word at its place: "FILE"
  std::string help{};                ///< a line
  bool at_its_place = false;
  bool takes_value = false;  ///< also every word at its place
  bool required = false;
};

struct VerbEntry {
  std::string name{};
  std::string description{};  ///< a line
  std::string example{};      ///< without "calibctl "
  std::vector<OptionEntry> options{};
};

struct CommandTree {
  std::string version{};              ///< lines
  std::vector<OptionEntry> common{};  ///< that every verb takes
  std::vector<VerbEntry> verbs{};     ///< in the order of the help
};

}  // namespace calib::ctl
