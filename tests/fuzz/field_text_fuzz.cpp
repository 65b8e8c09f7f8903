// The first byte chooses type and syntax; whatever is accepted must survive printing and parsing.
#include <cstdint>

#include <rtsg/core/field_text.h>

#include "reading.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace rtsg;
    if (size == 0) return 0;
    const auto type = static_cast<FieldType>(data[0] % kFieldTypeCount);
    const TextSyntax syntax = data[0] / kFieldTypeCount % 2 ? TextSyntax::xml : TextSyntax::classicVrml;
    const std::string_view text(reinterpret_cast<const char*>(data + 1), size - 1);
    const Result<Value> value = parseFieldText(type, text, syntax);
    if (!value) return 0;
    for (const TextSyntax other : {TextSyntax::classicVrml, TextSyntax::xml}) {
        const std::string printed = printFieldText(*value, other);
        const Result<Value> back = parseFieldText(type, printed, other);
        fuzz::require(back && *back == *value, "printing and parsing changed the value", printed, Diagnostics());
    }
    return 0;
}
