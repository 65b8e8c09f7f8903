// Picture: the result of a renderer: colour and coverage, its files, and the comparison of two.
//
// Invariant: pixels are in `space` (Rec. 709 primaries), premultiplied by alpha, row by row from the top left. .exr
// (and .hdr, .pfm, .tif) hold linear radiance in any case; other formats (.png, .jpg, .gif ...) hold display values:
// those of a display picture unchanged and clipped at white in each channel, those of a linear one tone-mapped and
// encoded. Threading: a Picture is plain data; the functions are re-entrant.
#pragma once

#include <cmath>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>
#include <rtsg/renderers/color.h>

namespace rtsg {

/// Data of each pixel besides its colour, under the names of an OpenEXR file's channels ("Z", "N.X").
struct PictureLayer {
    std::vector<std::string> channels;
    bool integers = false;      // the values are the bits of unsigned numbers of 32 bits
    std::vector<float> values;  // channels.size() a pixel
};

/// A rectangle of pixels; left and top count from a picture's top left corner.
struct PixelRegion {
    int left = 0, top = 0, width = 0, height = 0;
    bool empty() const { return width <= 0 || height <= 0; }
    bool operator==(const PixelRegion&) const = default;
};

struct Picture {
    int width = 0, height = 0;
    ColorSpace space = ColorSpace::linear;  // or display
    std::vector<Vec4f> pixels;              // width * height
    /// Half the width of each pixel's 95 % interval, by channel, in `space`; empty unless an error target was set. In
    /// .exr, whose pictures are linear, it is the layer "interval".
    std::vector<Vec3f> interval;
    /// Only .exr holds layers. Notes are attributes of an .exr and texts of a .png (picture_notes.h), by name.
    std::vector<PictureLayer> layers;
    std::vector<std::pair<std::string, std::string>> notes;

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

/// The light of a picture: the mean logarithm over its tiles of 16 x 16 pixels that show any (Reinhard et al. 2002), so
/// that neither a lamp in view nor black surroundings decide.
class LogAverage {
  public:
    void add(double light, double pixels) {
        if (light > 0) sum_ += pixels * std::log(light), pixels_ += pixels;
    }
    double value() const { return pixels_ > 0 ? std::exp(sum_ / pixels_) : 0; }

  private:
    double sum_ = 0, pixels_ = 0;
};
/// The LogAverage of the pixels' brightest channels; 0 for a black picture.
double averageLight(const Picture& picture);

/// Converts linear radiance to what a display can show. Radiance up to 1 passes unchanged, so that colours in a file
/// are the colours on the screen; brighter radiance keeps its hue and fades to white, instead of clipping in each
/// channel.
struct ToneMap {
    float exposure = 1;
    Vec3f apply(Vec3f linear) const;
};

/// The same picture in linear light. Colours are decoded before alpha is multiplied in; intervals are converted, too.
Picture toLinear(Picture picture);

/// 8-bit RGBA, sRGB-encoded, alpha not premultiplied. Linear pictures are tone-mapped; display pictures are clamped at
/// white. A value half way between two bytes is rounded up: .9 is 230.
std::vector<std::uint8_t> toSrgb8(const Picture& picture, const ToneMap& toneMap = {});

/// Returns the extension in lower case: ".png" for "a.PNG".
std::string lowerExtension(const std::filesystem::path& file);
/// Checks that the extension of the name is a format that can be written. The error names the available formats.
Result<> checkPictureName(const std::filesystem::path& file);
/// Checks that the format of the extension, or a film (.mp4), allows pictures of this size.
Result<> checkPictureSize(const std::filesystem::path& file, int width, int height);
/// Writes a picture in the format of the extension; an old file is replaced when the new one is complete. Errors:
/// unknown extension, folder that cannot be written, empty picture.
Result<> writePicture(const Picture& picture, const std::filesystem::path& file, const ToneMap& toneMap = {});
/// Writes an animated GIF that repeats for ever; `framesPerSecond` is rounded to the format's 1/100 s. All frames must
/// have one size.
Result<> writeAnimation(std::span<const Picture> frames, const std::filesystem::path& file, double framesPerSecond,
                        const ToneMap& toneMap = {});
/// Reads any format that OpenImageIO knows, as a linear picture: integer formats are sRGB-decoded.
Result<Picture> readPicture(const std::filesystem::path& file);

/// Reads a .png or .exr that writePicture() has written; writing it again gives the same bytes. A .png becomes a
/// display picture; an .exr has each channel as a layer. Errors: another format; an .exr with numbers
/// that do not have 32 bits; any .exr in a build without OpenEXR's own library.
Result<Picture> readWrittenPicture(const std::filesystem::path& file);

/// The difference over the three colour channels. `rmse` and `maximum` are absolute; the maximum is at `worstX`,
/// `worstY`.
struct PictureDifference {
    double rmse = 0, maximum = 0, mean = 0;
    int worstX = 0, worstY = 0;
};
/// Compares in the pictures' own space. Error: sizes or spaces differ.
Result<PictureDifference> compare(const Picture& a, const Picture& b);

}  // namespace rtsg
