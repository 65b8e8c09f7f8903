// The program's verbs and options: what is declared here is parsed, explained, completed and listed in the man page.
//
// A thin cover of the parser, so that one file is compiled with its headers and not every verb's.
// Threading: the main thread; all belongs to the program's Command.
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

/// The user typed what cannot be meant; exit status 2.
struct UsageError : std::runtime_error {
    explicit UsageError(const std::string& text) : std::runtime_error(text) {}
    UsageError(const std::string& option, const std::string& text, std::string likely = {})
        : std::runtime_error(option + ": " + text), meant(std::move(likely)) {}
    std::string meant;  // what may have been, if that is known
};

/// Something that an option names cannot be had or used, such as a scene that cannot be read; exit status 1.
struct InputError : std::runtime_error {
    InputError(const std::string& option, const std::string& text) : std::runtime_error(option + ": " + text) {}
};

class Option {
  public:
    Option* required();
    /// Shows the variable's present value in the help.
    Option* preset();
    Option* range(int least, int most);
    Option* range(std::uint64_t least, std::uint64_t most);
    Option* range(double least, double most);
    Option* positive();
    /// A number of bytes, as 64MB.
    Option* bytes();
    Option* oneOf(std::vector<std::string> values);
    /// How many values at once.
    Option* expected(int count);
    /// May come several times, with a value each.
    Option* repeatable();
    Option* excludes(Option* other);

  private:
    friend class Command;
    explicit Option(CLI::Option* parsed) : parsed_(parsed) {}
    CLI::Option* parsed_;
};

class Command {
  public:
    /// The program itself.
    Command(const std::string& name, const std::string& description, const std::string& version);
    ~Command();
    Command(const Command&) = delete;
    Command& operator=(const Command&) = delete;

    Command* addVerb(const std::string& name, const std::string& description);
    /// `names`: "-o,--output", or "SCENE" for an argument by its place. The variable must outlive the parsing. Numbers
    /// are finite.
    Option* addOption(const std::string& names, std::string& into, const std::string& description);
    Option* addOption(const std::string& names, int& into, const std::string& description);
    Option* addOption(const std::string& names, unsigned& into, const std::string& description);
    Option* addOption(const std::string& names, std::uint64_t& into, const std::string& description);
    Option* addOption(const std::string& names, double& into, const std::string& description);
    Option* addOption(const std::string& names, std::optional<double>& into, const std::string& description);
    Option* addOption(const std::string& names, std::vector<std::string>& into, const std::string& description);
    Option* addOption(const std::string& names, std::vector<double>& into, const std::string& description);
    Option* addFlag(const std::string& names, bool& into, const std::string& description);
    /// Lines that begin with "Example: " stand first in the help, the others last.
    void footer(const std::string& text);
    /// Options that are added while it lives stand under this heading in the help. Of two, the inner one holds.
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

    /// Parses the program's arguments. Returns the exit status if help or version were asked for, which are then
    /// printed. Throws UsageError.
    std::optional<int> parse(int argc, char** argv);
    /// Whether this verb is the one that was typed.
    bool parsed() const;
    /// The verb of the program that was typed; null before parse().
    const Command* parsedVerb() const;
    /// The options that were typed, by their long names: "--output"; arguments by theirs.
    std::vector<std::string> given() const;
    std::string name() const;
    std::string description() const;
    /// The program's text of `rtsg --help` or `rtsg VERB --help`.
    std::string help() const;
    std::string help(const std::string& verb) const;

    CLI::App& parser() const { return *parser_; }

  private:
    explicit Command(CLI::App* parser);
    Option* add(CLI::Option* option);

    std::unique_ptr<CLI::App> own_;  // of the program
    CLI::App* parser_;
    std::string heading_;  // empty: the parser's own
    std::deque<std::unique_ptr<Command>> verbs_;
    std::deque<std::unique_ptr<Option>> options_;
};

}  // namespace rtsg::app
