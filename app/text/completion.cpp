// Makes completion scripts for shells from the program's tables of verbs and options.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "command_table.h"

namespace rtsg::app {

namespace {

std::vector<std::string> verbNames(const std::vector<VerbRow>& verbs) {
    std::vector<std::string> names;
    for (const VerbRow& verb : verbs) names.push_back(verb.name);
    return names;
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
    for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += by.size())
        text.replace(at, what.size(), by);
    return text;
}

/// Values from a list are completed as words, all others as file names.
std::string bash(const std::vector<VerbRow>& verbs) {
    std::string values, options;
    for (const VerbRow& verb : verbs) {
        std::vector<std::string> names, words;
        for (const OptionRow& option : verb.options) {
            if (option.positional) {
                words.insert(words.end(), option.choices.begin(), option.choices.end());
                continue;
            }
            names.insert(names.end(), option.names.begin(), option.names.end());
            if (!option.takesValue) continue;
            std::vector<std::string> patterns;
            for (const std::string& name : option.names) patterns.push_back(verb.name + ":" + name);
            values += option.choices.empty()
                          ? fmt::format("        {}) return ;;\n", fmt::join(patterns, " | "))
                          : fmt::format("        {}) COMPREPLY=($(compgen -W '{}' -- \"$cur\")); return ;;\n",
                                        fmt::join(patterns, " | "), fmt::join(option.choices, " "));
        }
        options += fmt::format("        {}) options='{}' words='{}' ;;\n", verb.name, fmt::join(names, " "),
                               fmt::join(words, " "));
    }
    return fmt::format(R"(# Completion of rtsg for bash: rtsg completion bash > /etc/bash_completion.d/rtsg
_rtsg() {{
    local cur=${{COMP_WORDS[COMP_CWORD]}} prev=${{COMP_WORDS[COMP_CWORD-1]}} verb=${{COMP_WORDS[1]}} options= words=
    COMPREPLY=()
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W '{} --help --version' -- "$cur"))
        return
    fi
    case $verb:$prev in
{}    esac
    case $verb in
{}    esac
    case $cur in
        -*) COMPREPLY=($(compgen -W "$options" -- "$cur")) ;;
        *) [ -z "$words" ] || COMPREPLY=($(compgen -W "$words" -- "$cur")) ;;
    esac
}}
complete -o default -F _rtsg rtsg
)",
                       fmt::join(verbNames(verbs), " "), values, options);
}

std::string zsh(const std::vector<VerbRow>& verbs) {
    const auto quoted = [](const std::string& text) {
        std::string out = replaced(text, "'", "'\\''");
        for (const char* special : {"[", "]", ":"}) out = replaced(out, special, std::string("\\") + special);
        return out;
    };
    std::string names, cases;
    for (const VerbRow& verb : verbs) {
        names += fmt::format("        '{}:{}'\n", verb.name, quoted(verb.description));
        std::string arguments;
        for (const OptionRow& option : verb.options) {
            const std::string value =
                option.choices.empty() ? "_files" : fmt::format("({})", fmt::join(option.choices, " "));
            if (option.positional) {
                arguments += fmt::format(" \\\n                '*:{}:{}'", quoted(option.names.front()), value);
                continue;
            }
            for (const std::string& name : option.names)
                arguments += fmt::format(" \\\n                '{}[{}]{}'", name, quoted(option.description),
                                         option.takesValue ? ":" + quoted(option.value) + ":" + value : "");
        }
        cases += fmt::format("            {})\n            _arguments{}\n            ;;\n", verb.name, arguments);
    }
    return fmt::format(R"(#compdef rtsg
# Completion of rtsg for zsh: rtsg completion zsh > a folder of $fpath/_rtsg
_rtsg() {{
    local -a verbs=(
{}    )
    if (( CURRENT == 2 )); then
        _describe verb verbs
        return
    fi
    local verb=$words[2]
    shift words
    (( CURRENT-- ))
    case $verb in
{}    esac
}}
_rtsg "$@"
)",
                       names, cases);
}

std::string fish(const std::vector<VerbRow>& verbs) {
    const auto quoted = [](const std::string& text) {
        return "'" + replaced(replaced(text, "\\", "\\\\"), "'", "\\'") + "'";
    };
    std::string out =
        "# Completion of rtsg for fish: rtsg completion fish > ~/.config/fish/completions/rtsg.fish\n"
        "complete -c rtsg -n __fish_use_subcommand -f\n"
        "complete -c rtsg -n __fish_use_subcommand -l help -d 'Print help'\n"
        "complete -c rtsg -n __fish_use_subcommand -l version -d 'Print the version'\n";
    for (const VerbRow& verb : verbs) {
        out +=
            fmt::format("complete -c rtsg -n __fish_use_subcommand -a {} -d {}\n", verb.name, quoted(verb.description));
        const std::string here = fmt::format("complete -c rtsg -n '__fish_seen_subcommand_from {}'", verb.name);
        for (const OptionRow& option : verb.options) {
            const std::string words =
                option.choices.empty() ? "" : fmt::format(" -f -a '{}'", fmt::join(option.choices, " "));
            if (option.positional) {
                if (!words.empty()) out += here + words + "\n";
                continue;
            }
            out += here;
            for (const std::string& name : option.names)
                out += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
            if (option.takesValue) out += " -r" + words;
            out += " -d " + quoted(option.description) + "\n";
        }
    }
    return out;
}

}  // namespace

std::string completionScript(const Command& program, const std::string& shell) {
    const auto verbs = commandTable(program);
    return shell == "zsh" ? zsh(verbs) : shell == "fish" ? fish(verbs) : bash(verbs);
}

}  // namespace rtsg::app
