// Makes textures of image files and films.
#pragma once

#include <array>

#include <rtsg/renderers/texture.h>

#include "image/image_files.h"

namespace rtsg {

/// One layer. Errors: as Texture::fromBytes() and fromFloats().
Result<Texture> textureFromPixels(const FilePixels& file, Texture::Content content, int layer = 0);

/// linearFromSrgb() of each byte.
const std::array<float, 256>& lightOfBytes();

}  // namespace rtsg
