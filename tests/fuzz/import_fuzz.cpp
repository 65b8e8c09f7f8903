// Arbitrary bytes as files of other programs: glTF and GLB, STL, OBJ and PLY. Whatever they say, reading ends, commands
// nest, and what was imported can be written and read again without an error.
#include <cstdint>

#include "import/import.h"
#include "reading.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string_view bytes(reinterpret_cast<const char*>(data), size);
    const rtsg::detail::FileKind kind = rtsg::detail::fileKind(bytes, bytes.size());
    if (kind == rtsg::detail::FileKind::document || kind == rtsg::detail::FileKind::notRead) return 0;
    rtsg::fuzz::checkText(bytes);
    return 0;
}
