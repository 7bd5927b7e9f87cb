#pragma once
// Where a verb names its options, without the argument library.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace calib::ctl {

/// One option that was added to a list; valid as long as the command line it belongs to.
class Option {
 public:
  explicit Option(CLI::Option* option) : option_(option) {}
  /// A command line without it is refused.
  const Option& Required() const;
  /// A command line with both is refused.
  const Option& Excludes(const Option& other) const;

 private:
  CLI::Option* option_;
};

/// Every function adds an option. names: "FILE" for a word at its place, "-o,--output" for one that
/// is named. help: a line, with the default in brackets. value: written when the command line is
/// read, untouched where the option is not given; outlives the list.
class OptionList {
 public:
  explicit OptionList(CLI::App* verb) : verb_(verb) {}

  Option Text(const std::string& names, std::string& value, const std::string& help);
  /// An option that may be given more than once, with one text each time; at its place: all words
  /// that are left.
  Option Texts(const std::string& names, std::vector<std::string>& values, const std::string& help);
  /// An option whose text may be left out: it is empty then.
  Option OptionalText(const std::string& names, std::optional<std::string>& value,
                      const std::string& help);
  Option Flag(const std::string& names, bool& value, const std::string& help);

  /// A whole number from 0 on; others are refused, also those that are too large.
  Option WholeNumber(const std::string& names, int& value, const std::string& help);
  Option WholeNumber(const std::string& names, std::optional<int>& value, const std::string& help);
  Option WholeNumber(const std::string& names, std::optional<std::uint64_t>& value,
                     const std::string& help);

  struct Bounds {
    int min, max;  ///< both allowed
  };
  Option BoundedNumber(const std::string& names, int& value, Bounds bounds,
                       const std::string& help);
  Option BoundedNumber(const std::string& names, std::optional<std::int64_t>& value, Bounds bounds,
                       const std::string& help);

  /// ID: the campaign that the verb is about.
  Option Campaign(std::string& campaign);
  /// FILE: a campaign file.
  Option CampaignFile(std::string& file);
  /// --seed in the place of the campaign file's.
  Option Seed(std::optional<std::uint64_t>& seed);

 private:
  CLI::App* verb_;
};

}  // namespace calib::ctl
