// PROTOCOL.md is enough: an independent reader in Python, written from it alone, sees what we see.
#include <cstdio>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/lossy_scene.h>
#include <rtsg/sync/replay.h>

#include "bench/motion_sync.h"
#include "support/random_edits.h"
#include "support/temp_folder.h"
#include "test_paths.h"

namespace rtsg {
namespace {

using nlohmann::json;

std::vector<json> runReader(const std::string& arguments) {
    const std::string command = "python3 " RTSG_SOURCE_DIR "/tests/sync/reader.py " + arguments;
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
        default:
            return nullptr;
    }
}

TEST(Protocol, AnIndependentReaderAgrees) {
    if (std::system("python3 -c '' 2>/dev/null") != 0) GTEST_SKIP() << "python3 is not installed";
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
    // Every value that is not the default is there and the same.
    std::size_t compared = 0;
    scene.forEachNode([&](const Node& node) {
        for (FieldIndex i = 0; i < node.type().fields.size(); ++i) {
            if (!node.type().fields[i].readable() || node.isDefault(i)) continue;
            const std::string_view name = scene.name(node.id());
            const std::string key = (name.empty() ? "#" + std::to_string(node.id().value) : std::string(name)) + "." +
                                    node.type().fields[i].name;
            const json expected = asJson(node.value(i));
            if (expected.is_null()) continue;
            ASSERT_TRUE(summary["values"].contains(key)) << key;
            EXPECT_EQ(summary["values"][key], expected) << key;
            ++compared;
        }
    });
    EXPECT_GT(compared, 100u);

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
    if (std::system("python3 -c '' 2>/dev/null") != 0) GTEST_SKIP() << "python3 is not installed";
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
