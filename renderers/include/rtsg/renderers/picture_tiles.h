// Tiles of a picture that several jobs make: where each lies, what its file is called, and how all are joined.
//
// Columns and rows of tiles divide the picture between blocks of 16 x 16 pixels, which are traced whole, so that a tile
// costs its share. The tiles of "a.png" are "a.tile-X-Y-of-COLUMNS-ROWS.png"; X counts from the left and Y from the
// top, from 0. Joined files have the bytes of a picture that was made whole. Threading: re-entrant.
//
// Example:
//     #include <rtsg/renderers/picture_tiles.h>
//     const rtsg::PictureTile tile{.x = 1, .y = 0, .columns = 2, .rows = 1};
//     std::cout << tile.of("a.png").string() << ' ' << tile.in(100, 50).left << '\n';  // a.tile-1-0-of-2-1.png 48
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/renderers/picture.h>

namespace rtsg {

struct PictureTile {
    int x = 0, y = 0, columns = 1, rows = 1;

    /// Its pixels in a picture of that size. Empty: the picture has fewer blocks than there are columns or rows.
    PixelRegion in(int width, int height) const;
    /// Its file.
    std::filesystem::path of(const std::filesystem::path& picture) const;
    bool operator==(const PictureTile&) const = default;
};

/// Whether tiles of this kind of file are joined without loss: .png and .exr.
Result<> checkTileName(const std::filesystem::path& picture);

/// The display picture of which toSrgb8() makes these bytes.
Picture pictureOfBytes(std::span<const std::uint8_t> rgba, int width, int height);

/// Copies all that a tile holds into a picture of the same layers. Precondition: it lies within.
void layTile(const Picture& tile, int left, int top, Picture& whole);

/// Writes the picture of its tiles' files, all of it or nothing, and returns the tiles that are missing: none if it is
/// written. Errors: a tile that cannot be read; sizes that leave gaps or overlap, or other layers than its neighbours'.
Result<std::vector<PictureTile>> joinTiles(const std::filesystem::path& picture, int columns, int rows);

}  // namespace rtsg
