// Matches brackets and checks commas of a JSON text, 64 bytes at a time where it is numbers.
#include "json_outline.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <string>
#include <utility>

#if defined(__SSSE3__)
#include <tmmintrin.h>
#endif

#include "text/number_text.h"
#include "text/text_pieces.h"
#include "text/text_position.h"

namespace rtsg::detail {

namespace {

constexpr std::size_t kDeepest = 4'000'000;

#if defined(__SSSE3__)
/// Marks 64 bytes by a bit each: commas, white space, and other bytes that end a number.
struct Masks {
    std::uint64_t comma = 0, space = 0, other = 0;
    explicit Masks(const char* p) {
        for (unsigned part = 0; part < 4; ++part) {
            const __m128i bytes = _mm_loadu_si128(reinterpret_cast<const __m128i*>(p + 16 * std::size_t{part}));
            // Looked up by their lower four bits: the byte that is wanted among those that end so, or one that does
            // not.
            const auto isIn = [&](__m128i table) { return _mm_cmpeq_epi8(_mm_shuffle_epi8(table, bytes), bytes); };
            const auto put = [&](std::uint64_t& mask, __m128i found) {
                mask |= static_cast<std::uint64_t>(static_cast<std::uint32_t>(_mm_movemask_epi8(found))) << (16 * part);
            };
            put(comma, _mm_cmpeq_epi8(bytes, _mm_set1_epi8(',')));
            put(space, isIn(_mm_setr_epi8(' ', 0, 0, 0, 0, 0, 0, 0, 0, '\t', '\n', 0, 0, '\r', 0, 0)));
            put(other, _mm_or_si128(isIn(_mm_setr_epi8(1, 0, '"', '#', 0, 0, 0, 0, 0, 0, ':', '[', 0, ']', 0, 0)),
                                    isIn(_mm_setr_epi8(1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, '{', 0, '}', 0, 0))));
        }
    }
};

/// Numbers, white space and commas taking turns, 64 bytes at a time.
struct Order {
    bool inNumber = false;  // where the next bytes begin
    bool isDue = false;     // a number must come next
    bool isDueAtOther = false;

    /// Moves behind these bytes; false if numbers and commas do not alternate in them. If they hold a byte that may
    /// stand in no list of numbers, it looks at those before it, and does not move.
    bool take(const Masks& masks) {
        const std::uint64_t number = ~(masks.comma | masks.space | masks.other);
        const std::uint64_t starts = number & ~(number << 1 | std::uint64_t{inNumber});
        // From each comma on through white space: where a number may start, and another comma may not.
        const std::uint64_t after = masks.comma << 1 | std::uint64_t{isDue};
        std::uint64_t sum = 0;
        const bool carried = __builtin_add_overflow(after & masks.space, masks.space, &sum);
        const std::uint64_t due = (sum ^ masks.space) | after;
        const std::uint64_t looked = masks.other ? (masks.other & -masks.other) - 1 : ~std::uint64_t{0};
        if (((starts & ~due) | (masks.comma & due)) & looked) return false;
        isDueAtOther = masks.other & due & -masks.other;
        if (masks.other) return true;
        inNumber = number >> 63;
        isDue = carried || masks.comma >> 63;
        return true;
    }
};

/// Finds, in a piece that begins behind a comma, the last comma up to which numbers and commas alternate.
void lookAtOrders(TextPiece& piece) {
    constexpr std::ptrdiff_t each = 64;
    Order rotations{.isDue = true};
    const char* p = piece.begin;
    for (; p < piece.end; p += each) {
        char last[each];
        const std::ptrdiff_t rest = piece.end - p;
        if (rest < each) {  // which ends with a comma
            std::memset(last, ' ', each);
            std::memcpy(last, p, static_cast<std::size_t>(rest));
        }
        const Masks masks(rest < each ? last : p);
        if (masks.other || !rotations.take(masks)) break;
    }
    piece.stop = std::min(p, piece.end);
    while (piece.stop != piece.begin && piece.stop[-1] != ',') --piece.stop;
}
#endif

class Outliner {
  public:
    Outliner(TextFeed& text, bool release, Diagnostics& diagnostics, const Splitting& splitting)
        : feed_(text),
          diagnostics_(diagnostics),
          position_(text.begin()),
          begin_(text.begin()),
          released_(begin_),
          p_(begin_),
          end_(text.end()),
          release_(release),
          splitting_(splitting) {}

    JsonOutline run() {
        const char* complaint = nullptr;
        while (!complaint && there()) {
            forget();
            complaint = token();
        }
        if (!complaint && !open_.empty()) complaint = "the document ends inside an object or array";
        if (complaint) {
            diagnostics_.error(position_.of(p_),
                               std::string("not well-formed JSON: ") + complaint + "; reading ends here");
            outline_.complete = false;
        }
        outline_.end = static_cast<std::uint64_t>(p_ - begin_);
        std::ranges::sort(outline_.late);
        return std::move(outline_);
    }

  private:
    struct Open {
        std::uint64_t at;
        bool isObject, isAttribute = false;  // the last key's value is one
        bool hasChild = false, isLate = false;
        bool isPlain = true;  // no string or bracket is in it
    };

    /// There is a character at p_, maybe one that had to be fetched.
    bool there() {
        if (p_ != end_) return true;
        feed_.more();
        end_ = feed_.end();
        return p_ != end_;
    }
    void forget() {
        constexpr std::ptrdiff_t step = 1 << 20;
        if (!release_ || p_ - released_ < step) return;
        position_.of(p_);
        feed_.release(released_ = p_);
    }

