// What holds for every text, whatever it is: reading ends, commands nest, failure is reported; and what was understood
// can be written, read back without an error but for those of what is kept, and written again to the same text.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

#include <rtsg/documents/loader.h>
#include <rtsg/documents/writer.h>

#include "documents/recording_handler.h"

namespace rtsg::fuzz {

inline void require(bool holds, const char* what, std::string_view text, const Diagnostics& diagnostics) {
    if (holds) return;
    std::fprintf(stderr, "VIOLATED: %s\n", what);
    for (const Diagnostic& d : diagnostics.all()) std::fprintf(stderr, "%s\n", d.format().c_str());
    std::fprintf(stderr, "----\n%.*s\n", static_cast<int>(text.size()), text.data());
    std::abort();
}

inline std::string rewrite(std::string_view text, Encoding encoding, Diagnostics& reading) {
    std::string out;
    Diagnostics writing;
    readDocument(text, *makeWriter(encoding, [&](std::string_view t) { out += t; }, writing), reading);
    return out;
}

/// Nodes in fields that there are not are an error each time they are read, and are kept each time.
inline bool isFaultless(const Diagnostics& diagnostics) {
    for (const Diagnostic& d : diagnostics.all())
        if (d.severity == Severity::error && !d.text.contains("what is in it is kept under its name")) return false;
    return true;
}

inline void checkText(std::string_view text) {
    test::RecordingHandler handler;
    handler.quiet = true;
    Diagnostics diagnostics;
    const bool usable = readDocument(text, handler, diagnostics);
    require(handler.violation.empty(), handler.violation.c_str(), text, diagnostics);
    require(usable || diagnostics.errors() > 0, "failure without an error", text, diagnostics);
    require(!usable || handler.complete(), "not ended", text, diagnostics);
    if (!usable && handler.header.version.empty()) return;
    for (const Encoding encoding : {Encoding::classicVrml, Encoding::xml, Encoding::vrml97, Encoding::json}) {
        Diagnostics first, second, third;
        const std::string written = rewrite(text, encoding, first);
        if (written.empty()) continue;
        const std::string again = rewrite(written, encoding, second);
        require(isFaultless(second), "what was written is read with errors", written, second);
        const std::string last = rewrite(again, encoding, third);
        require(again == last, "writing is not stable", again + "\n--------\n" + last, third);
    }
}

}  // namespace rtsg::fuzz
