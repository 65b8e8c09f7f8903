// Finds and loads the module that knows fonts.
#include "fonts.h"

#include <dlfcn.h>

#include <fmt/format.h>

namespace rtsg {

#ifdef RTSG_NO_FONTS

Result<const Fonts*> fonts() {
    return fail("text is not drawn: this build leaves fonts out (RTSG_FONTS=OFF)");
}

#else

namespace {

#define RTSG_TEXT_OF(name) #name
#define RTSG_TEXT(name) RTSG_TEXT_OF(name)

Result<const Fonts*> load() {
    // By its name alone: the program's run path and LD_LIBRARY_PATH say where. It stays until the process ends.
    void* module = ::dlopen("librtsg_fonts.so", RTLD_NOW | RTLD_LOCAL);
    if (!module) return fail(fmt::format("text needs the module librtsg_fonts.so: {}", ::dlerror()));
    void* symbol = ::dlsym(module, RTSG_TEXT(RTSG_FONTS_SYMBOL));
    if (!symbol) return fail("the module librtsg_fonts.so belongs to another version of this program");
    return reinterpret_cast<const Fonts* (*)()>(symbol)();
}

}  // namespace

Result<const Fonts*> fonts() {
    static const Result<const Fonts*> loaded = load();
    return loaded;
}

#endif

}  // namespace rtsg
