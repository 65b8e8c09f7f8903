// Drives expat, and hands its elements to the ElementReader. Long lists of numbers are found by a look at the text
// before expat gets it, parsed where they are, and replaced by a placeholder.
#include "reader_xml.h"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <cstring>

#include "text/find_bytes.h"
#include "text/text_pieces.h"

namespace rtsg::detail {

namespace {

// The position of expat. From 2.9 on it has 64 bits on all machines, and warns of the older function.
#if XML_MAJOR_VERSION > 2 || XML_MINOR_VERSION >= 9
std::int64_t byteIndex(XML_Parser parser) {
    return XML_GetCurrentByteIndex64(parser);
}
std::uint64_t byteCount(XML_Parser parser) {
    return XML_GetCurrentByteCount64(parser);
}
std::uint64_t lineNumber(XML_Parser parser) {
    return XML_GetCurrentLineNumber64(parser);
}
std::uint64_t columnNumber(XML_Parser parser) {
    return XML_GetCurrentColumnNumber64(parser);
}
#else
std::int64_t byteIndex(XML_Parser parser) {
    return XML_GetCurrentByteIndex(parser);
}
std::uint64_t byteCount(XML_Parser parser) {
    return static_cast<std::uint64_t>(XML_GetCurrentByteCount(parser));
}
std::uint64_t lineNumber(XML_Parser parser) {
    return XML_GetCurrentLineNumber(parser);
}
std::uint64_t columnNumber(XML_Parser parser) {
    return XML_GetCurrentColumnNumber(parser);
}
#endif

}  // namespace

bool readXml(TextFeed& text, bool utf8, DocumentHandler& handler, Diagnostics& diagnostics,
             const ReaderOptions& options) {
    return XmlReader(text, utf8, handler, diagnostics, options).read();
}

XmlReader::XmlReader(TextFeed& text, bool utf8, DocumentHandler& handler, Diagnostics& diagnostics,
                     const ReaderOptions& options)
    : ElementReader(Encoding::xml, handler, diagnostics, options.dialect),
      feed_(text),
      utf8_(utf8),
      position_(text.begin()),
      released_(text.begin()),
      meter_(text.total(), options.progress),
      splitting_(options.splitting),
      parser_([this](std::string what) { error(std::move(what)); }) {}

namespace {

/// In all known files, a fieldValue names its field before its value, and first.
std::string_view fieldOf(std::string_view tag) {
    tag = tag.substr(0, 1024);
    const std::size_t name = tag.find(" name=");
    if (name == tag.npos || name + 7 >= tag.size()) return {};
    const std::size_t close = tag.find(tag[name + 6], name + 7);
    return close == tag.npos ? std::string_view() : tag.substr(name + 7, close - name - 7);
}

}  // namespace

/// Is there a '&' that begins no reference, in the token that starts at `p`?
bool XmlReader::isBareAmpersand(const char* p) const {
    constexpr std::ptrdiff_t maximum = 1 << 16;
    const char* const stop = feed_.end() - p > maximum ? p + maximum : feed_.end();
    // The place of the fault may be within the reference.
    for (int back = 0; back < 64 && p > released_ && !isSpace(p[-1]) && p[-1] != '\'' && p[-1] != '"'; ++back) --p;
    while (p < stop && (p = static_cast<const char*>(std::memchr(p, '&', static_cast<std::size_t>(stop - p))))) {
        const char* s = ++p;
        while (s != stop && (std::isalnum(static_cast<unsigned char>(*s)) || *s == '#' || *s == '_' || *s == '-')) ++s;
        if (s == p || s == stop || *s != ';') return true;
    }
    return false;
}

bool XmlReader::read() {
    parser_.giveHandlers<&XmlReader::parser_>(*this);
    XML_SetElementHandler(
        parser_,
        [](void* self, const char* name, const char** attributes) {
            static_cast<XmlReader*>(self)->startElement(name, attributes);
        },
        [](void* self, const char*) { static_cast<XmlReader*>(self)->end(); });
    XML_SetCharacterDataHandler(parser_, [](void* self, const char* characters, int count) {
        static_cast<XmlReader*>(self)->text({characters, static_cast<std::size_t>(count)});
    });
    XML_SetCdataSectionHandler(
        parser_, [](void* self) { static_cast<XmlReader*>(self)->beginSection(); },
        [](void* self) { static_cast<XmlReader*>(self)->endSection(); });
    XML_SetCommentHandler(parser_, [](void* self, const char* text) { static_cast<XmlReader*>(self)->comment(text); });
    feedAll();
    if (status_ != XML_STATUS_OK && !parser_.isRefused()) {
        const std::int64_t at = XML_GetErrorCode(parser_) == XML_ERROR_INVALID_TOKEN ? byteIndex(parser_) : -1;
        if (utf8_ && at >= 0 && isBareAmpersand(feed_.begin() + textIndex(static_cast<std::uint64_t>(at))))
            error("a '&' that begins no reference is written &amp;");
        const std::string inside = openElement().empty() ? "" : ", inside " + openElement();
        error(std::string("not well-formed XML: ") + XML_ErrorString(XML_GetErrorCode(parser_)) + inside +
              "; reading ends here");
    }
    if (!finish()) return false;
    meter_.finish();
    return status_ == XML_STATUS_OK;
}

/// False once expat has found the text not well-formed.
bool XmlReader::feed(const char* from, const char* to, bool last) {
    do {
        const auto count = std::min<std::size_t>(static_cast<std::size_t>(to - from), 1 << 30);
        fed_ += count;
        status_ = XML_Parse(parser_, from, static_cast<int>(count), last && from + count == to);
        from += count;
    } while (status_ == XML_STATUS_OK && from != to);
    return status_ == XML_STATUS_OK;
}

bool XmlReader::feedAll() {
    const char *at = feed_.begin(), *looked = at;  // expat has had the text before `at`
    std::size_t part = kPart;
    if (!utf8_) in_ = In::opaque;
    for (;;) {
        bool more = true;
        while (static_cast<std::size_t>(feed_.end() - at) < part && more) more = feed_.more();
        const char *const before = at, *to = more ? at + part : feed_.end();
        const bool last = !more;
        if (const char* quote = scan(looked, to)) {
            if (!feed(at, quote + 1, false)) return false;
            at = looked = readLong(quote);
            if (status_ != XML_STATUS_OK) return false;
        } else {
            looked = to;
            // A list of numbers that may turn out to be long waits until that is clear.
            if (!last && in_ == In::quoted && opened_ >= at && typeOfLong(opened_) != FieldType::SFNode) to = opened_;
            if (!feed(at, to, last)) return false;
            if (last) return true;
            at = to;
        }
        // Expat keeps a token that it could not finish, and reads it again with the next part. Larger parts within a
        // long tag make the work grow with the tag's length, not with its square.
        const bool isLong = in_ == In::opaque || (in_ == In::quoted && tag_ < before);
        part = isLong ? std::min<std::size_t>(2 * part, 1 << 30) : kPart;
        release(in_ == In::quoted || in_ == In::tag ? std::min(tag_, at) : at);
    }
}

/// Tells what kind of markup the `<` at `opened_` begins, by the character behind it.
XmlReader::In XmlReader::whatBegins(char next) {
    if (next == '?') return In::instruction;
    if (next != '!') return In::tag;
    // Which of three it is shows a few characters on.
    const char* const stop = opened_ + 9;
    while (feed_.end() < stop && feed_.more()) {
    }
    const std::string_view mark(opened_, static_cast<std::size_t>(std::min(feed_.end(), stop) - opened_));
    depth_ = 0;
    if (mark.starts_with("<!--")) {
        opened_ += 4;  // `<!-->` ends nothing
        return In::comment;
    }
    return mark == "<![CDATA[" ? In::section : In::declaration;
}

/// Moves behind one character, string or comment of a DTD: those may hide brackets. One that goes on behind `to` makes
/// all that follows opaque, which is left to expat.
const char* XmlReader::scanDeclaration(const char* p, const char* to) {
    const std::string_view text(p, static_cast<std::size_t>(to - p));
    const bool isComment = text.starts_with("<!--");
    if (isComment || *p == '"' || *p == '\'') {
        const std::size_t end = isComment ? text.find("-->") : text.find(*p, 1);
        if (end == text.npos) {
            in_ = In::opaque;
            return p;
        }
        return p + end + (isComment ? 2 : 0);
    }
    depth_ += *p == '[' || *p == '<';
    depth_ -= *p == ']' || *p == '>';
    if (depth_ < 0) in_ = In::content;
    return p;
}

/// Looks at the text, from where the last look ended, for an attribute that is long already at `to`: its opening quote,
/// or null. Goes on behind `to` the next time.
const char* XmlReader::scan(const char* p, const char* to) {
    const auto find = [&](char c) {
        const void* found = std::memchr(p, c, static_cast<std::size_t>(to - p));
        return found ? static_cast<const char*>(found) : to;
    };
    // A mark that the end of the text cuts in two is found when there is more.
    const auto endsWith = [&](const char* at, std::string_view mark) {
        return at - opened_ + 1 >= static_cast<std::ptrdiff_t>(mark.size()) &&
               std::string_view(at + 1 - mark.size(), mark.size()) == mark;
    };
    while (p != to) {
        switch (in_) {
            case In::opaque:
                return nullptr;
            case In::content:
                p = find('<');
                if (p == to) return nullptr;
                opened_ = tag_ = p++;
                in_ = In::tag;
                break;
            case In::tag:
                if (p == opened_ + 1) in_ = whatBegins(*p);
                if (in_ != In::tag) {
                    ++p;
                    break;
                }
                while (p != to && *p != '"' && *p != '\'' && *p != '>') ++p;
                if (p == to) return nullptr;
                if (*p == '>') {
                    in_ = In::content;
                } else {
                    in_ = In::quoted;
                    quote_ = *p;
                    opened_ = p;
                }
                ++p;
                break;
            case In::quoted:
                p = find(quote_);
                if (p - opened_ > kLong && typeOfLong(opened_) != FieldType::SFNode) {
                    if (static_cast<std::uint64_t>(opened_ - feed_.begin()) >= textIndex(fed_)) return opened_;
                }
                if (p == to) return nullptr;
                in_ = In::tag;
                opened_ = tag_;
                ++p;
                break;
            case In::comment:
            case In::section:
            case In::instruction: {
                p = find('>');
                if (p == to) return nullptr;
                const std::string_view mark = in_ == In::comment ? "-->" : in_ == In::section ? "]]>" : "?>";
                if (endsWith(p, mark)) in_ = In::content;
                ++p;
                break;
            }
            case In::declaration:
                p = scanDeclaration(p, to);
                if (in_ == In::opaque) return nullptr;
                ++p;
                break;
        }
    }
    return nullptr;
}

/// Finds the first character that may end a value, or needs a look in it; by several threads if the value is long.
const char* XmlReader::findMark(const char* from, const char* end) const {
    const char quote = quote_;
    const auto find = [quote](const char* begin, const char* stop) { return findAnyOf(begin, stop, quote, '<', '&'); };
    if (splitting_.threads < 2 || end - from < static_cast<std::ptrdiff_t>(splitting_.from)) return find(from, end);
    const char* const enough = from + splitting_.from / 16;
    const char* p = find(from, enough);
    if (p != enough) return p;
    PieceWalk walk(
        p, splitting_, [](const char*, const char* maximum) { return maximum; },
        [find](TextPiece& piece) { piece.stop = find(piece.begin, piece.end); });
    for (walk.add(end); walk.next(p); walk.add(end)) {
    }
    return find(p, end);
}

/// The type of the attribute whose value starts at `quote`, if it is a list of numbers.
FieldType XmlReader::typeOfLong(const char* quote) const {
    const bool again = longTag_ == tag_;  // then the text before its last long value may be gone
    const char* const from = again ? longEnd_ : tag_ + 1;
    if (!again && tag_ < released_) return FieldType::SFNode;
    if (feed_.isComplete()) {
        // Text that is not ours cannot be mended: expat takes care of references in it.
        if (wholeQuote_ != quote) {
            wholeQuote_ = quote;
            wholeEnd_ = findMark(quote + 1, feed_.end());
        }
        const char* stop = wholeEnd_;
        if (stop != feed_.end() && *stop == '<') stop = findAnyOf(stop, feed_.end(), quote_, '&');
        if (stop == feed_.end() || *stop == '&') return FieldType::SFNode;
    }
    const std::string_view text(from, static_cast<std::size_t>(quote - from));
    const std::size_t stop = text.find_last_not_of(" \t\r\n=");
    if (stop == text.npos) return FieldType::SFNode;
    const std::size_t start = text.find_last_of(" \t\r\n\"'", stop);
    if (start == text.npos) return FieldType::SFNode;
    const std::string_view attribute = text.substr(start + 1, stop - start);
    if (again) return longAttribute(longElement_, attribute, longField_);
    const auto isEnd = [](char c) { return isSpace(c) || c == '=' || c == '>' || c == '/'; };
    const std::string_view element(text.begin(), std::ranges::find_if(text, isEnd));
    return longAttribute(element, attribute, fieldOf(text));
}

/// The parser of a value between quotes asks for more of it here.
class XmlReader::LongValue final : public detail::FieldTextReport {
  public:
    LongValue(XmlReader& reader, const char* from, std::string name)
        : reader_(reader), from_(from), name_(std::move(name)) {}
    const char* end(const char* from) {
        for (;;) {
            const char* const stop = reader_.feed_.end();
            const bool known = reader_.wholeQuote_ && from == reader_.wholeQuote_ + 1;
            const char* const found = known ? reader_.wholeEnd_ : findAnyOf(from, stop, reader_.quote_, '<', '&');
            if (found == stop || *found != '&') {
                ended_ = found != stop;
                return found;
            }
            const char* const end = spaceReference(found);
            if (!end || !reader_.feed_.blank(found, end)) {
                ended_ = true;
                return found;
            }
            from = end;
        }
    }
    const char* more(const char* before) override {
        if (ended_ || before != stop_) return before;
        if (!reader_.feed_.more()) {
            ended_ = true;
            return before;
        }
        return stop_ = end(before);
    }
    Splitting splitting() const override { return reader_.splitting_; }
    void start() { stop_ = end(from_); }
    const char* stop() const { return stop_; }
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
    /// The end of `&#10;` and the like at `at`, which stand for white space; null if it is something else.
    const char* spaceReference(const char* at) {
        while (reader_.feed_.end() - at < 8 && reader_.feed_.more()) {
        }
        const std::string_view text(at, std::min<std::size_t>(8, static_cast<std::size_t>(reader_.feed_.end() - at)));
        for (const std::string_view space :
             {"&#10;", "&#9;", "&#13;", "&#32;", "&#xA;", "&#xa;", "&#xD;", "&#xd;", "&#x9;", "&#x20;"})
            if (text.starts_with(space)) return at + space.size();
        return nullptr;
    }

