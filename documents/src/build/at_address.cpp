// Finds where a document at an address really is.
#include "at_address.h"

#include <rtsg/core/web_address.h>

namespace rtsg {

std::string startAtAnswer(BuildOptions& options) {
    if (!isWebAddress(options.file.native()) || !options.resources) return {};
    const auto opened = options.resources->open({}, options.file.native());
    if (!opened) return {};
    options.file = opened->path();
    options.resources = Resources(options.resources->folderBehind({}, opened->name()), options.resources->policy());
    return opened->name();
}

std::filesystem::path folderOfDocument(const std::filesystem::path& file) {
    return isWebAddress(file.native()) ? Resources().folderBehind({}, file.native()) : file.parent_path();
}

}  // namespace rtsg
