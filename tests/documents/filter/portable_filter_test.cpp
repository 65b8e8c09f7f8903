// Materials with metadata as instances of portable materials, and which of them stay as they are.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/documents/filters.h>
#include <rtsg/documents/writer.h>

#include "core/scene_check.h"

namespace rtsg {
namespace {

using testing::HasSubstr;

/// ClassicVRML of the text after the filter, in one line.
std::string asPortable(const std::string& text, const std::string& reported = "",
                       std::string_view filter = "portable") {
    std::string out;
    Diagnostics diagnostics("test");
    const auto writer = makeWriter(Encoding::classicVrml, [&](std::string_view piece) { out += piece; }, diagnostics);
    const auto created = makeFilter(filter, *writer, {diagnostics});
    readDocument("#X3D V4.0 utf8\nPROFILE Full\n" + text, **created, diagnostics);
    EXPECT_THAT(test::allText(diagnostics),
                reported.empty() ? testing::Eq("") : testing::Matcher<std::string>(HasSubstr(reported)));
    std::string line;
    for (const char c : out.substr(out.find("Full") + 4)) {
        const bool white = c == ' ' || c == '\n' || c == ',' || c == '\t';
        if (!white || (!line.empty() && line.back() != ' ')) line += white ? ' ' : c;
    }
    while (line.ends_with(' ')) line.pop_back();
    return line;
}
std::string shown(const std::string& material) {
    return "Shape { appearance Appearance { material " + material + " } }";
}
std::string optics(const std::string& fields, const std::string& entries) {
    return "Material { " + fields + " metadata MetadataSet { name \"RTSG\" value [ " + entries + " ] } }";
}
const std::string kReflect = "MetadataFloat { name \"reflectivity\" value .5 }";
const std::string kRefract = "MetadataFloat { name \"refractiveIndex\" value 1.5 }";
const std::string kMirrorDeclared =
    "EXTERNPROTO Mirror [ inputOutput MFFloat reflectivity ] [\"urn:rtsg:material:Mirror\" \"materials.x3dv#Mirror\"]";

TEST(PortableFilter, MaterialsWithMetadataBecomeInstances) {
    const std::string mirror = asPortable(shown("DEF M " + optics("diffuseColor 0 0 0", kReflect)));
    EXPECT_EQ(mirror, kMirrorDeclared + " " + shown("DEF M Mirror { reflectivity [0.5] }"));
    // An entry alone; values that are the node's defaults.
    EXPECT_EQ(asPortable(shown("DEF M Material { shininess .2 diffuseColor 0 0 0 metadata MetadataFloat { name "
                               "\"reflectivity\" reference \"RTSG\" value .5 } }")),
              mirror);
    EXPECT_THAT(asPortable(shown(optics("transparency 1 diffuseColor 0 0 0",
                                        kRefract + "MetadataFloat { name \"absorption\" value [1 2 3] }"))),
                HasSubstr("material Glass { refractiveIndex [1.5] absorption [1 2 3] }"));
    EXPECT_THAT(asPortable(shown(optics("diffuseColor 1 0 0", kReflect))),
                HasSubstr("material Polished { diffuseColor 1 0 0 reflectivity [0.5] }"));
    EXPECT_THAT(asPortable(shown(optics("", kReflect))), HasSubstr("material Polished { reflectivity [0.5] }"));
}

TEST(PortableFilter, BodiesOfPrototypesKeepTheirConnections) {
    EXPECT_THAT(asPortable("PROTO Stone [ inputOutput MFFloat shine .1 inputOutput SFColor hue 1 1 1 ] { " +
                           optics("diffuseColor IS hue", "MetadataFloat { name \"reflectivity\" value IS shine }") +
                           " }\nPROTO Thing [ inputOutput MFFloat shine .1 ] { " +
                           shown(optics("", "MetadataFloat { name \"reflectivity\" value IS shine }")) + " }"),
                testing::AllOf(HasSubstr("{ Polished { diffuseColor IS hue reflectivity IS shine } }"),
                               HasSubstr("material Polished { reflectivity IS shine }")));
}

TEST(PortableFilter, WhatInstancesCannotSayStaysAndIsTold) {
    const std::string other = "stays as it is: no portable material says the same";
    for (const std::string& material :
         {optics("diffuseColor 0 0 0 specularColor 1 1 1", kReflect), optics("diffuseColor 0 0 0", kRefract),
          optics("diffuseColor 0 0 0 transparency 1", kRefract + kReflect), optics("", "DEF N " + kReflect),
          optics("", kReflect + kReflect), optics("", "MetadataFloat { name \"reflectivity\" }"),
          optics("", kReflect + "MetadataString { name \"author\" value \"me\" }"),
          optics("diffuseTexture PixelTexture { image 1 1 1 9 }", kReflect),
          "Physical" + optics("metallic 1", kReflect)})
        EXPECT_THAT(asPortable(shown(material), other), HasSubstr("MetadataSet")) << material;
    const std::string mirror = optics("diffuseColor 0 0 0", kReflect);
    EXPECT_THAT(asPortable(shown("DEF M " + mirror) + " ROUTE M.shininess TO M.transparency", "'M' stands in a route"),
                HasSubstr("MetadataSet"));
    EXPECT_THAT(asPortable(shown("DEF M " + mirror) + " Script { initializeOnly SFNode m USE M }", "no material"),
                HasSubstr("MetadataSet"));
    EXPECT_THAT(asPortable("PROTO Mirror [ ] { Material { } }\n" + shown(mirror), "with the name Mirror"),
                HasSubstr("MetadataSet"));
    EXPECT_THAT(asPortable("PROTO P [ initializeOnly SFNode what " + mirror + " ] { Group { } }", "the field what"),
                HasSubstr("MetadataSet"));
    // Neither ours nor metadata at all.
    const std::string plain = shown("Material { metadata MetadataSet { name \"other\" value [ " + kReflect + " ] } }");
    EXPECT_EQ(asPortable(plain), asPortable(plain, "", "drop-comments"));
}

TEST(PortableFilter, StatementsAboutTheDocumentStayInFront) {
    EXPECT_THAT(asPortable("META \"a\" \"b\"\nUNIT length cm 0.01\n" + shown(optics("diffuseColor 0 0 0", kReflect))),
                testing::MatchesRegex(".*UNIT length cm 0.01 " + std::string("EXTERNPROTO Mirror .*")));
}

TEST(PortableFilter, FlattenProtosIsTheWayBack) {
    const std::string first = asPortable(shown(optics("diffuseColor 0 0 0", kReflect)));
    const std::string back = asPortable(first, "", "flatten-protos");
    EXPECT_THAT(back, HasSubstr("MetadataFloat { name \"reflectivity\" value [0.5] }"));
    EXPECT_EQ(back.find("PROTO"), std::string::npos);
    EXPECT_EQ(asPortable(back), first);
    EXPECT_EQ(asPortable(first), first);
}

}  // namespace
}  // namespace rtsg
