// The module librtsg_plain.so, reading: PNG and JPEG files by their own libraries, which load quickly. It does not link
// this project's libraries, and throws only if memory runs out.
#include <algorithm>
#include <bit>
#include <csetjmp>
#include <cstdio>  // before the next ones, which need it
#include <cstring>

#include <jpeglib.h>
#include <png.h>

#include "image/image_files.h"

namespace rtsg {

namespace {

/// Takes memory for the pixels, if that is granted.
bool begin(int width, int height, int channels, bool eightBits, const ReadRequest& request, FilePixels& out,
           std::string& refused) {
    if (request.check) refused = request.check(width, height, 1, eightBits);
    if (!refused.empty()) return false;
    out = {};
    out.width = width, out.height = height, out.channels = channels, out.encoded = true;
    const std::size_t numbers =
        static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * static_cast<std::size_t>(channels);
    if (eightBits)
        out.bytes.resize(numbers);
    else
        out.values.resize(numbers);
    return true;
}
/// The index at which a row's numbers begin.
std::size_t offsetOf(const FilePixels& out, int y, const ReadRequest& request) {
    const int at = request.bottomRowFirst ? out.height - 1 - y : y;
    return static_cast<std::size_t>(at) * static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.channels);
}

// ---- PNG -------------------------------------------------------------------------------------------------------

/// Objects with destructors are outside the part that an error leaves by longjmp.
struct PngReading {
    std::span<const std::uint8_t> rest;
    std::vector<std::uint16_t> wide;
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
    const int type = png_get_color_type(reading.png, reading.info);
    const bool eightBits = png_get_bit_depth(reading.png, reading.info) <= 8;
    png_set_expand(reading.png);  // palettes to colours, grey to 8 bits, a transparent colour to alpha
    if (!eightBits && std::endian::native == std::endian::little) png_set_swap(reading.png);
    const int passes = png_set_interlace_handling(reading.png);
    png_read_update_info(reading.png, reading.info);
    const int channels = png_get_channels(reading.png, reading.info);
    if ((type & PNG_COLOR_MASK_ALPHA || channels == 2 || channels == 4) && !request.straight) return false;
    const auto width = png_get_image_width(reading.png, reading.info),
               height = png_get_image_height(reading.png, reading.info);
    if (!begin(static_cast<int>(width), static_cast<int>(height), channels, eightBits, request, out, refused))
        return false;
    if (png_get_rowbytes(reading.png, reading.info) !=
        std::size_t{width} * static_cast<std::size_t>(channels) * (eightBits ? 1 : 2))
        return false;
    reading.wide.resize(out.values.size());
    for (int pass = 0; pass < passes; ++pass)
        for (int y = 0; y < out.height; ++y) {
            const std::size_t at = offsetOf(out, y, request);
            png_read_row(reading.png, eightBits ? &out.bytes[at] : reinterpret_cast<png_bytep>(&reading.wide[at]),
                         nullptr);
        }
    for (std::size_t i = 0; i < reading.wide.size(); ++i)
        out.values[i] = static_cast<float>(reading.wide[i]) * (1.0f / 65535);
    png_read_end(reading.png, nullptr);
    return !reading.warned;
}

// ---- JPEG ------------------------------------------------------------------------------------------------------

struct JpegReading {
    jpeg_error_mgr errors{};  // first: the error functions get a pointer to this only
    std::jmp_buf after{};
    char warning[JMSG_LENGTH_MAX] = {};  // the first
    std::vector<std::uint8_t> inks;      // a row of them
    jpeg_decompress_struct jpeg{};
    ~JpegReading() { jpeg_destroy_decompress(&jpeg); }
};

/// The light that paper sends: of each colour what its ink leaves of what black leaves. 255 is no ink.
void lightOfInks(const std::vector<std::uint8_t>& inks, std::uint8_t* colors) {
    for (std::size_t i = 0; i < inks.size(); i += 4)
        for (std::size_t c = 0; c < 3; ++c)
            *colors++ = static_cast<std::uint8_t>((2 * inks[i + c] * inks[i + 3] + 255) / 510);
}

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
    const bool isInks = jpeg.num_components == 4;
    if ((jpeg.num_components != 1 && jpeg.num_components != 3 && !isInks) || jpeg.data_precision != 8) return false;
    const int channels = isInks ? 3 : jpeg.num_components;
    if (isInks) jpeg.out_color_space = JCS_CMYK;
    if (!begin(static_cast<int>(jpeg.image_width), static_cast<int>(jpeg.image_height), channels, true, request, out,
               refused))
        return false;
    jpeg_start_decompress(&jpeg);
    if (jpeg.output_components != jpeg.num_components) return false;
    if (isInks) reading.inks.resize(std::size_t{4} * jpeg.output_width);
    while (jpeg.output_scanline < jpeg.output_height) {
        std::uint8_t* const row = &out.bytes[offsetOf(out, static_cast<int>(jpeg.output_scanline), request)];
        JSAMPROW to = isInks ? reading.inks.data() : row;
        jpeg_read_scanlines(&jpeg, &to, 1);
        if (isInks) lightOfInks(reading.inks, row);
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
