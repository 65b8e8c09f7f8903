// Reader of the JSON encoding: a first pass matches brackets, so that the second can skip any value at once and look
// for an element's attributes wherever they stand. Explicit stacks throughout; both passes are linear. Source: X3D JSON
// encoding, ISO/IEC 19776-5 draft: "@name" attributes, "-field" nodes, "#comment", "#sourceCode".
#include <algorithm>

#include "reader_element.h"
#include "value/text_position.h"

namespace rtsg::detail {

namespace {

class JsonReader final : private ElementReader {
  public:
    JsonReader(std::string_view text, DocumentHandler& handler, Diagnostics& diagnostics,
               const ReaderProgress& progress)
        : ElementReader(Encoding::json, handler, diagnostics),
          text_(text),
          position_(text.data()),
          meter_(text.size(), progress) {}

    bool read() {
        const bool complete = matchBrackets();
        const std::size_t root = skipSpace(0);
        if (root == text_.size() || text_[root] != '{') {
            error("a JSON document of X3D is an object");
            return false;
        }
        frames_.push_back({Inside::wrapper, root + 1, closeOf(root), {}, {}});
        while (!frames_.empty()) step();
        if (!finish()) {
            at_ = 0;
            error("there is no X3D object in the document");
            return false;
        }
        meter_.finish();
        return complete;
    }

  private:
    enum class Inside : std::uint8_t {
        wrapper,   // { "Type": { ... } }: the members are elements
        element,   // the members of an element besides its attributes
        nodes,     // an array of wrappers
        elements,  // an array of elements of one name
    };
    struct Frame {
        Inside inside;
        std::size_t at, end;
        std::string name;  // elements: of each
        std::string containerField;
    };
    struct Bracket {
        std::size_t open, close;
    };

    SourceLocation where() override { return position_.of(text_.data() + std::min(at_, text_.size())); }
    SourceLocation locate(const char*) override {
        // The values are copies; the start of the original is near enough.
        const std::string_view name(parsedAttribute() ? parsedAttribute() : "");
        for (std::size_t i = 0; i + 1 < attributes_.size(); i += 2)
            if (name == attributes_[i]) return position_.of(text_.data() + valuePositions_[i / 2]);
        return where();
    }

    // ---- first pass
    bool matchBrackets() {
        std::vector<std::size_t> open;  // indices in brackets_
        std::size_t i = 0;
        const char* complaint = nullptr;
        bool value = false, comma = false;  // what came last, white space aside
        while (i < text_.size() && !complaint) {
            const char c = text_[i];
            if (c == ' ' || c == '\n' || c == '\t' || c == '\r') {
                ++i;
                continue;
            }
            if (c == ',' || c == ':') {
                if (c == ',' && !value) commaFault(i, "a comma too many");
                value = false;
                comma = c == ',';
                ++i;
                continue;
            }
            const bool closes = c == '}' || c == ']';
            if (closes && comma) commaFault(i, "there is nothing between the last comma and this bracket");
            if (!closes && value) commaFault(i, "a comma is missing before this");
            comma = false;
            value = closes;
            if (c == '"') {
                const std::size_t end = stringEnd(i);
                if (end == text_.npos)
                    complaint = "the string is not closed";
                else
                    i = end;
                value = true;
                continue;
            }
            if (c == '{' || c == '[') {
                open.push_back(brackets_.size());
                brackets_.push_back({i, 0});
            } else if (closes) {
                if (open.empty() || text_[brackets_[open.back()].open] != (c == '}' ? '{' : '[')) {
                    complaint = "the bracket matches none";
                    continue;
                }
                brackets_[open.back()].close = i;
                open.pop_back();
            } else {
                // A number or a word.
                while (i + 1 < text_.size() && !isSeparator(text_[i + 1]) && text_[i + 1] != ':') ++i;
                value = true;
            }
            ++i;
        }
        if (!complaint && !open.empty()) complaint = "the document ends inside an object or array";
        if (!complaint) return true;
        at_ = i;
        error(std::string("not well-formed JSON: ") + complaint + "; reading ends here");
        text_ = text_.substr(0, i);
        for (const std::size_t bracket : open) brackets_[bracket].close = i;
        return false;
    }
    /// Commas are read as white space, so that nothing is lost; a few faults are enough to see what is wrong.
    void commaFault(std::size_t i, const char* what) {
        constexpr int most = 20;
        if (++commaFaults_ <= most) complain(i, what);
    }
    /// Behind the closing quote of the string that starts at `i`; npos if there is none.
    std::size_t stringEnd(std::size_t i) const {
        for (++i; i < text_.size(); ++i) {
            if (text_[i] == '"') return i + 1;
            if (text_[i] == '\\') ++i;
        }
        return text_.npos;
    }
    std::size_t closeOf(std::size_t open) const {
        const auto found = std::ranges::lower_bound(brackets_, open, {}, &Bracket::open);
        return found != brackets_.end() && found->open == open ? found->close : text_.size();
    }

