// The module librtsg_plain.so, writing: PNG files by libpng, which loads at once. Links nothing of ours, throws
// nothing.
#include <png.h>

#include "image/image_files.h"

namespace {

/// libpng's own way takes three channels next to each other.
std::vector<std::uint8_t> withoutAlpha(const rtsg::Sheet& sheet) {
    const std::size_t pixels = static_cast<std::size_t>(sheet.width) * static_cast<std::size_t>(sheet.height);
    std::vector<std::uint8_t> colors(pixels * 3);
    for (std::size_t i = 0; i < pixels; ++i)
        for (std::size_t c = 0; c < 3; ++c) colors[i * 3 + c] = sheet.bytes[i * 4 + c];
    return colors;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const char* RTSG_ENCODE_PNG_SYMBOL(const rtsg::Sheet& sheet,
                                                                                     std::vector<unsigned char>& file) {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = static_cast<png_uint_32>(sheet.width), image.height = static_cast<png_uint_32>(sheet.height);
    image.format = sheet.opaque ? PNG_FORMAT_RGB : PNG_FORMAT_RGBA;
    const std::vector<std::uint8_t> colors = sheet.opaque ? withoutAlpha(sheet) : std::vector<std::uint8_t>();
    png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
    file.resize(size);
    const void* const pixels = sheet.opaque ? colors.data() : sheet.bytes;
    if (png_image_write_to_memory(&image, file.data(), &size, 0, pixels, 0, nullptr) == 0)
        return "libpng could not pack the picture";
    file.resize(size);
    return nullptr;
}
