// Escapes text for pages.
#include <rtsg/core/field_text.h>
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

}  // namespace rtsg
