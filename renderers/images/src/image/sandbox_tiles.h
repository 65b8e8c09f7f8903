// Pictures in tiles that workers of the sandbox read: a TiledPicture whose file is asked for piece by piece.
//
// Blocks of 64 x 64 pixels are kept here, 256 MiB for all such pictures of a process; a part of a block that cannot be
// read makes all of it zeros. Threading: any number of threads.
#pragma once

#include <memory>
#include <string>

#include "image_files.h"

namespace rtsg {

/// Does what ImageFiles::openTiles() does.
std::string openTilesSandboxed(ByteSource source, const std::string& name, std::unique_ptr<TiledPicture>& out);

}  // namespace rtsg
