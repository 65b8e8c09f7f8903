// Files of other programs: what they become, what is wrong with them, and what is named and not read.
#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <rtsg/documents/loader.h>
#include <rtsg/documents/writer.h>

#include "core/scene_check.h"
#include "documents/recording_handler.h"
#include "import/import.h"
#include "imported.h"

namespace rtsg {
namespace {

using test::binaryStl;
using test::Imported;
using test::put;
using test::RecordingHandler;
using testing::HasSubstr;
using testing::Not;

TEST(ImportStl, TextAndBinaryGiveTheSameMeshWithEachPointOnce) {
    const Imported text(
        "solid two facets\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n   vertex 1 1e0 0\n"
        "  endloop\n endfacet\n facet normal 0 0 1\n outer loop\nvertex 0 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\n"
        "endfacet\nendsolid\n");
    EXPECT_EQ(text.problems, "");
    EXPECT_THAT(text.commands, HasSubstr("begin IndexedTriangleSet in geometry"));
    EXPECT_THAT(text.commands, HasSubstr("set index MFInt32 [0, 1, 2, 0, 2, 3]"));
    EXPECT_THAT(text.commands, HasSubstr("set point MFVec3f [0 0 0, 1 0 0, 1 1 0, 0 1 0]"));
    EXPECT_THAT(text.commands, HasSubstr("meta title=two facets"));
    for (const char* title : {"title", "solid, says this binary file; facet"}) {
        const Imported binary(binaryStl({{0, 0, 0, 1, 0, 0, 1, 1, 0}, {0, 0, 0, 1, 1, 0, -0.0f, 1, 0}}, title));
        EXPECT_EQ(binary.problems, "");
        EXPECT_EQ(binary.commands.substr(binary.commands.find("begin Shape")),
                  text.commands.substr(text.commands.find("begin Shape")));
    }
}

TEST(ImportStl, ANameInAnotherEncodingIsWrittenAsText) {
    const Imported latin(
        "solid caf\xE9\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\nendfacet\n"
        "endsolid\n");
    EXPECT_EQ(latin.problems, "");
    EXPECT_THAT(latin.commands, HasSubstr("meta title=caf\xEF\xBF\xBD"));
}

TEST(ImportStl, FaultsAreNamedAndTheRestIsKept) {
    const Imported bad(
        "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 zero 0\nvertex 1 1 0\nendloop\nendfacet\n"
        "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\nendfacet\n"
        "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n");
    EXPECT_THAT(bad.problems, HasSubstr("test:5:1: error: expected three numbers behind vertex"));
    EXPECT_THAT(bad.problems, HasSubstr("test:13:1: error: a facet has three corners"));
    EXPECT_THAT(bad.commands, HasSubstr("set index MFInt32 [0, 1, 2]"));
    const Imported empty("solid x\nendsolid x\n");
    EXPECT_FALSE(empty.good);
    EXPECT_THAT(empty.problems, HasSubstr("has no facets"));
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const Imported holes(binaryStl({{{nan, 2, 3, 4, -std::numeric_limits<float>::infinity(), 6, 7, 8, 9}}}));
    EXPECT_THAT(holes.problems, HasSubstr("2 numbers of the STL file are not finite; 0 is taken instead [parse]"));
    EXPECT_THAT(holes.commands, HasSubstr("set point MFVec3f [0 2 3, 4 0 6, 7 8 9]"));
}

TEST(ImportPly, TextAndBinaryOfBothByteOrdersGiveTheSame) {
    const std::string head =
        "element vertex 3\ncomment a remark\nproperty float x\nproperty double y\nproperty short z\nproperty uchar "
        "red\n"
        "property uchar green\nproperty uchar blue\nelement face 1\nproperty list uchar int "
        "vertex_indices\nend_header\n";
    const Imported text("ply\nformat ascii 1.0\n" + head + "0 0 0 255 0 0\n1 0 0 0 255 0\n0 1.5 2 0 0 255\n3 0 1 2\n");
    EXPECT_EQ(text.problems, "");
    EXPECT_THAT(text.commands, HasSubstr("set index MFInt32 [0, 1, 2]"));
    EXPECT_THAT(text.commands, HasSubstr("set point MFVec3f [0 0 0, 1 0 0, 0 1.5 2]"));
    EXPECT_THAT(text.commands, HasSubstr("set color MFColorRGBA [1 0 0 1, 0 1 0 1, 0 0 1 1]"));
    for (const bool big : {false, true}) {
        std::string bytes = std::string("ply\nformat binary_") + (big ? "big" : "little") + "_endian 1.0\n" + head;
        const auto add = [&](auto value) {
            std::string raw;
            put(raw, value);
            if (big) std::ranges::reverse(raw);
            bytes += raw;
        };
        const float x[3] = {0, 1, 0};
        const double y[3] = {0, 0, 1.5};
        for (std::size_t i = 0; i < 3; ++i) {
            add(x[i]);
            add(y[i]);
            add(static_cast<std::int16_t>(i == 2 ? 2 : 0));
            for (std::size_t c = 0; c < 3; ++c) add(static_cast<std::uint8_t>(c == i ? 255 : 0));
        }
        add(std::uint8_t{3});
        for (std::int32_t i = 0; i < 3; ++i) add(i);
        const Imported binary(bytes);
        EXPECT_EQ(binary.problems, "");
        EXPECT_EQ(binary.commands, text.commands);
        const Imported cut(bytes.substr(0, bytes.size() - 6));
        EXPECT_THAT(cut.problems, HasSubstr("the file ends within its 1 elements 'face'"));
        EXPECT_THAT(cut.commands, HasSubstr("begin PointSet"));
    }
}

TEST(ImportPly, PolygonsPointsAndAbsurdCounts) {
    const std::string head =
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
    const std::string points = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
    const Imported quad(head + "element face 2\nproperty list uchar int vertex_index\nend_header\n" + points +
                        "4 0 1 2 3\n3 0 1 9\n");
    EXPECT_THAT(quad.commands, HasSubstr("set coordIndex MFInt32 [0, 1, 2, 3, -1]"));
    EXPECT_THAT(quad.problems, HasSubstr("names fewer than three vertices, or one that there is not"));
    EXPECT_THAT(Imported(head + "end_header\n" + points).commands, HasSubstr("begin PointSet in geometry"));
    const Imported absurd(
        "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nend_header\n");
    EXPECT_FALSE(absurd.good);
    EXPECT_THAT(absurd.problems, HasSubstr("the file ends within its 4000000000 elements 'vertex'"));
    EXPECT_THAT(Imported("ply\nformat ascii 1.0\nelement vertex many\n").problems,
                HasSubstr("expected 'element NAME COUNT'"));
    EXPECT_THAT(Imported("ply\nformat binary_middle_endian 1.0\nelement vertex 1\n").problems,
                HasSubstr("test:2:1: error: 'binary_middle_endian' is no format of PLY files"));
    // Elements of no bytes, so that the end of the file does not stop the reader.
    for (const char* element : {"vertex", "face", "other"}) {
        const Imported empty(std::string("ply\nformat binary_little_endian 1.0\nelement ") + element +
                             " 9000000000000000000\nend_header\n");
        EXPECT_THAT(empty.problems, HasSubstr("the PLY file has no vertices"));
    }
    std::string hole =
        "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty double y\nend_header\n";
    put(hole, std::numeric_limits<float>::infinity());
    put(hole, 1e300);
    EXPECT_THAT(Imported(hole).problems, HasSubstr("2 numbers of the PLY file are not finite"));
    EXPECT_THAT(Imported(hole).commands, HasSubstr("set point MFVec3f [0 0 0]"));
}

TEST(ImportObj, WhatIsNotImportedIsNamedOnce) {
    const Imported file("v 0 0 0\nv 1 0 0\nv 0 1 0\ns 1\nl 1 2\nf 1 2 3\nl 2 3\np 1\n# p 2\n");
    EXPECT_EQ(file.problems,
              "test:5:1: warning: what 'l' says is not imported; only faces and their materials are [parse]\n"
              "test:8:1: warning: what 'p' says is not imported; only faces and their materials are [parse]\n");
}

TEST(ImportObj, NamesInAnotherEncodingAreWrittenAsText) {
    const std::filesystem::path folder =
        std::filesystem::path(testing::TempDir()) / ("import_obj_names_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder);
    std::ofstream(folder / "a.obj") << "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl m\ng caf\xE9\nf 1 2 3\n";
    std::ofstream(folder / "a.mtl") << "newmtl m\nmap_Kd t\xFCr.png\n";
    std::string written;
    Diagnostics problems((folder / "a.obj").string()), writing;
    const auto writer = makeWriter(Encoding::classicVrml, [&](std::string_view text) { written += text; }, writing);
    ASSERT_TRUE(readDocumentFile(folder / "a.obj", *writer, problems));
    EXPECT_EQ(test::allText(problems) + test::allText(writing), "");
    EXPECT_THAT(written, HasSubstr("DEF caf\xEF\xBF\xBD Shape"));
    EXPECT_THAT(written, HasSubstr("url [\"t\xEF\xBF\xBDr.png\"]"));
    std::filesystem::remove_all(folder);
}

TEST(ImportObj, FacesWithMaterialsFromTheLibraryBesideIt) {
    const std::filesystem::path folder =
        std::filesystem::path(testing::TempDir()) / ("import_obj_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder);
    std::ofstream(folder / "a.obj")
        << "# a comment\nmtllib a.mtl\no square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
           "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\nusemtl red\nf 1/1/1 2/2/1 3/3/1 4/4/1\n"
           "usemtl blue\nf -4//-1 -3//-1 -2//-1\nf 1 2 17\nf 1 2\n";
    std::ofstream(folder / "a.mtl")
        << "newmtl red\nKd 1 0 0\nNs 64\nd 0.25\nmap_Kd -clamp on red.png\nnewmtl blue\nKd 0 0 1\n";
    RecordingHandler handler;
    Diagnostics problems((folder / "a.obj").string());
    EXPECT_TRUE(readDocumentFile(folder / "a.obj", handler, problems));
    const std::string commands = handler.text();
    EXPECT_THAT(commands, HasSubstr("set diffuseColor SFColor 1 0 0\n"));
    EXPECT_THAT(commands, HasSubstr("set shininess SFFloat 0.5\nset transparency SFFloat 0.75"));
    EXPECT_THAT(commands, HasSubstr("set url MFString [\"red.png\"]"));
    EXPECT_THAT(commands,
                HasSubstr("set coordIndex MFInt32 [0, 1, 2, 3, -1]\nset normalIndex MFInt32 [0, 0, 0, 0, -1]\n"
                          "set texCoordIndex MFInt32 [0, 1, 2, 3, -1]"));
    EXPECT_THAT(commands, HasSubstr("set diffuseColor SFColor 0 0 1\n"));
    EXPECT_THAT(commands,
                HasSubstr("set coordIndex MFInt32 [0, 1, 2, -1]\nset normalIndex MFInt32 [0, 0, 0, -1]\nbegin"));
    EXPECT_THAT(commands, HasSubstr("set point MFVec3f [0 0 0, 1 0 0, 1 1 0]"));
    EXPECT_THAT(test::allText(problems), HasSubstr("'17' names no vertex"));
    EXPECT_THAT(test::allText(problems), HasSubstr("a face has at least three vertices"));
    // Nothing outside of the folder is opened for it.
    std::ofstream(folder / "b.obj") << "mtllib ../../../../etc/passwd\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n";
    Diagnostics refused("b.obj");
    RecordingHandler second;
    EXPECT_TRUE(readDocumentFile(folder / "b.obj", second, refused));
    EXPECT_THAT(test::allText(refused), HasSubstr("the material library ../../../../etc/passwd: "));
    std::filesystem::remove_all(folder);
}

TEST(ImportObj, NamesOfGroupsAndMaterialsSurvive) {
    const std::filesystem::path folder =
        std::filesystem::path(testing::TempDir()) / ("import_names_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder);
    std::ofstream(folder / "a.obj") << "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\no Door\nusemtl Oak\nf 1 2 3\n"
                                       "o Wall\nusemtl Oak\nf 1 2 3\no Door\nf 3 2 1\n";
    std::ofstream(folder / "a.mtl") << "newmtl Oak\nKd 1 0 0\n";
    RecordingHandler handler;
    Diagnostics problems((folder / "a.obj").string());
    EXPECT_TRUE(readDocumentFile(folder / "a.obj", handler, problems));
    EXPECT_EQ(test::allText(problems), "");
    const std::string commands = handler.text();
    EXPECT_THAT(
        commands,
        HasSubstr("begin Shape DEF Door\nbegin Appearance in appearance\nbegin Material DEF Oak in material\n"));
    EXPECT_THAT(commands, HasSubstr("begin Shape DEF Wall\nbegin Appearance in appearance\nuse Oak in material\n"));
    EXPECT_THAT(commands, HasSubstr("begin Shape DEF Door_2\n"));
    std::filesystem::remove_all(folder);
}

TEST(ImportedPoints, AreNotBlack) {
    const char* unlit = "begin Appearance in appearance\nbegin UnlitMaterial in material\nend\nend\nbegin PointSet";
    const std::string ply =
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
    EXPECT_THAT(Imported(ply + "end_header\n0 1 2\n").commands, HasSubstr(unlit));
    EXPECT_THAT(Imported("v 0 0 0\nv 1 2 3\n").commands, HasSubstr(unlit));
    // Points with normals are lit.
    EXPECT_THAT(
        Imported(ply + "property float nx\nproperty float ny\nproperty float nz\nend_header\n0 1 2 0 0 1\n").commands,
        HasSubstr("begin Material in material"));
}

TEST(FileKinds, AreKnownBehindALongComment) {
    std::string comment;
    while (comment.size() < 10'000) comment += "# a remark of the program that wrote this\n";
    EXPECT_THAT(Imported(comment + "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").commands, HasSubstr("begin Shape"));
}

TEST(FileKinds, WhatIsNotReadIsNamedInOneLine) {
    const auto says = [](std::string_view bytes) {
        const Imported file(bytes);
        EXPECT_FALSE(file.good);
        EXPECT_EQ(std::ranges::count(file.problems, '\n'), 1) << file.problems;
        return file.problems;
    };
    EXPECT_THAT(says("#VRML V1.0 ascii\nSeparator { }\n"), HasSubstr("VRML 1.0"));
    EXPECT_THAT(says(std::string_view("\xE0\x00\x00\x01\x00xyz", 8)), HasSubstr("X3DB"));
    EXPECT_THAT(says("\x89PNG\r\n\x1a\n"), HasSubstr("a picture (PNG)"));
    EXPECT_THAT(says("PK\x03\x04 zip"), HasSubstr("a ZIP archive"));
    EXPECT_THAT(says(std::string_view("glTF\x01\0\0\0\x20\0\0\0\x0c\0\0\0\0\0\0\0{\"asset\":{}}", 32)),
                HasSubstr("GLB of version 1 is not read, 2 is (version 1 is that of glTF 1.0)"));
    EXPECT_THAT(says("#usda 1.0\ndef Xform \"a\" { }\n"), HasSubstr("a USD file, as text"));
    EXPECT_THAT(says(std::string_view("PXR-USDC\0\x08\0\0", 12)), HasSubstr("a USD file, binary"));
    EXPECT_THAT(says("ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('IFC4'));\n"), HasSubstr("as IFC files are"));
    EXPECT_THAT(says("<?xml version='1.0'?><!-- a --><COLLADA xmlns='x' version='1.4.1'><asset/></COLLADA>"),
                HasSubstr("the Collada file cannot be read"));
    EXPECT_THAT(says("<svg xmlns='x'/>"), HasSubstr("a picture (SVG)"));
    const auto utf16 = [](std::string_view text, bool bigEndian) {
        std::string bytes = bigEndian ? "\xFE\xFF" : "\xFF\xFE";
        for (const char c : text) bytes += bigEndian ? std::string{'\0', c} : std::string{c, '\0'};
        return bytes;
    };
    for (const bool bigEndian : {false, true}) {
        EXPECT_THAT(says(utf16("v 0 0 0\nv 1 0 0\n", bigEndian)), HasSubstr("OBJ, PLY and STL are in ASCII or UTF-8"));
        EXPECT_THAT(says(utf16("# Blender\nv 0 0 0\n", bigEndian)), HasSubstr("OBJ, PLY and STL"));
        EXPECT_THAT(says(utf16("#X3D V4.0 utf8\n", bigEndian)), HasSubstr("ClassicVRML or JSON in UTF-16"));
        EXPECT_EQ(Imported(utf16("<?xml version='1.0' encoding='UTF-16'?><X3D version='4.0'/>", bigEndian)).problems,
                  "");
    }
    EXPECT_THAT(says("Kaydara FBX Binary  "), HasSubstr("the FBX file cannot be read"));
    EXPECT_THAT(says(std::string_view("\x01\x02 abc\0\xFF", 8)), HasSubstr("is no text"));
    EXPECT_THAT(says("[1, 2, 3]"), HasSubstr("a list of JSON, which is no X3D"));
    const std::string stl = binaryStl({{{0, 0, 0, 1, 0, 0, 0, 1, 0}}});
    EXPECT_THAT(says(stl.substr(0, stl.size() - 3)), HasSubstr("50 for each facet"));
    EXPECT_THAT(says(stl + "more"), HasSubstr("50 for each facet"));
    // In a document a zero byte is the reader's to name.
    EXPECT_THAT(Imported(std::string_view("#X3D V4.0 utf8\nGroup { \0 }", 27)).problems, HasSubstr("zero"));
    EXPECT_THAT(Imported(std::string_view("<X3D>\0</X3D>", 13)).problems, Not(HasSubstr("no text")));
}

}  // namespace
}  // namespace rtsg
