// ISO/IEC 19775-1 V4.0 4.4.4 and 4.4.5: prototypes.
#include <algorithm>

#include <gmock/gmock.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/scene_builder.h>
#include <rtsg/documents/writer.h>

#include "core/scene_check.h"

namespace rtsg {
namespace {

using test::Loaded;
using testing::HasSubstr;

/// Node `index` of the body of the instance named `def`.
NodeId bodyNode(const Loaded& l, NodeId instance, std::size_t index = 0) {
    const NodeType& type = l.scene.node(instance).type();
    for (std::size_t i = type.fields.size(); i-- > 0;)
        if (type.fields[i].hidden && type.fields[i].name == "body")
            return l.scene.node(instance).value(static_cast<FieldIndex>(i)).as<Array<NodeId>>()[index];
    return {};
}

TEST(Proto, AnInstanceHasItsOwnBodyWithTheValuesGiven) {
    Loaded l(
        "PROTO Ball [ inputOutput SFFloat size 2 initializeOnly SFColor color 1 0 0 ] {\n"
        "  Shape { appearance Appearance { material DEF M Material { diffuseColor IS color } }\n"
        "          geometry DEF G Sphere { radius IS size } } }\n"
        "DEF A Ball { } DEF B Ball { size 5 color 0 1 0 }");
    // Sphere.radius is initializeOnly: an inputOutput field cannot be connected with it.
    EXPECT_THAT(l.problems(), HasSubstr("table 4.4"));
    EXPECT_EQ(l.diagnostics.errors(), 1u) << "once, not for every instance:\n" << l.problems();
    const NodeId a = l.named("A"), b = l.named("B");
    EXPECT_NE(bodyNode(l, a), bodyNode(l, b));
    EXPECT_EQ(l.get(l.named("M", a), "diffuseColor"), "1 0 0");
    EXPECT_EQ(l.get(l.named("M", b), "diffuseColor"), "0 1 0");
    EXPECT_FALSE(l.named("M")) << "DEF inside a PROTO is not visible outside";
    EXPECT_EQ(l.scene.node(bodyNode(l, a)).scope(), a);
}

/// 4.4.4.3: X3DPrototypeInstance has metadata as every node has, whether its interface says so or not.
TEST(Proto, EveryInstanceHasMetadata) {
    const char* classic =
        "#X3D V4.0 utf8\nPROFILE Full\nPROTO P [ ] { DEF T Transform { metadata IS metadata } }\n"
        "PROTO Own [ initializeOnly SFInt32 metadata 3 ] { Group { } }\n"
        "DEF I P { metadata MetadataString { name \"a\" value \"b\" } }\nDEF O Own { metadata 4 }\nDEF N P { }";
    const char* xml =
        "<X3D profile='Full' version='4.0'><Scene><ProtoDeclare name='P'><ProtoBody><Transform DEF='T'><IS>"
        "<connect nodeField='metadata' protoField='metadata'/></IS></Transform></ProtoBody></ProtoDeclare>"
        "<ProtoDeclare name='Own'><ProtoInterface><field name='metadata' type='SFInt32' accessType='initializeOnly' "
        "value='3'/></ProtoInterface><ProtoBody><Group/></ProtoBody></ProtoDeclare>"
        "<ProtoInstance DEF='I' name='P'><MetadataString containerField='metadata' name='a' value='\"b\"'/>"
        "</ProtoInstance><ProtoInstance DEF='O' name='Own'><fieldValue name='metadata' value='4'/></ProtoInstance>"
        "<ProtoInstance DEF='N' name='P'/></Scene></X3D>";
    for (const char* text : {classic, xml}) {
        Scene scene;
        Diagnostics diagnostics;
        ASSERT_TRUE(loadText(scene, text, diagnostics));
        EXPECT_EQ(test::allText(diagnostics), "");
        const auto metadata = [&](const Node& node) {
            return node.value(node.type().findExact("metadata")).as<NodeId>();
        };
        const NodeId given = metadata(scene.node(scene.findName("I")));
        ASSERT_TRUE(given);
        EXPECT_EQ(scene.node(given).get(x3d::MetadataString::name), "a");
        EXPECT_EQ(metadata(*scene.effectiveNode(scene.findName("I"))), given);
        EXPECT_FALSE(metadata(scene.node(scene.findName("N"))));
        const Node& own = scene.node(scene.findName("O"));
        EXPECT_EQ(own.value(own.type().findExact("metadata")).as<std::int32_t>(), 4);
        for (const Encoding encoding : {Encoding::classicVrml, Encoding::xml, Encoding::json}) {
            std::string out;
            Diagnostics ignored;
            const auto writer = makeWriter(encoding, [&](std::string_view piece) { out += piece; }, ignored);
            readDocument(text, *writer, ignored);
            Scene again;
            ASSERT_TRUE(loadText(again, out, ignored));
            EXPECT_EQ(test::allText(ignored), "");
            EXPECT_EQ(again.hash(), scene.hash()) << out;
        }
    }
}

TEST(Proto, EventsPassThroughIs) {
    Loaded l(
        "PROTO P [ inputOutput SFVec3f place 1 2 3 inputOnly SFVec3f put outputOnly SFVec3f placed ] {\n"
        "  DEF T Transform { translation IS place set_rotation IS nothing }\n"
        "  DEF U Transform { translation IS put } DEF V Transform { translation IS placed } }\n"
        "DEF A P { } DEF OUT Transform { }\n"
        "ROUTE A.placed TO OUT.translation");
    EXPECT_THAT(l.problems(), HasSubstr("nothing"));
    const NodeId a = l.named("A"), t = l.named("T", a), u = l.named("U", a), v = l.named("V", a);
    ASSERT_TRUE(t && u && v);
    EXPECT_EQ(l.get(t, "translation"), "1 2 3");
    ASSERT_TRUE(l.scene.sendEvent(a, l.field(a, "place"), Value(Vec3f(4, 5, 6))));
    ASSERT_TRUE(l.scene.sendEvent(a, l.field(a, "put"), Value(Vec3f(7, 8, 9))));
    ASSERT_TRUE(l.scene.sendEvent(v, l.field(v, "translation"), Value(Vec3f(1, 0, 1))));
    l.scene.newFrame(0);
    EXPECT_EQ(l.get(t, "translation"), "4 5 6");
    EXPECT_EQ(l.get(u, "translation"), "7 8 9");
    EXPECT_EQ(l.get("OUT", "translation"), "1 0 1") << "out through IS and on along a ROUTE";
}

TEST(Proto, IsPairsOfTable44) {
    // Rows: access in the body; columns: access in the interface.
    const char* body[] = {"initializeOnly", "inputOnly", "outputOnly", "inputOutput"};
    const bool legal[4][4] = {{true, false, false, false},
                              {false, true, false, false},
                              {false, false, true, false},
                              {true, true, true, true}};
    for (int node = 0; node < 4; ++node)
        for (int proto = 0; proto < 4; ++proto) {
            const auto hasValue = [](int access) { return access == 0 || access == 3; };
            const std::string text =
                fmt::format("PROTO P [ {} SFFloat p {} ] {{ Script {{ {} SFFloat f IS p }} }}\nP {{ }}", body[proto],
                            hasValue(proto) ? "1" : "", body[node]);
            Loaded l(text);
            EXPECT_EQ(l.diagnostics.errors(), legal[node][proto] ? 0u : 1u) << text << '\n' << l.problems();
        }
}

TEST(Proto, InitializeOnlyIntoInputOutputSetsWithoutAnEvent) {
    Loaded l(
        "PROTO P [ initializeOnly SFVec3f at 1 2 3 ] { DEF T Transform { translation IS at } }\nDEF A P { at 4 5 6 }");
    EXPECT_EQ(l.problems(), "");
    int events = 0;
    l.scene.setEventListener([&](double, const Node&, FieldIndex, const Value&) { ++events; });
    l.scene.newFrame(0);
    EXPECT_EQ(events, 0);
    EXPECT_EQ(l.get(l.named("T", l.named("A")), "translation"), "4 5 6");
}

TEST(Proto, SeveralBodyNodesAndRoutesPerInstance) {
    Loaded l(
        "PROTO Twin [ ] { DEF A Transform { } DEF B Transform { } DEF C Group { }\n"
        "  ROUTE A.translation TO B.translation }\n"
        "DEF X Twin { } DEF Y Twin { }");
    EXPECT_EQ(l.problems(), "");
    EXPECT_EQ(l.scene.routeCount(), 2u);
    const NodeId x = l.named("X"), y = l.named("Y");
    EXPECT_EQ(bodyNode(l, x, 0), l.named("A", x));
    EXPECT_EQ(bodyNode(l, x, 2), l.named("C", x));
    ASSERT_TRUE(l.scene.sendEvent(l.named("A", x), l.field(l.named("A", x), "translation"), Value(Vec3f(1, 1, 1))));
    l.scene.newFrame(0);
    EXPECT_EQ(l.get(l.named("B", x), "translation"), "1 1 1");
    EXPECT_EQ(l.get(l.named("B", y), "translation"), "0 0 0");
}

TEST(Proto, UseInsideTheBodyMeansThisInstance) {
    Loaded l("PROTO P [ ] { Group { children [ DEF S Shape { } USE S ] } }\nDEF S Group { } DEF A P { } DEF B P { }");
    EXPECT_EQ(l.problems(), "");
    for (const char* name : {"A", "B"}) {
        const NodeId instance = l.named(name), s = l.named("S", instance);
        EXPECT_EQ(l.nodes(bodyNode(l, instance), "children"), (Array<NodeId>{s, s}));
        EXPECT_EQ(l.scene.node(s).type().name, "Shape");
    }
}

TEST(Proto, OuterNamesAreNotVisibleInside) {
    Loaded l("DEF S Shape { } PROTO P [ ] { Group { children USE S } }\nP { }");
    EXPECT_THAT(l.problems(), HasSubstr("USE 'S'"));
}

TEST(Proto, NestedOverridesGoThroughIncludingNodes) {
    Loaded l(
        "PROTO Inner [ initializeOnly MFNode parts [ ] inputOutput SFVec3f at 0 0 0 ]\n"
        "  { DEF G Transform { children IS parts translation IS at } }\n"
        "PROTO Outer [ initializeOnly MFNode things [ DEF D Shape { } ] inputOutput SFVec3f where 1 1 1 ]\n"
        "  { DEF I Inner { parts IS things at IS where } }\n"
        "DEF A Outer { } DEF B Outer { things [ DEF P Group { } DEF Q Group { } ] where 2 2 2 }");
    EXPECT_EQ(l.problems(), "");
    const NodeId a = l.named("A"), b = l.named("B");
    const NodeId innerA = l.named("I", a), innerB = l.named("I", b);
    ASSERT_TRUE(innerA && innerB);
    const NodeId groupA = l.named("G", innerA), groupB = l.named("G", innerB);
    EXPECT_EQ(l.nodes(groupA, "children"), Array<NodeId>{l.named("D", a)}) << "the default, in the instance's scope";
    EXPECT_EQ(l.nodes(groupB, "children"), (Array<NodeId>{l.named("P"), l.named("Q")}));
    EXPECT_EQ(l.get(groupA, "translation"), "1 1 1");
    EXPECT_EQ(l.get(groupB, "translation"), "2 2 2");
    ASSERT_TRUE(l.scene.sendEvent(b, l.field(b, "where"), Value(Vec3f(3, 3, 3))));
    l.scene.newFrame(0);
    EXPECT_EQ(l.get(groupB, "translation"), "3 3 3");
}

TEST(Proto, AnEditGoesInwardsThroughAllLevels) {
    Loaded l(
        "PROTO Inner [ inputOutput SFVec3f at 0 0 0 ] { DEF T Transform { translation IS at } }\n"
        "PROTO Outer [ inputOutput SFVec3f at 0 0 0 ] { DEF I Inner { at IS at } }\nDEF A Outer { }");
    const NodeId a = l.named("A"), i = l.named("I", a), t = l.named("T", i);
    ASSERT_TRUE(l.scene.setField(a, l.field(a, "at"), Value(Vec3f(1, 2, 3))));
    EXPECT_EQ(l.get(t, "translation"), "1 2 3");
    ASSERT_TRUE(l.scene.setField(i, l.field(i, "at"), Value(Vec3f(4, 5, 6))));
    EXPECT_EQ(l.get(t, "translation"), "4 5 6");
}

TEST(Proto, ChildrenEditedInAnInstanceReachItsBody) {
    Loaded l(
        "PROTO Inner [ inputOutput MFNode kids [ ] ] { DEF G Group { children IS kids } }\n"
        "PROTO Outer [ inputOutput MFNode kids [ ] ] { DEF I Inner { kids IS kids } }\n"
        "DEF A Outer { } DEF S Group { } DEF T Group { }");
    ASSERT_EQ(l.problems(), "");
    const NodeId a = l.named("A"), g = l.named("G", l.named("I", a));
    ASSERT_TRUE(l.scene.insertChild(a, l.field(a, "kids"), l.named("S")));
    ASSERT_TRUE(l.scene.insertChild(a, l.field(a, "kids"), l.named("T"), 0));
    EXPECT_EQ(l.nodes(g, "children"), (Array<NodeId>{l.named("T"), l.named("S")}));
    ASSERT_TRUE(l.scene.removeChild(a, l.field(a, "kids"), 0));
    EXPECT_EQ(l.nodes(g, "children"), Array<NodeId>{l.named("S")});
}

TEST(Proto, AnEmptyListOverridesDefaultNodes) {
    Loaded l(
        "PROTO P [ initializeOnly MFNode c [ Shape { } ] ] { DEF G Group { children IS c } }\nDEF A P { c [ ] } DEF B "
        "P { }");
    EXPECT_EQ(l.problems(), "");
    EXPECT_TRUE(l.nodes(l.named("G", l.named("A")), "children").empty());
    EXPECT_EQ(l.nodes(l.named("G", l.named("B")), "children").size(), 1u);
}

TEST(Proto, BuiltinNamesStay) {
    Loaded l("PROTO Box [ ] { Group { } }\nShape { geometry DEF B Box { size 1 1 1 } }");
    EXPECT_THAT(l.problems(), HasSubstr("Box"));
    EXPECT_GE(l.diagnostics.errors(), 1u);
    EXPECT_EQ(l.get("B", "size"), "1 1 1");
}

TEST(Proto, TheFirstDeclarationStays) {
    Loaded l("PROTO P [ ] { Group { } }\nPROTO P [ ] { Transform { } }\nDEF A P { }");
    EXPECT_GE(l.diagnostics.errors(), 1u);
    EXPECT_EQ(l.scene.node(bodyNode(l, l.named("A"))).type().name, "Group");
}

TEST(Proto, RecursionIsReportedAndEnds) {
    Loaded direct("PROTO P [ ] { Group { children P { } } }\nDEF A P { }");
    EXPECT_GE(direct.diagnostics.errors(), 1u);
    Loaded mutual("PROTO P [ ] { Group { children Q { } } }\nPROTO Q [ ] { Group { children P { } } }\nQ { }");
    EXPECT_GE(mutual.diagnostics.errors(), 1u);
    EXPECT_LT(mutual.scene.nodeCount(), 10u);
}

TEST(Proto, ABombOfInstancesIsStopped) {
    std::string text = "PROTO P0 [ ] { Group { } }\n";
    for (int i = 1; i < 40; ++i)
        text += fmt::format("PROTO P{} [ ] {{ Group {{ children [ P{} {{ }} P{} {{ }} P{} {{ }} ] }} }}\n", i, i - 1,
                            i - 1, i - 1);
    Scene scene;
    Diagnostics diagnostics;
    BuildOptions options;
    ResourcePolicy policy;
    policy.maximumNodes = 10'000;
    options.resources = Resources({}, policy);
    SceneBuilder builder(scene, diagnostics, options);
    readDocument("#X3D V4.0 utf8\n" + text + "P39 { }", builder, diagnostics);
    EXPECT_GE(diagnostics.errors(), 1u);
    EXPECT_LT(scene.nodeCount(), 25'000u);
}

TEST(Proto, AnInstanceMadeByNameHasItsBody) {
    Loaded l(
        "PROTO Part [ inputOutput SFVec3f at 1 2 3 ] { Transform { translation IS at } }\n"
        "PROTO Whole [ inputOutput SFVec3f at 4 5 6 inputOutput MFNode children [ ] ]"
        "{ Group { children [ DEF P Part { at IS at } DEF C Group { children IS children } ] } }\n"
        "DEF A Whole { }");
    const std::size_t types = l.scene.typeCount();
    const NodeId a = l.scene.findName("A");
    const auto created = l.scene.createNode("Whole");
    ASSERT_TRUE(created) << created.error().text;
    EXPECT_EQ(l.scene.typeCount(), types) << "it is of the type that is there";
    EXPECT_EQ(l.scene.node(*created).typeIndex(), l.scene.node(a).typeIndex());
    EXPECT_TRUE(l.scene.parents(*created).empty()) << "where it goes is the caller's";
    ASSERT_TRUE(l.scene.insertChild(l.scene.root(), x3d::RtsgScene::children, *created));
    const NodeId part = l.scene.findName("P", *created);
    ASSERT_TRUE(part);
    EXPECT_NE(part, l.scene.findName("P", a));
    ASSERT_TRUE(l.scene.sendEvent(*created, l.scene.node(*created).type().find("at"), Vec3f(7, 8, 9)));
    l.scene.newFrame(0);
    EXPECT_EQ(l.scene.node(part).value(l.scene.node(part).type().find("at")), Value(Vec3f(7, 8, 9)));
    const auto body = l.scene.node(part).value(l.scene.node(part).type().body()).as<Array<NodeId>>();
    ASSERT_EQ(body.size(), 1u);
    EXPECT_EQ(l.scene.node(body[0]).get(x3d::Transform::translation), Vec3f(7, 8, 9));
    EXPECT_EQ(l.problems(), "");

    const auto unknown = l.scene.createNode("Nothing");
    ASSERT_FALSE(unknown);
    EXPECT_THAT(unknown.error().text, HasSubstr("unknown node type"));
}

/// The limit of nothing at all passes with the first look at the clock, at the 16th command.
TEST(Proto, ReadingEndsWhenItsTimeIsOver) {
    std::string text = "#X3D V4.0 utf8\n";
    for (int i = 0; i < 3000; ++i) text += "Group { }\n";
    const auto nodes = [&](std::uint64_t seconds, std::string& problems) {
        Scene scene;
        Diagnostics diagnostics;
        BuildOptions options;
        ResourcePolicy policy;
        policy.maximumSeconds = seconds;
        options.resources = Resources({}, policy);
        SceneBuilder builder(scene, diagnostics, options);
        readDocument(text, builder, diagnostics);
        builder.finish();
        for (const Diagnostic& d : diagnostics.all()) problems += d.format() + '\n';
        return scene.nodeCount();
    };
    std::string problems;
    EXPECT_EQ(nodes(600, problems), 3001u);
    EXPECT_EQ(problems, "");
    EXPECT_EQ(nodes(0, problems), 16u);
    EXPECT_THAT(problems, HasSubstr("takes more than 0 seconds"));
    EXPECT_THAT(problems, HasSubstr("--limit seconds=N"));
    EXPECT_EQ(std::ranges::count(problems, '\n'), 1) << problems;
}

TEST(Proto, FieldsAreDeclaredUpToABound) {
    for (const int count : {4000, 4001}) {
        std::string fields;
        for (int i = 0; i < count; ++i) fields += "inputOutput SFInt32 f" + std::to_string(i) + " 1\n";
        Loaded l("PROTO P [\n" + fields + "] { Group { } }\nDEF I P { f3999 7 }\nDEF S Script { " + fields + "}");
        const bool tooMany = count > 4000;
        EXPECT_EQ(l.diagnostics.errors(), tooMany ? 2u : 0u) << l.problems();
        EXPECT_EQ(l.problems().find("PROTO P declares more than 4000 fields") != std::string::npos, tooMany);
        EXPECT_EQ(l.problems().find("Script S declares more than 4000 fields") != std::string::npos, tooMany);
        for (const char* name : {"I", "S"}) {
            const Node& node = l.scene.node(l.named(name));
            const FieldIndex last = node.type().find("f3999");
            ASSERT_NE(last, kNoField);
            EXPECT_EQ(node.value(last).as<std::int32_t>(), name[0] == 'I' ? 7 : 1);
            EXPECT_EQ(node.type().find("f4000"), kNoField);
        }
    }
}

TEST(Proto, AnInstanceStandsWhereItsFirstNodeMay) {
    Loaded l(
        "PROTO Look [ ] { Appearance { } }\nPROTO Nested [ ] { Look { } }\n"
        "DEF S Shape { appearance Nested { } }\nDEF T Shape { geometry Look { } }");
    EXPECT_TRUE(l.only(l.named("S"), "appearance"));
    EXPECT_FALSE(l.only(l.named("T"), "geometry"));
    EXPECT_EQ(l.diagnostics.warnings(), 1u) << l.problems();
    EXPECT_THAT(l.problems(), HasSubstr("field 'geometry' of Shape does not take Look"));
}

TEST(Proto, DeclarationsInsideABodyAreItsOwn) {
    Loaded l(
        "PROTO Outer [ ] { PROTO Inner [ ] { Transform { } } Group { children [ DEF I Inner { } ] } }\n"
        "DEF A Outer { } DEF B Outer { } Inner { }");
    EXPECT_EQ(l.diagnostics.warnings(), 1u) << l.problems();
    EXPECT_EQ(l.scene.node(bodyNode(l, l.named("I", l.named("B")))).type().name, "Transform");
    EXPECT_EQ(l.scene.node(l.named("I", l.named("A"))).typeIndex(),
              l.scene.node(l.named("I", l.named("B"))).typeIndex());
}

TEST(Proto, AProtoNobodyUsesIsCheckedToo) {
    Loaded l("PROTO P [ ] { Group { }\n ROUTE A.x TO B.y }\nGroup { }");
    EXPECT_THAT(l.problems(), HasSubstr("test.x3dv:3:"));
    EXPECT_EQ(l.scene.nodeCount(), 2u);
}

TEST(Proto, AFieldMayBeCalledBody) {
    Loaded l("PROTO P [ inputOutput SFFloat body 3 ] { Group { } }\nDEF A P { body 4 }");
    EXPECT_EQ(l.problems(), "");
    EXPECT_EQ(l.get("A", "body"), "4");
    EXPECT_TRUE(bodyNode(l, l.named("A")));
}

TEST(Proto, ScriptsInAThousandInstancesShareOneType) {
    std::string text = "PROTO P [ initializeOnly SFFloat v 0 ] { Script { initializeOnly SFFloat f IS v } }\n";
    for (int i = 0; i < 1000; ++i) text += fmt::format("DEF P{} P {{ v {} }}\n", i, i);
    Loaded l(text);
    EXPECT_EQ(l.problems(), "");
    EXPECT_EQ(l.scene.typeCount(), builtinTypes().size() + 2);
    EXPECT_EQ(l.get(bodyNode(l, l.named("P777")), "f"), "777");
}

TEST(Proto, AReplicaInstancesFromTheDeclaration) {
    Loaded l(
        "PROTO Base [ inputOutput SFVec3f at 1 0 0 ] { DEF T Transform { translation IS at } }\n"
        "PROTO P [ inputOutput SFVec3f at 1 2 3 ] { Group { children DEF B Base { at IS at } } }\nDEF A P { }");
    ASSERT_EQ(l.problems(), "");
    l.scene.newFrame(0);
    Scene replica;
    ASSERT_TRUE(replica.apply(std::make_shared<ChangeSet>(l.scene.snapshot())));
    Diagnostics diagnostics;
    const std::size_t types = replica.typeCount();
    const auto created = instantiate(replica, *replica.findType("P"), diagnostics);
    ASSERT_TRUE(created) << created.error().text;
    EXPECT_EQ(test::allText(diagnostics), "");
    EXPECT_EQ(replica.typeCount(), types);
    const NodeId base = replica.findName("B", *created);
    ASSERT_TRUE(base);
    const Node& t = replica.node(replica.findName("T", base));
    EXPECT_EQ(printFieldText(t.value(t.type().find("translation"))), "1 2 3");
}

}  // namespace
}  // namespace rtsg
