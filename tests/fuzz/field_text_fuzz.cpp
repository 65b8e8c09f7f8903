// The first byte chooses type and syntax; whatever is accepted must survive printing and parsing. Types from outside
// have numbers, bytes, and a text that is not always the same one again.
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/core/field_text.h>

#include "reading.h"

namespace {

/// "1.5@2": two numbers. Its text is lost beyond six digits; the numbers must then be printed instead.
rtsg::CustomFunctions pairText() {
    rtsg::CustomFunctions functions;
    functions.print = [](const rtsg::CustomValue& value) {
        const std::vector<double> numbers = rtsg::customNumbers(value);
        return std::to_string(numbers[0]) + "@" + std::to_string(numbers[1]);
    };
    functions.parse = [](const rtsg::CustomType& type, std::string_view text) -> rtsg::Result<rtsg::CustomValue> {
        double numbers[2] = {};
        const std::string copy(text);
        if (std::sscanf(copy.c_str(), "%lf@%lf", numbers, numbers + 1) != 2) return rtsg::fail("no pair");
        return type.value(numbers);
    };
    return functions;
}

const rtsg::CustomType* typeAt(unsigned which) {
    using Of = rtsg::CustomLayout::Of;
    static const std::shared_ptr<const rtsg::CustomType> types[] = {
        rtsg::registerFieldType("SFPair", {Of::float64, 2}, pairText()).value(),
        rtsg::registerFieldType("SFTag", {Of::bytes, 0}).value(),
        rtsg::registerFieldType("SFTriple", {Of::float32, 3}).value(),
        rtsg::registerFieldType("SFCount", {Of::int32, 1}).value()};
    return types[which % std::size(types)].get();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace rtsg;
    if (size == 0) return 0;
    const auto type = static_cast<FieldType>(data[0] % kFieldTypeCount);
    const TextSyntax syntax = data[0] / kFieldTypeCount % 2 ? TextSyntax::xml : TextSyntax::classicVrml;
    std::string_view text(reinterpret_cast<const char*>(data + 1), size - 1);
    const CustomType* custom = nullptr;
    if (sf(type) == FieldType::SFCustom && !text.empty()) {
        custom = typeAt(static_cast<unsigned char>(text[0]));
        text.remove_prefix(1);
    }
    const Result<Value> value = parseFieldText(type, text, syntax, custom);
    if (!value) return 0;
    for (const TextSyntax other : {TextSyntax::classicVrml, TextSyntax::xml}) {
        const std::string printed = printFieldText(*value, other);
        const Result<Value> back = parseFieldText(type, printed, other, custom);
        fuzz::require(back && *back == *value, "printing and parsing changed the value", printed, Diagnostics());
    }
    return 0;
}
