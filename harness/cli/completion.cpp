// raybench completion: what a shell needs to complete commands, options and names, made of the commands themselves.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>

#include "datasets/models/manifest.h"
#include "harness/cli/commands.h"
#include "harness/plan/suite.h"

namespace raybench {
namespace {

/// What can stand in a place: the word that the scripts know it by.
enum class Filled { kNothing, kAnything, kFile, kNames };

struct Place {
  Filled filled = Filled::kNothing;
  std::string names;    ///< key of the lists of names
  bool files = false;   ///< or a file
  bool commas = false;  ///< several, with commas between
};

struct OptionOf {
  std::vector<std::string> words;  ///< "--out", "-o"
  std::string doc;                 ///< its first sentence
  Place value;
};

struct CommandOf {
  std::string path;                                        ///< "raybench list structure"
  std::vector<std::pair<std::string, std::string>> below;  ///< subcommands with their documentation
  std::vector<OptionOf> options;
  Place positional;
};

std::string FirstSentence(const std::string& text) {
  std::string line =
      text.substr(0, std::min({text.find(". "), text.find("; "), text.find('\n'), text.size()}));
  std::replace(line.begin(), line.end(), '\'', ' ');
  return line;
}

/// What an option or argument takes, by what its help calls it.
Place PlaceOf(const CLI::App& command, const CLI::Option& option) {
  if (option.get_items_expected_max() == 0) return {};
  const std::string type = option.get_type_name();
  const bool list = option.get_delimiter() == ',' || type.find(',') != type.npos;
  const auto names = [&](const char* key, bool files, bool commas) {
    return Place{Filled::kNames, key, files, commas};
  };
  if (type.find("SCENE") != type.npos) return names("scenes", true, false);
  if (option.check_lname("structures") || option.check_lname("structure"))
    return names("structures", false, list);
  if (option.check_lname("suite")) return names("suites", true, false);
  if (type.find("FAMILY") != type.npos) return names("models", false, false);
  if (type.find("SHELL") != type.npos) return names("shells", false, false);
  if (type == "NAME") return names((command.get_name() + "s").c_str(), command.get_name() == "suite", false);
  for (const char* file : {"FILE", "DIR", "OUT"})
    if (type.find(file) != type.npos) return {Filled::kFile, "", true, false};
  return {Filled::kAnything, "", false, false};
}

void Collect(const CLI::App& app, const std::string& path, std::vector<CommandOf>& commands) {
  CommandOf own{.path = path, .below = {}, .options = {}, .positional = {}};
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_positional()) {
      own.positional = PlaceOf(app, *option);
      continue;
    }
    OptionOf known{{}, FirstSentence(option->get_description()), PlaceOf(app, *option)};
    for (const std::string& name : option->get_lnames()) known.words.push_back("--" + name);
    for (const std::string& name : option->get_snames()) known.words.push_back("-" + name);
    own.options.push_back(std::move(known));
  }
  const auto below = app.get_subcommands([](const CLI::App*) { return true; });
  for (const CLI::App* sub : below)
    own.below.emplace_back(sub->get_name(), FirstSentence(sub->get_description()));
  commands.push_back(std::move(own));
  for (const CLI::App* sub : below) Collect(*sub, path + " " + sub->get_name(), commands);
}

using Names = std::map<std::string, std::vector<std::string>>;

Names AllNames(const Registry& registry) {
  Names names;
  for (const rb_structure* s : registry.structures()) names["structures"].push_back(s->name);
  for (const std::string& name : registry.OnRequest()) names["structures"].push_back(name);
  for (const Generator* g : Generators()) names["generators"].push_back(g->name);
  for (const Modifier* m : Modifiers()) names["generators"].push_back(m->name);
  for (const ManifestEntry& entry : Manifest()) names["models"].push_back(entry.name);
  names["scenes"] = names["generators"];
  names["scenes"].insert(names["scenes"].end(), names["models"].begin(), names["models"].end());
  for (const SuiteText& suite : ShippedSuites()) names["suites"].push_back(suite.name);
  names["shells"] = {"bash", "zsh", "fish"};
  return names;
}

