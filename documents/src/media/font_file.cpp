// Looks at the directory of tables of a font.
#include "font_file.h"

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

namespace rtsg::detail {

namespace {

/// Big-endian, as all of a font; 0 beyond the end.
std::uint64_t fontNumber(std::string_view bytes, std::uint64_t at, unsigned size) {
    std::uint64_t value = 0;
    for (unsigned i = 0; i < size; ++i)
        value = value << 8 | (at + i < bytes.size() ? static_cast<unsigned char>(bytes[at + i]) : 0u);
    return value;
}

struct TableEntries {
    std::uint64_t first, size, offset, length;  // of the directory and its entries; of the fields in an entry
};

bool hasTables(std::string_view bytes, std::uint64_t count, const TableEntries& in, std::string& why) {
    if (count == 0 || in.first + count * in.size > bytes.size())
        return why = "its directory of tables reaches beyond its end", false;
    std::vector<std::string_view> tags;
    for (std::uint64_t i = 0; i < count; ++i) {
        const std::uint64_t at = in.first + i * in.size;
        tags.push_back(bytes.substr(at, 4));
        const std::uint64_t offset = fontNumber(bytes, at + in.offset, 4),
                            length = fontNumber(bytes, at + in.length, 4);
        if (offset > bytes.size() || length > bytes.size() - offset)
            return why = "its table '" + std::string(tags.back()) + "' reaches beyond its end", false;
    }
    const auto has = [&](std::string_view tag) { return std::ranges::find(tags, tag) != tags.end(); };
    for (const std::string_view tag : {"head", "maxp", "cmap"})
        if (!has(tag)) return why = "it has no table '" + std::string(tag) + "'", false;
    if (!has("CFF ") && !has("CFF2") && !(has("glyf") && has("loca"))) return why = "it has no outlines", false;
    return true;
}

}  // namespace

bool isFontFile(std::string_view bytes, std::string& why) {
    constexpr std::uint64_t trueType = 0x00010000, openType = 0x4F54544F, apple = 0x74727565, collection = 0x74746366;
    constexpr std::uint64_t woff = 0x774F4646, woff2 = 0x774F4632;
    const std::uint64_t kind = fontNumber(bytes, 0, 4);
    if (kind == woff || kind == woff2) {
        // The tables of WOFF2 are one packed stream: its length is all there is to see.
        if (fontNumber(bytes, 8, 4) != bytes.size()) return why = "it is not as long as its head says", false;
        // Readers take memory for the size in the header; deflate makes at most 258 bytes of two bits.
        constexpr std::uint64_t maxOfByte = 1032, maxUnpacked = std::uint64_t{1} << 28;
        const std::uint64_t unpacked = fontNumber(bytes, 16, 4);
        if (unpacked > maxUnpacked || (kind == woff && unpacked / maxOfByte > bytes.size()))
            return why = "its head says " + std::to_string(unpacked) + " bytes unpacked, which are not in it", false;
        return kind == woff2 || hasTables(bytes, fontNumber(bytes, 12, 2), {44, 20, 4, 8}, why);
    }
    std::uint64_t start = 0;
    if (kind == collection) start = fontNumber(bytes, 12, 4);
    const std::uint64_t form = fontNumber(bytes, start, 4);
    if (form != trueType && form != openType && form != apple)
        return why = "it is no font of TrueType, OpenType or WOFF", false;
    return hasTables(bytes, fontNumber(bytes, start + 4, 2), {start + 12, 16, 8, 12}, why);
}

}  // namespace rtsg::detail
