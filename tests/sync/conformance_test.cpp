// The conformance set: small logs with what a reader has to make of them. Checks that this reader does; with
// RTSG_WRITE_CONFORMANCE=FOLDER it writes the set anew (tests/sync/conformance/README.md).
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <rtsg/core/custom_field.h>

#include <rtsg/core/change_composer.h>
#include <rtsg/core/field_text.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/dictionary.h>
#include <rtsg/sync/log_compact.h>
#include <rtsg/sync/log_summary.h>
#include <rtsg/sync/lossy_scene.h>
#include <rtsg/sync/scene_file.h>

#include "conformance_support.h"
#include "parts/part.h"
#include "support/log_support.h"
#include "test_paths.h"

namespace rtsg {
namespace {

using namespace test;
namespace fs = std::filesystem;

/// The result of a reader of PROTOCOL.md for a log, or for a scene file.
std::string expectedOf(const fs::path& log) {
    if (!isLog(log)) {
        Scene scene;
        const auto read = readSceneFile(scene, log);
        EXPECT_TRUE(read) << log;
        return fmt::format(
            "{{\"states\":[[{},\"{}\"]],\n\"gaps\":0,\"damage\":[],\"closed\":false,"
            "\"unclosed_sessions\":0,\n\"last\":{}}}\n",
            scene.sequence(), scene.hash().hex(), dumpOf(scene));
    }
    auto replayer = Replayer::open(log);
    EXPECT_TRUE(replayer) << replayer.error().format();
    std::string states, damage;
    while (true) {
        const Result<bool> more = (*replayer)->step();
        EXPECT_TRUE(more) << more.error().format();
        if (!more || !*more) break;
        const Scene& scene = (*replayer)->scene();
        states += fmt::format("{}[{},\"{}\"]", states.empty() ? "" : ",", scene.sequence(), scene.hash().hex());
    }
    const LogReader& read = (*replayer)->log();
    for (const LogDamage& d : read.damage())
        damage += fmt::format("{}{{\"offset\":{},\"length\":{}}}", damage.empty() ? "" : ",", d.offset, d.length);
    EXPECT_FALSE((*replayer)->divergence()) << log;
    return fmt::format(
        "{{\"states\":[{}],\n\"gaps\":{},\"damage\":[{}],\"closed\":{},\"unclosed_sessions\":{},\n\"last\":{}}}\n",
        states, (*replayer)->gaps(), damage, read.closed(), (*replayer)->unclosedSessions(),
        dumpOf((*replayer)->scene()));
}

// ---- the generator ---------------------------------------------------------------------------------------------

LogOptions optionsOf(std::uint64_t epoch, Coding coding = Coding::raw) {
    LogOptions options;
    options.epoch = epoch;
    options.creator = "conformance";
    options.mode.coding = coding;
    options.keyframeBytes = 6000;
    options.keyframeFactor = .5;
    return options;
}

constexpr const char* kDocument = R"(#X3D V4.0 utf8
PROFILE Immersive
PROTO Lamp [ inputOutput SFBool on TRUE initializeOnly SFColor tint 1 .5 .25 inputOutput MFString label [ "a" "" ] ] {
  Group { children [ DEF BULB PointLight { on IS on color IS tint } Shape { geometry Text { string IS label } } ] }
}
DEF LAMP Lamp { on FALSE label [ "Grüße" "\"x\"" "" ] }
DEF PICTURE Shape { appearance Appearance { texture PixelTexture { image 2 2 3 0xFF0000 0x00FF00 0x0000FF 0xFFFFFF } }
  geometry IndexedFaceSet { coordIndex [ 0 1 2 -1 ] coord Coordinate { point [ 0 0 0, 1 0 0, 0 1 0 ] } } }
DEF ON BooleanToggle { }
DEF CLOCK TimeSensor { cycleInterval 1.25 loop TRUE }
DEF TURN OrientationInterpolator { key [ 0 .5 1 ] keyValue [ 0 1 0 0, 0 1 0 3.14, 0 1 0 6.28 ] }
DEF THING Transform { rotation 1 0 0 .5 children [ USE PICTURE ] }
ROUTE CLOCK.fraction_changed TO TURN.set_fraction
ROUTE TURN.value_changed TO THING.rotation
ROUTE ON.toggle TO LAMP.on
)";

void writeDocument(const fs::path& file, bool inputs) {
    Scene scene;
    scene.setInputRecording(inputs);
    scene.newFrame(10);
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, kDocument, diagnostics));
    LogOptions options = optionsOf(0x1001 + inputs);
    options.inputs = inputs;
    auto log = LogWriter::create(file, builtinTypes(), options);
    ASSERT_TRUE(log);
    const Attachment attachment = scene.bus().attach(**log);
    for (int k = 0; k < 12; ++k) {
        if (k == 5) {
            ASSERT_TRUE(scene.sendEvent(scene.findName("ON"), x3d::BooleanToggle::set_boolean.index, true));
        }
        scene.newFrame(10 + k / 8.0);
    }
    ASSERT_TRUE((*log)->close());
}

