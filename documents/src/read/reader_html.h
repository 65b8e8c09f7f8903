// X3D inside a page: its first X3D element, as a document of XML.
//
// A page's parser knows neither the case of names nor attributes without quotes as faults; so names of nodes and fields
// are found whatever their case, and tags that end in /> are closed. Lines stay what they are, columns may not.
// Threading: pure functions. Source: HTML Living Standard 13.2; ISO/IEC 19776-1 V3.3.
#pragma once

#include <string>
#include <string_view>

#include <rtsg/core/diagnostic.h>

namespace rtsg::detail {

/// By the first bytes of a file.
bool isHtml(std::string_view head);
/// Empty, with an error, if there is no X3D element.
std::string xmlOfHtml(std::string_view page, Diagnostics& diagnostics);

}  // namespace rtsg::detail
