// Prints lines on standard error, in the chosen form and from the chosen level on.
#include "say.h"

#include <chrono>
#include <cstdio>
#include <ctime>
#include <map>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/terminal.h>

namespace rtsg::app {

namespace {

/// How the whole process says things; needed wherever something is said.
struct Manner {
    bool json = false;
    Severity minimum = Severity::note;
    /// What stands in messages, and what is said instead.
    std::map<std::string, std::string> instead;
} manner;

constexpr std::string_view kLevels[] = {"note", "warning", "error"};  // in the order of Severity

std::string timeText() {
    const auto now = std::chrono::system_clock::now();
    const auto whole = std::chrono::floor<std::chrono::seconds>(now);
    const std::time_t seconds = std::chrono::system_clock::to_time_t(whole);
    const auto part = std::chrono::duration_cast<std::chrono::milliseconds>(now - whole).count();
    return fmt::format("{:%FT%T}.{:03}Z", fmt::gmtime(seconds), part);
}

}  // namespace

void writeError(std::string_view text) {
    std::string said(text);
    for (const auto& [name, shown] : manner.instead)
        for (std::size_t at = 0; (at = said.find(name, at)) != said.npos; at += shown.size())
            said.replace(at, name.size(), shown);
    (void)std::fwrite(said.data(), 1, said.size(), stderr);
}

void sayInstead(const std::string& name, const std::string& shown) {
    manner.instead[name] = shown;
}

void SayArguments::addTo(Command& command) {
    const Command::Section section(command, "What is said");
    command.addOption("--log", form, "text, or json: each message is one line of JSON on standard error")
        ->preset()
        ->oneOf({"text", "json"});
    command.addOption("--log-level", level, "least severity of messages on standard error")
        ->preset()
        ->oneOf({"note", "warning", "error"});
}

void SayArguments::apply() const {
    manner.json = form == "json";
    manner.minimum = level == "error" ? Severity::error : level == "warning" ? Severity::warning : Severity::note;
}

void say(const Diagnostic& diagnostic, std::string_view text) {
    if (diagnostic.severity < manner.minimum) return;
    if (!manner.json) return reportError("{}\n", text);
    std::string line =
        fmt::format("{{\"time\":\"{}\",\"level\":\"{}\",\"code\":{}", timeText(),
                    kLevels[static_cast<std::size_t>(diagnostic.severity)], jsonString(diagnostic.code.text()));
    if (!diagnostic.file.empty()) line += fmt::format(",\"file\":{}", jsonString(diagnostic.file));
    if (diagnostic.where.line > 0) line += fmt::format(",\"line\":{}", diagnostic.where.line);
    if (diagnostic.where.column > 0) line += fmt::format(",\"column\":{}", diagnostic.where.column);
    reportError("{},\"text\":{}}}\n", line, jsonString(diagnostic.text));
}

void say(const Diagnostic& diagnostic) {
    say(diagnostic, terminalText(diagnostic.format()));
}

void say(std::string_view text, Severity level) {
    if (level < manner.minimum) return;
    if (!manner.json) return reportError("{}\n", terminalText(text));
    reportError("{{\"time\":\"{}\",\"level\":\"{}\",\"text\":{}}}\n", timeText(),
                kLevels[static_cast<std::size_t>(level)], jsonString(text));
}

}  // namespace rtsg::app
