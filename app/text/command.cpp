// Implements verbs and options with CLI11.
#include "command.h"

#include <charconv>
#include <cmath>
#include <sstream>

#include <CLI/CLI.hpp>

namespace rtsg::app {

namespace {

/// The parser takes "nan" and "inf" for numbers, and nan passes every range.
CLI::Option* finite(CLI::Option* option) {
    return option->check([](const std::string& text) {
        double number = 0;
        const bool known = CLI::detail::lexical_cast(text, number);
        return known && !std::isfinite(number) ? text + " is not a finite number" : std::string();
    });
}

/// The parser would treat an empty value, as of an unset shell variable, as an option that was not given.
CLI::Option* notEmpty(CLI::Option* option) {
    return option->check([](const std::string& text) { return text.empty() ? "a value is empty" : std::string(); });
}

/// Without this check -1 would become a large number.
CLI::Option* notNegative(CLI::Option* option) {
    return option->check([](const std::string& text) {
        if (text.starts_with('-')) return text + " is negative";
        // The parser would use the largest number instead.
        std::uint64_t value = 0;
        const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
        return problem == std::errc::result_out_of_range ? text + " is too large" : std::string();
    });
}

/// Shows examples first, in lines of readable length.
class Help : public CLI::Formatter {
  public:
    std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override {
        std::string examples, rest;
        std::istringstream footer(app->get_footer());
        for (std::string line; std::getline(footer, line);)
            (line.starts_with("Example: ") ? examples : rest) += line + "\n";
        if (!examples.empty()) examples.insert(0, "\n");
        const std::string options =
            CLI::detail::find_and_replace(make_positionals(app) + make_groups(app, mode), "\n\n\n", "\n\n");
        return make_description(app) + make_usage(app, std::move(name)) + examples + options +
               make_subcommands(app, mode) + (rest.empty() ? "" : "\n" + rest);
    }
    std::string make_option_desc(const CLI::Option* option) const override {
        constexpr std::size_t kWidth = 70;
        std::string text;
        std::size_t column = 0;
        std::istringstream words(option->get_description());
        for (std::string word; words >> word; column += word.size() + 1) {
            if (column > 0 && column + word.size() > kWidth) column = 0;
            text += (text.empty() ? "" : column == 0 ? "\n" : " ") + word;
        }
        return text;
    }
};

}  // namespace

Option* Option::required() {
    parsed_->required();
    return this;
}
Option* Option::preset() {
    parsed_->capture_default_str();
    return this;
}
Option* Option::range(int minimum, int maximum) {
    parsed_->check(CLI::Range(minimum, maximum));
    return this;
}
Option* Option::range(std::uint64_t minimum, std::uint64_t maximum) {
    parsed_->check(CLI::Range(minimum, maximum));
    return this;
}
Option* Option::range(double minimum, double maximum) {
    parsed_->check(CLI::Range(minimum, maximum));
    return this;
}
Option* Option::positive() {
    parsed_->check(CLI::Validator(
        [](std::string& text) {
            double value = 0;
            const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
            return problem == std::errc() && !(value > 0) ? text + " is not more than 0" : std::string();
        },
        "POSITIVE"));
    return this;
}
Option* Option::bytes() {
    CLI::AsSizeValue size(true);
    size.description("SIZE");
    parsed_->transform(size);
    return this;
}
Option* Option::oneOf(std::vector<std::string> values) {
    parsed_->check(CLI::IsMember(std::move(values)));
    return this;
}
Option* Option::expected(int count) {
    parsed_->expected(count);
    return this;
}
Option* Option::repeatable() {
    parsed_->expected(1)->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    return this;
}
Option* Option::excludes(Option* other) {
    parsed_->excludes(other->parsed_);
    return this;
}

Command::Command(const std::string& name, const std::string& description, const std::string& version)
    : own_(std::make_unique<CLI::App>(description, name)), parser_(own_.get()) {
    parser_->require_subcommand(1);
    parser_->formatter(std::make_shared<Help>());  // verbs inherit it
    parser_->set_version_flag("-V,--version", name + " " + version);
}
Command::Command(CLI::App* parser) : parser_(parser) {}
Command::~Command() = default;

Command* Command::addVerb(const std::string& name, const std::string& description) {
    verbs_.push_back(std::unique_ptr<Command>(new Command(parser_->add_subcommand(name, description))));
    return verbs_.back().get();
}

Option* Command::add(CLI::Option* option) {
    if (!heading_.empty()) option->group(heading_);
    options_.push_back(std::unique_ptr<Option>(new Option(option)));
    return options_.back().get();
}
Option* Command::addOption(const std::string& names, std::string& into, const std::string& description) {
    return add(notEmpty(parser_->add_option(names, into, description)));
}
Option* Command::addOption(const std::string& names, int& into, const std::string& description) {
    return add(notEmpty(parser_->add_option(names, into, description)));
}
Option* Command::addOption(const std::string& names, unsigned& into, const std::string& description) {
    return add(notEmpty(parser_->add_option(names, into, description)));
}
Option* Command::addOption(const std::string& names, std::uint64_t& into, const std::string& description) {
    return add(notEmpty(notNegative(parser_->add_option(names, into, description))));
}
Option* Command::addOption(const std::string& names, double& into, const std::string& description) {
    return add(notEmpty(finite(parser_->add_option(names, into, description))));
}
Option* Command::addOption(const std::string& names, std::optional<double>& into, const std::string& description) {
    return add(notEmpty(finite(parser_->add_option(names, into, description))));
}
Option* Command::addOption(const std::string& names, std::vector<std::string>& into, const std::string& description) {
    return add(notEmpty(parser_->add_option(names, into, description)));
}
Option* Command::addOption(const std::string& names, std::vector<double>& into, const std::string& description) {
    return add(notEmpty(finite(parser_->add_option(names, into, description))));
}
Option* Command::addFlag(const std::string& names, bool& into, const std::string& description) {
    return add(parser_->add_flag(names, into, description));
}
void Command::footer(const std::string& text) {
    parser_->footer(text);
}

namespace {

/// Names the argument that the verb does not take: an unknown option, or the first word too many. The parser's own text
/// lists all of them backwards, with the values of unknown options.
std::string notExpected(const CLI::App& program, const CLI::ExtrasError& error) {
    const auto verbs = program.get_subcommands();
    const CLI::App& command = verbs.empty() ? program : *verbs.front();
    const std::vector<std::string> words = command.remaining();
    for (const std::string& word : words)
        if (word.size() > 1 && word.starts_with("-"))
            return command.get_name() + " has no option " + word.substr(0, word.find('='));
    for (const std::string& word : program.remaining())
        if (words.empty() && word.starts_with("-"))
            return word.substr(0, word.find('=')) + " stands before the verb: options of a verb stand behind it";
    return words.empty() ? error.what() : command.get_name() + " takes no '" + words.front() + "' after what it has";
}

}  // namespace

std::optional<int> Command::parse(int argc, char** argv) {
    try {
        parser_->parse(argc, argv);
    } catch (const CLI::Success& e) {  // for --help and --version
        return parser_->exit(e);
    } catch (const CLI::ExtrasError& e) {
        throw UsageError(notExpected(*parser_, e));
    } catch (const CLI::ParseError& e) {
        throw UsageError(e.what());
    }
    return std::nullopt;
}

bool Command::parsed() const {
    return parser_->parsed();
}

const Command* Command::parsedVerb() const {
    for (const auto& verb : verbs_)
        if (verb->parsed()) return verb.get();
    return nullptr;
}

std::vector<std::string> Command::given() const {
    std::vector<std::string> names;
    for (const CLI::Option* option : parser_->get_options())
        if (option->count() > 0) names.push_back(option->get_name());
    return names;
}

std::string Command::name() const {
    return parser_->get_name();
}

std::string Command::description() const {
    return parser_->get_description();
}

std::string Command::help() const {
    // App::help() would explain the verb that was parsed.
    return parser_->get_formatter()->make_help(parser_, name(), CLI::AppFormatMode::Normal);
}

std::string Command::help(const std::string& verb) const {
    return parser_->get_subcommand(verb)->help(name());
}

}  // namespace rtsg::app
