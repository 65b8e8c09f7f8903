// Memory that untrusted documents may take: Inlines, prototypes and worlds, compressed and in data: urls. Each test
// states its bound.
#include <algorithm>
#include <fstream>

#include <gmock/gmock.h>
#include <malloc.h>
#include <zlib.h>

#include <rtsg/core/document_services.h>
#include <rtsg/core/machine.h>
#include <rtsg/documents/command_list.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/world.h>

#include "core/scene_check.h"
#include "support/taken_memory.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using test::kMegabyte;
using testing::HasSubstr;

std::string timesOver(std::string_view text, std::size_t count) {
    std::string result;
    result.reserve(text.size() * count);
    for (std::size_t i = 0; i < count; ++i) result += text;
    return result;
}

std::string gzipped(const std::string& text) {
    z_stream stream{};
    EXPECT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY), Z_OK);
    std::string packed(deflateBound(&stream, static_cast<uLong>(text.size())), '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
    stream.avail_in = static_cast<uInt>(text.size());
    stream.next_out = reinterpret_cast<Bytef*>(packed.data());
    stream.avail_out = static_cast<uInt>(packed.size());
    EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
    packed.resize(stream.total_out);
    deflateEnd(&stream);
    return packed;
}

std::string hex(std::string_view bytes) {
    std::string result;
    for (const char c : bytes) {
        constexpr char digits[] = "0123456789ABCDEF";
        const auto byte = static_cast<unsigned char>(c);
        result += {'%', digits[byte >> 4], digits[byte & 15]};
    }
    return result;
}

class DocumentLimits : public testing::Test {
  protected:
    DocumentLimits() {
        if (!test::kMemoryIsOurs) return;
        policy.roots = {folder.path()};
        policy.maximumNodes = 1000;
        policy.maximumBytes = 128 * kMegabyte;
    }
    void SetUp() override {
        if (!test::kMemoryIsOurs) GTEST_SKIP() << "sanitizers have memory of their own";
    }
    void write(const std::string& name, const std::string& bytes) const {
        std::ofstream(folder / name, std::ios::binary) << bytes;
    }
    Resources resources() const { return {folder.path(), policy}; }
    /// Memory that loading the text takes, which has to end in an error of these words.
    std::size_t takenByLoading(const std::string& text, const std::string& says) const {
        return test::takenBy([&] {
            Scene scene;
            Diagnostics diagnostics("main");
            LoadOptions options;
            options.resources = resources();
            loadText(scene, "#X3D V4.0 utf8\n" + text, diagnostics, {}, options);
            const std::string problems = test::allText(diagnostics);
            EXPECT_TRUE(problems.contains(says)) << problems.substr(0, 2000);
            return problems.contains(says);
        });
    }

    const test::TempFolder folder;
    ResourcePolicy policy;
    // Seven million nodes are in 50 kB.
    const std::size_t many = 3'000'000;
    const std::string head = "#X3D V4.0 utf8\n";
    const std::string tooMany = "make more than 1000 nodes; the rest is left out, unless --limit nodes=N";
};

TEST_F(DocumentLimits, NodesOfInlinesAreCountedWhileTheyAreRead) {
    write("a.x3dv.gz", gzipped(head + timesOver("Group{}", many)));
    write("a.x3d.gz", gzipped("<X3D version='4.0'><Scene>" + timesOver("<Group/>", many) + "</Scene></X3D>"));
    write("a.json.gz", gzipped("{\"X3D\":{\"@version\":\"4.0\",\"Scene\":{\"-children\":[" +
                               timesOver("{\"Group\":{}},", many) + "{\"Group\":{}}]}}}"));
    write("nested.x3dv.gz", gzipped(head + timesOver("Group{children[", 900) + timesOver("Group{}", many)));
    for (const char* file : {"a.x3dv.gz", "a.x3d.gz", "nested.x3dv.gz"})
        EXPECT_LT(takenByLoading("Inline { url \"" + std::string(file) + "\" }", tooMany), 16 * kMegabyte) << file;
    // For JSON, the places of brackets are found first.
    EXPECT_LT(takenByLoading("Inline { url \"a.json.gz\" }", tooMany), 160 * kMegabyte);
    write("a.x3dv", head + timesOver("Group{}", many));
    EXPECT_LT(takenByLoading("Inline { url \"a.x3dv\" }", tooMany), 16 * kMegabyte);
}

// Where reading ends at a limit nothing else is wrong.
TEST_F(DocumentLimits, OnlyTheLimitIsReported) {
    write("a.x3dv.gz", gzipped(head + timesOver("Group{}", many)));
    write("a.x3d.gz", gzipped("<X3D version='4.0'><Scene>" + timesOver("<Group/>", many) + "</Scene></X3D>"));
    for (const char* file : {"a.x3dv.gz", "a.x3d.gz"}) {
        Scene scene;
        Diagnostics diagnostics("main");
        LoadOptions options;
        options.resources = resources();
        loadText(scene, "#X3D V4.0 utf8\nInline { url \"" + std::string(file) + "\" }", diagnostics, {}, options);
        ASSERT_EQ(diagnostics.all().size(), 1u) << test::allText(diagnostics);
        EXPECT_THAT(diagnostics.all()[0].format(), HasSubstr(std::string(file) + (file[5] == 'v' ? ":2:7" : ":1:80")));
        EXPECT_EQ(scene.nodeCount(), 1002u);  // with the Inline and the root
    }
}

