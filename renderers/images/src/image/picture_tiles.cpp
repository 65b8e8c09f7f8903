// Divides pictures into tiles, and joins the files of tiles.
#include <rtsg/renderers/picture_tiles.h>

#include <algorithm>
#include <cstring>
#include <numeric>

#include <fmt/format.h>

namespace rtsg {

namespace {

constexpr int kBlock = 16;  // pixels that are traced together, each way

/// Where tile `number` of `count` begins; the last one ends where `count` begins.
int edgeOf(int number, int count, int pixels) {
    const std::int64_t blocks = (pixels + kBlock - 1) / kBlock;
    return std::min(static_cast<int>(number * blocks / count) * kBlock, pixels);
}

std::vector<PictureTile> allTiles(int columns, int rows) {
    std::vector<PictureTile> all;
    for (int y = 0; y < rows; ++y)
        for (int x = 0; x < columns; ++x) all.push_back({x, y, columns, rows});
    return all;
}

bool holdAlike(const Picture& a, const Picture& b) {
    const auto alike = [](const PictureLayer& one, const PictureLayer& other) {
        return one.channels == other.channels && one.integers == other.integers;
    };
    return a.space == b.space && a.interval.empty() == b.interval.empty() && a.notes == b.notes &&
           std::ranges::equal(a.layers, b.layers, alike);
}

/// One of the size of all tiles together, with the first one's layers.
Picture roomFor(const Picture& first, int width, int height) {
    Picture whole(width, height);
    whole.space = first.space, whole.notes = first.notes;
    if (!first.interval.empty()) whole.interval.resize(whole.pixels.size());
    for (const PictureLayer& layer : first.layers)
        whole.layers.push_back(
            {layer.channels, layer.integers, std::vector<float>(whole.pixels.size() * layer.channels.size())});
    return whole;
}

}  // namespace

PixelRegion PictureTile::in(int width, int height) const {
    const int left = edgeOf(x, columns, width), top = edgeOf(y, rows, height);
    const PixelRegion region{left, top, edgeOf(x + 1, columns, width) - left, edgeOf(y + 1, rows, height) - top};
    return region.empty() ? PixelRegion() : region;
}

std::filesystem::path PictureTile::of(const std::filesystem::path& picture) const {
    return picture.parent_path() / fmt::format("{}.tile-{}-{}-of-{}-{}{}", picture.stem().string(), x, y, columns, rows,
                                               picture.extension().string());
}

Result<> checkTileName(const std::filesystem::path& picture) {
    const std::string extension = lowerExtension(picture);
    if (extension == ".png" || extension == ".exr") return {};
    return fail("tiles are .png or .exr, which are joined without loss", {}, picture.string());
}

Picture pictureOfBytes(std::span<const std::uint8_t> rgba, int width, int height) {
    Picture picture(width, height);
    picture.space = ColorSpace::display;
    for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
        const float alpha = static_cast<float>(rgba[4 * i + 3]) / 255;
        const Vec3f color = Vec3f(rgba[4 * i], rgba[4 * i + 1], rgba[4 * i + 2]) / 255.0f;
        picture.pixels[i] = Vec4f(alpha > 0 ? color * alpha : color, alpha);
    }
    return picture;
}

void layTile(const Picture& tile, int left, int top, Picture& whole) {
    const auto width = static_cast<std::size_t>(tile.width);
    for (int y = 0; y < tile.height; ++y) {
        const std::size_t from = static_cast<std::size_t>(y) * width;
        const std::size_t to =
            static_cast<std::size_t>(top + y) * static_cast<std::size_t>(whole.width) + static_cast<std::size_t>(left);
        std::copy_n(&tile.pixels[from], width, &whole.pixels[to]);
        if (!whole.interval.empty()) std::copy_n(&tile.interval[from], width, &whole.interval[to]);
        for (std::size_t i = 0; i < whole.layers.size(); ++i) {
            const std::size_t n = whole.layers[i].channels.size();
            // Bits of integers are not to go through a float's register.
            std::memcpy(&whole.layers[i].values[to * n], &tile.layers[i].values[from * n], width * n * sizeof(float));
        }
    }
}

Result<std::vector<PictureTile>> joinTiles(const std::filesystem::path& picture, int columns, int rows,
                                           std::string_view without) {
    if (auto ok = checkTileName(picture); !ok) return std::unexpected(ok.error());
    const std::vector<PictureTile> all = allTiles(columns, rows);
    std::vector<PictureTile> missing;
    std::error_code ignored;
    std::ranges::copy_if(all, std::back_inserter(missing), [&](const PictureTile& tile) {
        return !std::filesystem::is_regular_file(tile.of(picture), ignored);
    });
    if (!missing.empty()) return missing;
    std::vector<Picture> tiles;
    for (const PictureTile& tile : all) {
        auto read = readWrittenPicture(tile.of(picture));
        if (!read) return std::unexpected(read.error());
        tiles.push_back(std::move(*read));
    }
    int width = 0, height = 0;
    for (std::size_t i = 0; i < all.size(); ++i)
        width += all[i].y == 0 ? tiles[i].width : 0, height += all[i].x == 0 ? tiles[i].height : 0;
    Picture whole = roomFor(tiles[0], width, height);
    for (std::size_t i = 0; i < all.size(); ++i) {
        const PixelRegion region = all[i].in(width, height);
        const std::string name = all[i].of(picture).string();
        if (tiles[i].width != region.width || tiles[i].height != region.height)
            return fail(
                fmt::format("{} x {} pixels: there would be gaps or overlaps, as this tile of {} x {} has {} x "
                            "{} where all tiles together are {} x {}",
                            tiles[i].width, tiles[i].height, columns, rows, region.width, region.height, width, height),
                {}, name);
        if (!holdAlike(tiles[i], tiles[0])) return fail("it holds other layers or notes than the first tile", {}, name);
        layTile(tiles[i], region.left, region.top, whole);
    }
    if (!without.empty()) std::erase_if(whole.notes, [&](const auto& note) { return note.first.starts_with(without); });
    if (auto ok = writePicture(whole, picture); !ok) return std::unexpected(ok.error());
    return missing;
}

}  // namespace rtsg
