// Arbitrary bytes as a JSON document.
#include <cstdint>

#include "reading.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string_view text(reinterpret_cast<const char*>(data), size);
    if (rtsg::detectEncoding(text) == rtsg::Encoding::json) rtsg::fuzz::checkText(text);
    return 0;
}
