// Finds and loads the modules that read and write image files.
#include "image_files.h"

#include <rtsg/core/module.h>

namespace rtsg {

#ifdef RTSG_NO_IMAGES

Result<const ImageFiles*> imageFiles() {
    return fail("image files are neither read nor written: this build leaves them out (RTSG_IMAGES=OFF)");
}
Result<EncodePng> pngEncoder() {
    return std::unexpected(imageFiles().error());
}
Result<ReadPlain> plainReader() {
    return std::unexpected(imageFiles().error());
}

#else

namespace {

#define RTSG_TEXT_OF(name) #name
#define RTSG_TEXT(name) RTSG_TEXT_OF(name)

Result<const ImageFiles*> load() {
    const auto symbol = loadModule("rtsg_images", RTSG_TEXT(RTSG_IMAGE_FILES_SYMBOL), "image files need");
    if (!symbol) return std::unexpected(symbol.error());
    return reinterpret_cast<const ImageFiles* (*)()>(*symbol)();
}

Result<EncodePng> loadPngEncoder() {
    const auto symbol = loadModule("rtsg_plain", RTSG_TEXT(RTSG_ENCODE_PNG_SYMBOL), "PNG files need");
    if (!symbol) return std::unexpected(symbol.error());
    return reinterpret_cast<EncodePng>(*symbol);
}

Result<ReadPlain> loadPlainReader() {
    const auto symbol = loadModule("rtsg_plain", RTSG_TEXT(RTSG_READ_PLAIN_SYMBOL), "PNG and JPEG files need");
    if (!symbol) return std::unexpected(symbol.error());
    return reinterpret_cast<ReadPlain>(*symbol);
}

}  // namespace

Result<EncodePng> pngEncoder() {
    static const Result<EncodePng> encoder = loadPngEncoder();
    return encoder;
}

Result<ReadPlain> plainReader() {
    static const Result<ReadPlain> reader = loadPlainReader();
    return reader;
}

Result<const ImageFiles*> imageFiles() {
    static const Result<const ImageFiles*> files = load();
    return files;
}

#endif

}  // namespace rtsg