void writeEdits(const fs::path& file, std::uint64_t epoch, bool append = false) {
    Scene scene;
    LogOptions options = optionsOf(epoch);
    options.append = append;
    auto log = LogWriter::create(file, builtinTypes(), options);
    ASSERT_TRUE(log);
    const Attachment attachment = scene.bus().attach(**log);
    RandomEdits edits(scene, epoch);
    for (int frame = 0; frame < 25; ++frame) {
        for (int i = 0; i < 6; ++i) edits.step();
        scene.newFrame(frame * .125);
    }
    ASSERT_TRUE((*log)->close());
}

/// As a mirror writes it whose origin started anew: the first session lacks its end, the second one has it.
void writeUnclosed(const fs::path& file) {
    fs::remove(file);
    writeEdits(file, 0x2004);
    std::uint64_t end = 0;
    {
        auto log = LogReader::open(file);
        ASSERT_TRUE(log);
        while (const auto record = log->next())
            if (record->header.kind == RecordKind::index) end = record->offset;
    }
    ASSERT_GT(end, 0u);
    fs::resize_file(file, end);
    writeEdits(file, 0x2005, true);
}

/// A rotated log: its pieces joined; without the last ones; and with those of another session before and between.
void writePieces(const fs::path& folder) {
    LogOptions options = optionsOf(0x6001);
    options.rotateSeconds = 1.2;
    {
        Scene scene;
        auto log = LogWriter::create(folder / "piece.rlog", builtinTypes(), options);
        ASSERT_TRUE(log);
        const Attachment attachment = scene.bus().attach(**log);
        RandomEdits edits(scene, options.epoch);
        for (int frame = 0; frame < 25; ++frame) {
            for (int i = 0; i < 6; ++i) edits.step();
            scene.newFrame(frame * .125);
        }
        ASSERT_TRUE((*log)->close());
    }
    auto files = earlierPieces(folder / "piece.rlog");
    ASSERT_EQ(files.size(), 2u);
    files.push_back(folder / "piece.rlog");
    std::vector<std::string> pieces;
    for (const fs::path& file : files) pieces.push_back(readAll(file));
    for (const fs::path& file : files) fs::remove(file);
    writeAll(folder / "pieces.rlog", pieces[0] + pieces[1] + pieces[2]);
    writeAll(folder / "pieces_cut.rlog", pieces[0] + pieces[1]);
    writeAll(folder / "pieces_mixed.rlog", pieces[0] + readAll(folder / "edits.rlog") + pieces[1] + pieces[2]);
}

void writeMotion(const fs::path& file, std::uint64_t epoch, Coding coding, bool lossy) {
    Scene scene;
    std::unique_ptr<LossyScene> followed;
    LogOptions options = optionsOf(epoch, coding);
    if (lossy) {
        auto created = LossyScene::follow(scene, 1e-3);
        ASSERT_TRUE(created);
        followed = std::move(*created);
        options.mode.mode = Mode::lossy;
        options.mode.maxError = 1e-3;
    }
    auto log = LogWriter::create(file, builtinTypes(), options);
    ASSERT_TRUE(log);
    const Attachment attachment = (followed ? followed->scene() : scene).bus().attach(**log);
    MovingNodes motion(scene);
    for (int k = 0; k < 36; ++k) {
        motion.frame(k, !lossy);
        scene.newFrame(k / 20.0);
    }
    ASSERT_TRUE((*log)->close());
}

