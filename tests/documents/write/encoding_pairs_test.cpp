// From every encoding to every other and back: the same document, byte for byte, of our own scenes and of the
// collection beside the project, where it is present.
#include <algorithm>
#include <filesystem>

#include <gtest/gtest.h>

#include <unistd.h>

#include <rtsg/documents/filter.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/writer.h>

#include "documents/reading.h"
#include "test_paths.h"

namespace rtsg {
namespace {

namespace fs = std::filesystem;

struct Named {
    Encoding encoding;
    const char *name, *packed;
};
constexpr Named kEncodings[] = {{Encoding::xml, "XML", ".x3dz"},
                                {Encoding::classicVrml, "ClassicVRML", ".x3dvz"},
                                {Encoding::json, "JSON", ".json.gz"}};

/// Comments keep their words and not always their places, and what is said about declarations is a comment in some.
class WithoutComments final : public Filter {
  public:
    using Filter::Filter;
    void comment(std::string_view, SourceLocation) override {}
    void documentation(const Documentation&, SourceLocation) override {}
    void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) override {
        Filter::declareField({field.access, field.type, field.name}, std::move(value), where);
    }
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override {
        std::vector<FieldDeclaration> bare;
        for (const FieldDeclaration& field : fields) bare.push_back({field.access, field.type, field.name});
        Filter::externProto(name, bare, url, where);
    }
};

struct Rewriter {
    Diagnostics reading, writing;

    std::string rewrite(const std::string& text, Encoding encoding) {
        std::string out;
        const auto writer = makeWriter(encoding, [&](std::string_view t) { out += t; }, writing);
        WithoutComments filter(*writer);
        readDocument(text, filter, reading);
        return out;
    }
    std::string rewriteFile(const fs::path& file, Encoding encoding) {
        std::string out;
        const auto writer = makeWriter(encoding, [&](std::string_view t) { out += t; }, writing);
        WithoutComments filter(*writer);
        readDocumentFile(file, filter, reading);
        return out;
    }
};

std::vector<fs::path> scenesBelow(const fs::path& folder) {
    std::vector<fs::path> files;
    if (!fs::exists(folder)) return files;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
        const std::string extension = entry.path().extension();
        if (extension == ".x3d" || extension == ".x3dv" || extension == ".wrl" || extension == ".json")
            files.push_back(entry.path());
    }
    std::ranges::sort(files);
    return files;
}

/// Through a file that is packed.
std::string throughGzip(const std::string& text, Encoding encoding, const char* extension) {
    const fs::path file = fs::temp_directory_path() / ("rtsg-pairs-" + std::to_string(::getpid()) + extension);
    Rewriter back;
    {
        const auto writer = DocumentFileWriter::create(file, back.writing);
        WithoutComments filter((*writer)->handler());
        readDocument(text, filter, back.reading);
        EXPECT_TRUE((*writer)->close());
    }
    std::string result = back.rewriteFile(file, encoding);
    fs::remove(file);
    return result;
}

/// How many pairs were gone through; each that differs fails.
std::size_t checkPairs(const std::vector<fs::path>& files) {
    std::size_t pairs = 0;
    for (const fs::path& file : files)
        for (const auto& [a, nameA, packed] : kEncodings) {
            Rewriter first;
            // With values before nodes, as XML and JSON have them, and in the order of A's own writer.
            const std::string original = first.rewrite(first.rewrite(first.rewriteFile(file, a), Encoding::xml), a);
            for (const auto& [b, nameB, other] : kEncodings) {
                if (a == b) continue;
                EXPECT_TRUE(first.rewrite(first.rewrite(original, b), a) == original)
                    << file << ": " << nameA << " -> " << nameB << " -> " << nameA;
                ++pairs;
            }
            EXPECT_TRUE(throughGzip(original, a, packed) == original) << file << ": " << nameA << " and gzip";
            // VRML97 has no head, IMPORT or EXPORT, and other names of fields: what it has comes back.
            const std::string old = first.rewrite(first.rewrite(original, Encoding::vrml97), a);
            EXPECT_TRUE(first.rewrite(first.rewrite(old, Encoding::vrml97), a) == old)
                << file << ": " << nameA << " -> VRML97 -> " << nameA;
            ++pairs;
        }
    return pairs;
}

TEST(EncodingPairs, OwnScenesComeBackFromEveryOtherEncoding) {
    EXPECT_GT(checkPairs(scenesBelow(fs::path(RTSG_SOURCE_DIR) / "examples")), 10u);
}

TEST(EncodingPairs, TheCollectionComesBackFromEveryOtherEncoding) {
    const char* named = std::getenv("RTSG_SCENES");
    const fs::path folder = named ? fs::path(named) : fs::path(RTSG_SOURCE_DIR) / "../shared/scenes";
    if (!fs::exists(folder)) GTEST_SKIP() << "no scenes in " << folder;
    EXPECT_GT(checkPairs(scenesBelow(folder)), 100u);
}

}  // namespace
}  // namespace rtsg
