// A document as a file holds it: plain or gzip.
#pragma once

#include <string_view>

#include <rtsg/core/resource.h>
#include <rtsg/documents/read_document.h>

#include "import/import.h"
#include "reader_common.h"

namespace rtsg::detail {

/// Opens files that the resources allow, relative to the folder of the file that is read (or the resources' own
/// folder).
OpenBeside openBeside(Resources resources, std::filesystem::path folder);
/// The same as readDocument.
bool readText(std::string_view text, const OpenBeside& beside, DocumentHandler& handler, Diagnostics& diagnostics,
              const ReaderOptions& options);

/// Does what readDocumentFile() does for an open file, which it reads so many bytes at a time.
bool readDescriptorInBlocks(int descriptor, std::size_t block, const OpenBeside& beside, DocumentHandler& handler,
                            Diagnostics& diagnostics, const ReaderOptions& options);

/// Reads the document behind a url, piece by piece if it is a file or packed. Content that does not look like a scene
/// is refused without repeating a word of it. `maximumBytes` limits the unpacked text.
bool readResource(Resource& resource, std::uint64_t maximumBytes, const TimeLimit& time, const OpenBeside& beside,
                  std::shared_ptr<const Dialect> dialect, DocumentHandler& handler, Diagnostics& diagnostics);

}  // namespace rtsg::detail
