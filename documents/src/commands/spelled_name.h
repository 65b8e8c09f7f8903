// Spells names that an encoding cannot express so that they can be read back: a forbidden character becomes _x, four
// hexadecimal digits of its code point (six beyond U+FFFF), and _.
//
// Invariant: readName(spellName(name)) == name for every name. A name that is allowed, and does not look like a spelled
// one, stays as it is. Threading: pure functions. Source: the escapes of ISO/IEC 9075-14 (SQL/XML) 9.1; allowed names:
// ISO/IEC 19776-2 V3.3 annex A (Id), XML 1.0 2.3.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace rtsg::detail {

enum class Spelling : std::uint8_t {
    classic,    // any name in ClassicVRML and VRML97
    element,    // the name of a node of unknown type, in XML and JSON
    attribute,  // the name of a field of such a node
};

std::string spellName(std::string_view name, Spelling spelling);
/// The name that is spelled so.
std::string readName(std::string_view text, Spelling spelling);
/// Why a document may not have this as the DEF of a node: "begins with '1'", "has '.' in it", "is a keyword"; empty if
/// it may. XML and JSON: by the rules for an ID (XML 1.0 NCName), without a check of characters beyond ASCII.
std::string faultOfDef(std::string_view text, Spelling spelling);
/// Whether readName() may give anything else than the text.
inline bool mayBeSpelled(std::string_view text) {
    return text.find("_x") != text.npos;
}

}  // namespace rtsg::detail
