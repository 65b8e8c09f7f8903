// rtsg help and rtsg completion: prints help about the program itself.
#include <memory>

#include <fmt/format.h>

#include "cli.h"
#include "command_table.h"

namespace rtsg::app {

Verb addHelp(Command& program) {
    struct HelpArguments {
        std::string verb;
        bool man = false;
    };
    auto options = std::make_shared<HelpArguments>();
    Command* command = program.addVerb("help", "Explain a verb, or list all verbs");
    std::vector<std::string> verbs;
    for (const VerbRow& verb : commandTable(program)) verbs.push_back(verb.name);
    command->addOption("VERB", options->verb, "verb to explain")->oneOf(verbs);
    command->addFlag("--man", options->man, "the man page, for man -l");
    command->footer("Example: rtsg help render");
    return {command, [options, &program] {
                if (options->man)
                    fmt::print("{}", manPage(program, RTSG_VERSION));
                else if (options->verb.empty())
                    fmt::print("{}", program.help());
                else
                    fmt::print("{}", program.help(options->verb));
                return static_cast<int>(kDone);
            }};
}

Verb addCompletion(Command& program) {
    auto shell = std::make_shared<std::string>();
    Command* command = program.addVerb("completion", "Print a shell's completion of verbs and options");
    command->addOption("SHELL", *shell, "which shell")
        ->required()
        ->oneOf(std::vector<std::string>{"bash", "zsh", "fish"});
    command->footer("Example: rtsg completion bash > rtsg.bash");
    return {command, [shell, &program] {
                fmt::print("{}", completionScript(program, *shell));
                return static_cast<int>(kDone);
            }};
}

}  // namespace rtsg::app