    // ---- tokens; all positions stay within the text
    std::size_t skipSpace(std::size_t i) const {
        while (i < text_.size() && isSpace(text_[i])) ++i;
        return i;
    }
    std::size_t valueEnd(std::size_t i) const {
        if (i >= text_.size()) return text_.size();
        if (text_[i] == '"') return std::min(stringEnd(i), text_.size());
        if (text_[i] == '{' || text_[i] == '[') return std::min(closeOf(i) + 1, text_.size());
        while (i < text_.size() && !isSeparator(text_[i])) ++i;
        return i;
    }
    char at(std::size_t i) const { return i < text_.size() ? text_[i] : '\0'; }

    /// The next member of an object: its key, and where its value starts. Moves behind the value.
    bool nextMember(std::size_t& i, std::size_t end, std::string& key, std::size_t& value) {
        i = skipSpace(i);
        while (i < end && text_[i] != '"') {
            complain(i, "expected a key in quotes");
            i = skipSpace(std::max(valueEnd(i), i + 1));
        }
        if (i >= end) return false;
        const std::size_t keyEnd = std::min(stringEnd(i), end);
        key = unescaped(i, keyEnd);
        const std::size_t colon = skipSpace(keyEnd);
        if (at(colon) != ':') {
            complain(colon, "expected ':' behind the key '" + key.substr(0, 40) + "'");
            i = std::max(colon, keyEnd);
            value = end;
            return i < end;
        }
        value = std::min(skipSpace(colon + 1), end);
        i = std::max(valueEnd(value), colon + 1);
        return true;
    }
    void complain(std::size_t i, std::string text) {
        at_ = i;
        error(std::move(text));
    }
    /// The text of the string literal in [start, end), quotes included.
    std::string unescaped(std::size_t start, std::size_t end) {
        std::string result;
        std::size_t i = start + 1;
        const std::size_t stop = end > start + 1 && text_[end - 1] == '"' ? end - 1 : end;
        while (i < stop) {
            if (text_[i] != '\\' || i + 1 >= stop) {
                result += text_[i++];
                continue;
            }
            constexpr std::string_view letters = "bfnrt/\\\"", meanings = "\b\f\n\r\t/\\\"";
            const char c = text_[i + 1];
            if (c == 'u') {
                i = appendUnicode(result, i, stop);
                continue;
            }
            const std::size_t which = letters.find(c);
            if (which == letters.npos) complain(i, std::string("'\\") + c + "' is no escape in JSON");
            result += which == letters.npos ? c : meanings[which];
            i += 2;
        }
        return result;
    }
    bool hexadecimal(std::size_t i, std::size_t stop, std::uint32_t& out) const {
        if (i + 6 > stop || text_[i] != '\\' || text_[i + 1] != 'u') return false;
        const char* first = text_.data() + i + 2;
        return std::from_chars(first, first + 4, out, 16).ptr == first + 4;
    }
    std::size_t appendUnicode(std::string& out, std::size_t i, std::size_t stop) {
        std::uint32_t code = 0, low = 0;
        std::size_t next = i + 6;
        bool good = hexadecimal(i, stop, code);
        if (!good) next = i + 2;
        if (good && code >= 0xD800 && code < 0xE000) {
            good = code < 0xDC00 && hexadecimal(next, stop, low) && low >= 0xDC00 && low < 0xE000;
            if (good) {
                code = 0x10000 + ((code - 0xD800) << 10) + (low - 0xDC00);
                next += 6;
            }
        }
        if (!good || code == 0) {
            complain(i, "the \\u escape names no character");
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

    // ---- second pass
    void step() {
        Frame& frame = frames_.back();
        if (frame.inside == Inside::wrapper || frame.inside == Inside::element) {
            std::string key;
            std::size_t value = 0;
            if (!nextMember(frame.at, frame.end, key, value)) return leave();
            if (frame.inside == Inside::element)
                member(key, value);
            else if (key == "#comment")
                comments(value);
            else if (!key.starts_with('#'))
                element(key, value, std::string(frame.containerField));
            return;
        }
        frame.at = skipSpace(frame.at);
        if (frame.at >= frame.end) return leave();
        const std::size_t item = frame.at;
        frame.at = std::max(valueEnd(item), item + 1);
        if (text_[item] != '{') return complain(item, "expected an object");
        if (frame.inside == Inside::nodes)
            frames_.push_back({Inside::wrapper, item + 1, closeOf(item), {}, std::string(frame.containerField)});
        else
            element(std::string(frame.name), item, {});
    }
    void leave() {
        at_ = frames_.back().end;
        const bool isElement = frames_.back().inside == Inside::element;
        frames_.pop_back();
        if (isElement) end();
    }

    /// Starts the element whose object is at `object`.
    void element(const std::string& name, std::size_t object, const std::string& containerField) {
        meter_.at(object);
        if (at(object) != '{') return complain(object, "expected an object for " + name.substr(0, 80));
        const std::size_t close = closeOf(object);
        strings_.clear();
        valuePositions_.clear();
        std::string key;
        std::size_t i = object + 1, value = 0;
        while (nextMember(i, close, key, value)) {
            if (!key.starts_with('@') || value >= close) continue;
            std::string text;
            if (!attributeText(value, text)) continue;
            if (text.find('\0') != text.npos) {
                complain(value, "a zero byte has no place here");
                continue;
            }
            strings_.push_back(key.substr(1));
            strings_.push_back(std::move(text));
            valuePositions_.push_back(value);
        }
        if (!containerField.empty()) {
            strings_.emplace_back("containerField");
            strings_.push_back(containerField);
            valuePositions_.push_back(object);
        }
        attributes_.clear();
        for (const std::string& string : strings_) attributes_.push_back(string.c_str());
        const auto count = static_cast<int>(attributes_.size());
        attributes_.push_back(nullptr);
        at_ = object;
        start(name.c_str(), attributes_.data(), count);
        attributes_.clear();
        frames_.push_back({Inside::element, object + 1, close, {}, {}});
    }

    /// A value as the text of an XML attribute; false for null and for what is no attribute.
    bool attributeText(std::size_t value, std::string& out) {
        const std::size_t end = valueEnd(value);
        const char c = at(value);
        if (c == '"') {
            out = unescaped(value, end);
            return true;
        }
        if (c == '{') {
            complain(value, "an attribute has no object as its value");
            return false;
        }
        if (c != '[') {
            out = text_.substr(value, end - value);
            return out != "null";
        }
        // An array: numbers stand as they are, strings get the quotes of MFString.
        std::size_t i = value + 1;
        const std::size_t close = closeOf(value);
        while (i < close) {
            const std::size_t quote = std::min(text_.find('"', i), close);
            for (; i < quote; ++i) out += text_[i] == '[' || text_[i] == ']' ? ' ' : text_[i];
            if (i >= close) break;
            i = std::min(stringEnd(quote), close);
            out += '"';
            for (const char letter : unescaped(quote, i)) {
                if (letter == '"' || letter == '\\') out += '\\';
                out += letter;
            }
            out += '"';
        }
        return true;
    }

    void member(const std::string& key, std::size_t value) {
        if (key.starts_with('@') || key == "encoding" || key == "JSON schema") return;
        if (key == "#comment") return comments(value);
        if (key == "#sourceCode" || key == "#sourceText") return source(value);
        const char c = at(value);
        if (key.starts_with('-')) {
            if (c == '[')
                frames_.push_back({Inside::nodes, value + 1, closeOf(value), {}, key.substr(1)});
            else if (c == '{')
                frames_.push_back({Inside::wrapper, value + 1, closeOf(value), {}, key.substr(1)});
            else
                complain(value, "'" + key.substr(0, 80) + "' takes nodes");
            return;
        }
        if (c == '[')
            frames_.push_back({Inside::elements, value + 1, closeOf(value), key, {}});
        else if (c == '{')
            element(key, value, {});
        else
            complain(value, "'" + key.substr(0, 80) + "' is unknown here");
    }
    /// One, or an array of them.
    void comments(std::size_t value) {
        if (at(value) == '"') {
            at_ = value;
            return comment(unescaped(value, valueEnd(value)));
        }
        if (at(value) != '[') return complain(value, "#comment takes strings");
        const std::size_t close = closeOf(value);
        for (std::size_t i = skipSpace(value + 1); i < close; i = skipSpace(std::max(valueEnd(i), i + 1)))
            if (text_[i] == '"') {
                at_ = i;
                comment(unescaped(i, valueEnd(i)));
            }
    }
    void source(std::size_t value) {
        beginSection();
        if (at(value) == '"')
            text(unescaped(value, valueEnd(value)));
        else if (at(value) == '[')
            sourceLines(value);
        else
            complain(value, "#sourceCode takes strings");
        endSection();
    }
    void sourceLines(std::size_t value) {
        const std::size_t close = closeOf(value);
        bool first = true;
        for (std::size_t i = skipSpace(value + 1); i < close; i = skipSpace(std::max(valueEnd(i), i + 1))) {
            if (text_[i] != '"') {
                complain(i, "#sourceCode takes strings");
                continue;
            }
            if (!first) text("\n");
            first = false;
            text(unescaped(i, valueEnd(i)));
        }
    }

    std::string_view text_;
    TextPosition position_;
    ProgressMeter meter_;
    std::vector<Bracket> brackets_;
    std::vector<Frame> frames_;
    std::size_t at_ = 0;
    int commaFaults_ = 0;
    std::vector<std::string> strings_;  // of the element being started
    std::vector<const char*> attributes_;
    std::vector<std::size_t> valuePositions_;
};

}  // namespace

bool readJson(std::string_view text, DocumentHandler& handler, Diagnostics& diagnostics,
              const ReaderProgress& progress) {
    return JsonReader(text, handler, diagnostics, progress).read();
}

}  // namespace rtsg::detail
