// Every scene of the collection beside the project, where it is present, must be read to its end.
#include <algorithm>
#include <filesystem>

#include <gtest/gtest.h>

#include <rtsg/documents/filters.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/writer.h>

#include "documents/reading.h"
#include "test_paths.h"

namespace rtsg {
namespace {

std::filesystem::path scenesFolder() {
    const char* named = std::getenv("RTSG_SCENES");
    return named ? std::filesystem::path(named) : std::filesystem::path(RTSG_SOURCE_DIR) / "../shared/scenes";
}

std::vector<std::filesystem::path> sceneFiles() {
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(scenesFolder())) {
        const std::string extension = entry.path().extension();
        if (extension == ".x3d" || extension == ".x3dv" || extension == ".wrl" || extension == ".gz" ||
            extension == ".x3dz" || extension == ".json")
            files.push_back(entry.path());
    }
    std::ranges::sort(files);
    return files;
}

// The only errors are nodes and fields of one browser's own, and fields and PROTOs that two files give twice.
TEST(ReaderScenes, AllAreRead) {
    if (!std::filesystem::exists(scenesFolder())) GTEST_SKIP() << "no scenes in " << scenesFolder();
    for (const auto& file : sceneFiles()) {
        test::RecordingHandler handler;
        handler.quiet = true;
        Diagnostics diagnostics(file);
        EXPECT_TRUE(readDocumentFile(file, handler, diagnostics)) << file;
        EXPECT_TRUE(handler.complete()) << file << ": " << handler.violation;
        EXPECT_GT(handler.nodes, 0u) << file;
        for (const Diagnostic& d : diagnostics.all()) {
            const bool known = d.text.starts_with("unknown node type") || d.text.find("has no field") != d.text.npos ||
                               d.text.find("is given already") != d.text.npos ||
                               d.text.find("which stays") != d.text.npos;
            EXPECT_TRUE(d.severity == Severity::warning || known) << d.format();
        }
    }
}

TEST(ReaderScenes, AllRoundTripThroughXmlAndClassicVrml) {
    if (!std::filesystem::exists(scenesFolder())) GTEST_SKIP() << "no scenes in " << scenesFolder();
    for (const auto& file : sceneFiles()) {
        Diagnostics reading, writing;
        const auto rewrite = [&](const std::string& text, Encoding encoding) {
            std::string out;
            // Descriptions of declarations become comments in ClassicVRML.
            const auto writer = makeWriter(encoding, [&](std::string_view t) { out += t; }, writing);
            readDocument(text, **makeFilter("drop-comments", *writer, {writing}), reading);
            return out;
        };
        std::string first;
        readDocumentFile(file, *makeWriter(Encoding::xml, [&](std::string_view t) { first += t; }, writing), reading);
        const std::string xml = rewrite(first, Encoding::xml);  // in the writer's own order
        const std::string classic = rewrite(xml, Encoding::classicVrml);
        const std::string again = rewrite(classic, Encoding::xml);
        EXPECT_TRUE(xml == again) << file;
        const std::string json = rewrite(xml, Encoding::json);
        EXPECT_TRUE(rewrite(json, Encoding::json) == json) << file;
        test::RecordingHandler fromXml, fromClassic;
        Diagnostics ignored;
        readDocument(xml, fromXml, ignored);
        readDocument(classic, fromClassic, ignored);
        EXPECT_TRUE(fromXml.lines == fromClassic.lines) << file;
    }
}

}  // namespace
}  // namespace rtsg
