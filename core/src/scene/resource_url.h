// The parts of a url: what resource.cpp opens.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include <rtsg/core/diagnostic.h>

namespace rtsg::detail {

struct UrlParts {
    enum class Kind : unsigned char { file, data, web, package, other };
    Kind kind = Kind::file;
    bool hasScheme = false;    // file: or another one stands before it
    std::string path;          // file: decoded; absolute if the url was a file: one
    std::string_view encoded;  // the url without its fragment
    std::string fragment;      // decoded
    std::string package{};     // of package://NAME/path and model://NAME/path, as robots' files have them: the name
};

UrlParts splitUrl(std::string_view url);
/// Each %XX as the byte it stands for; others stay.
std::string percentDecoded(std::string_view text);

struct DataUrl {
    std::string mediaType, bytes;
};
/// Decodes `data:[type][;base64],...`; nothing if it is malformed.
std::optional<DataUrl> decodeDataUrl(std::string_view url);

}  // namespace rtsg::detail
