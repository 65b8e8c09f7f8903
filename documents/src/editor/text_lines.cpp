// Counts lines, bytes, code points and units of UTF-16.
#include "text_lines.h"

#include <algorithm>

namespace rtsg::editor {

namespace {

bool beginsCharacter(char c) {
    return (static_cast<unsigned char>(c) & 0xC0u) != 0x80u;
}
/// Characters of four bytes are two units of UTF-16.
std::uint32_t unitsOf(char first) {
    return !beginsCharacter(first) ? 0 : static_cast<unsigned char>(first) >= 0xF0u ? 2 : 1;
}

}  // namespace

TextLines::TextLines(std::string_view text, bool countsBytes) : text_(text), countsBytes_(countsBytes), starts_{0} {
    for (std::size_t i = 0; i < text.size(); ++i) {
        const bool isEnd = text[i] == '\n' || (text[i] == '\r' && (i + 1 == text.size() || text[i + 1] != '\n'));
        if (isEnd) starts_.push_back(i + 1);
    }
}

std::string_view TextLines::line(std::size_t number) const {
    const std::size_t end = number + 1 < starts_.size() ? starts_[number + 1] : text_.size();
    std::string_view result = text_.substr(starts_[number], end - starts_[number]);
    while (!result.empty() && (result.back() == '\n' || result.back() == '\r')) result.remove_suffix(1);
    return result;
}

std::size_t TextLines::offsetOf(TextPosition position) const {
    if (position.line >= starts_.size()) return text_.size();
    const std::string_view inside = line(position.line);
    std::size_t at = 0;
    std::uint32_t passed = 0;
    while (at < inside.size() && passed < position.character) passed += countsBytes_ ? 1 : unitsOf(inside[at]), ++at;
    while (at < inside.size() && !beginsCharacter(inside[at])) ++at;
    return starts_[position.line] + at;
}

std::size_t TextLines::offsetOf(SourceLocation where) const {
    if (where.line == 0) return 0;
    if (where.line > starts_.size()) return text_.size();
    const std::string_view inside = line(where.line - 1);
    std::size_t at = 0;
    for (std::uint32_t column = 1; at < inside.size() && column < where.column; ++column) do
            ++at;
        while (at < inside.size() && !beginsCharacter(inside[at]));
    return starts_[where.line - 1] + at;
}

TextPosition TextLines::positionOf(std::size_t offset) const {
    offset = std::min(offset, text_.size());
    const auto next = std::ranges::upper_bound(starts_, offset);
    const auto number = static_cast<std::size_t>(next - starts_.begin()) - 1;
    TextPosition position{static_cast<std::uint32_t>(number), 0};
    for (std::size_t i = starts_[number]; i < offset; ++i) position.character += countsBytes_ ? 1 : unitsOf(text_[i]);
    return position;
}

}  // namespace rtsg::editor
