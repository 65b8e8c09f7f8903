// Documents without prototypes or Inlines say the same as those with them.
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <rtsg/documents/filters.h>
#include <rtsg/documents/writer.h>

#include "core/scene_check.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string flattened(const std::string& name, const std::string& text, const std::filesystem::path& file = {},
                      const std::string& reported = "") {
    std::string out;
    Diagnostics diagnostics("test");
    const auto writer = makeWriter(Encoding::classicVrml, [&](std::string_view piece) { out += piece; }, diagnostics);
    FilterContext context{diagnostics};
    context.file = file;
    if (!file.empty()) context.resources = Resources::ofFile(file);
    const auto filter = makeFilter(name, *writer, context);
    readDocument("#X3D V3.3 utf8\nPROFILE Immersive\n" + text, **filter, diagnostics);
    EXPECT_THAT(test::allText(diagnostics),
                reported.empty() ? testing::Eq("") : testing::Matcher<std::string>(HasSubstr(reported)));
    EXPECT_EQ(diagnostics.all().size(), reported.empty() ? 0u : 1u) << test::allText(diagnostics);
    return out;
}

constexpr const char* kButton =
    "PROTO Button [ inputOutput SFVec3f at 1 2 3 outputOnly SFTime hit inputOnly SFBool on initializeOnly MFNode kids "
    "[ "
    "] ] { DEF T Transform { translation IS at children [ DEF S TouchSensor { touchTime IS hit enabled IS on } Group { "
    "children IS kids } ] } DEF C TimeSensor { enabled IS on } ROUTE C.isActive TO S.enabled }\n";

TEST(FlattenProtos, InstancesBecomeTheirNodesWithTheirRoutes) {
    const std::string text =
        flattened("flatten-protos", std::string(kButton) +
                                        "DEF A Button { at 4 5 6 kids [ Shape { } ] }\n"
                                        "DEF B Button { } DEF X TimeSensor { } DEF F BooleanFilter { "
                                        "}\nROUTE A.hit TO X.startTime ROUTE B.at TO A.at ROUTE "
                                        "F.inputTrue TO B.on");
    EXPECT_TRUE(text.starts_with("#X3D V3.3 utf8\nPROFILE Immersive\n")) << text;
    EXPECT_THAT(text, Not(HasSubstr("PROTO")));
    EXPECT_THAT(text,
                HasSubstr("DEF A Transform {\n  children [\n    DEF S TouchSensor {}\n    Group {\n      children "
                          "[\n        Shape {}\n      ]\n    }\n  ]\n  translation 4 5 6\n}\n"));
    EXPECT_THAT(text, HasSubstr("DEF B Transform {\n  children [\n    DEF S_2 TouchSensor {}"));
    EXPECT_THAT(text,
                HasSubstr("Switch {\n  children [\n    DEF C TimeSensor {}\n    DEF C_2 TimeSensor {}\n  ]\n}\n"));
    for (const char* route : {"ROUTE S.touchTime TO X.startTime\n", "ROUTE B.translation TO A.translation\n",
                              "ROUTE C.isActive TO S.enabled\n", "ROUTE C_2.isActive TO S_2.enabled\n",
                              "ROUTE F.inputTrue TO S_2.enabled\n", "ROUTE F.inputTrue TO C_2.enabled\n"})
        EXPECT_THAT(text, HasSubstr(route));
}

TEST(FlattenProtos, InstancesWithinInstances) {
    const std::string text =
        flattened("flatten-protos", std::string(kButton) +
                                        "PROTO Panel [ inputOutput SFVec3f where 0 0 0 ] { Group { "
                                        "children [ DEF K Button { at IS where } USE K ] } }\n"
                                        "DEF P Panel { where 7 8 9 } DEF T Transform { } Group { "
                                        "children USE P }\nROUTE T.translation TO P.where");
    EXPECT_THAT(text, HasSubstr("DEF P Group {\n  children [\n    DEF K Transform {"));
    EXPECT_THAT(text, HasSubstr("    USE K\n"));
    EXPECT_THAT(text, HasSubstr("translation 7 8 9"));
    EXPECT_THAT(text, HasSubstr("    USE P\n"));
    EXPECT_THAT(text, HasSubstr("ROUTE T.translation TO K.translation\n"));
    test::Loaded again(text);
    EXPECT_EQ(again.problems(), "");
}

