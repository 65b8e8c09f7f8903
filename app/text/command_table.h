// Command table: the program's verbs and options as plain data, read from the parser's own tables. Help, completion and
// the man page use it, so that they agree with what the program accepts.
#pragma once

#include <string>
#include <vector>

#include "command.h"

namespace rtsg::app {

struct OptionRow {
    std::vector<std::string> names;  // "-o", "--output"; a positional argument has one
    bool positional = false;
    bool takesValue = false;
    std::string value;                 // placeholder of the value, such as TEXT or FLOAT; empty for flags
    std::string preset;                // the default value; may be empty
    std::vector<std::string> choices;  // all possible values, if they are a list
    std::string description;
};

struct VerbRow {
    std::string name, description, footer;
    std::vector<OptionRow> options;
};

std::vector<VerbRow> commandTable(const Command& program);

/// The one of `known` that is nearest to what was typed. Empty if none is near.
std::string nearest(const std::string& typed, const std::vector<std::string>& known);
/// Completes the error of a parse: "did you mean --size", or empty.
std::string suggestion(const Command& program, const UsageError& error);

/// The completion script for "bash", "zsh" or "fish".
std::string completionScript(const Command& program, const std::string& shell);
/// The man page in roff, section 1.
std::string manPage(const Command& program, const std::string& version);

}  // namespace rtsg::app
