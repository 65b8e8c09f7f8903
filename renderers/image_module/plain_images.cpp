// The module librtsg_plain.so, reading: PNG and JPEG files of the usual kinds by their own libraries, which load at
// once. Links nothing of ours, throws nothing but for want of memory.
#include <algorithm>
#include <csetjmp>
#include <cstdio>  // before the next ones, which need it
#include <cstring>

#include <jpeglib.h>
#include <png.h>

#include "image/image_files.h"

namespace rtsg {

namespace {

/// Takes memory for the pixels, if that is granted.
bool begin(int width, int height, int channels, const ReadRequest& request, FilePixels& out, std::string& refused) {
    if (request.check) refused = request.check(width, height, 1, true);
    if (!refused.empty()) return false;
    out = {};
    out.width = width, out.height = height, out.channels = channels, out.encoded = true;
    out.bytes.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) *
                     static_cast<std::size_t>(channels));
    return true;
}
std::uint8_t* row(FilePixels& out, int y, const ReadRequest& request) {
    const int at = request.bottomRowFirst ? out.height - 1 - y : y;
    return out.bytes.data() +
           static_cast<std::size_t>(at) * static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.channels);
}

// ---- PNG -------------------------------------------------------------------------------------------------------

/// Objects with destructors stay outside of what an error jumps out of.
struct PngReading {
    std::span<const std::uint8_t> rest;
    bool warned = false;
    png_structp png = nullptr;
    png_infop info = nullptr;
    ~PngReading() { png_destroy_read_struct(&png, &info, nullptr); }
};

void readPngBytes(png_structp png, png_bytep to, std::size_t length) {
    auto& reading = *static_cast<PngReading*>(png_get_io_ptr(png));
    if (length > reading.rest.size()) png_error(png, "the file ends too early");
    std::memcpy(to, reading.rest.data(), length);
    reading.rest = reading.rest.subspan(length);
}
void failPng(png_structp png, png_const_charp) {
    png_longjmp(png, 1);
}
void warnOfPng(png_structp png, png_const_charp) {
    static_cast<PngReading*>(png_get_error_ptr(png))->warned = true;
}

bool readPng(std::span<const std::uint8_t> bytes, const ReadRequest& request, FilePixels& out, std::string& refused) {
    PngReading reading;
    reading.rest = bytes;
    reading.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &reading, failPng, warnOfPng);
    if (!reading.png) return false;
    reading.info = png_create_info_struct(reading.png);
    if (!reading.info || setjmp(png_jmpbuf(reading.png))) return false;
    png_set_read_fn(reading.png, &reading, readPngBytes);
    png_read_info(reading.png, reading.info);
    const int type = png_get_color_type(reading.png, reading.info),
              depth = png_get_bit_depth(reading.png, reading.info);
    if (depth > 8 || png_get_interlace_type(reading.png, reading.info) != PNG_INTERLACE_NONE) return false;
    png_set_expand(reading.png);  // palettes to colours, grey to 8 bits, a transparent colour to alpha
    png_read_update_info(reading.png, reading.info);
    const int channels = png_get_channels(reading.png, reading.info);
    if ((type & PNG_COLOR_MASK_ALPHA || channels == 2 || channels == 4) && !request.straight) return false;
    const auto width = png_get_image_width(reading.png, reading.info),
               height = png_get_image_height(reading.png, reading.info);
    if (!begin(static_cast<int>(width), static_cast<int>(height), channels, request, out, refused)) return false;
    if (png_get_rowbytes(reading.png, reading.info) != std::size_t{width} * static_cast<std::size_t>(channels))
        return false;
    for (int y = 0; y < out.height; ++y) png_read_row(reading.png, row(out, y, request), nullptr);
    png_read_end(reading.png, nullptr);
    return !reading.warned;
}

// ---- JPEG ------------------------------------------------------------------------------------------------------

struct JpegReading {
    jpeg_error_mgr errors{};  // first: what is told of errors knows nothing else
    std::jmp_buf after{};
    char warning[JMSG_LENGTH_MAX] = {};  // the first
    jpeg_decompress_struct jpeg{};
    ~JpegReading() { jpeg_destroy_decompress(&jpeg); }
};

bool readJpeg(std::span<const std::uint8_t> bytes, const ReadRequest& request, FilePixels& out, std::string& refused) {
    JpegReading reading;
    jpeg_decompress_struct& jpeg = reading.jpeg;
    jpeg.err = jpeg_std_error(&reading.errors);
    reading.errors.error_exit = [](j_common_ptr common) {
        std::longjmp(reinterpret_cast<JpegReading*>(common->err)->after, 1);
    };
    reading.errors.emit_message = [](j_common_ptr common, int level) {
        auto& own = *reinterpret_cast<JpegReading*>(common->err);
        if (level < 0 && common->err->num_warnings++ == 0) common->err->format_message(common, own.warning);
    };
    if (setjmp(reading.after)) return false;
    jpeg_create_decompress(&jpeg);
    jpeg_mem_src(&jpeg, bytes.data(), static_cast<unsigned long>(bytes.size()));
    if (jpeg_read_header(&jpeg, TRUE) != JPEG_HEADER_OK) return false;
    if ((jpeg.num_components != 1 && jpeg.num_components != 3) || jpeg.data_precision != 8) return false;
    if (!begin(static_cast<int>(jpeg.image_width), static_cast<int>(jpeg.image_height), jpeg.num_components, request,
               out, refused))
        return false;
    jpeg_start_decompress(&jpeg);
    if (jpeg.output_components != out.channels) return false;
    while (jpeg.output_scanline < jpeg.output_height) {
        JSAMPROW to = row(out, static_cast<int>(jpeg.output_scanline), request);
        jpeg_read_scanlines(&jpeg, &to, 1);
    }
    jpeg_finish_decompress(&jpeg);
    out.damage = reading.warning;
    return true;
}

}  // namespace

}  // namespace rtsg

extern "C" __attribute__((visibility("default"))) bool RTSG_READ_PLAIN_SYMBOL(std::span<const std::uint8_t> bytes,
                                                                              const rtsg::ReadRequest& request,
                                                                              rtsg::FilePixels& out,
                                                                              std::string& refused) {
    constexpr std::uint8_t kPng[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1A, '\n'}, kJpeg[] = {0xFF, 0xD8, 0xFF};
    if (request.asFloats) return false;
    const auto begins = [&](std::span<const std::uint8_t> with) {
        return bytes.size() >= with.size() && std::ranges::equal(bytes.first(with.size()), with);
    };
    if (begins(kPng)) return rtsg::readPng(bytes, request, out, refused);
    if (begins(kJpeg)) return rtsg::readJpeg(bytes, request, out, refused);
    return false;
}
