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

/// The profile's own name, or what it is for where it has none; empty: there is none, it is sRGB's but for what eyes do
/// not tell apart, or the file is damaged before it. `file`: all of it.
std::string foreignColorProfile(std::span<const std::uint8_t> file);

}  // namespace rtsg
