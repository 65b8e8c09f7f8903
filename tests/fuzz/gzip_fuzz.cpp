// Packed bytes of any kind: no crash, no hang, never more text than the limit.
#include <cstdint>

#include "read/text_feed.h"
#include "reading.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string_view packed(reinterpret_cast<const char*>(data), size);
    constexpr std::size_t limit = 1 << 20;
    const auto feed = rtsg::detail::TextFeed::ofMemory(packed, limit);
    const rtsg::Diagnostics none;
    rtsg::fuzz::require(feed.has_value(), "no addresses", "", none);
    (*feed)->fill();
    const auto length = static_cast<std::size_t>((*feed)->end() - (*feed)->begin());
    // Bytes that are no UTF-8 become three each.
    rtsg::fuzz::require(length <= 3 * limit, "beyond the limit", "", none);
    return 0;
}
