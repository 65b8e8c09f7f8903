// TextLines: converts positions in a text between those of the Language Server Protocol and those of diagnostics.
//
// Threading: values; the text must outlive them. Source: Language Server Protocol 3.17, Position.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg::editor {

/// From 0. `character` counts units of UTF-16, or bytes if both sides have agreed on UTF-8.
struct TextPosition {
    std::uint32_t line = 0, character = 0;
};

class TextLines {
  public:
    TextLines(std::string_view text, bool countsBytes);

    /// A place beyond a line's end is its end; one beyond the text the text's.
    std::size_t offsetOf(TextPosition position) const;
    /// Columns of diagnostics count code points.
    std::size_t offsetOf(SourceLocation where) const;
    TextPosition positionOf(std::size_t offset) const;

  private:
    /// Without the line's end.
    std::string_view line(std::size_t number) const;

    std::string_view text_;
    bool countsBytes_;
    std::vector<std::size_t> starts_;
};

}  // namespace rtsg::editor
