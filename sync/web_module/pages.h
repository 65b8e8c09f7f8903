// Pages: which files of the page a browser may have, and their types.
//
// Invariant: a path consists of plain names below one of the listed folders, so it can name nothing else on the disk.
// Threading: pure functions of the file system.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace rtsg::web {

struct PageFile {
    std::string path;  // on disk
    std::string_view type;
    std::string tag;  // changes when the file does
};

/// `target` is that of the request, unchanged, without the part from '?' on. Empty if the file does not exist or is not
/// served.
std::optional<PageFile> findPage(const std::string& folder, std::string_view target);
std::optional<std::string> readPage(const PageFile& file);
/// True for text; pictures and fonts are compressed already.
bool isWorthPacking(const PageFile& file);
/// Compresses to gzip (RFC 1952). Empty if that fails.
std::string packed(const std::string& text);

}  // namespace rtsg::web
