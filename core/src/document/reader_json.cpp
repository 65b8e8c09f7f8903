// Reader of the JSON encoding: a first look (json_outline.h) matches brackets, so that the second can go through the
// text once, in blocks, and forget what is behind it. An explicit stack throughout. Source: X3D JSON encoding, ISO/IEC
// 19776-5 draft: "@name" attributes, "-field" nodes, "#comment", "#sourceCode".
#include <algorithm>
#include <cstring>
#include <optional>

#include "json_outline.h"
#include "reader_element.h"
#include "value/text_position.h"

namespace rtsg::detail {

namespace {

class JsonReader final : private ElementReader {
  public:
    JsonReader(TextFeed& text, JsonOutline outline, DocumentHandler& handler, Diagnostics& diagnostics,
               const ReaderProgress& progress)
        : ElementReader(Encoding::json, handler, diagnostics),
          feed_(text),
          outline_(std::move(outline)),
          position_(text.begin()),
          begin_(text.begin()),
          released_(begin_),
          p_(begin_),
          meter_(text.total(), progress) {
        findEnd();
    }

    bool read() {
        p_ = skipSpace(p_);
        if (at(p_) != '{') {
            complain(p_, "a JSON document of X3D is an object");
            return false;
        }
        ++p_;
        frames_.push_back({Inside::wrapper, {}, {}});
        while (!frames_.empty()) step();
        if (!finish()) {
            where_ = {1, 1};
            error("there is no X3D object in the document");
            return false;
        }
        while (feed_.more()) feed_.release(feed_.end());
        meter_.finish();
        return outline_.complete;
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
        std::string name;  // elements: of each
        std::string containerField;
    };
    /// A list of numbers that was read past attributes_.
    struct Early {
        std::size_t index;  // of its placeholder in attributes_
        Value value;
        SourceLocation where;
    };
    class LongValue;

    SourceLocation where() override { return where_; }
    SourceLocation locate(const char*) override {
        // The values are copies; the start of the original is near enough.
        const std::string_view name(parsedAttribute() ? parsedAttribute() : "");
        for (std::size_t i = 0; i + 1 < attributes_.size(); i += 2) {
            if (name != attributes_[i]) continue;
            const Early* early = earlyAt(i + 1);
            return early ? early->where : position_.of(valuePositions_[i / 2]);
        }
        return where_;
    }
    Value* parsedBefore(const char* text) override {
        for (Early& early : early_)
            if (attributes_[early.index] == text) return &early.value;
        return nullptr;
    }
    const Early* earlyAt(std::size_t index) const {
        const auto found = std::ranges::find(early_, index, &Early::index);
        return found == early_.end() ? nullptr : &*found;
    }

    // ---- text
    /// What is there so far, of what the first look let through.
    void findEnd() {
        const auto size = static_cast<std::uint64_t>(feed_.end() - begin_);
        end_ = begin_ + std::min(size, outline_.end);
    }
    bool grow() {
        const char* const before = end_;
        if (!feed_.more()) return false;
        findEnd();
        return end_ != before;
    }
    /// There is a character at `p`, maybe one that had to be fetched.
    bool there(const char* p) { return p < end_ || (grow() && there(p)); }
    char at(const char* p) { return there(p) ? *p : '\0'; }
    void release(const char* upTo) {
        constexpr std::ptrdiff_t kept = 1 << 20;  // behind the place where reading is
        if (held_ || upTo - released_ < 2 * kept) return;
        released_ = upTo - kept;
        position_.of(released_);
        feed_.release(released_);
    }

