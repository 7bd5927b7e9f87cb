#pragma once
// What the command line said.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/client/server_choice.h"

namespace calib::ctl {

struct Arguments {
  // Of every verb.
  client::ServerChoice server;
  bool json = false;

  // Of some.
  bool with_children = false;            ///< of delete: what comes from the campaign too
  bool force = false;                    ///< of delete: although something comes from it
  std::string file;                      ///< campaign file, or packing
  std::string clumps;                    ///< dumbbell:ASPECT or the file of a template
  std::string campaign;                  ///< id
  std::vector<std::string> campaigns{};  ///< ids
  std::string worker;                    ///< name
  int sample = 0;
  std::optional<int> iteration;
  std::optional<std::uint64_t> seed;
  std::vector<std::string> set;      ///< NAME=VALUE
  std::vector<std::string> effects;  ///< to join the model, or to be left out
  int max_effects = 3;
  std::optional<std::int64_t> max_evaluations;  ///< of improve
  std::string test;                             ///< file with the tests to predict
  int draws = 20;                               ///< of the posterior, to predict from
  std::vector<std::string> exceed;              ///< OBSERVABLE=LEVEL
  std::string output;                           ///< file or folder; empty: standard output
  std::string vtk;                              ///< folder
  std::string checkpoint;                       ///< folder
};

}  // namespace calib::ctl
