// The program's verbs and options as plain data, read from the parser's own tables: help, completion and the man page
// are made of these, so none of them can say something else than the program takes.
#pragma once

#include <string>
#include <vector>

#include "command.h"

namespace rtsg::app {

struct OptionRow {
    std::vector<std::string> names;  // "-o", "--output"; of a positional argument its one name
    bool positional = false;
    bool takesValue = false;
    std::string value;                 // what stands for it, as TEXT or FLOAT; empty for flags
    std::string preset;                // the value that it has without being said; may be empty
    std::vector<std::string> choices;  // all values there are, if they are a list
    std::string description;
};

struct VerbRow {
    std::string name, description, footer;
    std::vector<OptionRow> options;
};

std::vector<VerbRow> commandTable(const Command& program);

/// The nearest of `known` to what was typed, if it can be meant; else empty.
std::string nearest(const std::string& typed, const std::vector<std::string>& known);
/// For the error of a parse: "did you mean --size", or empty.
std::string suggestion(const Command& program, const UsageError& error);

/// The script for "bash", "zsh" or "fish".
std::string completionScript(const Command& program, const std::string& shell);
/// In roff, section 1.
std::string manPage(const Command& program, const std::string& version);

}  // namespace rtsg::app
