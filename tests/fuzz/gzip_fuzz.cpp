// Packed bytes of any kind: no crash, no hang, never more memory than the limit.
#include <cstdint>

#include "read/gzip.h"
#include "reading.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string_view packed(reinterpret_cast<const char*>(data), size);
    rtsg::Diagnostics diagnostics;
    std::string text;
    constexpr std::size_t limit = 1 << 20;
    const bool some = rtsg::detail::gunzip(packed, text, diagnostics, limit);
    rtsg::fuzz::require(text.size() <= limit, "beyond the limit", "", diagnostics);
    rtsg::fuzz::require(some || diagnostics.errors() > 0, "nothing, and no error", "", diagnostics);
    return 0;
}
