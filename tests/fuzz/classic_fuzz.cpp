// ClassicVRML and VRML97, without a header: the first byte's lowest bit says which.
#include <cstdint>

#include "reading.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) return 0;
    std::string text = data[0] & 1 ? "#VRML V2.0 utf8\n" : "#X3D V4.0 utf8\nPROFILE Full\n";
    text.append(reinterpret_cast<const char*>(data), size);
    rtsg::fuzz::checkText(text);
    return 0;
}
