// Making control characters visible.
#include <rtsg/core/terminal.h>

#include <fmt/format.h>

#include "utf8.h"

namespace rtsg {

namespace {

struct CodePoint {
    std::uint32_t value = 0;
    std::size_t length = 0;  // 0: no UTF-8
};

CodePoint codePointAt(std::string_view text, std::size_t at) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[at + i]); };
    const unsigned lead = byte(0);
    if (lead < 0x80) return {lead, 1};
    const std::size_t length = lead >= 0xC2 && lead < 0xE0   ? 2
                               : lead >= 0xE0 && lead < 0xF0 ? 3
                               : lead >= 0xF0 && lead < 0xF5 ? 4
                                                             : 0;
    if (length == 0 || at + length > text.size()) return {};
    std::uint32_t value = lead & (0xFFu >> (length + 1));
    for (std::size_t i = 1; i < length; ++i) {
        if ((byte(i) & 0xC0u) != 0x80u) return {};
        value = value << 6 | (byte(i) & 0x3Fu);
    }
    return {value, length};
}

bool isControl(std::uint32_t c) {
    const bool reversesDirection =
        c == 0x200E || c == 0x200F || (c >= 0x202A && c <= 0x202E) || (c >= 0x2066 && c <= 0x2069);
    return c < 0x20 || (c >= 0x7F && c < 0xA0) || c == 0x2028 || c == 0x2029 || reversesDirection;
}

}  // namespace

std::string terminalText(std::string_view text, Lines lines) {
    std::string result;
    result.reserve(text.size());
    for (std::size_t i = 0; i < text.size();) {
        const CodePoint c = codePointAt(text, i);
        const bool staysAnyway = lines == Lines::kept && (text[i] == '\n' || text[i] == '\t');
        if (c.length == 0)
            result += fmt::format("\\x{:02x}", static_cast<unsigned char>(text[i]));
        else if (!isControl(c.value) || staysAnyway)
            result += text.substr(i, c.length);
        else if (c.value == '\n')
            result += "\\n";
        else if (c.value < 0x100)
            result += fmt::format("\\x{:02x}", c.value);
        else
            result += fmt::format("\\u{{{:04x}}}", c.value);
        i += c.length == 0 ? 1 : c.length;
    }
    return result;
}

std::string asUtf8(std::string_view text) {
    std::size_t count = 0;
    return detail::replaceInvalidUtf8(text, count);
}

}  // namespace rtsg
