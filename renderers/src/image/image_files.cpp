// Finds and loads the module that reads and writes image files.
#include "image_files.h"

#include <rtsg/core/module.h>

namespace rtsg {

#ifdef RTSG_NO_IMAGES

Result<const ImageFiles*> imageFiles() {
    return fail("image files are neither read nor written: this build leaves them out (RTSG_IMAGES=OFF)");
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

}  // namespace

Result<const ImageFiles*> imageFiles() {
    static const Result<const ImageFiles*> files = load();
    return files;
}

#endif

}  // namespace rtsg
