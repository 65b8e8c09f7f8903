// Names the colour profile of an image file if its colours are not sRGB.
//
// Source: ICC.1:2022 (7.2, 9.2, 10.6, 10.13, 10.15, 10.18), the PNG specification's iCCP chunk, APP2 segments of JPEG
// (ICC.1, annex B.4) and WebP's ICCP chunk. Profiles of other formats are not looked for.
// Threading: any thread.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace rtsg {

/// The profile's name, or its purpose if it has none. Empty: there is no profile, it is visually the same as sRGB, or
/// the file is damaged before it. `file`: the whole file.
std::string foreignColorProfile(std::span<const std::uint8_t> file);

}  // namespace rtsg