    // ---- tokens
    const char* skipSpace(const char* p) {
        while (there(p) && isSpace(*p)) ++p;
        return p;
    }
    /// Behind the closing quote of the string that starts at `p`.
    const char* stringEnd(const char* p) {
        for (++p; there(p); ++p) {
            if (*p == '"') return p + 1;
            if (*p == '\\' && !there(++p)) break;
        }
        return end_;
    }
    const char* valueEnd(const char* p) {
        const char c = at(p);
        if (c == '"') return stringEnd(p);
        if (c == '{' || c == '[') return behindClose(p + 1, 1);
        while (there(p) && !isSeparator(*p)) ++p;
        return p;
    }
    /// Behind the bracket that closes the outermost of so many open ones.
    const char* behindClose(const char* p, std::size_t depth) {
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

    /// The next member of an object: its key; `p` is then at its value. False at the object's end, where `p` is then.
    bool nextMember(const char*& p, std::string& key) {
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
    void complain(const char* p, std::string text) {
        where_ = position_.of(std::min(p, end_));
        error(std::move(text));
    }
    /// The text of the string literal in [start, end), quotes included.
    std::string unescaped(const char* start, const char* end) {
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
    static bool hexadecimal(const char* p, const char* stop, std::uint32_t& out) {
        if (stop - p < 6 || p[0] != '\\' || p[1] != 'u') return false;
        return std::from_chars(p + 2, p + 6, out, 16).ptr == p + 6;
    }
    const char* appendUnicode(std::string& out, const char* p, const char* stop) {
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

    // ---- what the text says
    void step() {
        release(p_);
        const Inside inside = frames_.back().inside;
        if (inside == Inside::wrapper || inside == Inside::element) {
            std::string key;
            if (!nextMember(p_, key)) return leave();
            if (inside == Inside::element)
                member(key);
            else if (key == "#comment")
                comments();
            else if (!key.starts_with('#'))
                element(key, std::string(frames_.back().containerField));
            else
                p_ = valueEnd(p_);
            return;
        }
        p_ = skipSpace(p_);
        const char c = at(p_);
        if (c == '\0' || c == ']' || c == '}') return leave();
        if (c != '{') return skip(p_, "expected an object");
        if (inside == Inside::elements) return element(std::string(frames_.back().name), {});
        ++p_;
        frames_.push_back({Inside::wrapper, {}, std::string(frames_.back().containerField)});
    }
    void leave() {
        where_ = position_.of(std::min(p_, end_));
        if (there(p_)) ++p_;
        const bool isElement = frames_.back().inside == Inside::element;
        frames_.pop_back();
        if (isElement) end();
    }
    /// Leaves the value out that p_ is at.
    void skip(const char* complaintAt, std::string why) {
        complain(complaintAt, std::move(why));
        p_ = std::max(valueEnd(p_), std::min(p_ + 1, end_));
    }

    /// Starts the element whose object is at p_.
    void element(const std::string& name, const std::string& containerField) {
        meter_.at(feed_.done(p_));
        const char* const object = p_;
        if (at(object) != '{') return skip(object, "expected an object for " + name.substr(0, 80));
        strings_.clear();
        valuePositions_.clear();
        early_.clear();
        SourceLocation place = position_.of(object);
        ++p_;
        const auto offset = static_cast<std::uint64_t>(object - begin_);
        if (std::ranges::binary_search(outline_.late, offset)) {
            // Its members are gone through twice, and all of it is kept until then.
            held_ = true;
            for (std::string key; nextMember(p_, key);)
                if (key.starts_with('@'))
                    attribute(name, key.substr(1));
                else
                    p_ = valueEnd(p_);
            p_ = object + 1;
            held_ = false;
        } else {
            attributesInFront(name);
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
        where_ = place;
        start(name.c_str(), attributes_.data(), count);
        attributes_.clear();
        early_.clear();
        frames_.push_back({Inside::element, {}, {}});
    }
    void attributesInFront(const std::string& name) {
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
    /// What is neither an attribute nor a node. Returns where it ends.
    const char* scalar(const std::string& key) {
        if (key != "encoding" && key != "JSON schema") complain(p_, "'" + key.substr(0, 80) + "' is unknown here");
        return std::max(valueEnd(p_), std::min(p_ + 1, end_));
    }

    /// Takes the attribute's value, which is at p_.
    void attribute(const std::string& element, const std::string& name) {
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
    /// The value of an attribute of this element that has come already.
    std::string given(std::string_view name) const {
        for (std::size_t i = 0; i + 1 < strings_.size(); i += 2)
            if (strings_[i] == name) return strings_[i + 1];
        return {};
    }

    /// A value as the text of an XML attribute; false for null and for what is no attribute.
    bool attributeText(const char* value, const char* end, std::string& out) {
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

    /// Whether the array at `value` is worth reading in place. One that cannot be changed must be a plain list for
    /// that.
    bool isLong(const char* value) {
        constexpr std::ptrdiff_t shortest = 4096;
        if (!there(value + shortest)) return false;
        if (std::memchr(value, ']', shortest)) return false;
        if (!feed_.isWhole()) return true;
        const auto size = static_cast<std::size_t>(end_ - value - 1);
        const void* close = std::memchr(value, ']', size);
        if (!close) return false;
        const auto length = static_cast<std::size_t>(static_cast<const char*>(close) - value - 1);
        return !std::memchr(value + 1, '[', length) && !std::memchr(value + 1, '"', length);
    }
    void longValue(const std::string& name, FieldType type);

    void member(const std::string& key) {
        const char c = at(p_);
        if (key.starts_with('@')) {  // known since the element started
            p_ = valueEnd(p_);
        } else if (key == "#comment") {
            comments();
        } else if (key == "#sourceCode" || key == "#sourceText") {
            source();
        } else if (key.starts_with('-')) {
            if (c != '[' && c != '{') return skip(p_, "'" + key.substr(0, 80) + "' takes nodes");
            ++p_;
            frames_.push_back({c == '[' ? Inside::nodes : Inside::wrapper, {}, key.substr(1)});
        } else if (c == '[') {
            ++p_;
            frames_.push_back({Inside::elements, key, {}});
        } else if (c == '{') {
            element(key, {});
        } else {
            p_ = scalar(key);
        }
    }
    /// One, or an array of them.
    void comments() {
        const char c = at(p_);
        if (c == '"') return oneComment();
        if (c != '[') return skip(p_, "#comment takes strings");
        for (p_ = skipSpace(p_ + 1); there(p_) && *p_ != ']'; p_ = skipSpace(p_))
            if (*p_ == '"')
                oneComment();
            else
                p_ = std::max(valueEnd(p_), p_ + 1);
        p_ = std::min(p_ + 1, end_);
    }
    void oneComment() {
        const char* const start = p_;
        where_ = position_.of(start);
        p_ = stringEnd(start);
        comment(unescaped(start, p_));
    }
    void source() {
        beginSection();
        const char* const start = p_;
        const char c = at(p_);
        if (c == '[') {
            sourceLines();
        } else {
            p_ = valueEnd(p_);
            if (c == '"')
                text(unescaped(start, p_));
            else
                complain(start, "#sourceCode takes strings");
        }
        endSection();
    }
    void sourceLines() {
        bool first = true;
        for (p_ = skipSpace(p_ + 1); there(p_) && *p_ != ']'; p_ = skipSpace(p_)) {
            const char* const line = p_;
            p_ = std::max(valueEnd(line), line + 1);
            if (*line != '"') {
                complain(line, "#sourceCode takes strings");
                continue;
            }
            if (!first) text("\n");
            first = false;
            text(unescaped(line, p_));
        }
        p_ = std::min(p_ + 1, end_);
    }

    TextFeed& feed_;
    const JsonOutline outline_;
    TextPosition position_;
    const char* const begin_;
    const char* released_;
    const char* end_ = nullptr;
    const char* p_;
    bool held_ = false;  // nothing is given back
    ProgressMeter meter_;
    std::vector<Frame> frames_;
    SourceLocation where_;
    std::vector<std::string> strings_;  // of the element being started
    std::vector<const char*> attributes_;
    std::vector<const char*> valuePositions_;
    std::vector<Early> early_;
};

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
            const char* found = reader_.end_;
            for (const char c : {']', '[', '"', '{', '}'})
                if (const void* at = std::memchr(from, c, static_cast<std::size_t>(found - from)))
                    found = static_cast<const char*>(at);
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
    while (source.more(source.stop()) != source.stop()) {
        // An error has ended the value before its text.
    }
    const char* const stop = source.stop();
    if (there(stop) && *stop != ']') complain(stop, name + ": expected a number");
    p_ = behindClose(stop, source.depth());
    strings_.push_back(name);
    strings_.emplace_back();
    valuePositions_.push_back(value);
    early_.push_back(std::move(early));
}

}  // namespace

bool readJson(TextFeed& text, DocumentHandler& handler, Diagnostics& diagnostics, const ReaderProgress& progress) {
    // Looked at twice: what comes through a pipe has to be kept in between.
    std::unique_ptr<TextFeed> again = text.isWhole() ? nullptr : text.again();
    if (!again) text.fill();
    JsonOutline outline = outlineJson(again ? *again : text, again != nullptr, diagnostics);
    again.reset();
    return JsonReader(text, std::move(outline), handler, diagnostics, progress).read();
}

}  // namespace rtsg::detail
