// Pictures in the Khronos texture container KTX 2.0: header, level index, data format descriptor, supercompression.
//
// Invariant: nothing is read beyond the file, and no memory is taken for pixels that the file cannot hold. Only the
// largest level is read, as textures make their coarser copies themselves. Blocks are left to a reader of DDS files;
// links nothing else but zlib and Zstandard. Threading: any thread.
// Source: Khronos KTX File Format Specification 2.0; Khronos Data Format Specification 1.3, 3 and 5 (descriptors).
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "image/image_files.h"

namespace rtsg {

/// Whether these first bytes are those of a KTX 2.0 file.
bool isKtx2(std::span<const std::uint8_t> bytes);

/// Decodes a DDS file of one picture into rows from the top; an error is a sentence.
using DdsReader = std::function<std::string(std::span<const std::uint8_t> file, FilePixels& out)>;

/// Does what ImageFiles::readMemory() does. The six sides of a cube lie as those of a DDS file: +x +y +z above -x -y
/// -z. Without a KTXswizzle one channel is grey and two are grey and alpha, as in X3D (18.2.1). Errors: damage, with
/// the byte where it is; a form of pixels that is not read, by name.
std::string readKtx2(std::span<const std::uint8_t> file, const ReadRequest& request, const DdsReader& blocks,
                     FilePixels& out);

}  // namespace rtsg
