// Tokens of JSON: keys, strings with their escapes, and values as the text of attributes; long lists of numbers in
// place.
#include <algorithm>
#include <cstring>

#include "reader_json.h"
#include "text/find_bytes.h"

namespace rtsg::detail {

namespace {

/// The end, if there is none.
const char* findBracketOrQuote(const char* from, const char* end) {
    return findAnyOf(from, end, ']', '[', '"', '{', '}');
}

}  // namespace

const char* JsonReader::stringEnd(const char* p) {
    for (++p; there(p); ++p) {
        if (*p == '"') return p + 1;
        if (*p == '\\' && !there(++p)) break;
    }
    return end_;
}

const char* JsonReader::valueEnd(const char* p) {
    const char c = at(p);
    if (c == '"') return stringEnd(p);
    if (c == '{' || c == '[') return behindClose(p + 1, 1);
    while (there(p) && !isSeparator(*p)) ++p;
    return p;
}

const char* JsonReader::behindClose(const char* p, std::size_t depth) {
    while (there(p)) {
        if (*p == '"') {
            p = stringEnd(p);
            continue;
        }
        if (*p == '{' || *p == '[') ++depth;
        if ((*p == '}' || *p == ']') && --depth == 0) return p + 1;
        ++p;
    }
    return end_;
}

bool JsonReader::nextMember(const char*& p, std::string& key) {
    for (;;) {
        p = skipSpace(p);
        const char c = at(p);
        if (c == '\0' || c == '}' || c == ']') return false;
        if (c != '"') {
            complain(p, "expected a key in quotes");
            p = std::max(valueEnd(p), p + 1);
            continue;
        }
        const char* const start = p;
        p = stringEnd(p);
        key = unescaped(start, p);
        p = skipSpace(p);
        if (at(p) == ':') {
            p = skipSpace(p + 1);
            return true;
        }
        complain(p, "expected ':' behind the key '" + key.substr(0, 40) + "'");
    }
}

std::string JsonReader::unescaped(const char* start, const char* end) {
    const char* const stop = end > start + 1 && end[-1] == '"' ? end - 1 : end;
    const char* p = start + 1;
    std::string result;
    while (p < stop) {
        const void* found = std::memchr(p, '\\', static_cast<std::size_t>(stop - p));
        const char* const escape = found ? static_cast<const char*>(found) : stop;
        result.append(p, escape);
        p = escape;
        if (p + 1 >= stop) {
            result.append(p, stop);
            break;
        }
        constexpr std::string_view letters = "bfnrt/\\\"", meanings = "\b\f\n\r\t/\\\"";
        if (p[1] == 'u') {
            p = appendUnicode(result, p, stop);
            continue;
        }
        const std::size_t which = letters.find(p[1]);
        if (which == letters.npos) complain(p, std::string("'\\") + p[1] + "' is no escape in JSON");
        result += which == letters.npos ? p[1] : meanings[which];
        p += 2;
    }
    return result;
}

const char* JsonReader::appendUnicode(std::string& out, const char* p, const char* stop) {
    std::uint32_t code = 0, low = 0;
    const char* next = p + 6;
    bool good = hexadecimal(p, stop, code);
    if (!good) next = p + 2;
    if (good && code >= 0xD800 && code < 0xE000) {
        good = code < 0xDC00 && hexadecimal(next, stop, low) && low >= 0xDC00 && low < 0xE000;
        if (good) {
            code = 0x10000 + ((code - 0xD800) << 10) + (low - 0xDC00);
            next += 6;
        }
    }
    if (!good || code == 0) {
        complain(p, "the \\u escape names no character");
        code = 0xFFFD;
    }
    const auto byte = [&](std::uint32_t bits) { out += static_cast<char>(bits); };
    if (code < 0x80) {
        byte(code);
    } else if (code < 0x800) {
        byte(0xC0 | code >> 6);
        byte(0x80 | (code & 63));
    } else if (code < 0x10000) {
        byte(0xE0 | code >> 12);
        byte(0x80 | (code >> 6 & 63));
        byte(0x80 | (code & 63));
    } else {
        byte(0xF0 | code >> 18);
        byte(0x80 | (code >> 12 & 63));
        byte(0x80 | (code >> 6 & 63));
        byte(0x80 | (code & 63));
    }
    return next;
}

void JsonReader::attributesInFront(const std::string& name) {
    for (std::string key;;) {
        const char* const before = p_;
        if (!nextMember(p_, key)) return;
        const char c = at(p_);
        if (key.starts_with('@')) {
            attribute(name, key.substr(1));
        } else if (c != '{' && c != '[' && !key.starts_with('#')) {
            p_ = scalar(key);
        } else {
            p_ = before;
            return;
        }
    }
}

void JsonReader::attribute(const std::string& element, const std::string& name) {
    const char* const value = p_;
    if (at(value) == '[' && isLong(value)) {
        const FieldType type = longAttribute(element, name, given("name"));
        if (type != FieldType::SFNode) return longValue(name, type);
    }
    std::string text;
    p_ = valueEnd(value);
    if (p_ == value) {
        complain(value, "'" + name.substr(0, 80) + "' has no value");
        return;
    }
    if (!attributeText(value, p_, text)) return;
    if (text.find('\0') != text.npos) return complain(value, "a zero byte has no place here");
    strings_.push_back(name);
    strings_.push_back(std::move(text));
    valuePositions_.push_back(value);
}

bool JsonReader::attributeText(const char* value, const char* end, std::string& out) {
    const char c = *value;
    if (c == '"') {
        out = unescaped(value, end);
        return true;
    }
    if (c == '{') {
        complain(value, "an attribute has no object as its value");
        return false;
    }
    if (c != '[') {
        out.assign(value, end);
        return out != "null";
    }
    // An array: numbers stand as they are, strings get the quotes of MFString.
    const char* p = value + 1;
    const char* const close = end[-1] == ']' && end - 1 > value ? end - 1 : end;
    while (p < close) {
        const void* found = std::memchr(p, '"', static_cast<std::size_t>(close - p));
        const char* const quote = found ? static_cast<const char*>(found) : close;
        for (; p < quote; ++p) out += *p == '[' || *p == ']' ? ' ' : *p;
        if (p >= close) break;
        p = std::min(stringEnd(quote), close);
        out += '"';
        for (const char letter : unescaped(quote, p)) {
            if (letter == '"' || letter == '\\') out += '\\';
            out += letter;
        }
        out += '"';
    }
    return true;
}

bool JsonReader::isLong(const char* value) {
    constexpr std::ptrdiff_t shortest = 4096;
    listEnd_ = nullptr;
    if (!there(value + shortest)) return false;
    if (std::memchr(value, ']', shortest)) return false;
    const auto offset = static_cast<std::uint64_t>(value - begin_);
    const auto plain = std::ranges::lower_bound(outline_.plain, offset, {}, &JsonOutline::Plain::begin);
    if (plain != outline_.plain.end() && plain->begin == offset) {
        listEnd_ = begin_ + plain->end;
        return true;
    }
    if (!feed_.isComplete()) return true;
    listEnd_ = findBracketOrQuote(value + 1, end_);
    return listEnd_ == end_ || *listEnd_ != '[';
}

/// The parser of numbers between brackets asks for more of them here. Brackets within become white space.
class JsonReader::LongValue final : public detail::FieldTextReport {
  public:
    LongValue(JsonReader& reader, std::string name) : reader_(reader), name_(std::move(name)) {}

