// Command: the program's verbs and options. Declared options are parsed, explained by --help, completed by shells and
// listed in the man page.
//
// It wraps the parser thinly, so that only one file is compiled with the parser's headers.
// Threading: the main thread; everything belongs to the program's Command.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace rtsg::app {

/// The user typed something that makes no sense; exit status 2.
struct UsageError : std::runtime_error {
    explicit UsageError(const std::string& text) : std::runtime_error(text) {}
    UsageError(const std::string& option, const std::string& text, std::string likely = {})
        : std::runtime_error(option + ": " + text), meant(std::move(likely)) {}
    std::string meant;  // what the user may have meant, if known
};

/// Something that an option names cannot be used, such as a scene that cannot be read; exit status 1.
struct InputError : std::runtime_error {
    explicit InputError(const std::string& text) : std::runtime_error(text) {}
    InputError(const std::string& option, const std::string& text) : std::runtime_error(option + ": " + text) {}
};

class Option {
  public:
    Option* required();
    /// Shows the variable's present value in the help.
    Option* preset();
    Option* range(int minimum, int maximum);
    Option* range(std::uint64_t minimum, std::uint64_t maximum);
    Option* range(double minimum, double maximum);
    Option* positive();
    /// A number of bytes, such as 64MB.
    Option* bytes();
    Option* oneOf(std::vector<std::string> values);
    /// Sets how many values follow the option.
    Option* expected(int count);
    /// The option may be given several times, with one value each.
    Option* repeatable();
    Option* excludes(Option* other);

  private:
    friend class Command;
    explicit Option(CLI::Option* parsed) : parsed_(parsed) {}
    CLI::Option* parsed_;
};

class Command {
  public:
    /// Makes the program itself.
    Command(const std::string& name, const std::string& description, const std::string& version);
    ~Command();
    Command(const Command&) = delete;
    Command& operator=(const Command&) = delete;

    Command* addVerb(const std::string& name, const std::string& description);
    /// `names`: "-o,--output", or "SCENE" for a positional argument. The variable must outlive the parsing. Numbers
    /// must be finite.
    Option* addOption(const std::string& names, std::string& into, const std::string& description);
    Option* addOption(const std::string& names, int& into, const std::string& description);
    Option* addOption(const std::string& names, unsigned& into, const std::string& description);
    Option* addOption(const std::string& names, std::uint64_t& into, const std::string& description);
    Option* addOption(const std::string& names, double& into, const std::string& description);
    Option* addOption(const std::string& names, std::optional<double>& into, const std::string& description);
    Option* addOption(const std::string& names, std::vector<std::string>& into, const std::string& description);
    Option* addOption(const std::string& names, std::vector<double>& into, const std::string& description);
    Option* addFlag(const std::string& names, bool& into, const std::string& description);
    /// Lines that begin with "Example: " come first in the help, other lines last.
    void footer(const std::string& text);
    /// Options that are added while it lives stand under this heading in the help. If sections are nested, the inner
    /// one counts.
    class Section {
      public:
        Section(Command& command, std::string heading)
            : command_(command), outer_(std::exchange(command.heading_, std::move(heading))) {}
        ~Section() { command_.heading_ = std::move(outer_); }
        Section(const Section&) = delete;
        Section& operator=(const Section&) = delete;

      private:
        Command& command_;
        std::string outer_;
    };

    /// Parses the program's arguments. If help or version was asked for, prints it and returns the exit status. Throws
    /// UsageError.
    std::optional<int> parse(int argc, char** argv);
    /// True if this verb was typed.
    bool parsed() const;
    /// The verb that was typed; null before parse().
    const Command* parsedVerb() const;
    /// The options that were typed, by long name ("--output"), and positional arguments by theirs.
    std::vector<std::string> given() const;
    std::string name() const;
    std::string description() const;
    /// The text of `rtsg --help` or `rtsg VERB --help`.
    std::string help() const;
    std::string help(const std::string& verb) const;

    CLI::App& parser() const { return *parser_; }

  private:
    explicit Command(CLI::App* parser);
    Option* add(CLI::Option* option);

    std::unique_ptr<CLI::App> own_;  // only for the program itself
    CLI::App* parser_;
    std::string heading_;  // empty: the parser's default
    std::deque<std::unique_ptr<Command>> verbs_;
    std::deque<std::unique_ptr<Option>> options_;
};

}  // namespace rtsg::app
