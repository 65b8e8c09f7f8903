// Escapes text and encodes bytes for pages.
#include <rtsg/core/markup.h>

#include <rtsg/core/terminal.h>

namespace rtsg {

std::string escapeMarkup(std::string_view given) {
    constexpr std::string_view kNone = "\xEF\xBF\xBD";
    const std::string text = asUtf8(given);
    std::string out;
    out.reserve(text.size());
    for (std::size_t i = 0; i < text.size(); ++i) {
        const char c = text[i];
        // XML 1.0, 2.2: U+FFFE and U+FFFF are no characters.
        if (text.compare(i, 2, "\xEF\xBF") == 0 && i + 2 < text.size() && text[i + 2] >= '\xBE') {
            out += kNone;
            i += 2;
            continue;
        }
        switch (c) {
            case '&':
                out += "&amp;";
                break;
            case '<':
                out += "&lt;";
                break;
            case '>':
                out += "&gt;";
                break;
            case '"':
                out += "&quot;";
                break;
            case '\'':
                out += "&#39;";
                break;
            default:
                if (static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t')
                    out += kNone;
                else
                    out += c;
        }
    }
    return out;
}

std::string base64(std::span<const std::byte> bytes) {
    constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    out.reserve((bytes.size() + 2) / 3 * 4);
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        const auto at = [&](std::size_t k) {
            return k < bytes.size() ? static_cast<unsigned>(std::to_integer<unsigned char>(bytes[k])) : 0U;
        };
        const unsigned word = at(i) << 16 | at(i + 1) << 8 | at(i + 2);
        out += kDigits[word >> 18];
        out += kDigits[word >> 12 & 63];
        out += i + 1 < bytes.size() ? kDigits[word >> 6 & 63] : '=';
        out += i + 2 < bytes.size() ? kDigits[word & 63] : '=';
    }
    return out;
}

}  // namespace rtsg
