// Pictures that stay in their files, read by tiles through OpenImageIO's cache.
#pragma once

#include <memory>
#include <string>

#include "image/image_files.h"

namespace rtsg {

/// Does what ImageFiles::openTiles() does.
std::string openTiledPicture(ByteSource source, const std::string& name, std::unique_ptr<TiledPicture>& out);
/// For who keeps what is read: the cache is small from here on.
void keepFewTiles();

}  // namespace rtsg
