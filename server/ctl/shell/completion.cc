#include "server/ctl/shell/completion.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"

namespace calib::ctl {
namespace {

using Words = std::vector<std::string>;

// A text in single quotes, as bash and zsh read it.
std::string InQuotes(const std::string& text) {
  return absl::StrCat("'", absl::StrReplaceAll(text, {{"'", "'\\''"}}), "'");
}

// fish knows \' and \\ within single quotes.
std::string InQuotesOfFish(const std::string& text) {
  return absl::StrCat("'", absl::StrReplaceAll(text, {{"\\", "\\\\"}, {"'", "\\'"}}), "'");
}

Words NamesOf(const std::vector<OptionEntry>& options, bool only_with_value = false) {
  Words names;
  for (const OptionEntry& option : options) {
    if (option.at_its_place || (only_with_value && !option.takes_value)) continue;
    names.insert(names.end(), option.names.begin(), option.names.end());
  }
  return names;
}

Words VerbsOf(const CommandTree& tree) {
  Words names;
  for (const VerbEntry& verb : tree.verbs) names.push_back(verb.name);
  return names;
}

std::string Bash(const CommandTree& tree) {
  const std::string common = absl::StrJoin(NamesOf(tree.common), " ");
  std::string script = absl::StrCat(
      R"(# bash completion of calibctl
_calibctl() {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} verb= options values i
  COMPREPLY=()
  for ((i = 1; i < COMP_CWORD; ++i)); do
    case ${COMP_WORDS[i]} in
      )",
      absl::StrJoin(NamesOf(tree.common, true), "|"), R"() ((++i)) ;;
      -*) ;;
      *) verb=${COMP_WORDS[i]}; break ;;
    esac
  done
  case $verb in
)");
  for (const VerbEntry& verb : tree.verbs) {
    absl::StrAppend(&script, "    ", verb.name,
                    ") options=", InQuotes(absl::StrJoin(NamesOf(verb.options), " ")),
                    " values=", InQuotes(absl::StrJoin(NamesOf(verb.options, true), " ")), " ;;\n");
  }
  absl::StrAppend(&script, "    *) options=", InQuotes(absl::StrJoin(VerbsOf(tree), " ")), " ;;\n",
                  R"(  esac
  case " $values )",
                  absl::StrJoin(NamesOf(tree.common, true), " "), R"( " in
    *" $before "*) return ;;  # the value of an option: names of files
  esac
  if [[ -z $verb || $word == -* ]]; then
    COMPREPLY=($(compgen -W "$options )",
                  common, R"(" -- "$word"))
  fi
}
complete -o default -F _calibctl calibctl
)");
  return script;
}

// What _arguments of zsh reads: brackets and colons end its parts.
std::string SpecOfZsh(const OptionEntry& option) {
  const std::string help =
      absl::StrReplaceAll(option.help, {{"\\", "\\\\"}, {"[", "\\["}, {"]", "\\]"}, {":", "\\:"}});
  if (option.at_its_place) return InQuotes(absl::StrCat("*:", option.names.front(), ":_files"));
  Words specs;
  for (const std::string& name : option.names) {
    specs.push_back(InQuotes(
        absl::StrCat("*", name, "[", help, "]", option.takes_value ? ":value:_files" : "")));
  }
  return absl::StrJoin(specs, " ");
}

std::string SpecsOfZsh(const std::vector<OptionEntry>& options) {
  std::string specs;
  bool has_words = false;  // `*:` takes all that are left
  for (const OptionEntry& option : options) {
    if (option.at_its_place && has_words) continue;
    has_words = has_words || option.at_its_place;
    absl::StrAppend(&specs, " \\\n        ", SpecOfZsh(option));
  }
  return specs;
}

std::string Zsh(const CommandTree& tree) {
  std::string script =
      "#compdef calibctl\n# zsh completion of calibctl\n_calibctl() {\n"
      "  local curcontext=$curcontext state line\n  local -a verbs=(\n";
  for (const VerbEntry& verb : tree.verbs) {
    absl::StrAppend(&script, "    ",
                    InQuotes(absl::StrCat(verb.name, ":",
                                          absl::StrReplaceAll(verb.description, {{":", "\\:"}}))),
                    "\n");
  }
  absl::StrAppend(&script, "  )\n  _arguments -C", SpecsOfZsh(tree.common),
                  " \\\n        '1: :->verb' '*:: :->rest'\n"
                  "  case $state in\n    verb) _describe command verbs ;;\n    rest)\n"
                  "      case $words[1] in\n");
  for (const VerbEntry& verb : tree.verbs) {
    absl::StrAppend(&script, "      ", verb.name, ") _arguments", SpecsOfZsh(verb.options),
                    SpecsOfZsh(tree.common), " ;;\n");
  }
  return script + "      esac ;;\n  esac\n}\ncompdef _calibctl calibctl\n";
}

std::string LineOfFish(const std::string& condition, const OptionEntry& option) {
  std::string line = "complete -c calibctl" + condition;
  for (const std::string& name : option.names) {
    absl::StrAppend(&line, name.starts_with("--") ? " -l " : " -s ",
                    name.substr(name.starts_with("--") ? 2 : 1));
  }
  return absl::StrCat(line, option.takes_value ? " -r -F" : "", " -d ", InQuotesOfFish(option.help),
                      "\n");
}

std::string Fish(const CommandTree& tree) {
  std::string script = "# fish completion of calibctl\n";
  const std::string verbs = absl::StrJoin(VerbsOf(tree), " ");
  const std::string none = absl::StrCat(" -n 'not __fish_seen_subcommand_from ", verbs, "'");
  for (const OptionEntry& option : tree.common) absl::StrAppend(&script, LineOfFish("", option));
  for (const VerbEntry& verb : tree.verbs) {
    absl::StrAppend(&script, "complete -c calibctl -f", none, " -a ", verb.name, " -d ",
                    InQuotesOfFish(verb.description), "\n");
  }
  for (const VerbEntry& verb : tree.verbs) {
    const std::string chosen = absl::StrCat(" -n '__fish_seen_subcommand_from ", verb.name, "'");
    for (const OptionEntry& option : verb.options) {
      if (!option.at_its_place) absl::StrAppend(&script, LineOfFish(chosen, option));
    }
  }
  return script;
}

}  // namespace

std::string CompletionScript(Shell shell, const CommandTree& tree) {
  switch (shell) {
    case Shell::kBash:
      return Bash(tree);
    case Shell::kZsh:
      return Zsh(tree);
    case Shell::kFish:
      break;
  }
  return Fish(tree);
}

}  // namespace calib::ctl
