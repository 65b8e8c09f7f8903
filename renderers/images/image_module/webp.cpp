// The module librtsg_webp.so: WebP files by libwebp, which loads quickly. It does not link this project's libraries,
// and throws only if memory runs out.
#include <algorithm>
#include <new>

#include <webp/decode.h>
#include <webp/encode.h>

#include "image/image_files.h"

namespace {

/// A picture of the library's, which goes with all that it has.
struct WebpPicture {
    WebPPicture picture{};
    bool begun = WebPPictureInit(&picture) != 0;
    WebpPicture() = default;
    WebpPicture(const WebpPicture&) = delete;
    WebpPicture& operator=(const WebpPicture&) = delete;
    ~WebpPicture() {
        if (begun) WebPPictureFree(&picture);
    }
};

int takeBytes(const std::uint8_t* bytes, std::size_t size, const WebPPicture* picture) {
    auto& file = *static_cast<std::vector<unsigned char>*>(picture->custom_ptr);
    try {
        file.insert(file.end(), bytes, bytes + size);
    } catch (const std::bad_alloc&) {
        return 0;
    }
    return 1;
}

const char* reasonOf(WebPEncodingError error) {
    switch (error) {
        case VP8_ENC_ERROR_OUT_OF_MEMORY:
        case VP8_ENC_ERROR_BITSTREAM_OUT_OF_MEMORY:
        case VP8_ENC_ERROR_BAD_WRITE:
            return "there is too little memory for the WebP file";
        case VP8_ENC_ERROR_BAD_DIMENSION:
            return "a WebP file has at most 16383 pixels a side";
        case VP8_ENC_ERROR_PARTITION0_OVERFLOW:
        case VP8_ENC_ERROR_PARTITION_OVERFLOW:
        case VP8_ENC_ERROR_FILE_TOO_BIG:
            return "the picture has more detail than a WebP file holds";
        default:
            return "libwebp could not pack the picture";
    }
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const char* RTSG_ENCODE_WEBP_SYMBOL(
    const rtsg::Sheet& sheet, std::vector<unsigned char>& file) {
    file.clear();
    WebpPicture own;
    WebPConfig config;
    if (!own.begun || !WebPConfigInit(&config)) return "libwebp is of another version than its headers";
    // OpenImageIO's settings, so that files are the same as those that it writes.
    config.quality = 100, config.method = 6;
    WebPPicture& picture = own.picture;
    picture.width = sheet.width, picture.height = sheet.height;
    picture.writer = takeBytes, picture.custom_ptr = &file;
    const auto import = sheet.opaque ? WebPPictureImportRGBX : WebPPictureImportRGBA;
    if (!import(&picture, sheet.bytes, 4 * sheet.width) || !WebPEncode(&config, &picture))
        return reasonOf(picture.error_code);
    return nullptr;
}

extern "C" __attribute__((visibility("default"))) bool RTSG_READ_WEBP_SYMBOL(std::span<const std::uint8_t> bytes,
                                                                             const rtsg::ReadRequest& request,
                                                                             rtsg::FilePixels& out,
                                                                             std::string& refused) {
    WebPBitstreamFeatures found;
    if (WebPGetFeatures(bytes.data(), bytes.size(), &found) != VP8_STATUS_OK || found.has_animation) return false;
    if (request.asFloats || (found.has_alpha && !request.straight)) return false;
    if (request.check) refused = request.check(found.width, found.height, 1, true);
    if (!refused.empty()) return false;
    out = {};
    out.width = found.width, out.height = found.height, out.channels = found.has_alpha ? 4 : 3, out.encoded = true;
    const int stride = out.width * out.channels;
    out.bytes.resize(static_cast<std::size_t>(stride) * static_cast<std::size_t>(out.height));
    const auto decode = found.has_alpha ? WebPDecodeRGBAInto : WebPDecodeRGBInto;
    if (!decode(bytes.data(), bytes.size(), out.bytes.data(), out.bytes.size(), stride)) return false;
    if (request.bottomRowFirst)
        for (int top = 0, bottom = out.height - 1; top < bottom; ++top, --bottom)
            std::swap_ranges(out.bytes.begin() + std::ptrdiff_t{top} * stride,
                             out.bytes.begin() + std::ptrdiff_t{top + 1} * stride,
                             out.bytes.begin() + std::ptrdiff_t{bottom} * stride);
    return true;
}
