// A document as a file holds it: plain or gzip.
#pragma once

#include <string_view>

#include <rtsg/core/resource.h>
#include <rtsg/documents/read_document.h>

#include "import/import.h"
#include "reader_common.h"

namespace rtsg::detail {

struct SceneBytes {
    std::size_t limit = 0;      // of the unpacked text, bytes
    bool mustBeHeaded = false;  // refuses what shows no sign of being a scene, without repeating a word of it
    OpenBeside beside{};        // of what is imported: its other files
};

/// Opens what the resources let, from the folder of the file that is read (the resources' own if it is empty).
OpenBeside openBeside(Resources resources, std::filesystem::path folder);
/// As readDocument.
bool readText(std::string_view text, const OpenBeside& beside, DocumentHandler& handler, Diagnostics& diagnostics,
              const ReaderOptions& options);

/// Does what readDocumentFile() does for an open file, which it reads so many bytes at a time.
bool readDescriptorInBlocks(int descriptor, std::size_t block, const OpenBeside& beside, DocumentHandler& handler,
                            Diagnostics& diagnostics, const ReaderOptions& options);

/// As readDocument.
bool readSceneBytes(std::string_view bytes, DocumentHandler& handler, Diagnostics& diagnostics,
                    const SceneBytes& options);

}  // namespace rtsg::detail
