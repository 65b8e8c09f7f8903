// The module librtsg_plain.so, writing: PNG and JPEG files by their own libraries, which load quickly. It does not link
// this project's libraries, and throws only if memory runs out.
#include <algorithm>
#include <csetjmp>
#include <cstdio>  // before the next ones, which need it
#include <new>

#include <jpeglib.h>
#include <png.h>

#include "image/image_files.h"

namespace {

using rtsg::Sheet;

/// The colours of some pixels next to each other, as the libraries' own ways take them.
void takeColors(const std::uint8_t* pixels, std::size_t count, std::uint8_t* colors) {
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t c = 0; c < 3; ++c) colors[i * 3 + c] = pixels[i * 4 + c];
}

// ---- JPEG ------------------------------------------------------------------------------------------------------

constexpr int kQuality = 98;  // nearly nothing is lost but what subsampled colours lose

/// Exif 2.3: four entries beside the one that leads to them, of which the last is the one that matters: the colours are
/// sRGB's.
constexpr unsigned char kExif[] = {
    'E',  'x',  'i',  'f',  0, 0, 'I', 'I', '*', 0,   8,   0,   0, 0,  // little-endian, from byte 8 on
    1,    0,    0x69, 0x87, 4, 0, 1,   0,   0,   0,   26,  0,   0, 0, 0, 0, 0, 0, 4, 0,  // ... the Exif entries
    0x00, 0x90, 7,    0,    4, 0, 0,   0,   '0', '2', '3', '0',                          // of this version
    0x01, 0x91, 7,    0,    4, 0, 0,   0,   1,   2,   3,   0,                            // Y Cb Cr
    0x00, 0xA0, 7,    0,    4, 0, 0,   0,   '0', '1', '0', '0',                          // another version
    0x01, 0xA0, 3,    0,    1, 0, 0,   0,   1,   0,   0,   0,   0, 0, 0, 0,              // sRGB; the end
};

/// Objects with destructors are outside the part that an error leaves by longjmp.
struct JpegWriting {
    jpeg_error_mgr errors{};  // first: the error functions get a pointer to this only
    std::jmp_buf after{};
    jpeg_destination_mgr to{};
    std::vector<unsigned char>* file = nullptr;
    std::vector<std::uint8_t> row;
    jpeg_compress_struct jpeg{};
    JpegWriting() = default;
    JpegWriting(const JpegWriting&) = delete;
    JpegWriting& operator=(const JpegWriting&) = delete;
    ~JpegWriting() { jpeg_destroy_compress(&jpeg); }
    static JpegWriting& of(j_compress_ptr jpeg) { return *static_cast<JpegWriting*>(jpeg->client_data); }
};

/// Doubles the room. Nothing is thrown through the library.
void makeRoom(j_compress_ptr jpeg) {
    JpegWriting& writing = JpegWriting::of(jpeg);
    constexpr std::size_t kFirst = 1 << 16;
    const std::size_t full = writing.file->size();
    bool created = true;
    try {
        writing.file->resize(std::max(kFirst, 2 * full));
    } catch (const std::bad_alloc&) {
        created = false;
    }
    if (!created) std::longjmp(writing.after, 1);
    writing.to.next_output_byte = writing.file->data() + full;
    writing.to.free_in_buffer = writing.file->size() - full;
}

void setDestination(JpegWriting& writing, std::vector<unsigned char>& file) {
    file.clear();
    writing.file = &file;
    writing.to.init_destination = makeRoom;
    writing.to.empty_output_buffer = [](j_compress_ptr jpeg) -> boolean {
        makeRoom(jpeg);
        return TRUE;
    };
    writing.to.term_destination = [](j_compress_ptr jpeg) {
        JpegWriting& own = JpegWriting::of(jpeg);
        own.file->resize(own.file->size() - own.to.free_in_buffer);
    };
    writing.jpeg.client_data = &writing;
    writing.jpeg.dest = &writing.to;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const char* RTSG_ENCODE_JPEG_SYMBOL(
    const Sheet& sheet, std::vector<unsigned char>& file) {
    static thread_local char message[JMSG_LENGTH_MAX];
    std::snprintf(message, sizeof message, "there is too little memory for the JPEG file");
    JpegWriting writing;
    jpeg_compress_struct& jpeg = writing.jpeg;
    jpeg.err = jpeg_std_error(&writing.errors);
    writing.errors.error_exit = [](j_common_ptr common) {
        common->err->format_message(common, message);
        std::longjmp(reinterpret_cast<JpegWriting*>(common->err)->after, 1);
    };
    writing.row.resize(static_cast<std::size_t>(sheet.width) * 3);
    if (setjmp(writing.after)) return message;
    jpeg_create_compress(&jpeg);
    setDestination(writing, file);
    jpeg.image_width = static_cast<JDIMENSION>(sheet.width), jpeg.image_height = static_cast<JDIMENSION>(sheet.height);
    jpeg.input_components = 3, jpeg.in_color_space = JCS_RGB;
    jpeg_set_defaults(&jpeg);
    jpeg_set_quality(&jpeg, kQuality, TRUE);
    jpeg_start_compress(&jpeg, TRUE);
    jpeg_write_marker(&jpeg, JPEG_APP0 + 1, kExif, sizeof kExif);
    const std::size_t stride = static_cast<std::size_t>(sheet.width) * 4;
    while (jpeg.next_scanline < jpeg.image_height) {
        takeColors(sheet.bytes + jpeg.next_scanline * stride, stride / 4, writing.row.data());
        JSAMPROW row = writing.row.data();
        jpeg_write_scanlines(&jpeg, &row, 1);
    }
    jpeg_finish_compress(&jpeg);
    return nullptr;
}

// ---- PNG -------------------------------------------------------------------------------------------------------

extern "C" __attribute__((visibility("default"))) const char* RTSG_ENCODE_PNG_SYMBOL(const Sheet& sheet,
                                                                                     std::vector<unsigned char>& file) {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = static_cast<png_uint_32>(sheet.width), image.height = static_cast<png_uint_32>(sheet.height);
    image.format = sheet.opaque ? PNG_FORMAT_RGB : PNG_FORMAT_RGBA;
    std::vector<std::uint8_t> colors;
    if (sheet.opaque) {
        const std::size_t pixels = static_cast<std::size_t>(sheet.width) * static_cast<std::size_t>(sheet.height);
        colors.resize(pixels * 3);
        takeColors(sheet.bytes, pixels, colors.data());
    }
    png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
    file.resize(size);
    const void* const pixels = sheet.opaque ? colors.data() : sheet.bytes;
    if (png_image_write_to_memory(&image, file.data(), &size, 0, pixels, 0, nullptr) == 0)
        return "libpng could not pack the picture";
    file.resize(size);
    return nullptr;
}
