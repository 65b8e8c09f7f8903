// Passes commands to a writer until one of them throws.
#include "guarded_writer.h"

#include <utility>

namespace rtsg::detail {

GuardedWriter::GuardedWriter(const FormatWriter& format, TextSink sink, Diagnostics& diagnostics)
    : format_(format.name) {
    try {
        writer_ = format.make(std::move(sink), diagnostics);
        if (!writer_) noteFailure("there is none");
    } catch (const std::exception& e) {
        noteFailure(e.what());
    } catch (...) {
        noteFailure("it says not why");
    }
}

void GuardedWriter::noteFailure(std::string_view why) {
    state_ = fail("the writer of " + format_ + " files failed: " + std::string(why));
}

}  // namespace rtsg::detail