TEST(FlattenProtos, EventsComeOutTheSame) {
    const std::string declared =
        "PROTO P [ inputOnly SFFloat f outputOnly SFVec3f out ] { DEF I PositionInterpolator { key [ 0 1 ] "
        "keyValue [ 0 "
        "0 0 1 2 3 ] set_fraction IS f value_changed IS out } }\n";
    const std::string text =
        "DEF C TimeSensor { cycleInterval 2 loop TRUE } DEF A P { } DEF T Transform { }\n"
        "ROUTE C.fraction_changed TO A.f ROUTE A.out TO T.translation";
    test::Loaded with(declared + text);
    test::Loaded without(flattened("flatten-protos", declared + text));
    for (const double t : {0.0, .25, .5, 1.75, 2.5}) {
        with.scene.newFrame(t);
        without.scene.newFrame(t);
        const auto location = [](test::Loaded& l) {
            const Node& node = l.scene.node(l.named("T"));
            return *static_cast<const Vec3f*>(node.storage(node.type().findExact("translation")));
        };
        EXPECT_EQ(location(with), location(without)) << t;
    }
}

TEST(FlattenInlines, TheirContentComesInWithNamesOfItsOwn) {
    const std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("rtsg-flatten-" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder);
    std::ofstream(folder / "part.x3dv")
        << "#X3D V4.0 utf8\nPROFILE Immersive\nDEF T Transform { children Shape { } } DEF C "
           "TimeSensor { } ROUTE C.cycleTime TO C.stopTime EXPORT T AS T";
    const std::string text =
        flattened("flatten-inlines",
                  "DEF T Transform { } DEF I Inline { url \"part.x3dv\" } Inline { url \"part.x3dv\" }\n"
                  "IMPORT I.T AS Q ROUTE T.translation TO Q.translation",
                  folder / "main.x3dv");
    std::filesystem::remove_all(folder);
    EXPECT_THAT(text, Not(HasSubstr("Inline")));
    EXPECT_THAT(text, Not(HasSubstr("IMPORT")));
    EXPECT_THAT(text, HasSubstr("DEF I Group {\n  children [\n    DEF T_2 Transform {"));
    EXPECT_THAT(text, HasSubstr("ROUTE T.translation TO T_2.translation\n"));
    EXPECT_THAT(text, HasSubstr("ROUTE C.cycleTime TO C.stopTime\n"));
    EXPECT_THAT(text, HasSubstr("ROUTE C_2.cycleTime TO C_2.stopTime\n"));
}

/// A folder with documents, for each `text` that stands alone.
class InlinedLights : public testing::Test {
  protected:
    std::string flat(const std::string& part, const std::string& text, const std::string& reported = "") const {
        write("part.x3dv", part);
        return flattened("flatten-inlines", text, folder_.path() / "main.x3dv", reported);
    }
    void write(const char* name, const std::string& text) const {
        std::ofstream(folder_.path() / name) << "#X3D V4.0 utf8\nPROFILE Immersive\n" << text;
    }

  private:
    const test::TempFolder folder_;
};

// 9.4.2: the lights of an Inline whose `global` is FALSE do not shine beyond it; local lights of a Group do likewise.
TEST_F(InlinedLights, BecomeLocalWhereThatIsEqual) {
    const auto count = [](const std::string& text, const char* what) {
        std::size_t n = 0;
        for (std::size_t at = text.find(what); at != text.npos; at = text.find(what, at + 1)) ++n;
        return n;
    };
    const char* beside = "Shape { }\nInline { url \"part.x3dv\" }";
    const std::string direct = flat("PointLight { } SpotLight { global FALSE } Shape { }", beside);
    EXPECT_THAT(direct, HasSubstr("PointLight {\n      global FALSE"));
    // A Transform that holds all that is lit.
    const std::string deep = flat("WorldInfo { } Transform { children [ SpotLight { } Shape { } ] }", beside);
    EXPECT_THAT(deep, HasSubstr("global FALSE"));
    // An inner Inline that lets its lights out, into the outer one, which holds nothing else.
    write("lamp.x3dv", "PointLight { } Shape { }");
    EXPECT_THAT(flat("Inline { global TRUE url \"lamp.x3dv\" }", beside), HasSubstr("global FALSE"));
    // Where the Inline lets them out, or nothing is elsewhere, they stay.
    EXPECT_EQ(count(flat("PointLight { } Shape { }", "Shape { } Inline { global TRUE url \"part.x3dv\" }"), "global"),
              0u);
    const std::string alone = "Group { children Inline { url \"part.x3dv\" } }";
    EXPECT_EQ(count(flat("Transform { children PointLight { } } Shape { }", alone), "global"), 0u);
    // Twice the same Inline: each lights its own.
    const std::string twice = "Transform { children DEF I Inline { url \"part.x3dv\" } } Transform { children USE I }";
    EXPECT_EQ(count(flat("DirectionalLight { global TRUE } Shape { }", twice), "global FALSE"), 0u)
        << "FALSE is a DirectionalLight's default";
    EXPECT_EQ(count(flat("DirectionalLight { global TRUE } Shape { }", twice), "global TRUE"), 0u);
}

