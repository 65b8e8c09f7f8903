// Scanning numbers in X3D text: decimal and hexadecimal integers, and reals with correct rounding.
//
// Short decimals take Clinger's exact path (a 53-bit integer times or divided by a power of ten up to 10^22, one
// rounding); a float is then rounded from that double unless the double lies exactly between two floats, where the
// first rounding may have hidden which side the decimal was on. Everything else goes to std::from_chars. A number
// ends at a separator; anything else glued to it makes it malformed. Threading: pure functions.
// Source: ISO/IEC 19776-2 V3.3 annex A (sfint32Value, sffloatValue); W. Clinger, PLDI 1990.
#pragma once

#include <array>
#include <bit>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string_view>
#include <type_traits>

namespace rtsg::detail {

enum class NumberStatus : std::uint8_t { ok, malformed, notFinite };

/// The characters that may follow a number or a word: white space, comma, brackets, braces, quotes, comments.
constexpr std::array<bool, 256> kSeparator = [] {
    std::array<bool, 256> table{};
    for (const char c : {' ', '\t', '\r', '\n', ',', '[', ']', '{', '}', '"', '#', '\0'})
        table[static_cast<unsigned char>(c)] = true;
    return table;
}();
constexpr bool isSeparator(char c) {
    return kSeparator[static_cast<unsigned char>(c)];
}
/// White space including the comma (19776-2 annex A).
constexpr std::array<bool, 256> kSpace = [] {
    std::array<bool, 256> table{};
    for (const char c : {' ', '\t', '\r', '\n', ','}) table[static_cast<unsigned char>(c)] = true;
    return table;
}();
constexpr bool isSpace(char c) {
    return kSpace[static_cast<unsigned char>(c)];
}
constexpr bool isDigit(char c) {
    return static_cast<unsigned char>(c - '0') <= 9;
}

constexpr std::array<double, 23> kPowersOfTen = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                                 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

inline const char* endOfWord(const char* p, const char* end) {
    while (p != end && !isSeparator(*p)) ++p;
    return p;
}

/// True, and `eight` their value, when the eight bytes at `p` are all digits.
inline bool eightDigits(const char* p, std::uint64_t& eight) {
    std::uint64_t bytes = 0;
    std::memcpy(&bytes, p, 8);
    const std::uint64_t high = bytes & 0xF0F0F0F0F0F0F0F0u;
    const std::uint64_t carry = (bytes + 0x0606060606060606u) & 0xF0F0F0F0F0F0F0F0u;
    if (high != 0x3030303030303030u || carry != 0x3030303030303030u) return false;
    bytes -= 0x3030303030303030u;
    bytes = bytes * 10 + (bytes >> 8);  // pairs
    eight = ((bytes & 0x000000FF000000FFu) * 0x000F424000000064u +
             ((bytes >> 16) & 0x000000FF000000FFu) * 0x0000271000000001u) >>
            32;
    return true;
}
static_assert(std::endian::native == std::endian::little);

/// Decimal exponent of a well-formed number that is not zero: 0 for 1 to 9.99, -1 for 0.1 to 0.99. Saturates.
inline long decimalExponent(const char* p, const char* end) {
    long integers = 0, zeros = 0, exponent = 0;
    bool fraction = false, found = false;
    for (; p != end && *p != 'e' && *p != 'E'; ++p) {
        if (*p == '.') {
            fraction = true;
        } else if (isDigit(*p)) {
            found = found || *p != '0';
            if (found && !fraction) ++integers;
            if (!found && fraction) ++zeros;
        }
    }
    if (p != end && ++p != end) {
        const bool minus = *p == '-';
        if (minus || *p == '+') ++p;
        for (; p != end && exponent < 1000000; ++p) exponent = exponent * 10 + (*p - '0');
        if (minus) exponent = -exponent;
    }
    return exponent + (integers ? integers - 1 : -zeros - 1);
}

/// A double between two floats, as far from the one as from the other: rounding it once more might go the wrong way.
inline bool isBetweenFloats(double value) {
    constexpr std::uint64_t half = std::uint64_t{1} << 28, low = (std::uint64_t{1} << 29) - 1;
    return (std::bit_cast<std::uint64_t>(value) & low) == half;
}

template <class S>
NumberStatus scanRealSlowly(const char*& p, const char* end, S& out) {
    const char* first = p;
    p = endOfWord(p, end);
    if (end - p > 3 && *p == '#' && p != first && p[-1] == '.' &&
        std::string_view("QSI").find(p[1]) != std::string_view::npos) {
        // Printers of other systems write 1.#QNAN, 1.#SNAN, -1.#IND, 1.#INF.
        p = endOfWord(p + 1, end);
        out = 0;
        return NumberStatus::notFinite;
    }
    const bool plus = first != p && *first == '+';
    first += plus;
    if (first == p || (plus && *first == '-')) return NumberStatus::malformed;
    S value = 0;
    const auto [stop, error] = std::from_chars(first, p, value);
    if (stop != p || error == std::errc::invalid_argument) return NumberStatus::malformed;
    out = 0;
    if (error == std::errc::result_out_of_range)  // does not say on which side
        return decimalExponent(first, p) < 0 ? NumberStatus::ok : NumberStatus::notFinite;
    if (!(value <= std::numeric_limits<S>::max() && value >= std::numeric_limits<S>::lowest()))
        return NumberStatus::notFinite;
    out = value;
    return NumberStatus::ok;
}

/// `p` is on the first character of the number and afterwards behind its last, or behind the word that was no number.
/// Precondition: p != end. Not finite means: written as NaN or infinity, or beyond the type's range; `out` is then 0.
template <class S>
inline NumberStatus scanReal(const char*& p, const char* end, S& out) {
    const char* s = p;
    const bool negative = *s == '-';
    if (negative || *s == '+') ++s;
    std::uint64_t digits = 0;
    const char* first = s;
    while (s != end && isDigit(*s)) digits = digits * 10 + static_cast<unsigned char>(*s++ - '0');
    std::ptrdiff_t count = s - first;
    std::ptrdiff_t exponent = 0;
    if (s != end && *s == '.') {
        const char* fraction = ++s;
        if (std::uint64_t eight = 0; end - s >= 8 && eightDigits(s, eight)) {
            digits = digits * 100000000 + eight;
            s += 8;
        }
        while (s != end && isDigit(*s)) digits = digits * 10 + static_cast<unsigned char>(*s++ - '0');
        exponent = fraction - s;
        count -= exponent;
    }
    if (count == 0 || count > 19) return scanRealSlowly(p, end, out);
    if (s != end && (*s == 'e' || *s == 'E')) {
        ++s;
        const bool minus = s != end && *s == '-';
        if (s != end && (minus || *s == '+')) ++s;
        const char* power = s;
        std::ptrdiff_t value = 0;
        while (s != end && isDigit(*s) && s - power < 6) value = value * 10 + (*s++ - '0');
        if (s == power) return scanRealSlowly(p, end, out);
        exponent += minus ? -value : value;
    }
    if (s != end && (!isSeparator(*s) || *s == '#')) return scanRealSlowly(p, end, out);
    if (digits > (std::uint64_t{1} << 53) || exponent < -22 || exponent > 22) {
        if (digits != 0) return scanRealSlowly(p, end, out);
        exponent = 0;
    }
    double value = static_cast<double>(digits);
    if (exponent < 0)
        value /= kPowersOfTen[static_cast<std::size_t>(-exponent)];
    else
        value *= kPowersOfTen[static_cast<std::size_t>(exponent)];
    if constexpr (std::is_same_v<S, float>) {
        if (isBetweenFloats(value) || value > 3e38 || (value < 2e-38 && digits != 0))
            return scanRealSlowly(p, end, out);
    }
    out = static_cast<S>(negative ? -value : value);
    p = s;
    return NumberStatus::ok;
}

/// Decimal or 0x hexadecimal. Hexadecimal takes all 32 bits; decimals beyond int32 are `notFinite` with `out` 0,
/// unless `wide`, where 0 to 2^32-1 are bit patterns too (pixels).
inline NumberStatus scanInteger(const char*& p, const char* end, std::int32_t& out, bool wide = false) {
    const char* s = p;
    const bool negative = *s == '-';
    if (negative || *s == '+') ++s;
    std::uint64_t value = 0;
    const char* first = s;
    if (end - s > 2 && *s == '0' && (s[1] == 'x' || s[1] == 'X')) {
        const auto [stop, error] = std::from_chars(s + 2, end, value, 16);
        p = endOfWord(s, end);
        if (stop != p || error == std::errc::invalid_argument) return NumberStatus::malformed;
        out = 0;
        if (error != std::errc() || value > 0xFFFFFFFFu) return NumberStatus::notFinite;
        out = static_cast<std::int32_t>(static_cast<std::uint32_t>(negative ? -value : value));
        return NumberStatus::ok;
    }
    while (s != end && isDigit(*s) && s - first < 18) value = value * 10 + static_cast<unsigned char>(*s++ - '0');
    while (s != end && isDigit(*s)) {
        value = ~std::uint64_t{0};
        ++s;
    }
    if (s == first || (s != end && !isSeparator(*s))) {
        p = endOfWord(p, end);
        return NumberStatus::malformed;
    }
    p = s;
    out = 0;
    const std::uint64_t maximum = negative ? 0x80000000u : wide ? 0xFFFFFFFFu : 0x7FFFFFFFu;
    if (value > maximum) return NumberStatus::notFinite;
    out = static_cast<std::int32_t>(static_cast<std::uint32_t>(negative ? -value : value));
    return NumberStatus::ok;
}

inline NumberStatus scanNumber(const char*& p, const char* end, std::int32_t& out) {
    return scanInteger(p, end, out);
}
template <class S>
inline NumberStatus scanNumber(const char*& p, const char* end, S& out) {
    return scanReal(p, end, out);
}

}  // namespace rtsg::detail
