// Versions one apart, in both directions: an older reader follows a newer stream but for what it does not know, and a
// newer reader an older stream.
#include <rtsg/sync/log.h>
#include <rtsg/sync/replay.h>

#include <fstream>

#include <gtest/gtest.h>

#include <rtsg/core/hash_terms.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/change_codec.h>

#include "support/temp_folder.h"
#include "sync/other_types.h"

namespace rtsg {
namespace {

using test::copyOf;
using test::numberOf;

/// This program's types as another version has them: Transform has one field more in front, Box one less, one type is
/// new and one is gone.
std::vector<std::unique_ptr<NodeType>> otherVersion() {
    std::vector<std::unique_ptr<NodeType>> types;
    for (const auto& type : builtinTypes()) {
        if (type->name == "Sphere") {  // in its place, so that all after it have other numbers
            for (const char* name : {"Torus", "Helix"}) {
                auto added = copyOf(*type);
                added->name = name;
                if (!added->finish()) std::abort();
                types.push_back(std::move(added));
            }
            continue;
        }
        auto copy = copyOf(*type);
        if (type->name == "Transform") {
            FieldDef field;
            field.name = "wobble";
            field.type = FieldType::SFVec3f;
            field.defaultValue = Vec3f(0);
            copy->fields.insert(copy->fields.begin(), field);
        }
        if (type->name == "Box") std::erase_if(copy->fields, [](const FieldDef& f) { return f.name == "solid"; });
        if (!copy->finish()) std::abort();
        types.push_back(std::move(copy));
    }
    return types;
}

/// A document of a Transform over a Shape with a box, in the numbers of `types`; then it moves.
struct Stream {
    explicit Stream(TypeTable table) : types(table) {
        ChangeSet set;
        set.to = 1;
        const auto create = [&](std::uint32_t node, std::string_view type) {
            Change& change = set.changes.emplace_back();
            change.kind = ChangeKind::createNode;
            change.node = NodeId{node};
            change.index = numberOf(types, type);
        };
        create(2, "Transform");
        create(3, "Shape");
        create(4, "Box");
        assign(set, 1, "RtsgScene", "children", Array<NodeId>{NodeId{2}});
        assign(set, 2, "Transform", "children", Array<NodeId>{NodeId{3}});
        assign(set, 3, "Shape", "geometry", NodeId{4});
        assign(set, 4, "Box", "size", Vec3f(1, 2, 3));
        sets.push_back(set);
        for (std::uint64_t frame = 1; frame < 60; ++frame) {
            ChangeSet move;
            move.from = frame;
            move.to = frame + 1;
            move.time = double(frame) / 60;
            assign(move, 2, "Transform", "translation", Vec3f(float(frame) * .125f, std::sin(float(frame)), 3));
            assign(move, 2, "Transform", "rotation", Rotation{0, 1, 0, float(frame) * .01f});
            if (numberOf(types, "Torus") != 0xFFFF)
                assign(move, 2, "Transform", "wobble", Vec3f(float(frame), 0, 0));
            else
                assign(move, 4, "Box", "solid", frame % 2 == 0);
            sets.push_back(move);
        }
    }
    void assign(ChangeSet& set, std::uint32_t node, std::string_view type, std::string_view field, Value value) const {
        Change& change = set.changes.emplace_back();
        change.node = NodeId{node};
        change.field = types[numberOf(types, type)]->findExact(field);
        change.value = std::move(value);
    }
    TypeTable types;
    std::vector<ChangeSet> sets;
};

class Versions : public testing::TestWithParam<Coding> {};
INSTANTIATE_TEST_SUITE_P(Codings, Versions, testing::Values(Coding::raw, Coding::compact, Coding::smallest),
                         [](const auto& p) { return std::string(nameOf(p.param)); });

TEST_P(Versions, AReaderOneApartFollowsWhatItKnows) {
    const std::vector<std::unique_ptr<NodeType>> other = otherVersion();
    for (const bool newer : {true, false}) {
        SCOPED_TRACE(newer ? "a stream of the other version, read here" : "the other way round");
        const TypeTable there = newer ? TypeTable(other) : builtinTypes(),
                        here = newer ? builtinTypes() : TypeTable(other);
        const Stream stream(there);
        ByteBuffer head, record;
        encodeHead(7, "another version", there, {}, head);
        StreamMode mode;
        mode.coding = GetParam();
        ChangeEncoder encoder(mode, there);
        ChangeDecoder decoder(here);
        ASSERT_TRUE(decoder.setHead(*decodeHead(head.bytes())));
        EXPECT_FALSE(decoder.exact());
        std::map<std::pair<std::uint32_t, std::string>, Value> values;
        std::map<std::uint32_t, std::uint32_t> typeOf{{1, numberOf(here, "RtsgScene")}};
        ChangeSet found;
        for (const ChangeSet& set : stream.sets) {
            encoder.encode(set, record);
            const Result<> decoded = decoder.decode(record.bytes(), found);
            ASSERT_TRUE(decoded) << decoded.error().text;
            for (const Change& change : found.changes) {
                if (change.kind == ChangeKind::createNode) typeOf[change.node.value] = change.index;
                if (change.kind != ChangeKind::setField) continue;
                const NodeType& type = *here[typeOf.at(change.node.value)];
                ASSERT_LT(change.field, type.fields.size());
                EXPECT_EQ(type.fields[change.field].type, change.value.type());
                values[{change.node.value, type.fields[change.field].name}] = change.value;
            }
        }
        // And back: fields that both have, by the numbers there.
        for (const auto& [node, name, field] :
             {std::tuple{1u, "RtsgScene", "children"}, {2u, "Transform", "rotation"}, {4u, "Box", "size"}}) {
            const auto numberIn = [&](TypeTable types) { return types[numberOf(types, name)]->findExact(field); };
            EXPECT_EQ(decoder.fieldAtWriter(NodeId{node}, numberIn(here)), numberIn(there)) << name;
        }
        if (newer) {
            EXPECT_EQ(decoder.fieldAtWriter(NodeId{4}, here[numberOf(here, "Box")]->findExact("solid")), kNoField);
        }
        EXPECT_EQ(decoder.fieldAtWriter(NodeId{77}, 0), kNoField) << "a node that is not there";
        EXPECT_EQ(typeOf.at(2), numberOf(here, "Transform"));
        EXPECT_EQ(typeOf.at(4), numberOf(here, "Box"));
        EXPECT_EQ((values.at({1, "children"})), Value(Array<NodeId>{NodeId{2}}));
        EXPECT_EQ((values.at({4, "size"})), Value(Vec3f(1, 2, 3)));
        EXPECT_EQ((values.at({2, "translation"})), Value(Vec3f(59 * .125f, std::sin(59.f), 3)));
        EXPECT_EQ((values.at({2, "rotation"})), Value(Rotation{0, 1, 0, 59 * .01f}));
        EXPECT_EQ(decoder.losses().changes, 59u) << "a field that is not here";
    }
}

/// A frame whose input was read before it needs the types of the nodes that both destroy.
TEST(VersionsApart, TheTypesOfDestroyedNodesAreKeptForOneMoreSet) {
    const std::vector<std::unique_ptr<NodeType>> other = otherVersion();
    ByteBuffer head, record;
    encodeHead(7, "another version", other, {}, head);
    ChangeEncoder encoder({}, other);
    ChangeDecoder decoder(builtinTypes());
    ASSERT_TRUE(decoder.setHead(*decodeHead(head.bytes())));
    const Stream stream{TypeTable(other)};
    ChangeSet found, set = stream.sets[0];
    const FieldIndex size = x3d::Box::size.index;
    for (int frame = 0; frame < 4; ++frame) {
        if (frame > 0) set.from = set.to++;
        if (frame > 0) set.changes.clear();
        if (frame == 1) {
            Change& destroyed = set.changes.emplace_back();
            destroyed.kind = ChangeKind::destroyNode;
            destroyed.node = NodeId{4};
        }
        encoder.encode(set, record);
        ASSERT_TRUE(decoder.decode(record.bytes(), found));
        EXPECT_EQ(decoder.fieldAtWriter(NodeId{4}, size) != kNoField, frame < 3) << frame;
        EXPECT_NE(decoder.fieldAtWriter(NodeId{2}, x3d::Transform::rotation.index), kNoField);
    }
}

/// A log of another version, with records and columns that nobody knows yet among the rest.
TEST_P(Versions, ALogOfAnotherVersionIsReplayedButForWhatIsUnknown) {
    const std::vector<std::unique_ptr<NodeType>> other = otherVersion();
    const Stream stream{TypeTable(other)};
    const test::TempFolder own;
    const std::filesystem::path& folder = own.path();
    {
        std::ofstream out(folder / "a.rlog", std::ios::binary);
        const auto write = [&](const ByteBuffer& record) {
            out.write(reinterpret_cast<const char*>(record.data()), std::streamsize(record.size()));
        };
        ByteBuffer record;
        encodeHead(7, "another version", other, {}, record);
        write(record);
        StreamMode mode;
        mode.coding = GetParam();
        ChangeEncoder encoder(mode, other);
        for (const ChangeSet& set : stream.sets) {
            encoder.encode(set, record);
            RecordHeader header = *parseRecordHeader(record.bytes());
            record.put(std::uint8_t{4});  // a column in a coding of the future
            record.putVarint(3);
            record.putVarint(2);
            record.put(std::uint8_t{99});
            record.put(std::uint8_t{0});
            record.put(std::uint8_t{240});  // a kind of block of the future
            record.putVarint(1);
            record.putVarint(1);
            record.put(std::uint8_t{5});
            sealRecord(record, header);
            write(record);
            header.kind = static_cast<RecordKind>(77);  // a kind of record of the future
            sealRecord(record, header);
            write(record);
        }
    }
    auto replayer = Replayer::open(folder / "a.rlog");
    ASSERT_TRUE(replayer) << replayer.error().text;
    while (true) {
        const Result<bool> more = (*replayer)->step();
        ASSERT_TRUE(more) << more.error().text;
        if (!*more) break;
    }
    const Scene& scene = (*replayer)->scene();
    EXPECT_EQ(scene.sequence(), 60u);
    EXPECT_EQ(scene.node(NodeId{2}).get(x3d::Transform::translation), Vec3f(59 * .125f, std::sin(59.f), 3));
    EXPECT_EQ(scene.node(NodeId{4}).get(x3d::Box::size), Vec3f(1, 2, 3));
    EXPECT_TRUE((*replayer)->log().damage().empty());
}

// ---- hashes that outlive a release --------------------------------------------------------------------------------

/// Records what a scene of this program does in the numbers of other tables: as a build with those would have written
/// it.
class ForeignLog {
  public:
    ForeignLog(const std::filesystem::path& file, const Scene& scene, TypeTable types)
        : out_(file, std::ios::binary), renumbered_(scene, types), encoder_({}, types) {
        ByteBuffer record;
        encodeHead(7, "another version", types, {}, record);
        write(record);
    }
    /// `extra`: changes that this program's types cannot hold, and what they add to the hash.
    void add(const ChangeSet& from, std::span<const Change> extra = {}, Hash128 terms = {}) {
        ChangeSet set = renumbered_(from);
        set.changes.insert(set.changes.end(), extra.begin(), extra.end());
        set.hash = set.hash + terms;
        ByteBuffer record;
        encoder_.encode(set, record);
        write(record);
    }
    FieldIndex field(std::string_view type, std::string_view name) const { return renumbered_.field(type, name); }