TEST_F(InlinedLights, AreToldOnceWithTheLineWhereThereIsNoWay) {
    const char* beside = "Shape { }\nDEF I Inline { url \"part.x3dv\" }";
    const std::string reported = "test:4:1: warning: PointLight L of the Inline I shines beyond it now";
    EXPECT_THAT(flat("Transform { children [ DEF L PointLight { } PointLight { } ] } Shape { }", beside, reported),
                Not(HasSubstr("global")));
    // Its `global` is set by events; it is used twice; it is a prototype's.
    flat("DEF L PointLight { } Shape { } DEF B BooleanFilter { } ROUTE B.inputTrue TO L.global", beside, reported);
    flat("Transform { children DEF L PointLight { } } Transform { children [ USE L Shape { } ] }", beside, reported);
    write("lamp.x3dv", "Transform { children DEF L PointLight { } } Shape { }");
    flat("Shape { } Inline { url \"lamp.x3dv\" }", beside, "test:4:1: warning: PointLight L of the Inline I");
}

// 7.2.2: nothing in an Inline is bound by itself; in a Group the first one is.
TEST_F(InlinedLights, WhatIsBoundByItselfNowIsTold) {
    const auto reported = [](const char* location, const char* type) {
        return std::string("test:") + location + ": warning: the " + type + " of the Inline is bound by itself now";
    };
    const std::string own = "TextureBackground { } NavigationInfo { } OrthoViewpoint { } Fog { }\n",
                      inlined = "Inline { url \"part.x3dv\" }";
    for (const char* type : {"Background", "NavigationInfo", "Viewpoint", "Fog"}) {
        const std::string part = std::string(type) + " { } " + type + " { }";
        flat(part, "Shape { }\n" + inlined, reported("4:1", type));
        write("outer.x3dv", "Group { children Inline { url \"part.x3dv\" } }");
        flat(part, "Shape { }\nInline { url \"outer.x3dv\" }", reported("4:1", type));
        // Where one of the document's own comes first, that one is bound as before.
        flat(part, own + inlined);
        flat(part, "PROTO Q [ ] { " + part + " } Q { }\n" + inlined);
        flat(part, "PROTO Q [ ] { " + part + " }\n" + inlined + "\nQ { }", reported("4:1", type));
        flat(part, inlined + "\n" + own, reported("3:1", type));
    }
}

// In X3D 3.1 to 3.3 CADLayer.visible has a value for each child, and those without one show.
TEST_F(InlinedLights, ACadLayerThatIsNotVisibleStaysSoInADocumentOfBefore) {
    const std::string parts = "children [ CADPart { } CADPart { } CADPart { } ] }";
    const std::string text =
        flat("CADLayer { visible FALSE " + parts + " CADLayer { " + parts, "Inline { url \"part.x3dv\" }");
    const std::size_t first = text.find("visible");
    EXPECT_EQ(text.substr(first, text.find(']', first) - first), "visible [FALSE, FALSE, FALSE") << text;
    EXPECT_EQ(text.find("visible", first + 1), std::string::npos) << text;
    Scene scene;
    Diagnostics diagnostics("test");
    ASSERT_TRUE(loadText(scene, text, diagnostics)) << test::allText(diagnostics);
    std::size_t hidden = 0;
    scene.forEachNode([&](const Node& node) { hidden += node.is(x3d::Group::type) && !node.get(x3d::Group::visible); });
    EXPECT_EQ(hidden, 3u) << text;
}

