// Finds and loads the module that reads and writes image files.
#include "image_files.h"

#include <dlfcn.h>

#include <fmt/format.h>

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
    // By its name alone: the program's run path and LD_LIBRARY_PATH say where. It stays until the process ends.
    void* module = ::dlopen("librtsg_images.so", RTLD_NOW | RTLD_LOCAL);
    if (!module) return fail(fmt::format("image files need the module librtsg_images.so: {}", ::dlerror()));
    void* symbol = ::dlsym(module, RTSG_TEXT(RTSG_IMAGE_FILES_SYMBOL));
    if (!symbol) return fail("the module librtsg_images.so belongs to another version of this program");
    return reinterpret_cast<const ImageFiles* (*)()>(symbol)();
}

}  // namespace

Result<const ImageFiles*> imageFiles() {
    static const Result<const ImageFiles*> files = load();
    return files;
}

#endif

}  // namespace rtsg
