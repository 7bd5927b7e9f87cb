#pragma once
// A small campaign without any problem, for tests to read and to spoil.

#include <map>
#include <string>

#include "server/campaign/file/campaign_file.h"

namespace calib::campaign::testing {

/// Paths and contents that GoodYaml() names: data.txt, validation.csv, packing.txt.
std::map<std::string, std::string> GoodFiles();
std::string GoodYaml();

FileReader ReaderOf(std::map<std::string, std::string> files);

/// GoodYaml() with one text replaced; aborts the test when `from` does not occur exactly once.
std::string Spoiled(const std::string& from, const std::string& to);

/// All problems of a campaign file with the good files, one line each.
std::string ProblemsOf(const std::string& yaml);
std::string ProblemsOf(const std::string& yaml, const std::map<std::string, std::string>& files);

}  // namespace calib::campaign::testing