    XmlReader& reader_;
    const char* from_;
    const char* stop_ = nullptr;
    std::string name_;
    bool ended_ = false;
};

/// Reads the value behind `quote`, and gives expat a placeholder for it. Returns where the text goes on.
const char* XmlReader::readLong(const char* quote) {
    const FieldType type = typeOfLong(quote);
    const char* const from = longTag_ == tag_ ? longEnd_ : tag_ + 1;
    const std::string_view before(from, static_cast<std::size_t>(quote - from));
    if (longTag_ != tag_) {
        longTag_ = tag_;
        longAt_ = position_.of(tag_);
        longElement_ = before.substr(0, before.find_first_of(" \t\r\n"));
        longField_ = fieldOf(before);
    }
    const std::size_t nameEnd = before.find_last_not_of(" \t\r\n=") + 1;
    const std::size_t nameStart = before.find_last_of(" \t\r\n\"'", nameEnd - 1) + 1;
    LongValue source(*this, quote + 1, std::string(before.substr(nameStart, nameEnd - nameStart)));
    source.start();
    FieldTextParser parser(quote + 1, source.stop(), TextSyntax::xml, source);
    // U+F8FF is for private use, and no number.
    Early early{"\xEF\xA3\xBF rtsg value " + std::to_string(fed_), {}, fed_, longAt_};
    if (!parser.parse(type, early.value)) early.value = Value::zero(type);
    source.finish();
    const char* stop = source.stop();
    if (stop != feed_.end() && *stop == '&')
        diagnostics().error(position_.of(stop),
                            "entities are not read within so long a list of numbers; what is behind is left out");
    while (stop != feed_.end() && *stop == '&') {
        LongValue rest(*this, stop + 1, {});
        rest.start();
        rest.finish();
        stop = rest.stop();
    }
    const std::uint64_t seen = fed_ + early.placeholder.size();
    skipped_.push_back({seen, static_cast<std::uint64_t>(stop - feed_.begin()) - seen});
    if (skipped_.size() > 64) skipped_.pop_front();
    early_.push_back(std::move(early));
    const std::string placeholder = early_.back().placeholder;
    longEnd_ = stop;
    in_ = In::quoted;
    opened_ = stop;  // so short a rest is not long
    feed(placeholder.data(), placeholder.data() + placeholder.size(), false);
    return stop;
}

/// The place in the text of the byte that expat counts as this one.
std::uint64_t XmlReader::textIndex(std::uint64_t index) const {
    for (auto s = skipped_.rbegin(); s != skipped_.rend(); ++s)
        if (index >= s->index) return index + s->more;
    return index;
}

void XmlReader::release(const char* upTo) {
    if (!utf8_ || upTo - released_ < 2 * kKept) return;
    released_ = upTo - kKept;
    position_.of(released_);
    feed_.release(released_);
}

Value* XmlReader::parsedBefore(const char* text) {
    const auto found = std::ranges::find(early_, text, &Early::placeholder);
    return found == early_.end() ? nullptr : &found->value;
}

/// A long value of the tag that expat is at.
const XmlReader::Early* XmlReader::earlyHere() const {
    if (early_.empty()) return nullptr;
    const auto start = static_cast<std::uint64_t>(std::max<std::int64_t>(byteIndex(parser_), 0));
    const auto end = start + static_cast<std::uint64_t>(byteCount(parser_));
    const auto found =
        std::ranges::find_if(early_, [&](const Early& one) { return one.index >= start && one.index < end; });
    return found == early_.end() ? nullptr : &*found;
}

void XmlReader::startElement(const char* name, const char** attributes) {
    meter_.at(feed_.done(feed_.begin() +
                         textIndex(static_cast<std::uint64_t>(std::max<std::int64_t>(byteIndex(parser_), 0)))));
    start(name, attributes, XML_GetSpecifiedAttributeCount(parser_));
    while (const Early* used = earlyHere()) early_.erase(early_.begin() + (used - early_.data()));
}

SourceLocation XmlReader::where() {
    if (utf8_) return locate(nullptr);
    return {static_cast<std::uint32_t>(lineNumber(parser_)), static_cast<std::uint32_t>(columnNumber(parser_) + 1)};
}

/// The place in the text of `at`, which is in the value of the attribute being parsed; of null, the start of the
/// element. Attributes are asked for in their order, so that an element is looked through once.
SourceLocation XmlReader::locate(const char* at) {
    if (!utf8_) return where();
    if (const Early* early = earlyHere()) return early->tagAt;
    const std::int64_t index = byteIndex(parser_);
    if (index != located_.index || released_ > located_.next) {
        const std::uint64_t size = static_cast<std::uint64_t>(feed_.end() - feed_.begin());
        const std::uint64_t start = index < 0 ? size : std::min(textIndex(static_cast<std::uint64_t>(index)), size);
        const char* const element = std::max(feed_.begin() + start, released_);
        located_ = {index, position_.of(element), {}, nullptr, element};
    }
    if (!at || !parsedAttribute()) return located_.element;
    if (located_.attribute != parsedAttribute()) {
        located_.attribute = parsedAttribute();
        located_.value = findAttribute(located_.attribute);
    }
    const char* s = located_.value;
    if (!s) return located_.element;
    const char quote = *s++;
    for (std::ptrdiff_t offset = at - parsedValue(); offset > 0 && s != feed_.end() && *s != quote; --offset) {
        if (*s == '&')
            while (s != feed_.end() && *s != ';' && *s != quote) ++s;
        if (s != feed_.end()) ++s;
    }
    return position_.of(s);
}

/// The quote that opens the value of the element's attribute `name`, behind those found before; null if it is not
/// there, as in an element that stands in an entity. expat hands out copies.
const char* XmlReader::findAttribute(std::string_view name) {
    const char* const stop = feed_.end();
    const char*& s = located_.next;
    while (s != stop && *s != '>') {
        const char* const from = s;
        while (s != stop && *s != '=' && *s != '>') ++s;
        if (s == stop || *s == '>') return nullptr;
        const char* nameEnd = s;
        while (nameEnd != from && isSpace(nameEnd[-1])) --nameEnd;
        const std::string_view before(from, static_cast<std::size_t>(nameEnd - from));
        const bool found = before.size() > name.size() && before.ends_with(name) &&
                           isSpace(nameEnd[-static_cast<std::ptrdiff_t>(name.size()) - 1]);
        s = findAnyOf(s, stop, '"', '\'');
        if (s == stop) return nullptr;
        const char* const quote = s++;
        s = findAnyOf(s, stop, *quote, *quote);
        if (s == stop) return nullptr;
        ++s;
        if (found) return quote;
    }
    return nullptr;
}

}  // namespace rtsg::detail
