// PROTOCOL.md is enough: the reader in Python alone (python/rtsg/pure.py), written from it, sees what we see.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <random>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/lossy_scene.h>
#include <rtsg/sync/replay.h>
#include <rtsg/sync/scene_file.h>

#include "bench/motion_sync.h"
#include "codec/catalogue.h"
#include "support/random_edits.h"
#include "support/temp_folder.h"
#include "test_paths.h"

namespace rtsg {
namespace {

using nlohmann::json;

/// A Python that has NumPy; empty: there is none.
std::string python() {
    for (const char* const one : {"python3", "/usr/bin/python3"})
        if (std::system(fmt::format("{} -c 'import numpy' 2>/dev/null", one).c_str()) == 0) return one;
    return {};
}

std::vector<json> runReader(const std::string& arguments) {
    const std::string command =
        "PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=" RTSG_SOURCE_DIR "/python " + python() + " -m rtsg " + arguments;
    std::vector<json> lines;
    FILE* pipe = ::popen(command.c_str(), "r");
    if (!pipe) return lines;
    std::string text;
    for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) {
        if (c != '\n') {
            text.push_back(static_cast<char>(c));
            continue;
        }
        lines.push_back(json::parse(text, nullptr, false));
        text.clear();
    }
    EXPECT_EQ(::pclose(pipe), 0) << command;
    return lines;
}

template <class T>
json numbers(const T& element, std::size_t size) {
    std::vector<float> list(size);
    std::memcpy(list.data(), &element, size * sizeof(float));
    return list;
}
json asJson(const Value& value) {
    const auto many = [](const auto& array, const auto& one) {
        json list = json::array();
        for (const auto& element : array) list.push_back(one(element));
        return list;
    };
    switch (value.type()) {
        case FieldType::SFBool:
            return value.as<bool>();
        case FieldType::SFInt32:
            return value.as<std::int32_t>();
        case FieldType::SFFloat:
            return value.as<float>();
        case FieldType::SFTime:
            return value.as<Time>().seconds;
        case FieldType::SFString:
            return value.as<String>().str();
        case FieldType::SFNode:
            return value.as<NodeId>().value;
        case FieldType::SFVec3f:
            return numbers(value.as<Vec3f>(), 3);
        case FieldType::SFColor:
            return numbers(value.as<Color>(), 3);
        case FieldType::SFRotation:
            return numbers(value.as<Rotation>(), 4);
        case FieldType::MFInt32:
            return many(value.as<Array<std::int32_t>>(), [](std::int32_t i) { return json(i); });
        case FieldType::MFFloat:
            return many(value.as<Array<float>>(), [](float f) { return json(f); });
        case FieldType::MFString:
            return many(value.as<Array<String>>(), [](const String& s) { return json(s.str()); });
        case FieldType::MFNode:
            return many(value.as<Array<NodeId>>(), [](NodeId n) { return json(n.value); });
        case FieldType::MFVec3f:
            return many(value.as<Array<Vec3f>>(), [](Vec3f v) { return numbers(v, 3); });
        case FieldType::MFRotation:
            return many(value.as<Array<Rotation>>(), [](const Rotation& r) { return numbers(r, 4); });
        default:
            return nullptr;
    }
}

/// Every value that is not the default is there and the same. Returns how many there are.
std::size_t expectSameValues(const json& summary, const Scene& scene) {
    std::size_t compared = 0;
    scene.forEachNode([&](const Node& node) {
        for (FieldIndex i = 0; i < node.type().fields.size(); ++i) {
            if (!node.type().fields[i].readable() || node.isDefault(i)) continue;
            const std::string_view name = scene.name(node.id());
            const std::string key = (name.empty() ? "#" + std::to_string(node.id().value) : std::string(name)) + "." +
                                    node.type().fields[i].name;
            const json expected = asJson(node.value(i));
            if (expected.is_null()) continue;
            EXPECT_TRUE(summary["values"].contains(key)) << key;
            if (!summary["values"].contains(key)) continue;
            EXPECT_EQ(summary["values"][key], expected) << key;
            ++compared;
        }
    });
    return compared;
}

TEST(Protocol, AnIndependentReaderAgrees) {
    if (python().empty()) GTEST_SKIP() << "no Python with NumPy";
    const test::TempFolder own;
    const std::filesystem::path& folder = own.path();
    const std::uint64_t seed = 2009;
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Scene scene;
    std::vector<std::string> hashes;
    {
        LogOptions options;
        options.keyframeBytes = 3000;
        auto log = LogWriter::create(folder / "a.rlog", builtinTypes(), options);
        ASSERT_TRUE(log);
        Attachment attachment = scene.bus().attach(**log);
        test::RandomEdits edits(scene, seed);
        for (int frame = 0; frame < 80; ++frame) {
            for (int i = 0; i < 12; ++i) edits.step();
            hashes.push_back(scene.newFrame(frame * .25)->hash.hex());
        }
    }
    const std::vector<json> lines = runReader((folder / "a.rlog").string() + " --values");
    ASSERT_GT(lines.size(), 80u);
    EXPECT_EQ(lines[0]["types"], builtinTypes().size());
    std::vector<std::string> found;
    for (const json& line : lines)
        if (line.contains("state") && line.contains("hash") && line["state"] > 0) found.push_back(line["hash"]);
    EXPECT_EQ(found, hashes);
    const json& summary = lines.back();
    EXPECT_EQ(summary["nodes"], scene.nodeCount());
    EXPECT_EQ(summary["state"], scene.sequence());
    EXPECT_GT(expectSameValues(summary, scene), 100u);

    // And it finds damage where it is.
    std::string bytes;
    {
        std::ifstream in(folder / "a.rlog", std::ios::binary);
        bytes.assign(std::istreambuf_iterator<char>(in), {});
    }
    auto reader = LogReader::open(folder / "a.rlog");
    std::uint64_t offset = 0, length = 0;
    for (int i = 0; i < 30; ++i) {
        const auto record = reader->next();
        offset = record->offset;
        length = record->header.size();
    }
    bytes[offset + length - 1] ^= 4;
    std::ofstream(folder / "b.rlog", std::ios::binary) << bytes;
    bool reported = false;
    for (const json& line : runReader((folder / "b.rlog").string()))
        if (line.contains("damage")) {
            reported = true;
            EXPECT_EQ(line["damage"], offset);
            EXPECT_EQ(line["length"], length);
        }
    EXPECT_TRUE(reported);
}

TEST(Protocol, AnIndependentReaderAgreesOnTheArraysOfASceneFile) {
    if (python().empty()) GTEST_SKIP() << "no Python with NumPy";
    Scene scene;
    std::mt19937 random(20261121);
    const NodeId points = scene.createNode(x3d::Coordinate::type), faces = scene.createNode(x3d::IndexedFaceSet::type);
    const NodeId rotations = scene.createNode(x3d::OrientationInterpolator::type);
    Array<Vec3f> point;
    Array<std::int32_t> index;
    Array<Rotation> rotation;
    std::normal_distribution<float> normal;
    for (int i = 0; i < 40000; ++i) {  // too many to be deflated
        point.push_back({static_cast<float>(i % 200) / 100, normal(random), i % 50 ? 1.5f : -0.f});
        for (const int corner : {i, i + 200, i + 1 + static_cast<int>(random() % 3), -1}) index.push_back(corner);
        if (i < 2000) rotation.push_back({normal(random), normal(random), 1, static_cast<float>(i) / 8});
    }
    ASSERT_TRUE(scene.set(points, x3d::Coordinate::point, point));
    ASSERT_TRUE(scene.set(faces, x3d::IndexedFaceSet::coordIndex, index));
    ASSERT_TRUE(scene.set(rotations, x3d::OrientationInterpolator::keyValue, rotation));
    scene.newFrame(0);
    const test::TempFolder own;
    ASSERT_TRUE(writeSceneFile(scene, own.path() / "a.rtsgb"));
    const std::vector<json> lines = runReader((own.path() / "a.rtsgb").string() + " --values");
    ASSERT_EQ(lines.size(), 2u);
    EXPECT_EQ(lines.front().value("scene", 0u), wire::catalogueSize());
    EXPECT_GE(expectSameValues(lines.back(), scene), 3u);
    Scene again;
    ASSERT_TRUE(readSceneFile(again, own.path() / "a.rtsgb"));
    EXPECT_EQ(again.hash(), scene.hash());
}

struct Kind {
    StreamMode mode;
    const char* name;
};
class ProtocolPrediction : public testing::TestWithParam<Kind> {};
INSTANTIATE_TEST_SUITE_P(Modes, ProtocolPrediction,
                         testing::Values(Kind{{Mode::state, Coding::compact, 0}, "compact"},
                                         Kind{{Mode::state, Coding::smallest, 0}, "smallest"},
                                         Kind{{Mode::lossy, Coding::compact, 1e-3}, "lossyCompact"},
                                         Kind{{Mode::lossy, Coding::smallest, 1e-3}, "lossySmallest"}),
                         [](const auto& p) { return p.param.name; });

TEST_P(ProtocolPrediction, AnIndependentReaderAgreesOnPredictedValues) {
    if (python().empty()) GTEST_SKIP() << "no Python with NumPy";
    const test::TempFolder own;
    const std::filesystem::path& folder = own.path();
    const std::uint64_t seed = 7;
    Scene origin;
    auto lossy = LossyScene::follow(origin, 1e-3);
    ASSERT_TRUE(lossy);
    Scene& scene = GetParam().mode.mode == Mode::lossy ? (*lossy)->scene() : origin;
    constexpr std::size_t kBodies = 30;
    std::vector<NodeId> nodes;
    for (std::size_t i = 0; i < kBodies; ++i) {
        nodes.push_back(origin.createNode(x3d::Transform::type));
        ASSERT_TRUE(origin.setName(nodes.back(), "B" + std::to_string(i)));
    }
    {
        LogOptions options;
        options.mode = GetParam().mode;
        auto log = LogWriter::create(folder / "a.rlog", builtinTypes(), options);
        ASSERT_TRUE(log);
        Attachment attachment = scene.bus().attach(**log);
        bench::Motion motion(bench::Movement::mixed, kBodies, seed);
        for (int frame = 0; frame < 120; ++frame) {
            for (const Change& change : motion.next().changes)
                ASSERT_TRUE(origin.setField(nodes[(change.node.value - bench::Motion::kFirstNode) / 3], change.field,
                                            change.value));
            origin.newFrame(frame / 60.);
        }
        ASSERT_EQ(attachment.failure(), "");
    }
    const std::vector<json> lines = runReader((folder / "a.rlog").string() + " --values");
    ASSERT_GT(lines.size(), 100u);
    std::uint64_t predicted = 0;
    for (const json& line : lines)
        if (line.contains("blocks") && line["blocks"].contains("predicted"))
            predicted += line["blocks"]["predicted"].get<std::uint64_t>();
    EXPECT_GT(predicted, 3000u);
    EXPECT_EQ(lines.back()["state"], scene.sequence());
    for (std::size_t i = 0; i < kBodies; ++i) {
        const Node& node = scene.node(nodes[i]);
        const std::string name = "B" + std::to_string(i);
        EXPECT_EQ(lines.back()["values"][name + ".translation"], asJson(node.value(x3d::Transform::translation.index)));
        EXPECT_EQ(lines.back()["values"][name + ".rotation"], asJson(node.value(x3d::Transform::rotation.index)));
    }
}

}  // namespace
}  // namespace rtsg
