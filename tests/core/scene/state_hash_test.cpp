// The state hash: values that never change, what may not change them, and what must. PROTOCOL.md, "State hash", says
// how they come about; sync/js/test/state_hash.test.js has some of them from its own code.
#include <rtsg/core/hash_terms.h>

#include <set>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

namespace rtsg {
namespace {

Hash128 minus(Hash128 a, Hash128 b) {
    return {a.low - b.low, a.high - b.high - (a.low < b.low ? 1 : 0)};
}

/// A number that another build, or another program, gave to a state must be that state's for ever.
TEST(StateHash, TheExampleOfTheProtocolHasItsHash) {
    Scene scene;
    EXPECT_EQ(scene.hash().hex(), "00000000000000000000000000000000");
    const NodeId node = scene.createNode(x3d::Transform::type);
    ASSERT_EQ(node.value, 2u);
    ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, node));
    ASSERT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(1, 2, 3)));
    ASSERT_TRUE(scene.setName(node, "A"));
    scene.seal();
    EXPECT_EQ(scene.hash().hex(), "f725bafa49fad5584f08f409851e47e5");
}

/// The term of one field with one value, by setting it.
std::string termOf(std::string_view type, std::string_view field, Value value) {
    Scene scene;
    const Result<NodeId> node = scene.createNode(type);
    EXPECT_TRUE(node);
    scene.seal();
    const Hash128 before = scene.hash();
    EXPECT_TRUE(scene.setField(*node, scene.node(*node).type().findExact(field), std::move(value)));
    scene.seal();
    return minus(scene.hash(), before).hex();
}

TEST(StateHash, ValuesOfEverySizeHaveTheirTerms) {
    EXPECT_EQ(termOf("Switch", "whichChoice", 3), "7a25f91bc7ac9c2e1d5c2be197fa379b");
    EXPECT_EQ(termOf("PointLight", "on", false), "5e3b9bbf05365d06fe1a8f1f72355a47");
    EXPECT_EQ(termOf("TimeSensor", "cycleInterval", Time{2.5}), "66ccb6710ec2bf3e2c81830f3ebe01aa");
    EXPECT_EQ(termOf("Transform", "rotation", Rotation{0, 1, 0, .5f}), "39a95f6665de3654a6161678ce7ff894");
    EXPECT_EQ(termOf("TextureTransform", "center", Vec2f(.25f, .5f)), "da4b0f69539dd911d467237fa0033cca");
    EXPECT_EQ(termOf("Coordinate", "point", Array<Vec3f>{Vec3f(1, 2, 3), Vec3f(4, 5, 6)}),
              "c897f78ddf2be24c4d206acd12a1d12a");
    EXPECT_EQ(termOf("Text", "string", Array<String>{String("one"), String(""), String("Grüße")}),
              "836e401dd6e26bcd772c9bfb9d1d2e3b");
    EXPECT_EQ(termOf("Text", "string", Array<String>{}), "00000000000000000000000000000000") << "the default";
}

/// All kinds of terms at once: nodes, scopes, names, routes, IS connections, hidden fields, children.
TEST(StateHash, ADocumentHasItsHash) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, R"(#X3D V4.0 utf8
PROFILE Immersive
PROTO Lamp [ inputOutput SFBool on TRUE ] { Group { children [ DEF BULB PointLight { on IS on } ] } }
DEF LAMP Lamp { on FALSE }
DEF ON BooleanToggle { }
DEF A Group { children [ DEF B Transform { translation 1 0 0 } USE B ] }
ROUTE ON.toggle TO LAMP.on
)",
                         diagnostics));
    scene.seal();
    EXPECT_EQ(scene.hash().hex(), "1bade1941070808139389be1b6c8f577");
}

std::shared_ptr<NodeType> typeWith(std::initializer_list<const char*> floats) {
    auto type = std::make_shared<NodeType>();
    type->name = "Gadget";
    type->kind = NodeType::Kind::user;
    type->implements = {"X3DChildNode"};
    for (const char* name : floats) {
        FieldDef& field = type->fields.emplace_back();
        field.name = name;
        field.type = FieldType::SFFloat;
    }
    EXPECT_TRUE(type->finish());
    return type;
}