/// "names:files:commas" for the scripts; "-": nothing to complete; "": a flag.
std::string Word(const Place& place) {
  switch (place.filled) {
    case Filled::kNothing:
      return "";
    case Filled::kAnything:
      return "-";
    default:
      return fmt::format("{}:{}:{}", place.names, place.files ? "files" : "", place.commas ? "commas" : "");
  }
}

/// Tables as both bash and zsh read them: of each command's path its subcommands and options, what follows an
/// option and what stands free, and the lists of names.
std::string Tables(const std::vector<CommandOf>& commands, const Names& names) {
  std::string below, options, values, free, lists;
  for (const CommandOf& c : commands) {
    std::string words;
    for (const auto& [name, doc] : c.below) words += name + " ";
    below += fmt::format("  ['{}']='{}'\n", c.path, words);
    words.clear();
    for (const OptionOf& o : c.options)
      for (const std::string& word : o.words) {
        words += word + " ";
        if (o.value.filled != Filled::kNothing)
          values += fmt::format("  ['{} {}']='{}'\n", c.path, word, Word(o.value));
      }
    options += fmt::format("  ['{}']='{}'\n", c.path, words);
    free += fmt::format("  ['{}']='{}'\n", c.path, Word(c.positional));
  }
  for (const auto& [key, list] : names) lists += fmt::format("  ['{}']='{}'\n", key, fmt::join(list, " "));
  return fmt::format(
      "typeset -gA _raybench_below=(\n{})\ntypeset -gA _raybench_options=(\n{})\n"
      "typeset -gA _raybench_values=(\n{})\ntypeset -gA _raybench_free=(\n{})\ntypeset -gA "
      "_raybench_names=(\n{})\n",
      below, options, values, free, lists);
}

constexpr const char* kBash = R"script(
_raybench() {
  local path=raybench word i cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD - 1]} place= start=
  # bash splits --option=value at the sign
  if [[ $cur == = ]]; then cur=; elif [[ $prev == = ]]; then prev=${COMP_WORDS[COMP_CWORD - 2]}; fi
  for ((i = 1; i < COMP_CWORD; ++i)); do
    word=${COMP_WORDS[i]}
    [[ " ${_raybench_below[$path]} " == *" $word "* ]] && path+=" $word"
  done
  place=${_raybench_values["$path $prev"]-${_raybench_values["raybench $prev"]-}}
  COMPREPLY=()
  if [[ -z $place ]]; then
    if [[ $cur == -* ]]; then
      COMPREPLY=($(compgen -W "${_raybench_options[$path]} ${_raybench_options[raybench]}" -- "$cur"))
      return
    fi
    COMPREPLY=($(compgen -W "${_raybench_below[$path]}" -- "$cur"))
    place=${_raybench_free[$path]}
  fi
  [[ $place == - || -z $place ]] && return
  if [[ $place == *:commas && $cur == *,* ]]; then start=${cur%,*},; fi
  if [[ $place != :* ]]; then
    COMPREPLY+=($(compgen -P "$start" -W "${_raybench_names[${place%%:*}]}" -- "${cur#"$start"}"))
  fi
  if [[ $place == *:files:* ]]; then
    compopt -o filenames 2>/dev/null
    COMPREPLY+=($(compgen -f -- "$cur"))
  fi
}
complete -F _raybench raybench
)script";

constexpr const char* kZsh = R"script(
_raybench() {
  local place= at=raybench cur=$words[CURRENT] prev=$words[CURRENT-1] i
  for ((i = 2; i < CURRENT; ++i)); do
    [[ " ${_raybench_below[$at]} " == *" $words[i] "* ]] && at+=" $words[i]"
  done
  if [[ $cur == --*=* ]]; then
    prev=${cur%%=*}
    compset -P '*='
  fi
  place=${_raybench_values[$at $prev]-${_raybench_values[raybench $prev]-}}
  if [[ -z $place ]]; then
    if [[ $cur == -* ]]; then
      compadd -- ${=_raybench_options[$at]} ${=_raybench_options[raybench]}
      return
    fi
    compadd -- ${=_raybench_below[$at]}
    place=$_raybench_free[$at]
  fi
  [[ $place == - || -z $place ]] && return
  [[ $place == *:commas ]] && compset -P '*,'
  [[ $place == :* ]] || compadd -- ${=_raybench_names[${place%%:*}]}
  [[ $place == *:files:* ]] && _files
}
(( $+functions[compdef] )) || { autoload -Uz compinit && compinit }
compdef _raybench raybench
)script";

