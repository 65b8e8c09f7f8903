// rtsg help and rtsg completion: what the program says about itself.
#include <memory>

#include <fmt/format.h>

#include "cli.h"
#include "command_table.h"

namespace rtsg::app {

Verb addHelp(CLI::App& program) {
    struct Options {
        std::string verb;
        bool man = false;
    };
    auto options = std::make_shared<Options>();
    CLI::App* command = program.add_subcommand("help", "Say what a verb does, or what verbs there are");
    std::vector<std::string> verbs;
    for (const VerbRow& verb : commandTable(program)) verbs.push_back(verb.name);
    command->add_option("VERB", options->verb, "verb to explain")->check(CLI::IsMember(verbs));
    command->add_flag("--man", options->man, "the man page, for man -l");
    command->footer("Example: rtsg help render");
    return {command, [options, &program] {
                if (options->man)
                    fmt::print("{}", manPage(program, RTSG_VERSION));
                else if (options->verb.empty())
                    // App::help() would explain the verb that was parsed, this one.
                    fmt::print("{}", program.get_formatter()->make_help(&program, "rtsg", CLI::AppFormatMode::Normal));
                else
                    fmt::print("{}", program.get_subcommand(options->verb)->help("rtsg"));
                return static_cast<int>(kDone);
            }};
}

Verb addCompletion(CLI::App& program) {
    auto shell = std::make_shared<std::string>();
    CLI::App* command = program.add_subcommand("completion", "Print a shell's completion of verbs and options");
    command->add_option("SHELL", *shell, "which shell")
        ->required()
        ->check(CLI::IsMember(std::vector<std::string>{"bash", "zsh", "fish"}));
    command->footer("Example: rtsg completion bash > rtsg.bash");
    return {command, [shell, &program] {
                fmt::print("{}", completionScript(program, *shell));
                return static_cast<int>(kDone);
            }};
}

}  // namespace rtsg::app