TEST_F(DocumentLimits, InDataUrlsToo) {
    const std::string packed = gzipped(head + timesOver("Group{}", many));
    ASSERT_LT(packed.size(), 50'000u);
    EXPECT_LT(takenByLoading("Inline { url \"data:model/x3d+vrml," + hex(packed) + "\" }", tooMany), 16 * kMegabyte);
}

TEST_F(DocumentLimits, WhatIsNoNodeIsCountedByItsBytes) {
    policy.maximumBytes = 32 * kMegabyte;
    const std::string says = "takes more than 33554432 bytes; the rest is left out, unless --limit bytes=N";
    for (const char* each : {"USE A ", "ROUTE A.a TO A.b\n", "#c\n\n", "META \"a\" \"b\"\n"}) {
        write("a.x3dv.gz", gzipped(head + "DEF A Group{}\n" + timesOver(each, many)));
        // A list that grows is there twice.
        EXPECT_LT(takenByLoading("Inline { url \"a.x3dv.gz\" }", says), 160 * kMegabyte) << each;
    }
    write("a.x3dv.gz", gzipped(head + "MetadataString{value[" + timesOver("\"a\"", many) + "]}"));
    EXPECT_LT(takenByLoading("Inline { url \"a.x3dv.gz\" }", says), 96 * kMegabyte);
    // The text alone may be too long.
    write("a.x3dv.gz", gzipped(head + "#" + std::string(64 * kMegabyte, 'c')));
    EXPECT_LT(takenByLoading("Inline { url \"a.x3dv.gz\" }", says), 128 * kMegabyte);
}

// Each line is added to those before it, once: this took minutes as they were copied.
TEST_F(DocumentLimits, ACommentMayHaveMillionsOfLines) {
    CommandList commands;
    Diagnostics diagnostics("main");
    EXPECT_TRUE(readDocument(head + timesOver("#c\n", many) + "Group{}", commands, diagnostics));
    EXPECT_EQ(test::allText(diagnostics), "");
    EXPECT_EQ(commands.firstNodeType(), "Group");
}

TEST_F(DocumentLimits, LibrariesOfPrototypesAreInlinesInThis) {
    write("a.x3dv.gz", gzipped(head + "PROTO P [] { " + timesOver("Group{}", many) + "}"));
    EXPECT_LT(takenByLoading("EXTERNPROTO P [] \"a.x3dv.gz#P\" P { }", tooMany), 16 * kMegabyte);
}

TEST_F(DocumentLimits, OfWhatScriptsAndAnchorsLoad) {
    write("a.x3dv.gz", gzipped(head + timesOver("Group{}", many)));
    const auto taken = [&](DocumentRequest::Kind kind) {
        return test::takenBy([&] {
            Scene scene;
            registerDocuments(scene);
            DocumentRequest request;
            request.kind = kind;
            request.urls = {"a.x3dv.gz"};
            const Resources may = resources();
            (void)scene.documents().serve(scene, request, &may);
            const std::string problems = test::allText(scene.diagnostics());
            EXPECT_THAT(problems, HasSubstr(tooMany));
            return problems.contains(tooMany) && scene.nodeCount() < 1100;
        });
    };
    EXPECT_LT(taken(DocumentRequest::Kind::piece), 16 * kMegabyte);
    EXPECT_LT(taken(DocumentRequest::Kind::world), 16 * kMegabyte);
}

TEST_F(DocumentLimits, TheProcessMayHoldSoMuchAndNoMore) {
    policy.maximumNodes = UINT64_MAX;
    policy.maximumBytes = std::uint64_t{1} << 30;
    const auto takenWithin = [&](const std::string& file, std::size_t limit) {
        return test::takenBy([&] {
            ::malloc_trim(0);  // what earlier tests have given back
            setMemoryLimit(heldMemory() + limit);
            Scene scene;
            Diagnostics diagnostics("main");
            loadFile(scene, folder / file, diagnostics);
            const auto isOfMemory = [](const Diagnostic& d) { return d.code == DiagnosticCode("memory"); };
            EXPECT_TRUE(std::ranges::any_of(diagnostics.all(), isOfMemory)) << test::allText(diagnostics);
            return std::ranges::any_of(diagnostics.all(), isOfMemory);
        });
    };
    write("nodes.x3dv", head + timesOver("Group{}", many));
    EXPECT_LT(takenWithin("nodes.x3dv", 64 * kMegabyte), 96 * kMegabyte);
    write("numbers.x3dv.gz", gzipped(head + "MetadataDouble{value[" + timesOver("0 ", 60'000'000) + "]}"));
    EXPECT_LT(takenWithin("numbers.x3dv.gz", 64 * kMegabyte), 160 * kMegabyte);
    write("inline.x3dv", head + "Inline { url \"nodes.x3dv\" }");
    EXPECT_LT(takenWithin("inline.x3dv", 64 * kMegabyte), 96 * kMegabyte);
}

// The counts of these files stand for nothing that is in them.
TEST_F(DocumentLimits, CountsOfImportedFilesAreNotBelieved) {
    write("zeros.gltf", R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
        "accessors":[{"componentType":5126,"type":"VEC3","count":200000000,"sparse":{"count":1,
            "indices":{"bufferView":0,"componentType":5121},"values":{"bufferView":0}}}],
        "bufferViews":[{"buffer":0,"byteLength":12}],
        "buffers":[{"byteLength":12,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAA"}]})");
    EXPECT_LT(takenByLoading("Inline { url \"zeros.gltf\" }", "counts 200000000 elements, more than there can be"),
              16 * kMegabyte);
    write("values.gltf.gz", gzipped(R"({"asset":{"version":"2.0"},"extras":[)" + timesOver("{},", 10'000'000) + "0]}"));
    EXPECT_LT(takenByLoading("Inline { url \"values.gltf.gz\" }", "JSON take more than 134217728 bytes"),
              64 * kMegabyte);
}

}  // namespace
}  // namespace rtsg
