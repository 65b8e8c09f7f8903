// ImageFiles: image files to pixels and back, by a module (librtsg_images.so) that is loaded when the first one is
// asked for: the library behind it brings 250 others along, which programs without images should not wait for.
//
// Invariant: nothing of OpenImageIO is on this side; the module links nothing of ours. Errors are sentences; an empty
// one means done. Threading: every function may be called from any thread.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

/// What a file holds: rows from the top unless asked otherwise, layer by layer, at most 4 channels, in one of the two
/// arrays.
struct FilePixels {
    int width = 0, height = 0, channels = 0;
    int layers = 1;
    bool encoded = false;             // numbers of an integer format: sRGB where they are colours
    std::vector<std::uint8_t> bytes;  // 8 bits a channel
    std::vector<float> values;        // all else, and what was asked for as floats; integers span [0, 1]
};

struct ReadRequest {
    bool asFloats = false, bottomRowFirst = false;
    bool layers = false;    // a file with several layers is read whole, otherwise refused
    bool straight = false;  // colours as they are under an alpha of 0, and not multiplied with it elsewhere
    /// Asked before memory is taken for pixels: a sentence refuses them.
    std::function<std::string(int width, int height, int layers, bool eightBits)> check;
};

/// One number a pixel, of 32 bits, under a name.
struct SheetChannel {
    std::string name;
    const float* first = nullptr;  // of the top left pixel
    std::size_t stride = 1;        // floats from one pixel to the next
    bool integers = false;         // bits of unsigned numbers
};

/// A picture to write: RGBA, 8 bits or floats, rows from the top.
struct Sheet {
    int width = 0, height = 0;
    const std::uint8_t* bytes = nullptr;  // sRGB, alpha not multiplied in
    const float* values = nullptr;        // linear, alpha multiplied in
    bool opaque = false;                  // alpha may be left out
    /// Besides the colour, and text attributes: only .exr holds them.
    std::vector<SheetChannel> channels{};
    std::vector<std::pair<std::string, std::string>> notes{};
};

class ImageFiles {
  public:
    virtual ~ImageFiles() = default;
    virtual std::string readFile(const std::string& file, const ReadRequest& request, FilePixels& out) const = 0;
    /// `name`: its extension says the format.
    virtual std::string readMemory(std::span<const std::uint8_t> bytes, const std::string& name,
                                   const ReadRequest& request, FilePixels& out) const = 0;
    /// The whole file, in the format that the extension of `name` says.
    virtual std::string encode(const std::string& name, const Sheet& sheet, std::vector<unsigned char>& file) const = 0;
    virtual std::string encodeAnimation(const std::string& name, std::span<const Sheet> sheets, double framesPerSecond,
                                        std::vector<unsigned char>& file) const = 0;
};

/// The module's; loads it at the first call. Error: it was left out of this build, or it is not where programs look for
/// libraries (beside the program, ../lib/rtsg, LD_LIBRARY_PATH).
Result<const ImageFiles*> imageFiles();

/// What the module exports under this name, which changes whenever this header does.
#define RTSG_IMAGE_FILES_SYMBOL rtsgImageFiles4

}  // namespace rtsg
