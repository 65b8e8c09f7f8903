// How many pixels a picture has, read off its header.
//
// Source: PNG (ISO/IEC 15948:2004, 11.2.2), JPEG (ITU-T T.81, B.2.2), GIF89a (specification of 1990, section 18).
#pragma once

#include <cstdint>
#include <optional>

#include "media_length.h"

namespace rtsg {

struct PictureSize {
    std::uint32_t width = 0, height = 0;
};

/// The size of a PNG, JPEG or GIF file. Nothing for other files, for broken ones, for pictures without pixels, and for
/// a JPEG file with more than a thousand segments before the one that states the size.
std::optional<PictureSize> pictureSize(const MediaBytes& file);

}  // namespace rtsg
