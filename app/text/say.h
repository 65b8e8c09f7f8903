// Messages of verbs on standard error: as text, or with --log json as one line of JSON each, from a chosen level on.
//
// Threading: the main thread.
#pragma once

#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/diagnostic.h>

#include "command.h"

namespace rtsg::app {

/// Writes on standard error. If that takes nothing, such as a file on a full disk, the program goes on all the same.
void writeError(std::string_view text);
template <class... Arguments>
void reportError(fmt::format_string<Arguments...> text, Arguments&&... arguments) {
    writeError(fmt::format(text, std::forward<Arguments>(arguments)...));
}

/// All later messages have `shown` where they would have `name`, the file of a log that users know by its address.
void sayInstead(const std::string& name, const std::string& shown);

struct SayArguments {
    std::string form = "text", level = "note";
    void addTo(Command& command);
    /// All later messages take this form.
    void apply() const;
};

/// A line of the program's own. In JSON: {"time":"2026-01-02T03:04:05.678Z","level":"note","text":…}.
void say(std::string_view text, Severity level = Severity::note);
/// A diagnostic: `file:line:col: error: text [code]`, or with "file", "line", "column" and "code" in the JSON.
void say(const Diagnostic& diagnostic);
/// Says it as `text`, which begins and ends as it should on a terminal; in JSON as the diagnostic.
void say(const Diagnostic& diagnostic, std::string_view text);

}  // namespace rtsg::app