  private:
    void write(const ByteBuffer& record) {
        out_.write(reinterpret_cast<const char*>(record.data()), std::streamsize(record.size()));
    }

    std::ofstream out_;
    test::Renumbered renumbered_;
    ChangeEncoder encoder_;
};

constexpr const char* kMoving = R"(#X3D V4.0 utf8
PROFILE Immersive
DEF CLOCK TimeSensor { cycleInterval 4 loop TRUE }
DEF PATH PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 2 0 0 ] }
DEF THING Transform { rotation 1 0 0 .5 children [ Shape { geometry DEF BOX Box { size 1 2 3 } } ] }
ROUTE CLOCK.fraction_changed TO PATH.set_fraction
ROUTE PATH.value_changed TO THING.translation
)";

struct Verified {
    std::uint64_t frames = 0, verified = 0;
    std::string divergence, hash;
    std::uint64_t leftOut = 0;
};
Verified verify(const std::filesystem::path& file) {
    auto replayer = Replayer::open(file);
    EXPECT_TRUE(replayer) << replayer.error().text;
    Result<bool> more = true;
    while ((more = (*replayer)->step()) && *more)
        EXPECT_EQ((*replayer)->lastSet().hash, (*replayer)->scene().hash()) << "what subscribers are told";
    EXPECT_TRUE(more) << more.error().text;
    return {(*replayer)->frames(), (*replayer)->verified(),
            (*replayer)->divergence() ? (*replayer)->divergence()->format() : "", (*replayer)->scene().hash().hex(),
            (*replayer)->losses().changes};
}