TEST_F(InlinedLights, AGroupKeepsWhatItHasOfAnInline) {
    const std::string text =
        flat("Shape { }",
             "DEF I Inline { visible FALSE bboxSize 1 2 3 url \"part.x3dv\" metadata MetadataSet { "
             "} } DEF B BooleanFilter { } ROUTE B.inputTrue TO I.visible");
    for (const char* kept : {"visible FALSE", "bboxSize 1 2 3", "MetadataSet", "ROUTE B.inputTrue TO I.visible"})
        EXPECT_THAT(text, HasSubstr(kept));
    EXPECT_THAT(
        flat("Shape { }", "DEF I Inline { url \"part.x3dv\" } DEF B BooleanFilter { } ROUTE B.inputTrue TO I.load",
             "a route of I's load is left out"),
        Not(HasSubstr("ROUTE")));
}

// ---- embedding -----------------------------------------------------------------------------------------------------

class Embed : public testing::Test {
  protected:
    void SetUp() override {
        std::filesystem::create_directories(folder / "parts/pictures");
        std::ofstream(folder / "parts/tile.stl")
            << "solid t\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\nendfacet\n"
               "endsolid\n";
        std::ofstream(folder / "parts/room.x3dv")
            << "#X3D V4.0 utf8\nShape { appearance Appearance { texture ImageTexture { url [ \"pictures/wood.png\", "
               "\"http://example.org/a.png\" ] } } geometry Box { } } Script { url \"ecmascript: /* a/b#c */\" }\n";
    }
    const test::TempFolder own;
    const std::filesystem::path folder = own.path();
};

TEST_F(Embed, GeometriesStandInTheDocumentAndEachFileOnce) {
    const std::string text = flattened("embed",
                                       "Shape { geometry InlineGeometry { url \"parts/tile.stl\" } }\n"
                                       "Shape { geometry DEF M InlineGeometry { load FALSE url \"parts/tile.stl\" } }\n"
                                       "Shape { geometry InlineGeometry { solid TRUE url \"parts/tile.stl\" } }\n"
                                       "DEF T BooleanFilter { } ROUTE T.inputTrue TO M.load\n",
                                       folder / "scene.x3dv");
    EXPECT_THAT(text, Not(HasSubstr("InlineGeometry")));
    EXPECT_THAT(text, Not(HasSubstr("ROUTE"))) << "all is loaded";
    std::size_t sets = 0;
    for (std::size_t at = text.find("TriangleSet {"); at != text.npos; at = text.find("TriangleSet {", at + 1)) ++sets;
    EXPECT_EQ(sets, 2U) << text;
    EXPECT_THAT(text, HasSubstr("geometry USE _1"));
    test::Loaded again(text);
    EXPECT_EQ(again.problems(), "");
}

TEST_F(Embed, UrlsOfInlinesLeadToTheirFilesFromHere) {
    for (const char* filter : {"embed", "flatten-inlines"}) {
        const std::string text = flattened(filter, "Inline { url \"parts/room.x3dv\" }", folder / "scene.x3dv");
        EXPECT_THAT(text, HasSubstr("\"parts/pictures/wood.png\""));
        EXPECT_THAT(text, HasSubstr("\"http://example.org/a.png\""));
        EXPECT_THAT(text, HasSubstr("\"ecmascript: /* a/b#c */\""));
    }
}

TEST_F(Embed, AFileThatIsMissingIsNamedAndStaysNamed) {
    const std::string text = flattened("embed", "Shape { geometry InlineGeometry { url \"parts/none.stl\" } }",
                                       folder / "scene.x3dv", "parts/none.stl");
    EXPECT_THAT(text, HasSubstr("\"parts/none.stl\""));
}

TEST_F(Embed, RobotsAreKnownByTheirContent) {
    std::ofstream(folder / "arm.xml") << "<?xml version='1.0'?><robot name='r'><link name='a'/></robot>";
    EXPECT_TRUE(isRobotFile(folder / "arm.xml"));
    EXPECT_FALSE(isRobotFile(folder / "parts/room.x3dv"));
    EXPECT_TRUE(isRobotFile("http://example.org/arm.urdf"));
    EXPECT_FALSE(isRobotFile("-"));
}

}  // namespace
}  // namespace rtsg
