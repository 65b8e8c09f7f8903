// One field value as text: parsing and printing in the three text encodings.
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

/// The whole of `text` must be one value; XML is taken as the attribute's value, entities already resolved. JSON is
/// not parsed. Nodes: only NULL and [ ] are values. The diagnostic's position counts from the start of `text`.
/// `custom`: which type SFCustom and MFCustom are. Their own text stands in quotes, and their numbers without; in XML
/// the text of a single value may stand without, too.
Result<Value> parseFieldText(FieldType type, std::string_view text, TextSyntax syntax = TextSyntax::classicVrml,
                             const CustomType* custom = nullptr);

/// ClassicVRML with brackets and quotes as needed; XML as an attribute's value before escaping `&`, `<` and quotes;
/// JSON with vectors as arrays and MF values as arrays of those, NaN and infinity as null. A node prints as NULL, or
/// as `#` and its number (JSON: the number).
std::string printFieldText(const Value& value, TextSyntax syntax = TextSyntax::classicVrml);
void appendFieldText(std::string& out, const Value& value, TextSyntax syntax);

/// The text as a string of JSON, in its quotes. Bytes that are no UTF-8 become U+FFFD.
std::string jsonString(std::string_view text);

}  // namespace rtsg