    /// Reads the token at p_. Returns the fault if reading cannot go on.
    const char* token() {
        const char c = *p_;
        if (c == ',' || c == ':') {
            if (c == ',' && !value_) commaFault("a comma too many");
            value_ = false;
            comma_ = c == ',';
            colon_ = c == ':';
            ++p_;
            if (std::exchange(isLong_, false) && comma_) numbersInPieces();
            return nullptr;
        }
        if (isSpace(c)) {
            ++p_;
            return nullptr;
        }
        const bool isKey = !std::exchange(colon_, false);
        if (isSeparator(c)) isLong_ = false;
        if (c == '}' || c == ']') return close(c);
        if (value_) commaFault("a comma is missing before this");
        comma_ = false;
        if (!open_.empty() && (c == '"' || c == '{' || c == '[')) open_.back().isPlain = false;
        if (c == '"') return string(isKey);
        if (c == '{' || c == '[') return open(c);
        word();
        if (!open_.empty() && !open_.back().isObject) numbers();
        return nullptr;
    }

    /// Faulty commas are read as white space, so that nothing is lost; a few reports are enough.
    void commaFault(const char* what) {
        constexpr int maximum = 20;
        if (++commaFaults_ <= maximum) diagnostics_.error(position_.of(p_), what);
    }

    const char* open(char c) {
        if (open_.size() == kDeepest) return "objects and arrays are nested too deep";
        if (!open_.empty() && !open_.back().isAttribute) open_.back().hasChild = true;
        open_.push_back({.at = static_cast<std::uint64_t>(p_ - begin_), .isObject = c == '{'});
        value_ = false;
        ++p_;
        return nullptr;
    }
    const char* close(char c) {
        if (comma_) commaFault("there is nothing between the last comma and this bracket");
        comma_ = false;
        if (open_.empty() || open_.back().isObject != (c == '}')) return "the bracket matches none";
        const Open& closed = open_.back();
        const auto at = static_cast<std::uint64_t>(p_ - begin_);
        if (closed.isLate) outline_.late.push_back(closed.at);
        if (closed.isPlain && c == ']' && at - closed.at > kLongArray) outline_.plain.push_back({closed.at, at});
        open_.pop_back();
        value_ = true;
        ++p_;
        return nullptr;
    }

    const char* string(bool isKey) {
        const char* const start = p_;
        for (++p_; there() && *p_ != '"'; ++p_)
            if (*p_ == '\\') {
                ++p_;
                if (!there()) break;
            }
        if (!there()) {
            p_ = start;
            return "the string is not closed";
        }
        ++p_;
        value_ = true;
        if (!isKey || open_.empty() || !open_.back().isObject) return nullptr;
        Open& object = open_.back();
        object.isAttribute = start[1] == '@';
        if (object.isAttribute && object.hasChild) object.isLate = true;
        if (start[1] == '#') object.hasChild = true;
        return nullptr;
    }

    /// A number, true, null, or a misplaced word.
    void word() {
        do ++p_;
        while (there() && !isSeparator(*p_) && *p_ != ':');
        value_ = true;
    }

    /// Goes on behind a number, as long as numbers, white space and commas take turns as they should.
    void numbers() {
#if defined(__SSSE3__)
        const char* const start = p_;
        const bool mayBeLong = splitting_.threads > 1;
        Order rotations;
        while (end_ - p_ >= 64 && !isLong_) {
            const Masks masks(p_);
            if (!rotations.take(masks)) break;
            if (masks.other) {
                if (rotations.isDueAtOther) break;  // a comma before the bracket, or nothing at all
                p_ += std::countr_zero(masks.other);
                value_ = true;
                comma_ = false;
                return;
            }
            p_ += 64;
            comma_ = rotations.isDue;
            value_ = !rotations.isDue;
            isLong_ = mayBeLong && p_ - start >= static_cast<std::ptrdiff_t>(splitting_.from / 16);
        }
        if (rotations.inNumber)
            while (there() && !isSeparator(*p_) && *p_ != ':') ++p_;
#endif
    }

    /// Goes on behind a comma, in a list that has been long already: as far as it is long still, and all is in turn.
    void numbersInPieces() {
#if defined(__SSSE3__)
        const auto minimum = static_cast<std::ptrdiff_t>(splitting_.from);
        const auto grow = [this] {
            const bool more = feed_.more();
            end_ = feed_.end();
            return more;
        };
        const auto isClosed = [&] {
            return std::memchr(p_, ']', static_cast<std::size_t>(std::min(end_ - p_, minimum))) != nullptr;
        };
        while (end_ - p_ < minimum && !isClosed() && grow()) {
        }
        if (end_ - p_ < minimum || isClosed()) return;
        const auto behindComma = [](const char* begin, const char* maximum) {
            while (maximum != begin && maximum[-1] != ',') --maximum;
            return maximum;
        };
        PieceWalk walk(p_, splitting_, behindComma, &lookAtOrders);
        do {
            while (walk.add(end_) && grow()) {
            }
            forget();
        } while (walk.next(p_));
#endif
    }

    TextFeed& feed_;
    Diagnostics& diagnostics_;
    TextPosition position_;
    const char* const begin_;
    const char* released_;
    const char* p_;
    const char* end_;
    const bool release_;
    const Splitting splitting_;
    JsonOutline outline_;
    std::vector<Open> open_;
    bool value_ = false, comma_ = false, colon_ = false;  // what came last, white space aside
    bool isLong_ = false;                                 // the list that p_ is in
    int commaFaults_ = 0;
};

}  // namespace

JsonOutline outlineJson(TextFeed& text, bool release, Diagnostics& diagnostics, const Splitting& splitting) {
    return Outliner(text, release, diagnostics, splitting).run();
}

}  // namespace rtsg::detail
