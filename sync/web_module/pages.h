// The files of the page: which a browser may have, and as what.
//
// Invariant: a path is a row of plain names below one of the folders listed, so nothing else of the disk can be named.
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

/// `target`: of the request, as it came, without what follows '?'. Nothing for what is not served or not there.
std::optional<PageFile> findPage(const std::string& folder, std::string_view target);
std::optional<std::string> readPage(const PageFile& file);
/// Text worth packing on its way; pictures and fonts are packed as they are.
bool isWorthPacking(const PageFile& file);
/// As gzip (RFC 1952); empty if that cannot be done.
std::string packed(const std::string& text);

}  // namespace rtsg::web
