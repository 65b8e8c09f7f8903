// Escapes in names, written and read.
#include "spelled_name.h"

#include <algorithm>
#include <array>
#include <iterator>

#include <fmt/format.h>

#include "text/number_text.h"

namespace rtsg::detail {

namespace {

constexpr std::array<std::string_view, 16> kKeywords = {"AS",     "COMPONENT", "DEF",  "EXPORT", "EXTERNPROTO", "FALSE",
                                                        "IMPORT", "IS",        "META", "NULL",   "PROFILE",     "PROTO",
                                                        "ROUTE",  "TO",        "TRUE", "USE"};
constexpr std::array<std::string_view, 19> kStatements = {
    "EXPORT", "ExternProtoDeclare", "IMPORT", "IS",   "ProtoBody", "ProtoDeclare", "ProtoInstance",
    "ROUTE",  "ProtoInterface",     "Scene",  "X3D",  "component", "connect",      "field",
    "head",   "fieldValue",         "meta",   "unit", "encoding"};
constexpr std::array<std::string_view, 7> kMeanings = {"DEF", "USE", "class", "containerField", "id", "name", "style"};
constexpr std::string_view kNothing = "_x_";  // the empty name

bool isReserved(std::string_view name, Spelling spelling) {
    switch (spelling) {
        case Spelling::classic:
            return std::ranges::find(kKeywords, name) != kKeywords.end();
        case Spelling::element:
            return std::ranges::find(kStatements, name) != kStatements.end();
        case Spelling::attribute:
            return std::ranges::find(kMeanings, name) != kMeanings.end() || name.starts_with("xmlns");
    }
    return false;
}

/// Whether the byte at `i` may not stand there.
bool isForbidden(std::string_view name, std::size_t i, Spelling spelling) {
    const char c = name[i];
    const auto code = static_cast<unsigned char>(c);
    if (spelling == Spelling::classic) {
        constexpr std::string_view forbidden = "\"'#,.[]\\{}\x7F";
        return code <= 0x20 || forbidden.find(c) != forbidden.npos || (i == 0 && (isDigit(c) || c == '+' || c == '-'));
    }
    const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
    return !letter && (i == 0 || !(isDigit(c) || c == '-' || c == '.'));
}

bool isHexadecimal(char c) {
    return isDigit(c) || (c >= 'A' && c <= 'F');
}

/// The code point of the valid UTF-8 at `i`, which is moved behind it.
std::uint32_t codePoint(std::string_view text, std::size_t& i) {
    const auto first = static_cast<unsigned char>(text[i++]);
    const int more = first < 0xC0 ? 0 : first < 0xE0 ? 1 : first < 0xF0 ? 2 : 3;
    std::uint32_t code = more == 0 ? first : first & (0x3Fu >> more);
    for (int k = 0; k < more && i < text.size(); ++k) code = code << 6 | (static_cast<unsigned char>(text[i++]) & 0x3F);
    return code;
}

void appendUtf8(std::string& out, std::uint32_t code) {
    if (code < 0x80) {
        out += static_cast<char>(code);
        return;
    }
    const int more = code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
    constexpr std::array<unsigned, 4> leads = {0, 0xC0, 0xE0, 0xF0};
    out += static_cast<char>(leads[static_cast<std::size_t>(more)] | code >> (6 * more));
    for (int k = more - 1; k >= 0; --k) out += static_cast<char>(0x80 | (code >> (6 * k) & 0x3F));
}

void appendEscape(std::string& out, std::uint32_t code) {
    if (code > 0xFFFF)
        fmt::format_to(std::back_inserter(out), "_x{:06X}_", code);
    else
        fmt::format_to(std::back_inserter(out), "_x{:04X}_", code);
}

/// Whether the _ at `i`, with the text after it, would be read as an escape.
bool looksEscaped(std::string_view name, std::size_t i, Spelling spelling) {
    if (name.substr(i, 2) != "_x") return false;
    std::size_t end = i + 2;
    while (end < name.size() && end < i + 8 && isHexadecimal(name[end])) ++end;
    // An escape of fewer digits may end where one of more does not.
    for (const std::size_t digits : {std::size_t{4}, std::size_t{6}}) {
        const std::size_t stop = i + 2 + digits;
        if (stop <= end && stop < name.size() && (name[stop] == '_' || isForbidden(name, stop, spelling))) return true;
    }
    return false;
}

/// The number of bytes of the escape at `i`, 0 if there is none.
std::size_t escapeAt(std::string_view text, std::size_t i, std::uint32_t& code) {
    if (text.substr(i, 2) != "_x") return 0;
    for (const std::size_t digits : {std::size_t{4}, std::size_t{6}}) {
        const std::size_t stop = i + 2 + digits;
        if (stop >= text.size() || text[stop] != '_') continue;
        code = 0;
        bool good = true;
        for (const char c : text.substr(i + 2, digits)) {
            good = good && isHexadecimal(c);
            code = code * 16 + static_cast<std::uint32_t>(isDigit(c) ? c - '0' : c - 'A' + 10);
        }
        if (good && code <= 0x10FFFF && (code < 0xD800 || code > 0xDFFF)) return digits + 3;
    }
    return 0;
}

}  // namespace

std::string spellName(std::string_view name, Spelling spelling) {
    if (name.empty()) return std::string(kNothing);
    const bool reserved = isReserved(name, spelling) || name == kNothing;
    std::string result;
    for (std::size_t i = 0; i < name.size();) {
        const bool escaped = (i == 0 && reserved) || isForbidden(name, i, spelling) || looksEscaped(name, i, spelling);
        if (escaped)
            appendEscape(result, codePoint(name, i));
        else
            result += name[i++];
    }
    return result;
}

std::string faultOfDef(std::string_view text, Spelling spelling) {
    if (spelling == Spelling::classic && isReserved(text, spelling)) return "is a keyword";
    for (std::size_t i = 0; i < text.size(); ++i) {
        const auto code = static_cast<unsigned char>(text[i]);
        if (code >= 0x80 || !isForbidden(text, i, spelling)) continue;
        const bool isFirst = i == 0 && !isForbidden("_" + std::string(1, text[i]), 1, spelling);
        if (code <= 0x20 || code == 0x7F) return "has white space in it";
        return isFirst ? fmt::format("begins with '{}'", text[i]) : fmt::format("has '{}' in it", text[i]);
    }
    return {};
}

std::string readName(std::string_view text, Spelling spelling) {
    if (text == kNothing) return {};
    std::string result;
    for (std::size_t i = 0; i < text.size();) {
        std::uint32_t code = 0;
        if (const std::size_t size = escapeAt(text, i, code)) {
            appendUtf8(result, code);
            i += size;
        } else {
            result += text[i++];
        }
    }
    // An author's own name may look like this.
    return spellName(result, spelling) == text ? result : std::string(text);
}

}  // namespace rtsg::detail
