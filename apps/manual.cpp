// hapticd manual: man pages and shell completion, made from the same options as --help.
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "commands.h"

namespace hapticd::apps {
namespace {

namespace fs = std::filesystem;

void write(const fs::path& file, const std::string& text) {
  const auto fail = [&](const std::error_code& why) {
    throw std::runtime_error("cannot write '" + file.string() + "': " + why.message() +
                             "; name a folder that can be written");
  };
  std::error_code why;
  fs::create_directories(file.parent_path(), why);
  if (why) fail(why);
  std::ofstream out(file);
  out << text;
  if (!out.flush()) fail({errno, std::system_category()});
}

std::vector<std::string> linesOf(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

// Text for troff: hyphens that can be copied, no control lines.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if ((out.empty() || out.back() == '\n') && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else {
      out += c;
    }
  }
  return out;
}

std::vector<const CLI::App*> commandsOf(const CLI::App& app) {
  std::vector<const CLI::App*> commands;
  for (const CLI::App* command :
       app.get_subcommands([](const CLI::App* each) { return !each->get_group().empty(); }))
    commands.push_back(command);
  return commands;
}

std::vector<const CLI::Option*> optionsOf(const CLI::App& app) {
  std::vector<const CLI::Option*> options;
  for (const CLI::Option* option : app.get_options()) {
    if (!option->get_group().empty()) options.push_back(option);
  }
  return options;
}

// Lines that stay lines.
std::string roffLines(const std::string& text) {
  std::string out;
  for (const std::string& line : linesOf(text)) out += (out.empty() ? "" : "\n.br\n") + roff(line);
  return out;
}

bool takesValue(const CLI::Option& option) {
  return option.get_items_expected_max() > 0;
}

std::string manPage(const CLI::App& command, const std::string& name) {
  std::string page = ".TH \"" + name + "\" 1 \"\" \"hapticd " HAPTICD_VERSION "\"\n.SH NAME\n" + roff(name) +
                     " \\- " + roff(linesOf(command.get_description()).front()) + "\n.SH SYNOPSIS\n";
  std::string synopsis = name;
  if (const auto space = synopsis.find('-'); space != std::string::npos) synopsis[space] = ' ';
  page += ".B " + roff(synopsis) + "\n";
  const auto commands = commandsOf(command);
  page += commands.empty() ? "[OPTIONS]" : "COMMAND [OPTIONS]";
  for (const CLI::Option* option : optionsOf(command)) {
    if (!option->get_positional()) continue;
    page += option->get_required() ? " " + option->get_name(true) : " [" + option->get_name(true) + "]";
  }
  page += "\n.SH DESCRIPTION\n.nf\n" + roff(command.get_description()) + "\n.fi\n";
  if (!commands.empty()) {
    page += ".SH COMMANDS\n";
    for (const CLI::App* each : commands)
      page +=
          ".TP\n.BR " + roff("hapticd-" + each->get_name()) + " (1)\n" + roff(each->get_description()) + "\n";
  }
  if (!optionsOf(command).empty()) page += ".SH OPTIONS\n";
  for (const CLI::Option* option : optionsOf(command)) {
    std::string names = option->get_name(true, true);
    for (std::size_t at = 0; (at = names.find(',', at)) != std::string::npos; at += 2)
      names.replace(at, 1, ", ");
    if (takesValue(*option)) names += " " + option->get_type_name();
    page += ".TP\n.B " + roff(names) + "\n" + roffLines(option->get_description());
    if (!option->get_default_str().empty()) page += " [" + roff(option->get_default_str()) + "]";
    page += "\n";
  }
  if (!command.get_footer().empty()) page += ".SH NOTES\n.nf\n" + roff(command.get_footer()) + "\n.fi\n";
  return page + ".SH SEE ALSO\n.BR hapticd (1),\n/usr/share/doc/hapticd-doc\n";
}