/// Types as an earlier build had them: `remove` from each field's name list, one type less; all numbers differ.
std::vector<std::unique_ptr<NodeType>> earlierVersion() {
    std::vector<std::unique_ptr<NodeType>> types;
    for (const auto& type : builtinTypes()) {
        if (type->name == "Arc2D") continue;
        auto copy = copyOf(*type);
        std::erase_if(copy->fields, [](const FieldDef& f) {
            return f.name == "solid" || f.name == "pauseTime" || f.name == "bboxDisplay" || f.name == "description";
        });
        if (!copy->finish()) std::abort();
        types.push_back(std::move(copy));
    }
    return types;
}

/// The replica's own hash, too, is the one that was recorded: a new field has its default, and no term.
TEST(HashesOverVersions, ALogOfABuildWithoutSomeFieldsAndTypesIsVerified) {
    const std::vector<std::unique_ptr<NodeType>> earlier = earlierVersion();
    const test::TempFolder folder;
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, kMoving, diagnostics));
    scene.seal();
    {
        ForeignLog log(folder.path() / "a.rlog", scene, earlier);
        log.add(scene.snapshot());
        for (int frame = 1; frame <= 20; ++frame) log.add(*scene.newFrame(frame * .1));
    }
    const Verified found = verify(folder.path() / "a.rlog");
    EXPECT_EQ(found.frames, 21u);
    EXPECT_EQ(found.verified, 21u) << found.divergence;
    EXPECT_EQ(found.hash, scene.hash().hex());
}

