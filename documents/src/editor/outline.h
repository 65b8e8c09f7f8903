// What an editor does with a whole document: its outline, all places of a name, another name, and indentation.
//
// Threading: pure functions. Offsets are bytes of the text; any text will do, complete or not. Source: Language Server
// Protocol 3.17.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>

#include "answers.h"

namespace rtsg::editor {

/// A node, or a prototype, of the outline; its children follow it.
struct Symbol {
    std::string name, detail;
    bool isProto = false;
    TextRange all, word;
    std::size_t parent = static_cast<std::size_t>(-1);  // a number of the list; none: at the top
};
/// The prototypes and the nodes with names; all nodes of a text that has few.
std::vector<Symbol> outlineOf(std::string_view text);

/// All places of the name (of a node, or of a prototype) that stands at the offset, in its scope. Empty: none stands
/// there.
std::vector<TextRange> referencesAt(std::string_view text, std::size_t offset, bool withDefinitions);

/// The name at the offset that can be changed. Empty range: there is none.
TextRange renamableAt(std::string_view text, std::size_t offset);
/// The places to write the new name to. Errors: no name stands there; the new one is taken, or is no name.
Result<std::vector<TextRange>> renamed(std::string_view text, std::size_t offset, std::string_view to);

/// A line's new white space at its beginning.
struct Indentation {
    TextRange replaced;
    std::string with;
};
/// Lines that are indented otherwise than their brackets, or elements, ask for, with `unit` for each level. Lines that
/// begin within a text or a comment stay.
std::vector<Indentation> indentationOf(std::string_view text, std::string_view unit);

}  // namespace rtsg::editor