std::string ForBash(const std::vector<CommandOf>& commands, const Names& names) {
  std::string text = Tables(commands, names);
  // The same word for both shells but for this: in bash `typeset -g` inside no function is `declare`.
  for (size_t at; (at = text.find("typeset -gA")) != text.npos;) text.replace(at, 11, "declare -gA");
  return "# bash completion for raybench; use: source <(raybench completion bash)\n" + text + kBash;
}

/// zsh takes keys in quotes for keys with quotes.
std::string ForZsh(const std::vector<CommandOf>& commands, const Names& names) {
  std::string text = Tables(commands, names);
  std::string plain;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text.compare(i, 2, "['") == 0) {
      const size_t end = text.find("']=", i);
      plain += fmt::format("'{}' ", text.substr(i + 2, end - i - 2));
      i = end + 2;
    } else {
      plain += text[i];
    }
  }
  return "#compdef raybench\n# zsh completion for raybench; use: source <(raybench completion zsh)\n" +
         plain + kZsh;
}

std::string ForFish(const std::vector<CommandOf>& commands, const Names& names) {
  std::string text = R"script(# fish completion for raybench; use: raybench completion fish | source
function __raybench_at --description 'Whether these are the commands typed so far'
    set -l typed raybench
    for word in (commandline -opc)[2..]
        contains -- "$typed $word" $__raybench_paths; and set typed "$typed $word"
    end
    test "$typed" = "$argv"
end
complete -c raybench -f
)script";
  text += "set -g __raybench_paths";
  for (const CommandOf& c : commands) text += fmt::format(" '{}'", c.path);
  text += "\n";
  const auto arguments = [&](const Place& place) {
    std::string words = place.files ? " -F" : "";
    const auto list = names.find(place.names);
    if (list != names.end()) words += fmt::format(" -a '{}'", fmt::join(list->second, " "));
    return words;
  };
  for (const CommandOf& c : commands) {
    const std::string here = fmt::format("complete -c raybench -n '__raybench_at {}'", c.path);
    for (const auto& [name, doc] : c.below) text += fmt::format("{} -a {} -d '{}'\n", here, name, doc);
    if (c.positional.filled == Filled::kNames || c.positional.filled == Filled::kFile)
      text += here + arguments(c.positional) + "\n";
    for (const OptionOf& o : c.options) {
      std::string line = here;
      for (const std::string& word : o.words)
        line += word.starts_with("--") ? " -l " + word.substr(2) : " -s " + word.substr(1);
      if (o.value.filled != Filled::kNothing) line += o.value.files ? " -r" : " -x";
      if (o.value.filled != Filled::kNothing) line += arguments(o.value);
      text += fmt::format("{} -d '{}'\n", line, o.doc);
    }
  }
  return text;
}

void AddCompletionCommand(CLI::App& app, Invocation& invocation) {
  CLI::App& command =
      *app.add_subcommand("completion", "Print what completes this command's words in a shell");
  auto shell = std::make_shared<std::string>();
  command.add_option("shell", *shell, "bash, zsh or fish")->required()->type_name("SHELL");
  command.footer(
      "  bash:  source <(raybench completion bash)        in ~/.bashrc\n"
      "  zsh:   source <(raybench completion zsh)         in ~/.zshrc\n"
      "  fish:  raybench completion fish | source         in ~/.config/fish/config.fish");
  command.callback([&app, &invocation, shell] {
    invocation.action = [&app, shell](const Registry& registry) {
      std::vector<CommandOf> commands;
      Collect(app, "raybench", commands);
      const Names names = AllNames(registry);
      if (*shell == "bash") {
        fmt::print("{}", ForBash(commands, names));
      } else if (*shell == "zsh") {
        fmt::print("{}", ForZsh(commands, names));
      } else if (*shell == "fish") {
        fmt::print("{}", ForFish(commands, names));
      } else {
        throw InputError(fmt::format("completion '{}': allowed: bash, zsh, fish", *shell));
      }
      return 0;
    };
  });
}

}  // namespace

const Command kCompletion = {110, AddCompletionCommand};

}  // namespace raybench
