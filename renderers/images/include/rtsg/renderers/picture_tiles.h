// Tiles of a picture that several jobs make: their pixels, the names of their files, and how they are joined.
//
// Columns and rows of tiles divide the picture along blocks of 16 x 16 pixels, which are traced whole, so that a tile
// costs its share. The tiles of "a.png" are "a.tile-X-Y-of-COLUMNS-ROWS.png"; X counts from the left and Y from the
// top, from 0. A joined file has the same bytes as a picture made as a whole. Threading: re-entrant.
//
// Example:
//     #include <rtsg/renderers/picture_tiles.h>
//     const rtsg::PictureTile tile{.x = 1, .y = 0, .columns = 2, .rows = 1};
//     std::cout << tile.of("a.png").string() << ' ' << tile.in(100, 50).left << '\n';  // a.tile-1-0-of-2-1.png 48
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/renderers/picture.h>

namespace rtsg {

struct PictureTile {
    int x = 0, y = 0, columns = 1, rows = 1;

    /// The tile's pixels in a picture of that size. Empty if the picture has fewer blocks than columns or rows.
    PixelRegion in(int width, int height) const;
    /// The tile's file.
    std::filesystem::path of(const std::filesystem::path& picture) const;
    bool operator==(const PictureTile&) const = default;
};

/// Checks that tiles of this kind of file can be joined without loss: .png and .exr.
Result<> checkTileName(const std::filesystem::path& picture);

/// The display picture from which toSrgb8() makes these bytes.
Picture pictureOfBytes(std::span<const std::uint8_t> rgba, int width, int height);

/// Copies all data of a tile into a picture with the same layers. Precondition: the tile lies within the picture.
void layTile(const Picture& tile, int left, int top, Picture& whole);

/// Joins the files of the tiles and writes the picture, if no tile is missing; returns the missing tiles. The picture
/// has the tiles' notes, but for those whose names begin with `without`, if that is not empty. Errors: a tile that
/// cannot be read; tiles whose sizes leave gaps or overlap; tiles with different layers or notes.
Result<std::vector<PictureTile>> joinTiles(const std::filesystem::path& picture, int columns, int rows,
                                           std::string_view without = {});

}  // namespace rtsg
