// A document as a file holds it: plain or gzip.
#pragma once

#include <string_view>

#include <rtsg/core/loader.h>

namespace rtsg::detail {

struct SceneBytes {
    std::size_t limit = 0;      // of the unpacked text, bytes
    bool mustBeHeaded = false;  // refuses what shows no sign of being a scene, without repeating a word of it
    Progress progress;
};

/// As readDocument.
bool readSceneBytes(std::string_view bytes, DocumentHandler& handler, Diagnostics& diagnostics,
                    const SceneBytes& options);

}  // namespace rtsg::detail