/// Types that are not here are defined as the log describes them: same names, same hash.
TEST(HashesOverVersions, ALogOfABuildWithMoreTypesIsVerified) {
    const std::vector<std::unique_ptr<NodeType>> other = otherVersion();
    const test::TempFolder folder;
    Scene scene;
    std::shared_ptr<NodeType> torus = copyOf(*findBuiltinType("Sphere"));
    torus->name = "Torus";
    torus->kind = NodeType::Kind::user;
    ASSERT_TRUE(torus->finish());
    ASSERT_TRUE(scene.defineType(torus));
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, kMoving, diagnostics));
    const Result<NodeId> ring = scene.createNode("Torus");
    ASSERT_TRUE(ring);
    ASSERT_TRUE(scene.setField(*ring, torus->findExact("radius"), 4.f));
    scene.seal();
    {
        ForeignLog log(folder.path() / "a.rlog", scene, other);
        log.add(scene.snapshot());
        for (int frame = 1; frame <= 20; ++frame) {
            ASSERT_TRUE(scene.setField(*ring, torus->findExact("radius"), static_cast<float>(frame)));
            log.add(*scene.newFrame(frame * .1));
        }
    }
    const Verified found = verify(folder.path() / "a.rlog");
    EXPECT_EQ(found.frames, 21u);
    EXPECT_EQ(found.verified, 21u) << found.divergence;
    EXPECT_EQ(found.hash, scene.hash().hex());
}

/// A field that is not here is no part of the scene, but of what is verified; and so are defaults that were others.
TEST(HashesOverVersions, ALogWithFieldsThatAreNotHereIsVerifiedAsItsWriterWould) {
    std::vector<std::unique_ptr<NodeType>> other = otherVersion();
    for (const auto& type : other)
        if (type->name == "Shape") type->fields[type->findExact("castShadow")].defaultValue = Value(false);
    for (auto& type : other) {
        auto copy = copyOf(*type);
        ASSERT_TRUE(copy->finish());
        type = std::move(copy);
    }
    const test::TempFolder folder;
    const auto record = [&](const std::filesystem::path& file, bool wrong) {
        Scene scene;
        Diagnostics diagnostics;
        ASSERT_TRUE(loadText(scene, kMoving, diagnostics));
        const NodeId object = scene.findName("THING");
        const NodeId shape = scene.node(object).get(x3d::Transform::children)[0];
        // In the scene it is no default, in the log it is one.
        ASSERT_TRUE(scene.set(shape, x3d::Shape::castShadow, false));
        scene.seal();
        const bool no = false;
        FieldDef castShadow, wobble;
        castShadow.name = "castShadow";
        wobble.name = "wobble";
        const Hash128 shadow =
            hashOfValue(FieldType::SFBool, &no, hashSeed(shape, fieldKey(castShadow), HashTerm::field));
        const Hash128 without{0 - shadow.low, 0 - shadow.high - (shadow.low ? 1 : 0)};
        ForeignLog log(file, scene, other);
        ChangeSet start = scene.snapshot();
        std::erase_if(start.changes, [&](const Change& c) {
            return c.kind == ChangeKind::setField && c.node == shape && c.field == x3d::Shape::castShadow.index;
        });
        log.add(start, {}, without);
        for (int frame = 1; frame <= 20; ++frame) {
            const Vec3f value(static_cast<float>(frame), 0, 0);
            Change change;
            change.node = object;
            change.field = log.field("Transform", "wobble");
            change.value = value;
            Hash128 term = hashOfValue(FieldType::SFVec3f, &value, hashSeed(object, fieldKey(wobble), HashTerm::field));
            if (wrong && frame == 12) term.low ^= 1;
            log.add(*scene.newFrame(frame * .1), {&change, 1}, without + term);
        }
    };
    record(folder.path() / "a.rlog", false);
    const Verified found = verify(folder.path() / "a.rlog");
    EXPECT_EQ(found.frames, 21u);
    EXPECT_EQ(found.verified, 21u) << found.divergence;
    EXPECT_EQ(found.leftOut, 20u);
    record(folder.path() / "b.rlog", true);
    const Verified wrong = verify(folder.path() / "b.rlog");
    EXPECT_EQ(wrong.verified, 20u);
    EXPECT_TRUE(wrong.divergence.starts_with("frame 13")) << wrong.divergence;
}

}  // namespace
}  // namespace rtsg