std::string bashCompletion(const CLI::App& app) {
  std::string text =
      "# bash completion for hapticd\n_hapticd() {\n"
      "  local cur=${COMP_WORDS[COMP_CWORD]} command=${COMP_WORDS[1]} words=\n"
      "  if [ \"$COMP_CWORD\" = 1 ]; then\n    words='";
  for (const CLI::App* command : commandsOf(app)) text += command->get_name() + " ";
  text += "--help --version'\n  else\n    case $command in\n      help) words='";
  for (const CLI::App* command : commandsOf(app)) text += command->get_name() + " ";
  text += "' ;;\n";
  for (const CLI::App* command : commandsOf(app)) {
    text += "      " + command->get_name() + ") words='";
    for (const CLI::Option* option : optionsOf(*command)) {
      for (const std::string& name : option->get_lnames()) text += "--" + name + " ";
    }
    text += "' ;;\n";
  }
  return text +
         "    esac\n  fi\n  mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$cur\")\n"
         "  [[ $cur == -* ]] || [ \"$COMP_CWORD\" = 1 ] || [ $command = help ] ||\n"
         "    mapfile -t -O ${#COMPREPLY[@]} COMPREPLY < <(compgen -f -- \"$cur\")\n}\n"
         "complete -o filenames -F _hapticd hapticd\n";
}

// The first line, within single quotes that other ones end with `apostrophe`; a backslash before each of
// `special`.
std::string quoted(const std::string& text, std::string_view apostrophe, std::string_view special) {
  std::string out;
  for (const char c : linesOf(text).empty() ? std::string() : linesOf(text).front()) {
    if (c == '\'') {
      out += apostrophe;
    } else {
      if (special.find(c) != std::string_view::npos) out += '\\';
      out += c;
    }
  }
  return out;
}
std::string zshQuoted(const std::string& text, std::string_view special) {
  return quoted(text, R"('\'')", special);
}
std::string fishQuoted(const std::string& text) {
  return quoted(text, R"(\')", "\\");
}

std::string zshCompletion(const CLI::App& app) {
  std::string text = "#compdef hapticd\nlocal -a commands\ncommands=(\n";
  for (const CLI::App* command : commandsOf(app))
    text += "  '" + command->get_name() + ":" + zshQuoted(command->get_description(), ":\\") + "'\n";
  text += ")\nif (( CURRENT == 2 )); then\n  _describe command commands\n  return\nfi\ncase $words[2] in\n";
  for (const CLI::App* command : commandsOf(app)) {
    text += "  " + command->get_name() + ") _arguments";
    for (const CLI::Option* option : optionsOf(*command)) {
      for (const std::string& name : option->get_lnames())
        text += " \\\n    '--" + name + "[" + zshQuoted(option->get_description(), ":[]\\") + "]" +
                (takesValue(*option) ? ":value:_files'" : "'");
    }
    text += " \\\n    '*:file:_files' ;;\n";
  }
  return text + "esac\n";
}

std::string fishCompletion(const CLI::App& app) {
  std::string text;
  for (const CLI::App* command : commandsOf(app)) {
    const std::string& name = command->get_name();
    text += "complete -c hapticd -n __fish_use_subcommand -f -a " + name + " -d '" +
            fishQuoted(command->get_description()) + "'\n";
    for (const CLI::Option* option : optionsOf(*command)) {
      for (const std::string& each : option->get_lnames()) {
        text += "complete -c hapticd -n '__fish_seen_subcommand_from " + name + "' -l " + each +
                (takesValue(*option) ? " -r" : "") + " -d '" + fishQuoted(option->get_description()) + "'\n";
      }
    }
  }
  return text;
}

int run(const CLI::App& app, const fs::path& folder) {
  write(folder / "man/man1/hapticd.1", manPage(app, "hapticd"));
  for (const CLI::App* command : commandsOf(app)) {
    const std::string name = "hapticd-" + command->get_name();
    write(folder / "man/man1" / (name + ".1"), manPage(*command, name));
  }
  write(folder / "bash-completion/completions/hapticd", bashCompletion(app));
  write(folder / "zsh/vendor-completions/_hapticd", zshCompletion(app));
  write(folder / "fish/vendor_completions.d/hapticd.fish", fishCompletion(app));
  return 0;
}

}  // namespace

void addManual(CLI::App& app) {
  auto folder = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand("manual", "Write man pages and shell completion into a folder");
  command->group("");  // for the installation, not for people
  command->add_option("folder", *folder, "Folder that becomes PREFIX/share")->required();
  command->callback([&app, folder] { exitCode = run(app, *folder); });
}

}  // namespace hapticd::apps
