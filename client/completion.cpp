#include "client/completion.h"

#include <CLI/CLI.hpp>
#include <sstream>

namespace strata::client {
namespace {

std::string words(const CLI::App& app) {
  std::string text;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) text += command->get_name() + " ";
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) text += "--" + name + " ";
  return text;
}

std::string bash(const CLI::App& app) {
  std::ostringstream out;
  out << "_strata() {\n  local words=\"" << words(app) << "\"\n  case \"${COMP_WORDS[1]}\" in\n";
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    out << "    " << command->get_name() << ") words=\"" << words(*command) << words(app) << "\" ;;\n";
  out << "  esac\n  COMPREPLY=($(compgen -W \"$words\" -- \"${COMP_WORDS[COMP_CWORD]}\") $(compgen -f -- "
         "\"${COMP_WORDS[COMP_CWORD]}\"))\n}\n"
      << "complete -o filenames -F _strata strata\n";
  return out.str();
}

std::string fish(const CLI::App& app) {
  std::ostringstream out;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    out << "complete -c strata -n __fish_use_subcommand -a " << command->get_name() << " -d '" << command->get_description() << "'\n";
    for (const CLI::Option* option : command->get_options())
      for (const std::string& name : option->get_lnames())
        out << "complete -c strata -n '__fish_seen_subcommand_from " << command->get_name() << "' -l " << name << '\n';
  }
  return out.str();
}

}  // namespace

std::string completion(const CLI::App& app, const std::string& shell) {
  if (shell == "fish") return fish(app);
  return (shell == "zsh" ? "autoload -U +X bashcompinit && bashcompinit\n" : "") + bash(app);
}

}  // namespace strata::client
