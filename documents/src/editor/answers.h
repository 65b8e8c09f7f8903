// Answers an editor's questions about a text: completions, descriptions, definitions, and corrections.
//
// Threading: pure functions. Offsets are bytes of the text.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace rtsg::editor {

/// Half open.
struct TextRange {
    std::size_t begin = 0, end = 0;
};

struct Proposal {
    enum class Kind { node, field, name, value, keyword };
    Kind kind = Kind::value;
    std::string text, detail{};
};
struct Proposals {
    TextRange replaced;
    std::vector<Proposal> all;
};
/// The words that may be completed at the offset.
Proposals proposalsAt(std::string_view text, std::size_t offset);

struct Explanation {
    TextRange word;
    std::string markdown;
};
/// An explanation of the word at the offset; nothing if there is none.
std::optional<Explanation> explanationAt(std::string_view text, std::size_t offset);

/// Where the name that stands there is defined.
std::optional<TextRange> definitionAt(std::string_view text, std::size_t offset);

struct Misspelled {
    TextRange word;
    std::string meant;
};
/// The misspelled word of a message at this place, with the proposal.
std::optional<Misspelled> misspelledWord(std::string_view text, std::size_t offset, std::string_view message);

/// The clause of ISO/IEC 19775-1 V4.0 that a component stands in; 0 if there is none of that name.
int clauseOf(std::string_view component);

}  // namespace rtsg::editor