/// Frames merged into one: every third.
void writeMerged(const fs::path& file) {
    Scene scene;
    auto log = LogWriter::create(file, builtinTypes(), optionsOf(0x4001, Coding::smallest));
    ASSERT_TRUE(log);
    MovingNodes motion(scene);
    scene.newFrame(0);
    ASSERT_TRUE((*log)->write(scene.snapshot()));
    ChangeComposer composer;
    for (int k = 1; k < 30; ++k) {
        motion.frame(k, true);
        const auto set = scene.newFrame(k / 20.0);
        composer.add(*set);
        if (k % 3 == 0 || k > 20) {
            ASSERT_TRUE((*log)->write(composer.take()));
        }
    }
    ASSERT_TRUE((*log)->close());
}

/// The records for a peer that asked for the surroundings of a viewpoint: nodes come and go with it, beside changes of
/// those that stay.
void writeRegion(const fs::path& file) {
    Scene scene;
    mirror::Wishes wishes;
    wishes.parts = {"region:EYE,5,.2"};
    const NodeId eye = scene.createNode(x3d::Viewpoint::type);
    ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, eye));
    ASSERT_TRUE(scene.setName(eye, "EYE"));
    std::vector<NodeId> positions;
    for (int i = 0; i < 12; ++i) {
        const NodeId transform = scene.createNode(x3d::Transform::type), shape = scene.createNode(x3d::Shape::type);
        ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, transform));
        ASSERT_TRUE(scene.insertChild(transform, x3d::Transform::children, shape));
        ASSERT_TRUE(scene.set(shape, x3d::Shape::geometry, scene.createNode(x3d::Box::type)));
        ASSERT_TRUE(scene.set(transform, x3d::Transform::translation, Vec3f(2.5f * static_cast<float>(i), 0, 0)));
        positions.push_back(transform);
    }
    const NodeId lamp = scene.createNode(x3d::PointLight::type), clock = scene.createNode(x3d::TimeSensor::type);
    for (const NodeId node : {lamp, clock})
        ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, node));
    ASSERT_TRUE(scene.setName(positions[4], "FOURTH"));
    for (const std::size_t i : {std::size_t{3}, std::size_t{5}})
        ASSERT_TRUE(scene.addRoute(positions[i], x3d::Transform::translation.index, positions[4],
                                   x3d::Transform::center.index));
    scene.newFrame(0);
    MirrorPart part(wishes);
    SpatialIndex shapes;
    shapes.coverRadius(5);
    auto log = LogWriter::create(file, builtinTypes(), optionsOf(0x5001, Coding::smallest));
    ASSERT_TRUE(log);
    ASSERT_TRUE(shapes.follow(scene, nullptr));
    const auto first = part.follow(scene, nullptr, &shapes);
    ASSERT_TRUE(first);
    ASSERT_TRUE((*log)->write(**first));
    for (int k = 1; k <= 40; ++k) {
        const auto at = static_cast<float>(k);
        ASSERT_TRUE(scene.set(eye, x3d::Viewpoint::position, Vec3f(at < 25 ? at : 50 - at, 0, 0)));
        const std::size_t i = static_cast<std::size_t>(k * 5) % positions.size();
        const bool isUp = scene.node(positions[i]).get(x3d::Transform::translation).y != 0;
        ASSERT_TRUE(scene.set(positions[i], x3d::Transform::translation,
                              Vec3f(2.5f * static_cast<float>(i), isUp ? 0.f : 6.f, 0)));
        ASSERT_TRUE(scene.set(lamp, x3d::PointLight::intensity, at / 40));
        if (k == 12) {
            ASSERT_TRUE(scene.removeChild(scene.root(), x3d::RtsgScene::children.index, 5));
            ASSERT_TRUE(scene.insertChild(positions[6], x3d::Transform::children, positions[4]));
        }
        const auto set = scene.newFrame(k / 8.0);
        ASSERT_TRUE(shapes.follow(scene, &*set));
        const auto step = part.follow(scene, &*set, &shapes);
        ASSERT_TRUE(step);
        ASSERT_TRUE((*log)->write(**step));
    }
    ASSERT_TRUE((*log)->close());
}

