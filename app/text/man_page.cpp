// Makes the man page from the program's tables of verbs and options.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "command_table.h"

namespace rtsg::app {

namespace {

/// Escapes text for roff.
std::string plain(const std::string& text) {
    std::string out;
    bool lineStart = true;
    for (const char c : text) {
        if (lineStart && (c == '.' || c == '\'')) out += "\\&";
        if (c == '\\')
            out += "\\e";
        else if (c == '-')
            out += "\\-";
        else
            out += c;
        lineStart = c == '\n';
    }
    return out;
}

std::vector<std::string> plainOf(std::vector<std::string> texts) {
    for (std::string& text : texts) text = plain(text);
    return texts;
}

/// Formats a footer: lines that begin with "Example: " one by one, the others as text.
std::string footer(const std::string& text) {
    std::string out;
    for (std::size_t at = 0; at < text.size();) {
        const std::size_t end = std::min(text.find('\n', at), text.size());
        const std::string line = text.substr(at, end - at);
        constexpr std::string_view kExample = "Example: ";
        if (line.starts_with(kExample))
            out += fmt::format(".PP\nExample:\n.RS 4\n.EX\n{}\n.EE\n.RE\n", plain(line.substr(kExample.size())));
        else if (!line.empty())
            out += ".PP\n" + plain(line) + "\n";
        at = end + 1;
    }
    return out;
}

std::string option(const OptionRow& row) {
    std::vector<std::string> names;
    for (const std::string& name : row.names) names.push_back("\\fB" + plain(name) + "\\fR");
    std::string out = fmt::format(".TP\n{}", fmt::join(names, ", "));
    if (!row.choices.empty())
        out += fmt::format(" {}", fmt::join(plainOf(row.choices), "|\\:"));  // a line may end behind each
    else if (!row.positional && !row.value.empty())
        out += " \\fI" + plain(row.value) + "\\fR";
    out += "\n" + plain(row.description);
    if (!row.preset.empty()) out += plain(" (" + row.preset + " unless told otherwise)");
    return out + "\n";
}

}  // namespace

std::string manPage(const Command& program, const std::string& version) {
    std::string out = fmt::format(
        ".TH RTSG 1 \"\" \"rtsg {}\" \"User Commands\"\n.ad l\n"
        ".SH NAME\nrtsg \\- one X3D scene and any number of subscribers in step with it\n"
        ".SH SYNOPSIS\n.B rtsg\n\\fIVERB\\fR [\\fIOPTION\\fR...] [\\fIARGUMENT\\fR...]\n"
        ".SH DESCRIPTION\n{}\n.SH VERBS\n",
        version, plain(program.description()));
    for (const VerbRow& verb : commandTable(program)) {
        out += fmt::format(".SS {}\n{}.\n", plain(verb.name), plain(verb.description));
        for (const OptionRow& row : verb.options) out += option(row);
        out += footer(verb.footer);
    }
    out +=
        ".SH EXIT STATUS\n"
        ".TP\n0\nDone: what was asked for is there, all of it.\n"
        ".TP\n1\nThe input is bad, a check failed, or the result is not complete, as of a scene with errors, the rest "
        "of which is drawn, heard or run all the same; standard error says which.\n"
        ".TP\n2\nWrong usage.\n"
        ".SH OUTPUT\nReports are text, or one line of JSON with \\fB\\-\\-json\\fR. Streams of events are lines of "
        "JSON "
        "always. Diagnostics go to standard error as file:line:column: error: text.\n"
        ".SH ENVIRONMENT\n.TP\n\\fBNO_COLOR\\fR, \\fBTERM\\fR=dumb\nNo progress bars: nothing that moves the cursor is "
        "written. Colours are never used.\n";
    return out;
}

}  // namespace rtsg::app