    const char* start(const char* from) { return stop_ = end(from); }
    const char* stop() const { return stop_; }
    /// Brackets open at stop().
    std::size_t depth() const { return depth_; }

    const char* more(const char* before) override {
        if (ended_ || before != stop_) return before;
        if (!reader_.grow()) {
            ended_ = true;
            return before;
        }
        return stop_ = end(before);
    }
    Splitting splitting() const override { return reader_.splitting_; }
    /// To the end of the value's text, where an error has ended the value before.
    void finish() {
        for (const char* before = nullptr; before != stop_;) {
            before = stop_;
            more(before);
        }
    }
    void progress(const char* at) override {
        reader_.meter_.at(reader_.feed_.done(at));
        reader_.release(at);
    }
    void report(Severity severity, const char* at, std::string text) override {
        reader_.diagnostics().add(severity, reader_.position_.of(at), name_ + ": " + text);
    }

  private:
    const char* end(const char* from) {
        for (;;) {
            const char* const known = reader_.listEnd_;
            const char* const found = known ? std::min(known, reader_.end_) : findBracketOrQuote(from, reader_.end_);
            if (found == reader_.end_) return found;
            if (*found == '[')
                ++depth_;
            else if (*found == ']' && depth_ > 1)
                --depth_;
            else
                ended_ = true;
            if (ended_ || !reader_.feed_.blank(found, found + 1)) {
                ended_ = true;
                return found;
            }
            from = found + 1;
        }
    }

    JsonReader& reader_;
    const std::string name_;
    const char* stop_ = nullptr;
    std::size_t depth_ = 1;
    bool ended_ = false;
};

void JsonReader::longValue(const std::string& name, FieldType type) {
    Early early{strings_.size() + 1, {}, position_.of(p_)};
    const char* const value = p_;
    LongValue source(*this, name);
    FieldTextParser parser(value + 1, source.start(value + 1), TextSyntax::xml, source);
    if (!parser.parse(type, early.value)) early.value = Value::zero(type);
    source.finish();
    const char* const stop = source.stop();
    if (there(stop) && *stop != ']') complain(stop, name + ": expected a number");
    p_ = behindClose(stop, source.depth());
    strings_.push_back(name);
    strings_.emplace_back();
    valuePositions_.push_back(value);
    early_.push_back(std::move(early));
}

}  // namespace rtsg::detail
