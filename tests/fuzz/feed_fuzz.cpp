// Bytes of any kind as a feed: lines of JSON and CSV, what a live viewer asks for. Whatever they say, each line is read
// or an error with a column, and a value for a field is the same after it is printed and read again.
#include <cstdint>
#include <cstdlib>

#include <rtsg/core/field_text.h>

#include "lines/feed_line.h"
#include "lines/line_splitter.h"
#include "lines/viewer_request.h"

namespace {

using namespace rtsg;

void expect(bool condition) {
    if (!condition) std::abort();
}

void checkValue(const feeds::FeedLine& line) {
    using T = FieldType;
    for (const T type : {T::SFBool,  T::SFInt32, T::SFFloat,    T::SFDouble, T::SFTime,     T::SFString,   T::SFVec2f,
                         T::SFVec3f, T::SFVec3d, T::SFRotation, T::SFColor,  T::SFImage,    T::SFMatrix3f, T::MFBool,
                         T::MFInt32, T::MFFloat, T::MFString,   T::MFVec3f,  T::MFRotation, T::SFNode,     T::MFNode}) {
        const auto value = feeds::valueOf(line, type);
        if (!value) continue;
        expect(type != T::SFNode && type != T::MFNode);
        feeds::FeedLine again;
        again.value = printFieldText(*value);
        const auto same = feeds::valueOf(again, type);
        // What is not finite has no text.
        expect(!same || printFieldText(*same) == again.value);
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string_view bytes(reinterpret_cast<const char*>(data), size);
    (void)feeds::readViewerRequest(std::string(bytes));
    feeds::FeedReader reader;
    feeds::LineSplitter splitter;
    const auto take = [&](std::string_view line, bool isTooLong) {
        expect(line.size() <= feeds::kLongestLine);
        if (isTooLong) return;
        const auto read = reader.read(line);
        if (!read) return expect(!read.error().text.empty());
        if (*read) checkValue(**read);
    };
    for (std::size_t at = 0; at < bytes.size(); at += 7) splitter.add(bytes.substr(at, 7), take);
    splitter.finish(take);
    return 0;
}
