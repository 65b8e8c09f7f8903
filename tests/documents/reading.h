// Reading a text into a RecordingHandler, with the checks that hold for every input.
#pragma once

#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include <rtsg/documents/loader.h>

#include "recording_handler.h"

namespace rtsg::test {

struct Read {
    RecordingHandler handler;
    Diagnostics diagnostics;
    bool usable = false;

    explicit Read(std::string_view text, bool quiet = false) : diagnostics(fileName(text)) {
        handler.quiet = quiet;
        usable = readDocument(text, handler, diagnostics);
        EXPECT_EQ(handler.violation, "");
        if (usable) {
            EXPECT_TRUE(handler.complete());
        } else {
            EXPECT_GT(diagnostics.errors(), 0u);
        }
    }
    std::string complaints() const {
        std::string all;
        for (const Diagnostic& d : diagnostics.all()) all += d.format() + "\n";
        return all;
    }

  private:
    static std::string fileName(std::string_view text) {
        return detectEncoding(text) == Encoding::xml ? "test.x3d" : "test.x3dv";
    }
};

inline Read readClassicScene(const std::string& body, bool quiet = false) {
    return Read("#X3D V4.0 utf8\nPROFILE Immersive\n" + body, quiet);
}
inline Read readXmlScene(const std::string& scene, bool quiet = false) {
    return Read("<X3D version='4.0' profile='Immersive'><Scene>" + scene + "</Scene></X3D>", quiet);
}

}  // namespace rtsg::test
