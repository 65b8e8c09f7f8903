// Documents from network addresses: their relative urls start at the final address of the response.
#pragma once

#include <rtsg/documents/scene_builder.h>

namespace rtsg {

/// For a document whose file is an address: fetches it, and has its urls start there. Files, and what cannot be
/// fetched, which its reader reports, are left as they are. Returns the address that answered, or an empty text.
std::string startAtAnswer(BuildOptions& options);
/// The folder of a file, which its own urls start from, or that of an address.
std::filesystem::path folderOfDocument(const std::filesystem::path& file);

}  // namespace rtsg
