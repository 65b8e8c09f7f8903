// NodeType: names of fields, layout of blocks, ranges, and types that no table describes.
#include <rtsg/core/node_type.h>

#include <gtest/gtest.h>

using namespace rtsg;

namespace {

FieldDef field(std::string name, FieldType type, Access access, Value value = {}) {
    FieldDef result;
    result.name = std::move(name);
    result.type = type;
    result.access = access;
    result.defaultValue = std::move(value);
    return result;
}

void fill(NodeType& type) {
    type.name = "Probe";
    type.implements = {"X3DChildNode", "X3DNode"};
    type.fields.push_back(field("on", FieldType::SFBool, Access::inputOutput, true));
    type.fields.push_back(field("size", FieldType::SFVec3d, Access::initializeOnly, Vec3d(1, 2, 3)));
    type.fields.push_back(field("set_bind", FieldType::SFBool, Access::inputOnly));
    type.fields.push_back(field("isBound", FieldType::SFBool, Access::outputOnly));
    type.fields.push_back(field("url", FieldType::MFString, Access::inputOutput, Array<String>{"a"}));
    type.fields.push_back(field("child", FieldType::SFNode, Access::inputOutput));
    type.fields.push_back(field("rotation", FieldType::SFRotation, Access::inputOutput));
}

}  // namespace

TEST(NodeType, FindsFieldsByAllTheirNames) {
    NodeType type;
    fill(type);
    ASSERT_TRUE(type.finish());
    EXPECT_EQ(type.find("on"), 0);
    EXPECT_EQ(type.find("set_on"), 0);
    EXPECT_EQ(type.find("on_changed"), 0);
    EXPECT_EQ(type.findExact("set_on"), kNoField);
    EXPECT_EQ(type.find("set_bind"), 2);
    EXPECT_EQ(type.find("bind"), kNoField);
    EXPECT_EQ(type.find("set_set_bind"), kNoField);
    EXPECT_EQ(type.find("isBound_changed"), kNoField);
    EXPECT_EQ(type.find("set_size"), kNoField);
    EXPECT_EQ(type.find("size_changed"), kNoField);
    EXPECT_EQ(type.find("set_"), kNoField);
    EXPECT_EQ(type.find("_changed"), kNoField);
    EXPECT_EQ(type.find(""), kNoField);
}

TEST(NodeType, FieldsDoNotOverlapAndAreAligned) {
    NodeType type;
    fill(type);
    ASSERT_TRUE(type.finish());
    std::vector<bool> used(type.blockSize());
    for (const FieldDef& f : type.fields) {
        if (f.access == Access::inputOnly) {
            EXPECT_EQ(f.offset, FieldDef::kNoOffset);
            continue;
        }
        EXPECT_EQ(f.offset % info(f.type).alignment, 0u) << f.name;
        ASSERT_LE(f.offset + info(f.type).size, type.blockSize()) << f.name;
        for (std::size_t b = f.offset; b < f.offset + info(f.type).size; ++b) {
            EXPECT_FALSE(used[b]) << f.name;
            used[b] = true;
        }
        EXPECT_TRUE(equalStorage(f.type, type.defaults() + f.offset, f.defaultValue.storage())) << f.name;
    }
    EXPECT_EQ(type.blockSize() % 8, 0u);
    // 24 (SFVec3d) + 8 (MFString) + 16 (SFRotation) + 4 (SFNode) + 2 SFBool, rounded up.
    EXPECT_EQ(type.blockSize(), 56u);
}

TEST(NodeType, ListsSharedAndNodeFields) {
    NodeType type;
    fill(type);
    ASSERT_TRUE(type.finish());
    ASSERT_EQ(type.sharedFields().size(), 1u);
    EXPECT_EQ(type.fields[type.sharedFields()[0]].name, "url");
    ASSERT_EQ(type.nodeFields().size(), 1u);
    EXPECT_EQ(type.fields[type.nodeFields()[0]].name, "child");
    EXPECT_TRUE(type.isA("Probe"));
    EXPECT_TRUE(type.isA("X3DNode"));
    EXPECT_FALSE(type.isA("X3DShapeNode"));
}

TEST(NodeType, MissingDefaultsAreTheTypesZero) {
    NodeType type;
    fill(type);
    ASSERT_TRUE(type.finish());
    const FieldDef& rotation = type.fields[type.find("rotation")];
    EXPECT_EQ(rotation.defaultValue.as<Rotation>(), Rotation());
}

TEST(NodeType, RefusesTwoFieldsOfOneName) {
    NodeType type;
    fill(type);
    type.fields.push_back(field("on", FieldType::SFInt32, Access::inputOutput));
    EXPECT_FALSE(type.finish());
}

TEST(NodeType, RefusesMoreThan4096Fields) {
    NodeType type;
    for (int i = 0; i < 4097; ++i)
        type.fields.push_back(field("f" + std::to_string(i), FieldType::SFMatrix4d, Access::inputOutput));
    EXPECT_FALSE(type.finish());
    type.fields.pop_back();
    EXPECT_TRUE(type.finish());  // 512 kB of block: offsets are 32 bits wide
    EXPECT_EQ(type.fields.back().offset, 128u * 4095u);
}

/// Such as come over the wire from a program whose tables this one does not have.
TEST(NodeType, ATypeThatNoTableDescribesIsWhatItsAbstractTypesAre) {
    const auto created = [](std::vector<std::string> implements, NodeType& type) {
        fill(type);
        type.kind = NodeType::Kind::user;
        type.implements = std::move(implements);
        type.fields.push_back(field("children", FieldType::MFNode, Access::inputOutput));
        EXPECT_TRUE(type.finish());
    };
    NodeType plain, interpolator, view, group, bounded;
    created({"X3DChildNode", "X3DNode"}, plain);
    EXPECT_EQ(plain.acts, Acts::always);  // it has an output
    EXPECT_TRUE(plain.writesInputs);
    EXPECT_EQ(plain.role, "");
    created({"Own", "X3DInterpolatorNode", "X3DChildNode", "X3DNode"}, interpolator);
    EXPECT_EQ(interpolator.acts, Acts::onInput);
    EXPECT_TRUE(interpolator.writesInputs);
    created({"X3DViewpointNode", "X3DBindableNode", "X3DChildNode", "X3DNode"}, view);
    EXPECT_EQ(view.role, "view");
    EXPECT_TRUE(view.below.empty());
    created({"X3DGroupingNode", "X3DChildNode", "X3DNode", "X3DBoundedObject"}, group);
    EXPECT_EQ(group.role, "group");
    EXPECT_EQ(group.below, std::vector{group.findExact("children")});
    created({"X3DChildNode", "X3DNode", "X3DBoundedObject"}, bounded);
    EXPECT_EQ(bounded.role, "group");
    EXPECT_EQ(bounded.below.size(), 1U);
}