/// Fields of types from outside: numbers of each kind, bytes, lists of them, defaults, and events along a route.
void writeCustom(const fs::path& file) {
    using Of = CustomLayout::Of;
    const auto quantity = CustomType::make("SFQuantity", {Of::float64, 2}).value(),
               count = CustomType::make("SFCount", {Of::int32, 1}).value(),
               basis = CustomType::make("SFBasis", {Of::float32, 3}).value(),
               tag = CustomType::make("SFTag", {Of::bytes, 0}).value();
    auto type = std::make_shared<NodeType>();
    type->name = "Crate";
    type->component = "Workshop";
    type->kind = NodeType::Kind::user;
    type->implements = {"X3DNode", "X3DChildNode"};
    for (const auto& [name, of, custom] :
         {std::tuple("weight", FieldType::SFCustom, quantity), std::tuple("most", FieldType::SFCustom, quantity),
          std::tuple("contents", FieldType::MFCustom, quantity), std::tuple("count", FieldType::SFCustom, count),
          std::tuple("axis", FieldType::SFCustom, basis), std::tuple("axes", FieldType::MFCustom, basis),
          std::tuple("tag", FieldType::SFCustom, tag), std::tuple("tags", FieldType::MFCustom, tag)}) {
        FieldDef& field = type->fields.emplace_back();
        field.name = name;
        field.type = of;
        field.custom = custom;
    }
    const auto numbers = [](const CustomType& of, std::vector<double> all) { return of.value(all).value(); };
    type->fields[1].defaultValue = Value(numbers(*quantity, {100, 2}));
    ASSERT_TRUE(type->finish());
    Scene scene;
    auto log = LogWriter::create(file, builtinTypes(), optionsOf(0x5001));
    ASSERT_TRUE(log);
    const Attachment attachment = scene.bus().attach(**log);
    const TypeIndex index = scene.defineType(type).value();
    const NodeId a = scene.createNode(index), b = scene.createNode(index);
    for (const NodeId id : {a, b}) ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, id));
    ASSERT_TRUE(scene.addRoute(a, 0, b, 0));
    ASSERT_TRUE(
        scene.setField(b, 5, Value(Array<CustomValue>{numbers(*basis, {1, 0, 0}), numbers(*basis, {.1, 2, 3})})));
    ASSERT_TRUE(scene.setField(b, 6, Value(numbers(*tag, {0, 127, 255}))));
    ASSERT_TRUE(scene.setField(b, 7, Value(Array<CustomValue>{numbers(*tag, {1}), tag->zero()})));
    for (int k = 0; k < 6; ++k) {
        ASSERT_TRUE(scene.sendEvent(a, 0, Value(numbers(*quantity, {k * .1, 3}))));
        ASSERT_TRUE(scene.setField(a, 3, Value(numbers(*count, {-k * 1000.0}))));
        ASSERT_TRUE(scene.setField(a, 2, Value(Array<CustomValue>{numbers(*quantity, {k + .5, 1}), quantity->zero()})));
        if (k == 2) {
            ASSERT_TRUE(scene.setField(a, 1, Value(numbers(*quantity, {0, 2}))));
        }
        if (k == 4) {
            ASSERT_TRUE(scene.setField(a, 1, Value(numbers(*quantity, {100, 2}))));
        }
        scene.newFrame(10 + k / 8.0);
    }
    ASSERT_TRUE((*log)->close());
}

/// A scene file: what a document has.
void writeScene(const fs::path& file) {
    Scene scene;
    scene.newFrame(10);
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, kDocument, diagnostics));
    scene.newFrame(10.5);
    ASSERT_TRUE(writeSceneFile(scene, file));
}

