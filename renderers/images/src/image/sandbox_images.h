// Pictures that are read in the sandbox: the same functions as those of image_files.h.
//
// Threading: any thread. Precondition: isSandboxed().
#pragma once

#include <span>
#include <string>

#include "image_files.h"

namespace rtsg {

/// A ReadPlain. A file that breaks its library is refused.
bool readPlainSandboxed(std::span<const std::uint8_t> bytes, const ReadRequest& request, FilePixels& out,
                        std::string& refused);
/// Reads in the sandbox, and writes here.
const ImageFiles& sandboxedImageFiles();

/// The readers and writers of this process, whether there is a sandbox or not.
Result<ReadPlain> plainReaderHere(std::span<const std::uint8_t> bytes);
Result<const ImageFiles*> imageFilesHere();
/// In a worker: loads the readers of all kinds of pictures.
Result<> prepareImageFiles();
/// Whether plainReader() may read a file that begins with these bytes.
bool isPlainKind(std::span<const std::uint8_t> bytes);

}  // namespace rtsg
