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

/// Of a PNG, JPEG or GIF file; nothing for all else, for what is broken and for what has no pixels, nor where a JPEG
/// file has more than a thousand segments before the one that says it.
std::optional<PictureSize> pictureSize(const MediaBytes& file);

}  // namespace rtsg
