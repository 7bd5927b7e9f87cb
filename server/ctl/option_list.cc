#include "server/ctl/option_list.h"

#include <CLI/CLI.hpp>
#include <charconv>

#include "absl/strings/str_cat.h"

namespace calib::ctl {
namespace {

// CLI11 wraps negative and too large numbers round.
std::string ProblemOfWholeNumber(const std::string& text) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc() && end == text.data() + text.size()) return "";
  return absl::StrCat("'", text, "' is not a whole number from 0 to 18446744073709551615");
}

}  // namespace

const Option& Option::Required() const {
  option_->required();
  return *this;
}

const Option& Option::Excludes(const Option& other) const {
  option_->excludes(other.option_);
  return *this;
}

Option OptionList::Text(const std::string& names, std::string& value, const std::string& help) {
  return Option(verb_->add_option(names, value, help));
}

Option OptionList::Texts(const std::string& names, std::vector<std::string>& values,
                         const std::string& help) {
  CLI::Option* const option = verb_->add_option(names, values, help);
  if (names.starts_with('-')) option->allow_extra_args(false);
  return Option(option);
}

Option OptionList::OptionalText(const std::string& names, std::optional<std::string>& value,
                                const std::string& help) {
  const auto read = [&value](const CLI::results_t& words) {
    value = words.empty() ? "" : words.front();
    return true;
  };
  return Option(verb_->add_option(names, read, help)->expected(0, 1));
}

Option OptionList::Flag(const std::string& names, bool& value, const std::string& help) {
  return Option(verb_->add_flag(names, value, help));
}

Option OptionList::WholeNumber(const std::string& names, int& value, const std::string& help) {
  return Option(verb_->add_option(names, value, help)->check(ProblemOfWholeNumber));
}

Option OptionList::WholeNumber(const std::string& names, std::optional<int>& value,
                               const std::string& help) {
  return Option(verb_->add_option(names, value, help)->check(ProblemOfWholeNumber));
}

Option OptionList::WholeNumber(const std::string& names, std::optional<std::uint64_t>& value,
                               const std::string& help) {
  return Option(verb_->add_option(names, value, help)->check(ProblemOfWholeNumber));
}

Option OptionList::BoundedNumber(const std::string& names, int& value, Bounds bounds,
                                 const std::string& help) {
  return Option(verb_->add_option(names, value, help)->check(CLI::Range(bounds.min, bounds.max)));
}

Option OptionList::BoundedNumber(const std::string& names, std::optional<std::int64_t>& value,
                                 Bounds bounds, const std::string& help) {
  return Option(verb_->add_option(names, value, help)->check(CLI::Range(bounds.min, bounds.max)));
}

Option OptionList::Campaign(std::string& campaign) {
  return Text("ID", campaign, "campaign, as shown by `calibctl list`").Required();
}

Option OptionList::CampaignFile(std::string& file) {
  return Text("FILE", file, "campaign file (YAML)").Required();
}

Option OptionList::Seed(std::optional<std::uint64_t>& seed) {
  return WholeNumber("--seed", seed, "replaces the seed of the campaign file");
}

}  // namespace calib::ctl
