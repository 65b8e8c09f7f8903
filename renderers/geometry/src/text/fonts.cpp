// Finds and loads the module for fonts.
#include "fonts.h"

#include <rtsg/core/module.h>
#include <rtsg/core/sandbox.h>

#include "sandbox_fonts.h"

namespace rtsg {

#ifdef RTSG_NO_FONTS

Result<const Fonts*> fontsHere() {
    return fail("text is not drawn: this build leaves fonts out (RTSG_FONTS=OFF)");
}

#else

namespace {

#define RTSG_TEXT_OF(name) #name
#define RTSG_TEXT(name) RTSG_TEXT_OF(name)

Result<const Fonts*> loadFonts() {
    const auto symbol = loadModule("rtsg_fonts", RTSG_TEXT(RTSG_FONTS_SYMBOL), "text needs");
    if (!symbol) return std::unexpected(symbol.error());
    return reinterpret_cast<const Fonts* (*)()>(*symbol)();
}

}  // namespace

Result<const Fonts*> fontsHere() {
    static const Result<const Fonts*> loaded = loadFonts();
    return loaded;
}

#endif

Result<const Fonts*> fonts() {
    auto here = fontsHere();
    if (here && isSandboxed()) return &sandboxedFonts();
    return here;
}

}  // namespace rtsg