/// A scene file as they were before the catalogue: a head and a keyframe.
void writeWithHead(const Scene& scene, const fs::path& file) {
    ByteBuffer head, keyframe;
    encodeHead(0, "rtsg", builtinTypes(), {}, head);
    ChangeEncoder encoder;
    encoder.makeSmall();
    encoder.encode(scene.snapshot(), keyframe);
    head.append(keyframe.bytes());
    writeAll(file, {reinterpret_cast<const char*>(head.data()), head.size()});
}

/// Such a file: arrays of each type that is packed, in more blocks than one, with numbers that are no decimals.
void writeArrays(const fs::path& file) {
    Scene scene;
    const auto add = [&](auto type, auto field, auto array) {
        const NodeId node = scene.createNode(type);
        EXPECT_TRUE(scene.set(node, field, array));
        EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, node));
    };
    Array<Vec3f> points;
    Array<std::int32_t> index;
    Array<float> odd;
    Array<Rotation> rotations;
    for (int i = 0; i < 1500; ++i) {
        points.push_back(Vec3f(static_cast<float>(i % 40) / 8, std::sin(static_cast<float>(i)), i % 7 ? .1f : -0.f));
        for (const int corner : {i, i + 1, i + 40, -1}) index.push_back(corner);
    }
    for (int i = 0; i < 40; ++i)
        odd.push_back(i == 3    ? std::numeric_limits<float>::infinity()
                      : i == 21 ? std::numeric_limits<float>::quiet_NaN()
                      : i == 30 ? 1e30f
                                : static_cast<float>(i) / 100);
    for (int i = 0; i < 9; ++i) rotations.push_back(Rotation{0, 1, 0, static_cast<float>(i) / 3});
    const NodeId faces = scene.createNode(x3d::IndexedFaceSet::type), shape = scene.createNode(x3d::Shape::type);
    const NodeId coordinate = scene.createNode(x3d::Coordinate::type), color = scene.createNode(x3d::ColorRGBA::type);
    const NodeId texture = scene.createNode(x3d::TextureCoordinate::type);
    EXPECT_TRUE(scene.set(coordinate, x3d::Coordinate::point, points));
    EXPECT_TRUE(scene.set(color, x3d::ColorRGBA::color, Array<ColorRGBA>{{1, .5f, .25f, 1}, {0, .2f, .4f, .6f}}));
    EXPECT_TRUE(scene.set(texture, x3d::TextureCoordinate::point, Array<Vec2f>{{0, 0}, {.333f, 1}, {1, -2.5f}}));
    EXPECT_TRUE(scene.set(faces, x3d::IndexedFaceSet::coordIndex, index));
    EXPECT_TRUE(scene.set(faces, x3d::IndexedFaceSet::coord, coordinate));
    EXPECT_TRUE(scene.set(faces, x3d::IndexedFaceSet::color, color));
    EXPECT_TRUE(scene.set(faces, x3d::IndexedFaceSet::texCoord, texture));
    EXPECT_TRUE(scene.set(shape, x3d::Shape::geometry, faces));
    EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, shape));
    add(x3d::ScalarInterpolator::type, x3d::ScalarInterpolator::keyValue, odd);
    add(x3d::OrientationInterpolator::type, x3d::OrientationInterpolator::keyValue, rotations);
    add(x3d::ColorInterpolator::type, x3d::ColorInterpolator::keyValue, Array<Color>{{1, 0, .1f}, {.7f, 1e-9f, 2}});
    scene.newFrame(1);
    writeWithHead(scene, file);
}

/// Bytes flipped in a frame, in a head and in a keyframe; the end cut off.
void writeDamaged(const fs::path& file, const fs::path& whole) {
    std::string bytes = readAll(whole);
    std::vector<std::pair<std::uint64_t, RecordHeader>> records;
    auto log = LogReader::open(whole);
    ASSERT_TRUE(log);
    while (const auto record = log->next()) records.emplace_back(record->offset, record->header);
    int frames = 0, heads = 0, keyframes = 0;
    for (const auto& [offset, header] : records) {
        const bool hit = (header.kind == RecordKind::frame && ++frames == 4) ||
                         (header.kind == RecordKind::head && ++heads == 1) ||
                         (header.kind == RecordKind::keyframe && ++keyframes == 3);
        if (hit) bytes[offset + 70] = static_cast<char>(bytes[offset + 70] ^ 0x10);
    }
    bytes.resize(records[records.size() - 2].first + 40);
    writeAll(file, bytes);
}

