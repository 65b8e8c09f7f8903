// The scenes that a SceneBuilder makes of commands, good and bad.
#include <rtsg/documents/scene_builder.h>

#include <thread>

#include <gmock/gmock.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/command_list.h>
#include <rtsg/documents/filter.h>
#include <rtsg/documents/loader.h>

#include "core/scene_check.h"

namespace rtsg {
namespace {

using test::Loaded;
using testing::HasSubstr;

TEST(SceneBuilder, BuildsNodesFieldsAndNames) {
    Loaded l("DEF T Transform { translation 1 2 3 children [ DEF S Shape { geometry Box { size 1 2 3 } } ] }");
    EXPECT_EQ(l.problems(), "");
    ASSERT_TRUE(l.named("T"));
    EXPECT_EQ(l.get("T", "translation"), "1 2 3");
    ASSERT_EQ(l.nodes(l.named("T"), "children").size(), 1u);
    EXPECT_EQ(l.nodes(l.named("T"), "children")[0], l.named("S"));
    EXPECT_EQ(l.get(l.only(l.named("S"), "geometry"), "size"), "1 2 3");
    EXPECT_EQ(l.roots(), std::vector{l.named("T")});
}

TEST(SceneBuilder, UseSharesOneNode) {
    Loaded l("DEF A Group { children DEF S Shape { } } DEF B Group { children [ USE S USE S ] }");
    EXPECT_EQ(l.problems(), "");
    EXPECT_EQ(l.nodes(l.named("B"), "children"), (Array<NodeId>{l.named("S"), l.named("S")}));
    EXPECT_EQ(l.scene.parents(l.named("S")).size(), 3u);
}

// ISO/IEC 19775-1 V3.3, 32.4.3: one value a child; children without one show. In V4.0 it is one for all.
TEST(SceneBuilder, ACadLayersListOfWhatIsVisibleHidesItsChildren) {
    const auto shown = [](const Scene& scene, const char* layer) {
        std::string flags;
        const Node& node = scene.node(scene.findName(layer));
        EXPECT_TRUE(node.get(x3d::CADLayer::visible));
        for (const NodeId child : node.get(x3d::CADLayer::children)) {
            const Node& one = scene.node(child);
            const bool isHidden = one.is(x3d::Group::type) && !one.get(x3d::Group::visible);
            EXPECT_EQ(isHidden, scene.name(child).empty());
            const NodeId inside = isHidden ? one.get(x3d::Group::children)[0] : child;
            flags += std::string(scene.name(inside)) + (isHidden ? "- " : "+ ");
        }
        return flags;
    };
    const std::string children = "children [ DEF A Shape { } DEF B CADPart { } DEF C Transform { } ]";
    const std::pair<std::string, const char*> cases[] = {{"[ TRUE FALSE TRUE ]", "A+ B- C+ "},
                                                         {"[ FALSE ]", "A- B+ C+ "},
                                                         {"FALSE", "A- B+ C+ "},
                                                         {"[ ]", "A+ B+ C+ "},
                                                         {"[ FALSE TRUE FALSE FALSE FALSE ]", "A- B+ C- "}};
    for (const auto& [visible, expected] : cases)
        for (const bool before : {false, true}) {
            Scene scene;
            Diagnostics diagnostics{"test"};
            const std::string flags = " visible " + visible + " ";
            EXPECT_TRUE(loadText(
                scene,
                "#X3D V3.3 utf8\nPROFILE Full\nDEF L CADLayer {" + (before ? flags + children : children + flags) + "}",
                diagnostics));
            EXPECT_EQ(test::allText(diagnostics), "") << visible;
            EXPECT_EQ(shown(scene, "L"), expected) << visible;
        }
    Scene xml;
    Diagnostics diagnostics{"test"};
    const std::string text =
        "<X3D version='3.3' profile='Full'><Scene><CADLayer DEF='L' visible='true false'><Shape DEF='A'/>"
        "<CADPart DEF='B'/></CADLayer></Scene></X3D>";
    EXPECT_TRUE(loadText(xml, text, diagnostics));
    EXPECT_EQ(test::allText(diagnostics), "");
    EXPECT_EQ(shown(xml, "L"), "A+ B- ");
    Loaded now("DEF L CADLayer { visible FALSE " + children + " }");
    EXPECT_EQ(now.problems(), "");
    EXPECT_EQ(now.get("L", "visible"), "FALSE");
    EXPECT_EQ(now.nodes(now.named("L"), "children"), (Array<NodeId>{now.named("A"), now.named("B"), now.named("C")}));
}

TEST(SceneBuilder, UseBeforeDefIsRefusedWithItsPosition) {
    Loaded l("Group { children [ USE S ] }\nDEF S Shape { }");
    EXPECT_THAT(l.problems(), HasSubstr("test.x3dv:2:20: error: USE 'S': no node has that name"));
    EXPECT_TRUE(l.named("S"));
    EXPECT_EQ(l.roots().size(), 2u);
}

TEST(SceneBuilder, UseOfAnAncestorIsRefused) {
    Loaded l("DEF G Group { children Transform { children [ USE G Shape { } ] } }");
    EXPECT_THAT(l.problems(), HasSubstr("a node cannot contain itself"));
    const NodeId transform = l.nodes(l.named("G"), "children")[0];
    EXPECT_EQ(l.nodes(transform, "children").size(), 1u);
}

/// 4.4.4.3: what an instance is given stands where its body says, and a Script there may refer to anything.
TEST(SceneBuilder, AnInstanceMayReferToWhatContainsIt) {
    const std::string proto =
        "PROTO P [ initializeOnly SFNode about NULL inputOutput MFNode children [] ] "
        "{ Group { children IS children } Script { initializeOnly SFNode about IS about } } ";
    Loaded l(proto +
             "DEF G Group { children DEF T Transform { children DEF A P { about USE G } } } "
             "DEF O P { children DEF B P { about USE O } } DEF S P { about USE S }");
    EXPECT_EQ(l.problems(), "");
    const auto about = [&](const char* name) {
        const Node& node = l.scene.node(l.named(name));
        return node.value(node.type().findExact("about")).as<NodeId>();
    };
    EXPECT_EQ(about("A"), l.named("G"));
    EXPECT_EQ(about("B"), l.named("O"));
    EXPECT_EQ(about("S"), l.named("S"));
    // But not hang there: the instance is left out.
    Loaded cycle(proto + "DEF G Group { children [ DEF A P { children USE G } DEF T Transform { } ] }");
    EXPECT_THAT(cycle.problems(), HasSubstr("cannot contain itself"));
    const Array<NodeId> left = cycle.nodes(cycle.named("G"), "children");
    ASSERT_EQ(left.size(), 1u);
    EXPECT_EQ(left[0], cycle.named("T"));
}

TEST(SceneBuilder, ALaterDefTakesTheNameOver) {
    Loaded l("DEF A Group { } DEF A Transform { } Group { children USE A }");
    EXPECT_THAT(l.problems(), HasSubstr("warning: DEF 'A' is used twice"));
    EXPECT_EQ(l.scene.node(l.nodes(l.roots()[2], "children")[0]).type().name, "Transform");
}

TEST(SceneBuilder, RoutesByAnyOfTheThreeNames) {
    // ISO/IEC 19775-1 V4.0 4.4.2.2: set_x, x_changed and x address one inputOutput field.
    Loaded l(
        "DEF A Transform { } DEF B Transform { }\n"
        "ROUTE A.translation_changed TO B.set_translation\n"
        "ROUTE A.translation TO B.translation");
    EXPECT_EQ(l.problems(), "");
    EXPECT_EQ(l.scene.routeCount(), 1u);
}

TEST(SceneBuilder, BadRoutesAreReportedAndTheRestIsKept) {
    Loaded l(
        "DEF A Transform { } DEF B Transform { } DEF K PositionInterpolator { }\n"
        "ROUTE A.translation TO Nobody.translation\n"
        "ROUTE A.nothing TO B.translation\n"
        "ROUTE A.translation TO B.rotation\n"
        "ROUTE A.translation TO K.value_changed\n"
        "ROUTE A.addChildren TO B.addChildren\n"
        "ROUTE K.value_changed TO B.translation");
    EXPECT_EQ(l.diagnostics.errors(), 5u) << l.problems();
    EXPECT_THAT(l.problems(), HasSubstr("test.x3dv:3:"));
    EXPECT_EQ(l.scene.routeCount(), 1u);
}

TEST(SceneBuilder, ARouteMayStandBeforeItsNodes) {
    Loaded l("ROUTE A.translation TO B.translation DEF A Transform { } DEF B Transform { }");
    EXPECT_EQ(l.scene.routeCount(), 1u) << l.problems();
}

/// Readers refuse most of this first; a program that drives the builder meets the builder's own checks.
class DirectBuilder : public testing::Test {
  protected:
    Scene scene;
    Diagnostics diagnostics{"direct"};
    SceneBuilder builder{scene, diagnostics};
    SourceLocation at(std::uint32_t line) { return {line, 1}; }
    std::string problems() { return test::allText(diagnostics); }
};

TEST_F(DirectBuilder, RefusesWhatDoesNotFit) {
    builder.beginDocument({});
    builder.beginNode("Transform", "T", "", at(1));
    builder.setField("nothing", Value(true), at(2));
    builder.setField("translation", Value(1.0f), at(3));
    builder.setField("addChildren", Value(Array<NodeId>()), at(4));
    builder.beginNode("Box", "", "children", at(5));
    builder.endNode(at(5));
    builder.beginNode("NoSuchNode", "N", "children", at(6));
    builder.beginNode("Box", "", "children", at(6));
    builder.endNode(at(6));
    builder.endNode(at(6));
    builder.beginNode("Shape", "", "nowhere", at(7));
    builder.beginNode("Box", "", "geometry", at(8));
    builder.endNode(at(8));
    builder.beginNode("Cone", "", "geometry", at(9));
    builder.endNode(at(9));
    builder.endNode(at(9));
    builder.endNode(at(10));
    builder.endDocument();
    const std::string text = problems();
    for (const char* wanted : {"direct:2:1: error: Transform T has no field 'nothing'",
                               "direct:3:1: error: Transform T.translation is SFVec3f, not SFFloat",
                               "direct:4:1: error: Transform T.addChildren is inputOnly",
                               "direct:5:1: warning: field 'children' of Transform does not take Box",
                               "direct:6:1: warning: unknown node type NoSuchNode",
                               "direct:9:1: warning: field 'geometry' of Shape has a node already"})
        EXPECT_THAT(text, HasSubstr(wanted));
    // Only `children` of Shape's possible parents takes one, so it goes there, with a warning.
    EXPECT_EQ(diagnostics.errors(), 3u) << text;
    EXPECT_EQ(scene.node(scene.findName("T"))
                  .value(scene.node(scene.findName("T")).type().find("children"))
                  .as<Array<NodeId>>()
                  .size(),
              1u);
}

TEST_F(DirectBuilder, ChildrenGoToTheirOnlyPossibleField) {
    builder.beginNode("Shape", "S", "", at(1));
    builder.beginNode("Box", "", "", at(2));
    builder.endNode(at(2));
    builder.beginNode("Appearance", "", "children", at(3));
    builder.endNode(at(3));
    builder.endNode(at(4));
    builder.finish();
    const Node& shape = scene.node(scene.findName("S"));
    EXPECT_TRUE(shape.value(shape.type().find("geometry")).as<NodeId>());
    EXPECT_TRUE(shape.value(shape.type().find("appearance")).as<NodeId>());
    EXPECT_EQ(diagnostics.warnings(), 1u) << problems();
}

TEST_F(DirectBuilder, AnUnfinishedDocumentKeepsWhatItHas) {
    builder.beginDocument({});
    builder.beginNode("Group", "G", "", at(1));
    builder.beginNode("Transform", "T", "children", at(2));
    builder.finish();
    builder.finish();
    EXPECT_EQ(builder.roots(), std::vector{scene.findName("G")});
    EXPECT_EQ(scene.parents(scene.findName("T")).size(), 1u);
}

TEST_F(DirectBuilder, StrayCommandsDoNoHarm) {
    builder.endNode(at(1));
    builder.setField("translation", Value(Vec3f(1)), at(1));
    builder.isConnection("a", "b", at(1));
    builder.declareField({Access::inputOutput, FieldType::SFBool, "x"}, {}, at(1));
    builder.endProto(at(1));
    builder.beginProtoBody(at(1));
    builder.useNode("X", "", at(1));
    builder.beginProto("P", at(2));
    builder.endNode(at(2));
    builder.finish();
    EXPECT_EQ(scene.nodeCount(), 1u);
    EXPECT_THAT(problems(), HasSubstr("PROTO P is never closed"));
}

TEST(SceneBuilder, RotationAxesBecomeUnitVectors) {
    Loaded l(
        "DEF A Transform { rotation 0 3 4 1.5 } DEF B Transform { rotation 0 0 0 2 }\n"
        "DEF K OrientationInterpolator { key [ 0 1 ] keyValue [ 0 0 2 1, 1 0 0 1 ] }\n"
        "DEF C Transform { rotation 0.577 0.577 0.577 1 }");
    EXPECT_EQ(l.get("A", "rotation"), "0 0.6 0.8 1.5");
    EXPECT_EQ(l.get("B", "rotation"), "0 0 1 0");
    EXPECT_EQ(l.get("K", "keyValue"), "[0 0 1 1, 1 0 0 1]");
    EXPECT_EQ(l.get("C", "rotation"), "0.577 0.577 0.577 1") << "three digits are left as the author wrote them";
    EXPECT_GE(l.diagnostics.warnings(), 2u) << l.problems();
}

TEST(SceneBuilder, ScriptsHaveTheirOwnFields) {
    Loaded l(
        "DEF T Transform { }\n"
        "DEF S Script { initializeOnly SFFloat size 2.5 inputOnly SFBool on outputOnly SFVec3f moved\n"
        "  inputOutput MFNode things [ Shape { } USE T ] initializeOnly SFNode me USE S\n"
        "  directOutput TRUE url \"ecmascript:\" }\n"
        "DEF S2 Script { initializeOnly SFFloat size 3 inputOnly SFBool on outputOnly SFVec3f moved\n"
        "  inputOutput MFNode things [ ] initializeOnly SFNode me NULL }\n"
        "ROUTE S.moved TO T.set_translation");
    EXPECT_EQ(l.problems(), "");
    EXPECT_EQ(l.get("S", "size"), "2.5");
    EXPECT_EQ(l.get("S", "directOutput"), "TRUE");
    EXPECT_EQ(l.nodes(l.named("S"), "things").size(), 2u);
    EXPECT_EQ(l.only(l.named("S"), "me"), l.named("S"));
    EXPECT_EQ(l.scene.routeCount(), 1u);
    EXPECT_EQ(l.scene.node(l.named("S")).typeIndex(), l.scene.node(l.named("S2")).typeIndex());
    EXPECT_EQ(l.scene.node(l.named("S")).type().kind, NodeType::Kind::script);
    EXPECT_EQ(l.get("S2", "size"), "3");
}

TEST(SceneBuilder, KeepsWhatTheHeadSays) {
    Loaded l("PROFILE Immersive\nCOMPONENT Geospatial:1\nMETA \"title\" \"a\\\"b\"\nUNIT length km 1000.0\nGroup { }");
    EXPECT_EQ(l.problems(), "");
    EXPECT_EQ(l.diagnostics.errors(), 0u);
    const auto hidden = [&](const char* name) {
        const Node& root = l.scene.node(l.scene.root());
        return printFieldText(root.value(root.type().findExact(name)));
    };
    EXPECT_EQ(hidden("profile"), "\"Immersive\"");
    EXPECT_EQ(hidden("components"), "[\"Geospatial\", \"1\"]");
    EXPECT_EQ(hidden("meta"), "[\"title\", \"a\\\"b\"]");
    EXPECT_EQ(hidden("units"), "[\"length\", \"km\", \"1000\"]");
}

TEST(SceneBuilder, DocumentsAreAppended) {
    Scene scene;
    Diagnostics diagnostics;
    EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nDEF A Group { }", diagnostics));
    EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nDEF B Group { }", diagnostics));
    EXPECT_EQ(scene.nodeCount(), 3u);
    EXPECT_EQ(scene.parents(scene.findName("B")).size(), 1u);
}

TEST(SceneBuilder, AHundredThousandSiblingsAndLevels) {
    Scene scene;
    Diagnostics diagnostics;
    SceneBuilder builder(scene, diagnostics);
    constexpr std::uint32_t count = 100'000;
    builder.beginDocument({});
    builder.beginNode("Group", "Wide", "", {});
    for (std::uint32_t i = 0; i < count; ++i) {
        builder.beginNode("Transform", "", "children", {});
        builder.endNode({});
    }
    builder.endNode({});
    for (std::uint32_t i = 0; i < count; ++i) builder.beginNode("Group", "", i ? "children" : "", {});
    for (std::uint32_t i = 0; i < count; ++i) builder.endNode({});
    builder.endDocument();
    EXPECT_EQ(diagnostics.errors(), 0u);
    EXPECT_EQ(scene.nodeCount(), 2u + 2u * count);
    const Node& wide = scene.node(scene.findName("Wide"));
    EXPECT_EQ(wide.value(wide.type().find("children")).as<Array<NodeId>>().size(), count);
    EXPECT_EQ(builder.roots().size(), 2u);
}

TEST(CommandList, KnowsItsFirstNodeAndIsReplayedByMany) {
    const auto recorded = [](const std::string& text) {
        CommandList list;
        Diagnostics diagnostics;
        readDocument("#X3D V4.0 utf8\nPROFILE Full\n" + text, list, diagnostics);
        return list;
    };
    EXPECT_EQ(recorded("").firstNodeType(), "");
    EXPECT_EQ(recorded("Group { children Shape { } } Transform { }").firstNodeType(), "Group");
    EXPECT_EQ(recorded("PROTO P [ inputOutput SFNode n Box { } ] { Sphere { } PROTO Q [ ] { Cone { } } } P { }")
                  .firstNodeType(),
              "P");
    const CommandList list = recorded("DEF A Group { children [ Shape { } USE A ] } Transform { translation 1 2 3 }");
    std::vector<std::size_t> nodes(4);
    std::vector<std::thread> threads;
    for (std::size_t& own : nodes)
        threads.emplace_back([&] {
            for (int i = 0; i < 50; ++i) {
                CountFilter count;
                list.replay(count);
                own += count.nodes();
            }
        });
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(nodes, std::vector<std::size_t>(4, 150));
}

}  // namespace
}  // namespace rtsg
