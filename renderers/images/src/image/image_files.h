// ImageFiles: image files to pixels and back, by a module (librtsg_oiio.so) that is loaded when the first one is
// asked for: the library behind it brings 250 others along, which programs without images should not wait for.
//
// Invariant: nothing of OpenImageIO is on this side; the module links nothing of ours. Errors are sentences; an empty
// one means done. Threading: every function may be called from any thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

/// The pixels of a file: rows from the top unless asked otherwise, layer by layer, with at most 4 channels, in one of
/// the two arrays.
struct FilePixels {
    int width = 0, height = 0, channels = 0;
    int layers = 1;
    std::string damage;               // of a file that is shown as far as it could be read; a sentence
    bool encoded = false;             // numbers of an integer format: sRGB where they are colours
    std::vector<std::uint8_t> bytes;  // 8 bits a channel
    std::vector<float> values;        // all other pixels, and those requested as floats; integers span [0, 1]
};

struct ReadRequest {
    bool asFloats = false, bottomRowFirst = false;
    bool layers = false;    // a file with several layers is read whole, otherwise refused
    bool straight = false;  // colours as they are under an alpha of 0, and not multiplied with it elsewhere
    bool data = false;      // numbers, no colours: bytes stay bytes even where the file says that they are light
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

/// Gives the bytes of a file; fewer than asked for at the end and after an error. May be called from any thread.
struct ByteSource {
    std::uint64_t size = 0;
    std::function<std::size_t(std::uint64_t offset, void* to, std::size_t length)> read;
};

/// A picture that stays in its file: tiles of it and of its coarser copies are read when they are looked at, and kept
/// in one cache of 256 MiB for all such pictures of a process. Threading: any number of threads.
class TiledPicture {
  public:
    static constexpr std::size_t kCacheMegabytes = 256;
    /// A tile has no more bytes than this: more would not be a part of a picture.
    static constexpr std::uint64_t kMaxTileBytes = std::uint64_t{1} << 24;
    struct Level {
        int width = 0, height = 0;
    };
    virtual ~TiledPicture() = default;
    TiledPicture() = default;
    TiledPicture(const TiledPicture&) = delete;
    TiledPicture& operator=(const TiledPicture&) = delete;

    std::vector<Level> levels;  // the finest first
    int channels = 0;           // 1 to 4
    bool encoded = false;       // not half or float
    bool eightBits = false;
    /// A block of a level, `channels` numbers a pixel, rows from the top, alpha not multiplied in. False, with zeros:
    /// the file cannot be read there; damage() says why from then on. Precondition: the block lies within.
    virtual bool read(int level, int x, int y, int width, int height, float* pixels) const = 0;
    virtual std::string damage() const = 0;
};

class ImageFiles {
  public:
    virtual ~ImageFiles() = default;
    /// Error: it is not stored in tiles with its coarser copies. `name`: its extension says the format.
    virtual std::string openTiles(ByteSource source, const std::string& name,
                                  std::unique_ptr<TiledPicture>& out) const = 0;
    virtual std::string readFile(const std::string& file, const ReadRequest& request, FilePixels& out) const = 0;
    /// `name`: its extension says the format.
    virtual std::string readMemory(std::span<const std::uint8_t> bytes, const std::string& name,
                                   const ReadRequest& request, FilePixels& out) const = 0;
    /// The whole file, in the format that the extension of `name` says.
    virtual std::string encode(const std::string& name, const Sheet& sheet, std::vector<unsigned char>& file) const = 0;
    virtual std::string encodeAnimation(const std::string& name, std::span<const Sheet> sheets, double framesPerSecond,
                                        std::vector<unsigned char>& file) const = 0;
    /// From here on it reads on the calling thread alone, and opens nothing.
    virtual void workAlone() const = 0;
};

/// The module's; loads it at the first call. Error: it was left out of this build, or it is not where programs look for
/// libraries (beside the program, ../lib/rtsg, LD_LIBRARY_PATH).
Result<const ImageFiles*> imageFiles();

/// The whole file of a sheet. Null: done; otherwise a sentence, which lasts until the thread's next call.
using EncodePlain = const char* (*)(const Sheet& sheet, std::vector<unsigned char>& file);
/// The encoder of a module that needs none of those libraries: .png and .jpg (librtsg_plain.so), and .exr
/// (librtsg_exr.so) and .webp (librtsg_webp.so) if the headers of their libraries were there at build time. Null:
/// ImageFiles::encode() writes files with this extension; it writes the same pixels in all formats, but encodes .png
/// its own way.
Result<EncodePlain> plainEncoder(std::string_view extension);

/// All that an .exr file holds, as a plainEncoder() wrote it.
struct ExrContent {
    struct Channel {
        std::string name;
        bool integers = false;
        std::vector<float> values;  // one a pixel, rows from the top; of integers the bits
    };
    int width = 0, height = 0;
    std::vector<Channel> channels;
    std::vector<std::pair<std::string, std::string>> notes;
};
/// Null: done; otherwise a sentence, which lasts until the thread's next call.
using ReadExr = const char* (*)(std::span<const std::uint8_t> bytes, ExrContent& out);
/// The reader of librtsg_exr.so. Error: the build has none.
Result<ReadExr> exrReader();

/// Reads a PNG, JPEG or still WebP file as ImageFiles::readMemory() would, bit for bit, unless floats are requested.
/// False: the file is of another kind or damaged, and ImageFiles is to read it; or, with a sentence, it is refused. A
/// JPEG file that ends too early is still read, and reported.
using ReadPlain = bool (*)(std::span<const std::uint8_t> bytes, const ReadRequest& request, FilePixels& out,
                           std::string& refused);
/// The reader of the same modules for a file that begins with these bytes, as most textures do.
Result<ReadPlain> plainReader(std::span<const std::uint8_t> bytes);

/// The names that the modules export; they change whenever this header does.
#define RTSG_IMAGE_FILES_SYMBOL rtsgImageFiles8
#define RTSG_ENCODE_PNG_SYMBOL rtsgEncodePng2
#define RTSG_ENCODE_JPEG_SYMBOL rtsgEncodeJpeg1
#define RTSG_ENCODE_EXR_SYMBOL rtsgEncodeExr1
#define RTSG_READ_EXR_SYMBOL rtsgReadExr1
#define RTSG_ENCODE_WEBP_SYMBOL rtsgEncodeWebp1
#define RTSG_READ_PLAIN_SYMBOL rtsgReadPlain2
#define RTSG_READ_WEBP_SYMBOL rtsgReadWebp1

}  // namespace rtsg
