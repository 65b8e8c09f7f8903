// Arbitrary bytes as a page, behind what makes it one.
#include <cstdint>

#include "reading.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    std::string text = "<!DOCTYPE html><html><body><x3d><scene>";
    text.append(reinterpret_cast<const char*>(data), size);
    rtsg::fuzz::checkText(text);
    return 0;
}
