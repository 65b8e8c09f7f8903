// Picture: what a renderer produces: linear RGB radiance and coverage, its files, and how two of them compare.
//
// Invariant: pixels are linear (Rec. 709 primaries), premultiplied by alpha, row by row from the top left.
// .exr (and .hdr, .pfm, .tif) keep them untouched; other formats (.png, .jpg, .gif ...) are tone-mapped and
// sRGB-encoded. Threading: a Picture is plain data; the functions are re-entrant. Source: IEC 61966-2-1 (sRGB
// transfer).
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>

namespace rtsg {

struct Picture {
    int width = 0, height = 0;
    std::vector<Vec4f> pixels;  // width * height

    Picture() = default;
    Picture(int w, int h, Vec4f fill = Vec4f(0))
        : width(w), height(h), pixels(static_cast<std::size_t>(w) * static_cast<std::size_t>(h), fill) {}

    /// Precondition: 0 <= x < width, 0 <= y < height; y counts from the top.
    Vec4f& at(int x, int y) {
        return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
    }
    const Vec4f& at(int x, int y) const {
        return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
    }
};

/// Linear to display. Radiance up to 1 passes unchanged, so that colours in a file are the colours on the screen; what
/// is brighter keeps its hue and fades to white instead of clipping channel by channel.
struct ToneMap {
    float exposure = 1;
    Vec3f apply(Vec3f linear) const;
};

/// IEC 61966-2-1, on [0, 1]; beyond it the curve goes on.
float srgbFromLinear(float linear);
float linearFromSrgb(float encoded);

/// 8-bit RGBA, tone-mapped, sRGB-encoded, alpha not premultiplied.
std::vector<std::uint8_t> toSrgb8(const Picture& picture, const ToneMap& toneMap = {});

/// Whether a picture can be written under this name, by its extension. The error names those there are.
Result<> checkPictureName(const std::filesystem::path& file);
/// The extension chooses the format; the file is replaced once all of it is written. Errors: unknown extension, folder
/// that cannot be written, empty picture.
Result<> writePicture(const Picture& picture, const std::filesystem::path& file, const ToneMap& toneMap = {});
/// An animated GIF, endlessly repeated, `framesPerSecond` rounded to what the format has (1/100 s). All frames must
/// have one size.
Result<> writeAnimation(std::span<const Picture> frames, const std::filesystem::path& file, double framesPerSecond,
                        const ToneMap& toneMap = {});
/// Any format OpenImageIO reads; integer formats are sRGB-decoded.
Result<Picture> readPicture(const std::filesystem::path& file);

/// Over the three colour channels. `rmse` and `maximum` are absolute; `worst` is where the maximum lies.
struct PictureDifference {
    double rmse = 0, maximum = 0, mean = 0;
    int worstX = 0, worstY = 0;
};
/// Error: sizes differ.
Result<PictureDifference> compare(const Picture& a, const Picture& b);

}  // namespace rtsg
