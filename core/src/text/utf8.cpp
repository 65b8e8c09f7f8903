// Finds and replaces bytes that are not UTF-8.
#include "utf8.h"

#include <algorithm>
#include <cstdint>
#include <cstring>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "text_pieces.h"

namespace rtsg::detail {

namespace {

/// Length of the valid sequence that starts at `p`; 0 if it is none.
std::size_t sequenceLength(const unsigned char* p, std::size_t available) {
    const unsigned char lead = p[0];
    if (lead == 0) return 0;
    if (lead < 0x80) return 1;
    const std::size_t length = lead >= 0xC2 && lead < 0xE0   ? 2
                               : lead >= 0xE0 && lead < 0xF0 ? 3
                               : lead >= 0xF0 && lead < 0xF5 ? 4
                                                             : 0;
    if (length == 0 || length > available) return 0;
    for (std::size_t i = 1; i < length; ++i)
        if ((p[i] & 0xC0u) != 0x80u) return 0;
    if (lead == 0xE0 && p[1] < 0xA0) return 0;  // overlong
    if (lead == 0xED && p[1] > 0x9F) return 0;  // surrogates
    if (lead == 0xF0 && p[1] < 0x90) return 0;  // overlong
    if (lead == 0xF4 && p[1] > 0x8F) return 0;  // above U+10FFFF
    return length;
}

}  // namespace

std::size_t findInvalidUtf8(std::string_view text, std::size_t from) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(text.data());
    std::size_t i = from;
    while (i < text.size()) {
#if defined(__SSE2__)
        while (text.size() - i >= 64) {
            __m128i bad = _mm_setzero_si128();  // a high bit where a byte is not ASCII, or zero
            for (std::size_t part = 0; part < 4; ++part) {
                const __m128i some = _mm_loadu_si128(reinterpret_cast<const __m128i*>(bytes + i + 16 * part));
                bad = _mm_or_si128(bad, _mm_or_si128(some, _mm_cmpeq_epi8(some, _mm_setzero_si128())));
            }
            if (_mm_movemask_epi8(bad) != 0) break;
            i += 64;
        }
        if (i == text.size()) break;
#endif
        constexpr std::size_t wide = 32;
        if (text.size() - i >= wide) {
            std::uint64_t words[4];
            std::memcpy(words, bytes + i, wide);
            constexpr std::uint64_t high = 0x8080808080808080u, low = 0x0101010101010101u;
            // Bytes above 0x7F have the high bit; where there are none, only a zero byte borrows into it.
            const std::uint64_t borrows = (words[0] - low) | (words[1] - low) | (words[2] - low) | (words[3] - low);
            if (((words[0] | words[1] | words[2] | words[3] | borrows) & high) == 0) {
                i += wide;
                continue;
            }
        }
        const std::size_t length = sequenceLength(bytes + i, text.size() - i);
        if (length == 0) return i;
        i += length;
    }
    return std::string_view::npos;
}

std::size_t findInvalidUtf8(std::string_view text, const Splitting& splitting) {
    if (splitting.threads < 2 || text.size() < splitting.from) return findInvalidUtf8(text);
    // No character is cut in two.
    const auto character = [](const char* begin, const char* maximum) {
        const char* at = maximum;
        while (maximum - at < 4 && at != begin && (static_cast<unsigned char>(*at) & 0xC0u) == 0x80u) --at;
        return at;
    };
    PieceWalk walk(text.data(), splitting, character, [](TextPiece& piece) {
        const std::string_view some(piece.begin, static_cast<std::size_t>(piece.end - piece.begin));
        piece.stop = piece.begin + std::min(findInvalidUtf8(some), some.size());
    });
    const char* p = text.data();
    const char* const end = p + text.size();
    for (walk.add(end); walk.next(p); walk.add(end)) {
    }
    return findInvalidUtf8(text, static_cast<std::size_t>(p - text.data()));
}

std::string replaceInvalidUtf8(std::string_view text, std::size_t& count) {
    std::string clean;
    clean.reserve(text.size() + 64);
    count = 0;
    std::size_t done = 0;
    for (std::size_t bad = findInvalidUtf8(text); bad != text.npos; bad = findInvalidUtf8(text, bad + 1)) {
        clean += text.substr(done, bad - done);
        clean += "\xEF\xBF\xBD";
        done = bad + 1;
        ++count;
    }
    clean += text.substr(done);
    return clean;
}

}  // namespace rtsg::detail