/// A node of it with `b` 2, and a route from it to another's `b`; types before it give it another number.
Hash128 hashWith(std::initializer_list<const char*> fields, int typesBefore) {
    Scene scene;
    for (int i = 0; i < typesBefore; ++i) {
        auto other = typeWith({"x"});
        other->name = "Other" + std::to_string(i);
        EXPECT_TRUE(scene.defineType(other));
    }
    const auto type = scene.defineType(typeWith(fields));
    EXPECT_TRUE(type);
    const NodeId from = scene.createNode(*type), to = scene.createNode(*type);
    const FieldIndex b = scene.type(*type).findExact("b");
    EXPECT_TRUE(scene.setField(from, b, 2.f));
    EXPECT_TRUE(scene.addRoute(from, b, to, b));
    scene.seal();
    return scene.hash();
}

TEST(StateHash, FieldsAndTypesThatAreAddedChangeNothing) {
    const Hash128 before = hashWith({"a", "b"}, 0);
    EXPECT_EQ(hashWith({"new", "a", "newer", "b", "last"}, 0), before);
    EXPECT_EQ(hashWith({"b", "a"}, 3), before);
    EXPECT_NE(hashWith({"b"}, 0), Hash128{});
}

TEST(StateHash, TheNameOfAFieldCounts) {
    Scene scene;
    const auto type = scene.defineType(typeWith({"a", "b"}));
    ASSERT_TRUE(type);
    const NodeId node = scene.createNode(*type);
    ASSERT_TRUE(scene.setField(node, 0, 2.f));
    scene.seal();
    const Hash128 a = scene.hash();
    ASSERT_TRUE(scene.setField(node, 0, 0.f));
    ASSERT_TRUE(scene.setField(node, 1, 2.f));
    scene.seal();
    EXPECT_NE(scene.hash(), a);
}

TEST(StateHash, AHiddenFieldIsNotThePublicOneOfItsName) {
    FieldDef field;
    field.name = "body";
    const FieldKey open = fieldKey(field);
    field.hidden = true;
    EXPECT_NE(fieldKey(field), open);
}

/// With small numbers side by side in the seed of a term and in its bytes, one could make up for the other: routes from
/// 4 to field 10 and from 5 to field 11 had one hash.
TEST(StateHash, NeighbouringNumbersDoNotMakeUpForEachOther) {
    std::set<std::string> hashes;
    for (std::uint32_t node = 2; node < 34; ++node)
        for (std::uint32_t before = 0; before < 16; ++before)
            for (std::uint32_t after = 0; after < 16; ++after) {
                const std::uint32_t pair[2] = {before, after};
                hashes.insert(hashOfBytes(pair, sizeof(pair), hashSeed(NodeId{node}, 77, HashTerm::children)).hex());
            }
    EXPECT_EQ(hashes.size(), 32u * 16 * 16);
}

/// The hash that is kept up to date, and the one that is counted anew, by names.
TEST(StateHash, TheSumOfTheTermsIsTheHash) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, R"(#X3D V4.0 utf8
PROTO P [ inputOutput SFFloat x 0 ] { PointLight { intensity IS x } }
DEF A P { x .5 }
DEF B ScalarInterpolator { key [ 0 1 ] keyValue [ 0 1 ] }
DEF T TimeSensor { loop TRUE }
ROUTE T.fraction_changed TO B.set_fraction
ROUTE B.value_changed TO A.x
)",
                         diagnostics));
    for (int frame = 1; frame < 5; ++frame) {
        scene.newFrame(frame * .1);
        Hash128 sum;
        scene.forEachNode([&](const Node& node) { sum = sum + hashOfNode(scene, node); });
        ASSERT_EQ(sum, scene.hash()) << frame;
    }
}

}  // namespace
}  // namespace rtsg
