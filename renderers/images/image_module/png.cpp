// Walks the chunks of a PNG file, compares the checksums of those that are necessary for the picture, and reads the
// pixels once, with error messages of this library.
#include "png.h"

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstring>

#include <png.h>
#include <zlib.h>

namespace rtsg {

namespace {

constexpr std::array<std::uint8_t, 8> kPngSignature{0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'};

std::uint32_t bigEndian32(std::span<const std::uint8_t> bytes) {
    return std::uint32_t{bytes[0]} << 24 | std::uint32_t{bytes[1]} << 16 | std::uint32_t{bytes[2]} << 8 | bytes[3];
}

}  // namespace

bool isPng(std::span<const std::uint8_t> bytes) {
    constexpr std::size_t kNamed = 4;  // the other bytes show damage by a transfer as text
    return bytes.size() >= kNamed && std::equal(bytes.begin(), bytes.begin() + kNamed, kPngSignature.begin());
}

namespace {

std::string damageOfChunks(std::span<const std::uint8_t> file) {
    if (file.size() < kPngSignature.size() || !std::ranges::equal(file.first(kPngSignature.size()), kPngSignature))
        return "the PNG file is damaged in its first bytes, as by a transfer as text";
    bool pixels = false;
    for (std::size_t at = kPngSignature.size();;) {
        const std::span<const std::uint8_t> rest = file.subspan(at);
        // Pixels may be whole though the last chunk is lost, and are shown then.
        if (rest.empty() && pixels) return {};
        if (rest.size() < 8) return "the PNG file ends too early, at its byte " + std::to_string(file.size());
        const std::string type(rest.begin() + 4, rest.begin() + 8);
        if (type == "IEND") return {};
        const std::size_t length = bigEndian32(rest);
        const bool needed = type == "IHDR" || type == "PLTE" || type == "IDAT";
        if (rest.size() < 12 || length > rest.size() - 12) {
            if (pixels && !needed) return {};
            return "the PNG file ends too early, at its byte " + std::to_string(file.size()) +
                   " in a chunk from byte " + std::to_string(at);
        }
        const auto sum = crc32_z(crc32_z(0, nullptr, 0), rest.data() + 4, length + 4);
        if (needed && sum != bigEndian32(rest.subspan(8 + length)))
            return "the PNG file is damaged in its " + type + " chunk from byte " + std::to_string(at) +
                   ", whose checksum is another";
        pixels |= type == "IDAT";
        at += 12 + length;
    }
}

/// Objects with destructors are outside the part that an error leaves by longjmp.
struct PixelsLookedAt {
    std::span<const std::uint8_t> rest;
    std::string damage;
    png_structp png = nullptr;
    png_infop info = nullptr;
    ~PixelsLookedAt() { png_destroy_read_struct(&png, &info, nullptr); }
};

void readBytes(png_structp png, png_bytep to, std::size_t length) {
    auto& looking = *static_cast<PixelsLookedAt*>(png_get_io_ptr(png));
    if (length > looking.rest.size()) png_error(png, "the file ends too early");
    std::memcpy(to, looking.rest.data(), length);
    looking.rest = looking.rest.subspan(length);
}
void keepError(png_structp png, png_const_charp what) {
    static_cast<PixelsLookedAt*>(png_get_error_ptr(png))->damage = what;
    png_longjmp(png, 1);
}
void ignoreWarning(png_structp, png_const_charp) {}

/// Reads the pixels and drops them.
void lookAtPixels(PixelsLookedAt& looking,
                  const std::function<std::string(int width, int height, int layers, bool eightBits)>& check) {
    looking.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &looking, keepError, ignoreWarning);
    looking.info = looking.png ? png_create_info_struct(looking.png) : nullptr;
    if (!looking.info || setjmp(png_jmpbuf(looking.png))) return;
    png_set_read_fn(looking.png, &looking, readBytes);
    png_read_info(looking.png, looking.info);
    const auto width = png_get_image_width(looking.png, looking.info),
               height = png_get_image_height(looking.png, looking.info);
    const bool eightBits = png_get_bit_depth(looking.png, looking.info) <= 8;
    if (check && !check(static_cast<int>(width), static_cast<int>(height), 1, eightBits).empty())
        return;  // the reader reports it
    const int passes = png_set_interlace_handling(looking.png);
    png_read_update_info(looking.png, looking.info);
    for (int pass = 0; pass < passes; ++pass)
        for (png_uint_32 y = 0; y < height; ++y) png_read_row(looking.png, nullptr, nullptr);
}

}  // namespace

std::string damageOfPng(std::span<const std::uint8_t> file,
                        const std::function<std::string(int width, int height, int layers, bool eightBits)>& check) {
    if (std::string damage = damageOfChunks(file); !damage.empty()) return damage;
    PixelsLookedAt looking;
    looking.rest = file;
    lookAtPixels(looking, check);
    return looking.damage.empty() ? std::string() : "the PNG file is damaged: " + looking.damage;
}

}  // namespace rtsg
