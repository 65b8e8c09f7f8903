// isFontFile: whether bytes have the form of a font, before they are used.
//
// It looks at the directory of tables alone: each table must lie within the file, and those must exist without which no
// glyph has a form. The content of the tables is left to the library that draws them. Threading: pure. Source: ISO/IEC
// 14496-22 (Open Font Format) 4.5, W3C WOFF 1.0 section 3 and WOFF 2.0 section 4.
#pragma once

#include <string>
#include <string_view>

namespace rtsg::detail {

/// TrueType and OpenType fonts, collections of them, WOFF and WOFF2. `why`: otherwise the fault, as a clause.
bool isFontFile(std::string_view bytes, std::string& why);

}  // namespace rtsg::detail