void writeSet(const fs::path& folder) {
    writeDocument(folder / "document.rlog", false);
    writeDocument(folder / "inputs.rlog", true);
    writeEdits(folder / "edits.rlog", 0x2001);
    fs::remove(folder / "sessions.rlog");
    writeEdits(folder / "sessions.rlog", 0x2002);
    writeEdits(folder / "sessions.rlog", 0x2003, true);
    writeUnclosed(folder / "unclosed.rlog");
    writePieces(folder);
    writeMotion(folder / "raw.rlog", 0x3001, Coding::raw, false);
    writeMotion(folder / "compact.rlog", 0x3002, Coding::compact, false);
    writeMotion(folder / "smallest.rlog", 0x3003, Coding::smallest, false);
    writeMotion(folder / "lossy.rlog", 0x3004, Coding::smallest, true);
    writeMerged(folder / "merged.rlog");
    writeRegion(folder / "region.rlog");
    writeArrays(folder / "arrays.rlog");
    writeScene(folder / "scene.rlog");
    writeCustom(folder / "custom.rlog");
    writeDamaged(folder / "damaged.rlog", folder / "edits.rlog");
    for (const auto& entry : fs::directory_iterator(folder))
        if (entry.path().extension() == ".rlog")
            writeAll(fs::path(entry.path()).replace_extension(".json"), expectedOf(entry.path()));
}

// ---- the tests -------------------------------------------------------------------------------------------------

TEST(Conformance, TheSetCanBeWritten) {
    if (const char* folder = std::getenv("RTSG_WRITE_CONFORMANCE")) return writeSet(folder);
    char pattern[] = "/tmp/rtsg-conformance-XXXXXX";
    const fs::path folder = mkdtemp(pattern);
    writeSet(folder);
    std::size_t logs = 0;
    for (const auto& entry : fs::directory_iterator(folder)) logs += entry.path().extension() == ".rlog";
    EXPECT_EQ(logs, 18u);
    fs::remove_all(folder);
}

/// All of it, whatever types and fields have come since: hashes go by names.
TEST(Conformance, LogsOfTheSetAreReadAsExpected) {
    const fs::path folder = RTSG_SOURCE_DIR "/tests/sync/conformance";
    std::size_t logs = 0;
    for (const auto& entry : fs::directory_iterator(folder)) {
        if (entry.path().extension() != ".rlog") continue;
        SCOPED_TRACE(entry.path().filename());
        ++logs;
        const std::string expected = readAll(fs::path(entry.path()).replace_extension(".json"));
        EXPECT_EQ(expectedOf(entry.path()), expected);
    }
    EXPECT_EQ(logs, 18u);
}

/// The hashes of November 2026: changing them changes the hashes with which users' logs are verified.
TEST(Conformance, TheHashesOfTheSetAreTheseForEver) {
    const std::pair<const char*, const char*> last[] = {{"document", "432fcf315a1b4c49a28f89ef95af3960"},
                                                        {"edits", "1c68543aad00dafd973b0829a8d58230"},
                                                        {"sessions", "50f1575410b8274839f4b3be499cd3e8"},
                                                        {"smallest", "a092d72d6ba5845da6f2bdd9a17b0693"}};
    for (const auto& [name, hash] : last) {
        auto replayer =
            Replayer::open(fs::path(RTSG_SOURCE_DIR "/tests/sync/conformance") / (std::string(name) + ".rlog"));
        ASSERT_TRUE(replayer) << replayer.error().format();
        Result<bool> more = true;
        while ((more = (*replayer)->step()) && *more) {
        }
        EXPECT_EQ((*replayer)->verified(), (*replayer)->frames()) << name;
        EXPECT_EQ((*replayer)->scene().hash().hex(), hash) << name;
    }
}

/// The content behind the hashes in a file of the set: nodes and routes.
std::string contentOf(const std::string& expected) {
    const std::size_t from = expected.find("\"nodes\":");
    return from == std::string::npos ? expected : expected.substr(from);
}

