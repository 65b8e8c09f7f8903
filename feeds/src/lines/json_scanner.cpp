// Reads strings, numbers and words of JSON, and skips values that are not needed.
#include "json_scanner.h"

#include <algorithm>

#include <fmt/format.h>

namespace rtsg::feeds {

namespace {

bool isDigit(char c) {
    return c >= '0' && c <= '9';
}

/// True for a number as JSON has it: no leading zeros, no '+', digits on both sides of the point.
bool isNumber(std::string_view text) {
    std::size_t at = 0;
    const auto digits = [&] {
        const std::size_t from = at;
        while (at < text.size() && isDigit(text[at])) ++at;
        return at - from;
    };
    if (at < text.size() && text[at] == '-') ++at;
    const std::size_t whole = at;
    const std::size_t count = digits();
    if (count == 0 || (count > 1 && text[whole] == '0')) return false;
    if (at < text.size() && text[at] == '.') {
        ++at;
        if (digits() == 0) return false;
    }
    if (at < text.size() && (text[at] == 'e' || text[at] == 'E')) {
        ++at;
        if (at < text.size() && (text[at] == '+' || text[at] == '-')) ++at;
        if (digits() == 0) return false;
    }
    return at == text.size();
}

void appendUtf8(std::string& out, unsigned c) {
    const auto put = [&](unsigned byte) { out += static_cast<char>(byte); };
    if (c < 0x80) return put(c);
    if (c < 0x800) {
        put(0xC0 | c >> 6);
    } else if (c < 0x10000) {
        put(0xE0 | c >> 12);
        put(0x80 | (c >> 6 & 0x3F));
    } else {
        put(0xF0 | c >> 18);
        put(0x80 | (c >> 12 & 0x3F));
        put(0x80 | (c >> 6 & 0x3F));
    }
    put(0x80 | (c & 0x3F));
}

}  // namespace

bool JsonScanner::refuse(std::string text) {
    if (!failed())
        problem_ = Diagnostic{Severity::error, {}, {1, static_cast<std::uint32_t>(at_ + 1)}, std::move(text)};
    return false;
}

char JsonScanner::next() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\t' || text_[at_] == '\r')) ++at_;
    return at_ < text_.size() ? text_[at_] : '\0';
}

bool JsonScanner::take(char c) {
    if (next() != c || at_ == text_.size()) return false;
    ++at_;
    return true;
}

bool JsonScanner::codeUnit(unsigned& unit) {
    unit = 0;
    for (int i = 0; i < 4; ++i, ++at_) {
        const char c = at_ < text_.size() ? text_[at_] : '\0';
        const unsigned digit = isDigit(c)             ? static_cast<unsigned>(c - '0')
                               : c >= 'a' && c <= 'f' ? static_cast<unsigned>(c - 'a' + 10)
                               : c >= 'A' && c <= 'F' ? static_cast<unsigned>(c - 'A' + 10)
                                                      : 16;
        if (digit == 16) return refuse("\\u needs four hexadecimal digits");
        unit = unit << 4 | digit;
    }
    return true;
}

bool JsonScanner::escape(std::string& into) {
    constexpr std::string_view kNames = "\"\\/bfnrt", kMeant = "\"\\/\b\f\n\r\t";
    const char c = at_ < text_.size() ? text_[at_] : '\0';
    if (const std::size_t found = kNames.find(c); c && found != kNames.npos) {
        into += kMeant[found];
        ++at_;
        return true;
    }
    if (c != 'u') return refuse("an unknown escape in a string");
    ++at_;
    unsigned high = 0, low = 0;
    if (!codeUnit(high)) return false;
    if (high >= 0xDC00 && high < 0xE000) return refuse("half of a surrogate pair");
    if (high >= 0xD800 && high < 0xDC00) {
        if (text_.substr(at_, 2) != "\\u") return refuse("half of a surrogate pair");
        at_ += 2;
        if (!codeUnit(low)) return false;
        if (low < 0xDC00 || low >= 0xE000) return refuse("half of a surrogate pair");
        high = 0x10000 + ((high - 0xD800) << 10 | (low - 0xDC00));
    }
    appendUtf8(into, high);
    return true;
}

bool JsonScanner::string(std::string& into) {
    into.clear();
    if (!take('"')) return refuse("expected a string");
    while (at_ < text_.size() && text_[at_] != '"') {
        const char c = text_[at_++];
        if (static_cast<unsigned char>(c) < 0x20) return refuse("a control character in a string");
        if (c != '\\')
            into += c;
        else if (!escape(into))
            return false;
    }
    if (at_ == text_.size()) return refuse("a string without an end");
    ++at_;
    return true;
}

bool JsonScanner::word(std::string_view& into) {
    (void)next();
    std::size_t end = at_;
    while (end < text_.size() && std::string_view(" \t\r,:]}[{\"").find(text_[end]) == std::string_view::npos) ++end;
    into = text_.substr(at_, end - at_);
    if (into.empty()) return refuse(at_ == text_.size() ? "the line ends too early" : "expected a value");
    if (into != "true" && into != "false" && into != "null" && !isNumber(into))
        return refuse(fmt::format("'{}' is no value of JSON", into.substr(0, 40)));
    at_ = end;
    return true;
}

bool JsonScanner::skip() {
    std::string open;  // the brackets around this place
    std::string ignored;
    std::string_view text;
    do {
        if (!open.empty() && open.back() == '}' && (!string(ignored) || !(take(':') || refuse("expected ':'"))))
            return false;
        const char c = next();
        if (c == '{' || c == '[') {
            ++at_;
            const char close = c == '{' ? '}' : ']';
            if (!take(close)) {
                open += close;
                continue;
            }
        } else if (!(c == '"' ? string(ignored) : word(text))) {
            return false;
        }
        while (!open.empty() && take(open.back())) open.pop_back();
        if (!open.empty() && !take(',')) return refuse("expected ',' or a closing bracket");
    } while (!open.empty());
    return true;
}

}  // namespace rtsg::feeds
