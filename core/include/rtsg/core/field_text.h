// One field value as text: parses and prints it in the three text encodings; escapes text for HTML and XML.
//
// Invariant: parseFieldText(v.type(), printFieldText(v, s), s) == v for ClassicVRML and XML and every value without
// nodes and without NaN or infinity; numbers are printed as the shortest text that reads back as the same bits.
// Threading: pure functions. Source: ISO/IEC 19776-1 V3.3 clause 5 (XML), 19776-2 V3.3 clause 5 and annex A
// (ClassicVRML). Both readers are laxer than the grammar: commas are white space, TRUE and true are both booleans.
#pragma once

#include <string>
#include <string_view>

#include <rtsg/core/custom_field.h>
#include <rtsg/core/diagnostic.h>
#include <rtsg/core/value.h>

namespace rtsg {

enum class TextSyntax : std::uint8_t { classicVrml, xml, json };

/// Parses one value, which must be all of `text`. XML means the attribute's value with entities already resolved; JSON
/// is not parsed. Of nodes, only NULL and [ ] are values. The diagnostic's position counts from the start of `text`.
/// `custom` is the type of SFCustom and MFCustom. The text form of such a value stands in quotes (in XML a single one
/// may stand without), its numbers stand without.
Result<Value> parseFieldText(FieldType type, std::string_view text, TextSyntax syntax = TextSyntax::classicVrml,
                             const CustomType* custom = nullptr);

/// Prints a value: in ClassicVRML with brackets and quotes as needed; in XML as an attribute's value before `&`, `<`
/// and quotes are escaped; in JSON with vectors as arrays, MF values as arrays of those, and NaN and infinity as null.
/// A node prints as NULL, or as `#` and its number (JSON: the number).
std::string printFieldText(const Value& value, TextSyntax syntax = TextSyntax::classicVrml);
void appendFieldText(std::string& out, const Value& value, TextSyntax syntax);

/// The text as a JSON string with its quotes. Bytes that are not UTF-8 become U+FFFD.
std::string jsonString(std::string_view text);

/// Escapes for content and attributes of HTML and XML (1.0, 2.2 and 2.4). Control characters, which XML cannot have,
/// become U+FFFD.
std::string escapeMarkup(std::string_view text);

}  // namespace rtsg