/// Their hashes go by numbers of fields, and are counted as they were: such logs are verified for ever, too.
TEST(Conformance, LogsOfFormat2AreVerifiedWithTheHashesOfTheirTime) {
    const fs::path folder = RTSG_SOURCE_DIR "/tests/sync/conformance/format2";
    std::size_t logs = 0;
    for (const auto& entry : fs::directory_iterator(folder)) {
        if (entry.path().extension() != ".rlog") continue;
        SCOPED_TRACE(entry.path().filename());
        ++logs;
        auto opened = Replayer::open(entry.path());
        ASSERT_TRUE(opened) << opened.error().format();
        Replayer& replayer = **opened;
        EXPECT_EQ(replayer.head().formatVersion, 2);
        Result<bool> more = true;
        while ((more = replayer.step()) && *more) EXPECT_EQ(replayer.lastSet().hash, replayer.scene().hash());
        EXPECT_TRUE(more) << more.error().format();
        EXPECT_GT(replayer.frames(), 0u);
        EXPECT_EQ(replayer.verified(), replayer.frames());
        EXPECT_FALSE(replayer.divergence()) << replayer.divergence()->format();
        const std::string expected = readAll(fs::path(entry.path()).replace_extension(".json"));
        // The first line lists the states, each in brackets.
        EXPECT_EQ(std::ranges::count(expected.substr(0, expected.find('\n')), '[') - 1,
                  static_cast<std::ptrdiff_t>(replayer.frames()));
        EXPECT_EQ(contentOf(dumpOf(replayer.scene()) + "}\n"), contentOf(expected));
    }
    EXPECT_EQ(logs, 10u);
}

/// Written anew, it has the hashes of today.
TEST(Conformance, ALogOfFormat2BecomesOneOfToday) {
    char pattern[] = "/tmp/rtsg-conformance-XXXXXX";
    const fs::path folder = mkdtemp(pattern);
    const auto created = compactLog(RTSG_SOURCE_DIR "/tests/sync/conformance/format2/document.rlog", folder / "a.rlog");
    ASSERT_TRUE(created) << created.error().format();
    auto replayer = Replayer::open(folder / "a.rlog");
    ASSERT_TRUE(replayer);
    EXPECT_EQ((*replayer)->head().formatVersion, kFormatVersion);
    Result<bool> more = true;
    while ((more = (*replayer)->step()) && *more) {
    }
    EXPECT_GT((*replayer)->frames(), 5u);
    EXPECT_EQ((*replayer)->verified(), (*replayer)->frames());
    fs::remove_all(folder);
}

/// A forged value is another hash by the former rule, too.
TEST(Conformance, AForgedLogOfFormat2IsNotVerified) {
    const fs::path original = RTSG_SOURCE_DIR "/tests/sync/conformance/format2/raw.rlog";
    std::string bytes = readAll(original);
    auto log = LogReader::open(original);
    ASSERT_TRUE(log);
    int frames = 0;
    std::uint64_t state = 0;
    while (const auto record = log->next()) {
        if (record->header.kind != RecordKind::frame || ++frames != 5) continue;
        ByteBuffer forged;
        forged.append(record->bytes);
        forged.data()[forged.size() - 2] ^= std::byte{0x10};  // in the last value
        sealRecord(forged, record->header);
        std::memcpy(bytes.data() + record->offset, forged.data(), forged.size());
        state = record->header.to;
    }
    ASSERT_GT(state, 0u);
    char pattern[] = "/tmp/rtsg-conformance-XXXXXX";
    const fs::path folder = mkdtemp(pattern);
    writeAll(folder / "forged.rlog", bytes);
    auto opened = Replayer::open(folder / "forged.rlog");
    ASSERT_TRUE(opened);
    Result<bool> more = true;
    while ((more = (*opened)->step()) && *more) {
    }
    ASSERT_TRUE((*opened)->divergence());
    EXPECT_EQ((*opened)->divergence()->frame, state);
    EXPECT_LT((*opened)->verified(), (*opened)->frames());
    fs::remove_all(folder);
}

}  // namespace
}  // namespace rtsg
