// Parses one field value after another in a longer text, with positions for errors.
#include "field_text_parser.h"

#include <algorithm>
#include <cstring>
#include <string_view>
#include <utility>

#include "gathered_numbers.h"
#include "number_pieces.h"
#include "number_run.h"

namespace rtsg::detail {

namespace {

constexpr std::size_t kBlock = 512;  // numbers read between two checks for other work

template <class T>
constexpr bool kNumeric = !std::is_same_v<T, bool> && !std::is_same_v<T, String> && !std::is_same_v<T, NodeId> &&
                          !std::is_same_v<T, Image> && !std::is_same_v<T, CustomValue>;
template <class T>
struct ScalarOf {
    using type = float;
};
template <>
struct ScalarOf<std::int32_t> {
    using type = std::int32_t;
};
template <class T>
    requires(std::is_same_v<T, double> || std::is_same_v<T, Time> || std::is_same_v<T, Vec2d> ||
             std::is_same_v<T, Vec3d> || std::is_same_v<T, Vec4d> || std::is_same_v<T, Matrix3d> ||
             std::is_same_v<T, Matrix4d>)
struct ScalarOf<T> {
    using type = double;
};
template <class T>
using Scalar = ScalarOf<T>::type;
template <class T>
constexpr std::size_t kCount = sizeof(T) / sizeof(Scalar<T>);

template <class T>
std::string elementName() {
    return std::string(info(FieldTypeOf<T>::value).name);
}

constexpr const char* kNotFinite = "the number is not finite or too large for its type";

bool isWordStart(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}

}  // namespace

std::string FieldTextParser::found(const char* at) const {
    if (at == end_) return syntax_ == TextSyntax::xml ? "the end of the value" : "the end";
    const char* stop = endOfWord(at, end_);
    if (stop == at) stop = at + 1;
    constexpr std::ptrdiff_t maximum = 40;
    if (stop - at <= maximum) return "'" + std::string(at, stop) + "'";
    stop = at + maximum;
    while (stop != at && (static_cast<unsigned char>(*stop) & 0xC0u) == 0x80u) --stop;  // not within a code point
    return "'" + std::string(at, stop) + "...'";
}

bool FieldTextParser::expected(const char* what) {
    report_.report(Severity::error, p, std::string("expected ") + what + ", found " + found(p));
    return false;
}

bool FieldTextParser::parseQuoted(String& out) {
    const char* open = p;
    const char* s = p + 1;
    bool escapes = false;
    while ((s != end_ || grow()) && *s != '"') {
        if (*s == '\\' && (s + 1 != end_ || grow())) {
            escapes = true;
            ++s;
        }
        ++s;
    }
    if (s == end_) {
        report_.report(Severity::error, open, "the string is not closed");
        p = end_;
        return false;
    }
    p = s + 1;
    const std::string_view raw(open + 1, static_cast<std::size_t>(s - open - 1));
    if (!escapes) {
        out = String(raw);
        return true;
    }
    std::string plain;
    plain.reserve(raw.size());
    for (std::size_t i = 0; i < raw.size(); ++i) {
        // Only these two are escapes (19776-2 5.16); any other backslash stands for itself.
        if (raw[i] == '\\' && i + 1 < raw.size() && (raw[i + 1] == '"' || raw[i + 1] == '\\')) ++i;
        plain += raw[i];
    }
    out = String(plain);
    return true;
}

bool FieldTextParser::parseBool(bool& out) {
    const char* stop = wordEnd();
    const std::string_view word(p, static_cast<std::size_t>(stop - p));
    if (word == "TRUE" || word == "true") {
        out = true;
    } else if (word == "FALSE" || word == "false") {
        out = false;
    } else if (word == "True" || word == "False") {
        out = word == "True";
        report_.report(Severity::warning, p, "booleans are written TRUE and FALSE (true and false in XML)");
    } else {
        return expected(syntax_ == TextSyntax::xml ? "true or false" : "TRUE or FALSE");
    }
    if (syntax_ == TextSyntax::classicVrml && (word == "true" || word == "false"))
        report_.report(Severity::warning, p, "ClassicVRML writes TRUE and FALSE");
    p = stop;
    return true;
}

template <class T>
bool FieldTextParser::parseNumbers(T& out) {
    Scalar<T> numbers[kCount<T>];
    bool finite = true;
    for (Scalar<T>& number : numbers) {
        skipSpace();
        const char* at = p;
        NumberStatus status = p == end_ ? NumberStatus::malformed : scanNumber(p, end_, number);
        while (p == end_ && grow()) status = scanNumber(p = at, end_, number);
        if (status == NumberStatus::malformed) {
            p = at;
            const std::string what = kCount<T> == 1 ? std::is_same_v<T, std::int32_t> ? "an integer" : "a number"
                                                    : std::to_string(kCount<T>) + " numbers";
            return expected((what + " (" + elementName<T>() + ")").c_str());
        }
        if (status == NumberStatus::notFinite && finite) {
            report_.report(Severity::error, at, kNotFinite);
            finite = false;
        }
    }
    std::memcpy(static_cast<void*>(&out), numbers, sizeof(T));
    return finite;
}

/// Threads for a list that began at `start`, if enough of it is still to come; else null.
template <class S>
std::unique_ptr<NumberPieces<S>> FieldTextParser::piecesOf(const char* start, bool bracketed) {
    const Splitting splitting = report_.splitting();
    // A long comment may have led past the size at which a list counts as long.
    const auto from = static_cast<std::ptrdiff_t>(splitting.from);
    const std::ptrdiff_t rest = std::max(from - (p - start), from / 16);
    const auto isHere = [&] { return end_ - p >= rest; };
    const auto isClosed = [&] {
        return bracketed && std::memchr(p, ']', static_cast<std::size_t>(std::min(end_ - p, rest)));
    };
    while (!isHere() && !isClosed() && grow()) {
    }
    if (!isHere() || isClosed()) return nullptr;
    return std::make_unique<NumberPieces<S>>(p, bracketed, splitting);
}

template <class S>
void FieldTextParser::readAhead(NumberPieces<S>& pieces) {
    while (pieces.cut(end_))
        if (!grow()) return pieces.end();
}

template <class T>
bool FieldTextParser::parseManyNumbers(Array<T>& out, bool bracketed) {
    const Splitting splitting = report_.splitting();
    // One thread begins: most lists are short, and where they end is not known.
    const auto alone = static_cast<std::ptrdiff_t>(splitting.from / 16);
    const char* start = p;
    bool mayBeLong = splitting.threads > 1;
    GatheredNumbers<Scalar<T>> numbers;
    std::unique_ptr<NumberPieces<Scalar<T>>> pieces;
    std::size_t message = 0;  // how many there were when report_ heard of progress
    bool reported = false;
    for (;;) {
        if (numbers.size() - message >= kBlock) {
            message = numbers.size();
            report_.progress(p);
        }
        if (pieces || (mayBeLong && p - start >= alone)) {
            skipSpace();
            if (!pieces) mayBeLong = (pieces = piecesOf<Scalar<T>>(start, bracketed)) != nullptr;
            if (pieces) readAhead(*pieces);
            if (pieces && pieces->take(p, numbers)) continue;
            if (pieces && pieces->isEmpty()) {
                pieces = nullptr;
                start = p;
            }
        }
        // Many at once, as far as they are plain; then one with care.
        const auto room = numbers.room(kRunMax);
        const char* const limit = pieces ? pieces->limit(end_) : end_;
        numbers.took(scanRun(p, limit, room.data(), std::min(room.size(), kBlock)));
        skipSpace();
        if (pieces && p >= limit && p != end_) continue;
        if (p == end_ || (bracketed && *p == ']')) break;
        const char* at = p;
        Scalar<T> number{};
        NumberStatus status = scanNumber(p, end_, number);
        while (p == end_ && grow()) status = scanNumber(p = at, end_, number);
        if (status == NumberStatus::malformed) {
            p = at;
            report_.report(Severity::error, p,
                           std::string("expected ") + (std::is_same_v<T, std::int32_t> ? "an integer" : "a number") +
                               " (" + std::string(info(mf(FieldTypeOf<T>::value)).name) + "), found " + found(p) +
                               "; the values before it are kept");
            out = numbers.template finish<T>();
            if (bracketed) abandonArray();
            return true;
        }
        if (status == NumberStatus::notFinite && !reported) {
            report_.report(Severity::error, at, std::string(kNotFinite) + "; 0 is taken instead");
            reported = true;
        }
        numbers.push(number);
    }
    if (const std::size_t rest = numbers.size() % kCount<T>; rest != 0)
        report_.report(Severity::error, p,
                       "the last " + std::to_string(rest) + " numbers do not make a whole " + elementName<T>() + " (" +
                           std::to_string(kCount<T>) + " needed)");
    out = numbers.template finish<T>();
    if (p == end_ && bracketed) report_.report(Severity::error, p, "']' is missing at the end");
    p += p != end_;
    return true;
}

/// Leaves a bracketed array after an error: behind its `]` if that comes next of all brackets, else here.
void FieldTextParser::abandonArray() {
    const char* s = p;
    while ((s != end_ || grow()) && *s != ']' && *s != '[' && *s != '{' && *s != '}' && *s != '"') ++s;
    if (s != end_ && *s == ']')
        p = s + 1;
    else if (!isWordStart(*p))
        p = s;
}

bool FieldTextParser::parseImage(Image& out, bool last) {
    std::int32_t head[3];
    for (std::int32_t& number : head) {
        skipSpace();
        const char* at = p;
        NumberStatus status = p == end_ ? NumberStatus::malformed : scanInteger(p, end_, number);
        while (p == end_ && grow()) status = scanInteger(p = at, end_, number);
        if (status != NumberStatus::ok || number < 0) {
            p = at;
            return expected("width, height and components of an image");
        }
    }
    if (head[2] > 4 || (head[2] == 0 && (head[0] != 0 || head[1] != 0)))
        report_.report(Severity::warning, p, "an image has 1 to 4 components, not " + std::to_string(head[2]));
    const std::uint64_t pixels = static_cast<std::uint64_t>(head[0]) * static_cast<std::uint64_t>(head[1]);
    std::int32_t block[kBlock];
    std::size_t count = 0;
    // `0 0 0` is the empty image, the default: it has one representation.
    if (head[0] != 0 || head[1] != 0 || head[2] != 0) out.words.append(head);
    // The bits that a pixel of so many components cannot have; a pixel of four components uses the whole word.
    const std::uint32_t beyond = head[2] >= 1 && head[2] <= 3 ? ~((1u << 8 * head[2]) - 1) : 0;
    bool reported = false, reportedBeyond = false;
    for (std::uint64_t i = 0; i < pixels; ++i) {
        skipSpace();
        const char* at = p;
        NumberStatus status = p == end_ ? NumberStatus::malformed : scanInteger(p, end_, block[count], true);
        while (p == end_ && grow()) status = scanInteger(p = at, end_, block[count], true);
        if (status == NumberStatus::malformed) {
            p = at;
            report_.report(Severity::error, p,
                           "the image has " + std::to_string(i) + " of " + std::to_string(head[0]) + " x " +
                               std::to_string(head[1]) + " pixels, then " + found(p));
            return false;
        }
        if (status == NumberStatus::notFinite && !reported) {
            report_.report(Severity::error, at, "the pixel does not fit 32 bits; 0 is taken instead");
            reported = true;
        }
        if ((static_cast<std::uint32_t>(block[count]) & beyond) != 0 && !reportedBeyond) {
            report_.report(Severity::warning, at,
                           "the pixel has more bits than " + std::to_string(head[2]) +
                               (head[2] == 1 ? " component takes" : " components take") + "; the others do not count");
            reportedBeyond = true;
        }
        if (++count == kBlock) {
            out.words.append({block, count});
            count = 0;
            report_.progress(p);
        }
    }
    out.words.append({block, count});
    if (last && syntax_ == TextSyntax::xml) {
        skipSpace();
        if (p != end_) report_.report(Severity::error, p, "there is more than the image's pixels: " + found(p));
    }
    return true;
}

namespace {

bool startsNumber(char c) {
    return isDigit(c) || c == '-' || c == '+' || c == '.';
}

}  // namespace

template <class T>
bool FieldTextParser::parseOne(T& out) {
    skipSpace();
    if constexpr (kNumeric<T>) {
        return parseNumbers(out);
    } else if constexpr (std::is_same_v<T, bool>) {
        return parseBool(out);
    } else if constexpr (std::is_same_v<T, String>) {
        if (p != end_ && syntax_ == TextSyntax::classicVrml && startsNumber(*p)) {
            // Not the grammar, but authors forget quotes round numbers, and all browsers read them.
            const char* stop = wordEnd();
            const std::string_view word(p, static_cast<std::size_t>(stop - p));
            report_.report(Severity::warning, p,
                           "the quotes round " + std::string(word.substr(0, 40)) + " are missing");
            out = String(word);
            p = stop;
            return true;
        }
        if (p == end_ || *p != '"') return expected("a string in double quotes");
        return parseQuoted(out);
    } else if constexpr (std::is_same_v<T, Image>) {
        return parseImage(out, false);
    } else if constexpr (std::is_same_v<T, CustomValue>) {
        return expected("a value of a type that is known");
    } else {
        const char* stop = wordEnd();
        if (std::string_view(p, static_cast<std::size_t>(stop - p)) != "NULL") return expected("a node or NULL");
        p = stop;
        return true;
    }
}

template <class T>
bool FieldTextParser::parseMany(Array<T>& out) {
    skipSpace();
    const bool bracketed = p != end_ && *p == '[' && syntax_ == TextSyntax::classicVrml;
    if (bracketed) ++p;
    const bool single = !bracketed && syntax_ == TextSyntax::classicVrml;
    if constexpr (kNumeric<T>) {
        if (!single) return parseManyNumbers(out, bracketed);
    }
    if (single) {
        T one{};
        if (!parseOne(one)) return false;
        out.push_back(std::move(one));
        return true;
    }
    for (;;) {
        skipSpace();
        if (p == end_) {
            if (bracketed) report_.report(Severity::error, p, "']' is missing at the end");
            return true;
        }
        if (bracketed && *p == ']') {
            ++p;
            return true;
        }
        T one{};
        if (!parseOne(one)) {
            if (bracketed && p != end_) abandonArray();
            return true;
        }
        out.push_back(std::move(one));
        if (out.size() % kBlock == 0) report_.progress(p);
    }
}

namespace {

/// An SFString attribute is the string itself; `\"` and `\\` may be escaped as in MFString.
String unescaped(std::string_view raw) {
    if (raw.find('\\') == raw.npos) return String(raw);
    std::string plain;
    for (std::size_t i = 0; i < raw.size(); ++i) {
        if (raw[i] == '\\' && i + 1 < raw.size() && (raw[i + 1] == '"' || raw[i + 1] == '\\')) ++i;
        plain += raw[i];
    }
    return String(plain);
}

}  // namespace

bool FieldTextParser::parse(FieldType type, Value& out, const CustomType* custom) {
    if (custom && sf(type) == FieldType::SFCustom) return parseCustom(type, *custom, out);
    const bool xml = syntax_ == TextSyntax::xml;
    if (xml && (type == FieldType::SFString || type == FieldType::MFString)) {
        const std::string_view raw(p, static_cast<std::size_t>(end_ - p));
        if (type == FieldType::SFString) {
            out = Value(unescaped(raw));
            p = end_;
            return true;
        }
        skipSpace();
        if (p != end_ && *p != '"') {  // a lone string without quotes is one string
            report_.report(Severity::warning, p, "the strings of a list stand in double quotes; this is taken as one");
            out = Value(Array<String>{unescaped(raw)});
            p = end_;
            return true;
        }
    }
    bool usable = false;
    switch (type) {
#define RTSG_X(suffix, T)                         \
    case FieldType::SF##suffix: {                 \
        T one{};                                  \
        usable = parseOne(one);                   \
        if (usable) out = Value(std::move(one));  \
        break;                                    \
    }                                             \
    case FieldType::MF##suffix: {                 \
        Array<T> many;                            \
        usable = parseMany(many);                 \
        if (usable) out = Value(std::move(many)); \
        break;                                    \
    }
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
    }
    if (xml) {
        skipSpace();
        if (usable && p != end_ && !isMF(type))
            report_.report(Severity::error, p,
                           "there is more than one " + std::string(info(type).name) + ": " + found(p));
        p = end_;
    }
    return usable;
}

}  // namespace rtsg::detail
