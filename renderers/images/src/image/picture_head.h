// Checks the size in the head of a picture's file against the length of the file: no reader takes memory for pixels
// that the file cannot hold.
//
// Readers take memory as the head says before they look further, some of them when a file is opened, so this comes
// before all of them. Each format has a most that a byte can hold; a file that says more is damaged, or was made to
// take memory. Pictures of up to kAlwaysRead bytes are not judged. Threading: pure functions. Source: PNG (W3C, third
// edition), JPEG (ITU-T T.81), GIF89a, TIFF 6.0, OpenEXR file layout, DDS, WebP (RFC 9649), Radiance, Netpbm, TGA 2.0.
#pragma once

#include <string>

#include "image_files.h"

namespace rtsg {

/// A sentence says why the file is not read; empty: nothing is wrong with its head. A file whose format is not known
/// here is not judged.
std::string whyNotWithin(const ByteSource& file);
std::string whyNotWithin(std::span<const std::uint8_t> file);

}  // namespace rtsg
