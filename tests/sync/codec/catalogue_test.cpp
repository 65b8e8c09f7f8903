// The catalogue: every built-in type is in it and none of its entries ever changes; scene records that name it are read
// as the same state, here and by programs of other versions, and what they do not know is refused.
#include "codec/catalogue.h"

#include <cstdlib>
#include <filesystem>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/change_codec.h>

#include "columns/wire.h"
#include "support/log_support.h"
#include "support/random_edits.h"
#include "test_paths.h"

namespace rtsg {
namespace {

ByteBuffer bytesOfEntry(std::size_t number) {
    ByteBuffer bytes;
    wire::putType(bytes, *wire::catalogueType(number));
    return bytes;
}

/// With RTSG_WRITE_CATALOGUE=FILE it writes them with what is missing at the end.
TEST(Catalogue, HasEveryBuiltInTypeAsItIs) {
    if (const char* file = std::getenv("RTSG_WRITE_CATALOGUE")) {
        const ByteBuffer bytes = wire::catalogueWith(builtinTypes());
        return test::writeAll(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    }
    for (const auto& type : builtinTypes()) {
        const auto number = wire::catalogueNumber(*type);
        ASSERT_TRUE(number) << type->name << ": RTSG_WRITE_CATALOGUE=sync/catalogue.bin build/test_sync "
                            << "--gtest_filter='Catalogue.HasEvery*' appends it";
        EXPECT_EQ(wire::catalogueType(*number)->name, type->name);
    }
    EXPECT_EQ(wire::catalogueWith(builtinTypes()).size(),
              std::filesystem::file_size(RTSG_SOURCE_DIR "/sync/catalogue.bin"));
    EXPECT_EQ(wire::catalogueType(wire::catalogueSize()), nullptr);
}

/// Files out there name these. When a release adds entries, they join by raising the count and the sum.
TEST(Catalogue, WhatWasGivenOutStays) {
    constexpr std::size_t kGivenOut = 266;
    ByteBuffer bytes;
    ASSERT_GE(wire::catalogueSize(), kGivenOut);
    for (std::size_t i = 0; i < kGivenOut; ++i) bytes.append(bytesOfEntry(i).bytes());
    EXPECT_EQ(checksumOf(bytes.bytes()), 0xf1b21584ddb88f0au);
    EXPECT_EQ(checksumOf(wire::sceneWords()), 0x4eda0ce9dcae0f0cu);
    std::set<std::string> different;
    for (std::size_t i = 0; i < wire::catalogueSize(); ++i) {
        const ByteBuffer entry = bytesOfEntry(i);
        different.emplace(reinterpret_cast<const char*>(entry.data()), entry.size());
    }
    EXPECT_EQ(different.size(), wire::catalogueSize()) << "an entry that is there twice";
}

constexpr const char* kSceneOfMany =
    "#X3D V4.0 utf8\nPROTO P [ inputOutput SFFloat f 1 ] { Transform { } }\n"
    "DEF T Transform { translation 1 2 3 children [ P { f 2 } DEF S Shape { geometry Sphere { radius 2 } } ] }\n"
    "DEF C TimeSensor { loop TRUE }\nDEF X Script { field SFInt32 n 3 }\nROUTE C.isActive TO C.set_loop\n";

void loadScene(Scene& scene) {
    Diagnostics problems("test");
    ASSERT_TRUE(loadText(scene, kSceneOfMany, problems));
    scene.newFrame(2);
}

ByteBuffer sceneRecord(const Scene& scene) {
    ByteBuffer record;
    EXPECT_TRUE(ChangeEncoder().encodeScene(scene.snapshot(), record));
    EXPECT_EQ(parseRecordHeader(record.bytes())->kind, RecordKind::scene);
    return record;
}

/// With another u16 at `at` of the payload.
ByteBuffer changed(const ByteBuffer& record, std::size_t at, std::uint16_t number) {
    ByteBuffer result;
    result.append(record.bytes());
    std::memcpy(result.data() + kRecordHeaderSize + at, &number, sizeof(number));
    sealRecord(result, *parseRecordHeader(record.bytes()));
    return result;
}

std::string refusalOf(const ByteBuffer& record) {
    ChangeSet set;
    ChangeDecoder decoder(builtinTypes());
    const auto ok = decoder.decode(record.bytes(), set);
    return ok ? "" : ok.error().text;
}

TEST(SceneRecord, HoldsTheStateWithoutAHeadOrDescriptions) {
    Scene scene, again;
    loadScene(scene);
    const ByteBuffer record = sceneRecord(scene);
    auto set = std::make_shared<ChangeSet>();
    ChangeDecoder decoder(builtinTypes());
    const auto ok = decoder.decode(record.bytes(), *set);
    ASSERT_TRUE(ok) << ok.error().text;
    EXPECT_TRUE(decoder.exact());
    ASSERT_TRUE(again.apply(std::move(set)));
    EXPECT_EQ(again.hash(), scene.hash());
    EXPECT_EQ(again.dump(), scene.dump());
    EXPECT_LT(record.size(), 600u);  // the description of Transform alone has 400
}

TEST(SceneRecord, OfRandomScenesIsTheSameState) {
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
        SCOPED_TRACE(seed);
        Scene scene, again;
        if (seed % 2) loadScene(scene);
        test::RandomEdits edits(scene, seed);
        for (std::uint64_t i = 0; i < seed * 10; ++i) edits.step();
        scene.newFrame(3);
        auto set = std::make_shared<ChangeSet>();
        const auto ok = ChangeDecoder(builtinTypes()).decode(sceneRecord(scene).bytes(), *set);
        ASSERT_TRUE(ok) << ok.error().text;
        ASSERT_TRUE(again.apply(std::move(set)));
        EXPECT_EQ(again.hash(), scene.hash());
        EXPECT_EQ(again.dump(), scene.dump());
    }
}

TEST(SceneRecord, OfALaterVersionIsRefusedByName) {
    Scene scene;
    loadScene(scene);
    const ByteBuffer record = sceneRecord(scene);
    EXPECT_THAT(refusalOf(changed(record, 0, 2)), testing::HasSubstr("version unknown"));
    const auto count = static_cast<std::uint16_t>(wire::catalogueSize());
    EXPECT_THAT(refusalOf(changed(record, 4, count)), testing::HasSubstr("root"));
    EXPECT_THAT(refusalOf(changed(record, 4, 0xFFFF)), testing::HasSubstr("root"));
    // If the writer knew more, the number that its PROTO has here is a place in its catalogue.
    EXPECT_EQ(refusalOf(changed(record, 2, count)), "");
    const std::string refusal = refusalOf(changed(record, 2, static_cast<std::uint16_t>(count + 1)));
    EXPECT_THAT(refusal, testing::HasSubstr("type " + std::to_string(count) + " of the catalogue"));
    EXPECT_THAT(refusal, testing::HasSubstr("later version"));
    for (const std::size_t length : {0u, 1u, 3u, 5u}) {
        ByteBuffer cut;
        cut.append(record.bytes().first(kRecordHeaderSize + length));
        sealRecord(cut, *parseRecordHeader(record.bytes()));
        EXPECT_THAT(refusalOf(cut), testing::HasSubstr("cut short")) << length;
    }
}

/// This program's types as one of another version has them: in the opposite order, Sphere perhaps with a field
/// more in front.
std::vector<std::unique_ptr<NodeType>> typesOfAnother(bool more) {
    std::vector<std::unique_ptr<NodeType>> types;
    for (std::size_t i = builtinTypes().size(); i-- > 0;) {
        auto copy = wire::catalogueType(*wire::catalogueNumber(*builtinTypes()[i]));
        if (more && copy->name == "Sphere") {
            FieldDef& field = *copy->fields.insert(copy->fields.begin(), FieldDef{});
            field.name = "dents";
            field.type = FieldType::SFInt32;
            field.defaultValue = std::int32_t{3};
            if (!copy->finish()) std::abort();
        }
        types.push_back(std::move(copy));
    }
    return types;
}

TEST(SceneRecord, IsReadByAProgramThatNumbersTheSameTypesOtherwise) {
    Scene scene;
    loadScene(scene);
    const auto types = typesOfAnother(false);
    ChangeDecoder decoder{TypeTable(types)};
    decoder.countOriginHash();
    ChangeSet set;
    const auto ok = decoder.decode(sceneRecord(scene).bytes(), set);
    ASSERT_TRUE(ok) << ok.error().text;
    EXPECT_TRUE(decoder.exact());
    EXPECT_FALSE(decoder.originHash());
    std::size_t nodes = 0;
    for (const Change& change : set.changes) {
        if (change.kind != ChangeKind::createNode) continue;
        const std::string& name = scene.node(change.node).type().name;
        EXPECT_EQ(change.index < types.size() ? types[change.index]->name : name, name);
        EXPECT_EQ(change.index >= types.size(), scene.node(change.node).type().kind != NodeType::Kind::builtin);
        ++nodes;
    }
    EXPECT_EQ(nodes, scene.nodeCount() - 1);
    ASSERT_FALSE(set.types.empty());
    EXPECT_EQ(set.types.front().index.value, types.size());
}

TEST(SceneRecord, IsReadByAProgramOfOtherTypes) {
    Scene scene;
    loadScene(scene);
    const ByteBuffer record = sceneRecord(scene);
    const auto types = typesOfAnother(true);
    ChangeDecoder decoder{TypeTable(types)};
    decoder.countOriginHash();
    ChangeSet set;
    const auto ok = decoder.decode(record.bytes(), set);
    ASSERT_TRUE(ok) << ok.error().text;
    EXPECT_FALSE(decoder.exact());
    EXPECT_EQ(decoder.originHash(), scene.hash());
    const NodeId sphere = scene.node(scene.findName("S")).get(x3d::Shape::geometry);
    bool created = false, assigned = false;
    for (const Change& change : set.changes) {
        if (change.node != sphere) continue;
        if (change.kind == ChangeKind::createNode) {
            EXPECT_EQ(types.at(change.index)->name, "Sphere");
            created = true;
        } else if (change.value.holds<float>()) {
            EXPECT_EQ(change.field, x3d::Sphere::radius.index + 1);
            EXPECT_EQ(change.value.as<float>(), 2);
            assigned = true;
        }
    }
    EXPECT_TRUE(created && assigned);
    // Its types are not in the catalogue: it writes a head, a keyframe and descriptions.
    ByteBuffer none;
    EXPECT_FALSE(ChangeEncoder({}, TypeTable(types)).encodeScene(set, none));
}

}  // namespace
}  // namespace rtsg
