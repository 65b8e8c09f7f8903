// Logs in input mode, and logs with inputs beside the changes.
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <unistd.h>

#include <rtsg/documents/loader.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/replay.h>
#include <rtsg/sync/replay_test.h>

#include "support/log_support.h"
#include "sync/input_support.h"

namespace rtsg {
namespace {

using namespace test;

struct TemporaryFile {
    std::filesystem::path path;
    explicit TemporaryFile(const std::string& name)
        : path(std::filesystem::temp_directory_path() / ("rtsg-input-" + std::to_string(::getpid()) + '-' + name)) {}
    ~TemporaryFile() {
        std::error_code ignored;
        std::filesystem::remove(path, ignored);
    }
};

LogOptions inMode(Mode mode) {
    LogOptions options;
    options.mode.mode = mode;
    options.keyframeBytes = 4000;  // so that there are some
    options.keyframeFactor = .1;
    return options;
}

class InputLog : public testing::TestWithParam<std::uint64_t> {};

TEST_P(InputLog, ReplaysAsTheLogOfTheChangesDoes) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    const std::string seed = std::to_string(GetParam());
    const TemporaryFile byState("state" + seed), byInput("input" + seed), byBoth("both" + seed);
    Scene origin;
    origin.setInputRecording(true);
    {
        auto a = LogWriter::create(byState.path, builtinTypes(), inMode(Mode::state));
        auto b = LogWriter::create(byInput.path, builtinTypes(), inMode(Mode::input));
        LogOptions both = inMode(Mode::state);
        both.inputs = true;
        auto c = LogWriter::create(byBoth.path, builtinTypes(), both);
        ASSERT_TRUE(a && b && c);
        const Attachment first = origin.bus().attach(**a), second = origin.bus().attach(**b),
                         third = origin.bus().attach(**c);
        live(origin, GetParam(), 120, true, GetParam() % 2 == 0, [](const ChangeSet&) {});
        ASSERT_TRUE(second.attached()) << second.failure();
    }
    const auto open = [](const TemporaryFile& file) {
        auto replayer = Replayer::open(file.path);
        EXPECT_TRUE(replayer);
        if ((*replayer)->head().mode.mode == Mode::input)
            (*replayer)->scene().registerBehaviour(x3d::Material::type, steady());
        return std::move(*replayer);
    };
    const auto x = open(byState), y = open(byInput), z = open(byBoth);
    EXPECT_GT(y->log().size(), 0u);
    for (int i = 0;; ++i) {
        const auto more = x->step(), same = y->step();
        ASSERT_TRUE(more) << more.error().text;
        ASSERT_TRUE(same) << same.error().text;
        ASSERT_EQ(*more, *same) << i;
        if (!*more) break;
        ASSERT_EQ(x->scene().sequence(), y->scene().sequence());
        ASSERT_EQ(x->scene().hash(), y->scene().hash()) << "state " << x->scene().sequence();
        if (x->scene().sequence() == origin.sequence()) {
            EXPECT_EQ(y->scene().dump(), origin.dump());
        }
    }
    EXPECT_EQ(y->verified(), y->frames());
    EXPECT_EQ(y->gaps(), 0u);
    EXPECT_FALSE(y->divergence());
    for (const double time : {1.0, .3, 2.2, 0.0, .9}) {
        ASSERT_TRUE(x->seek(time));
        const auto there = y->seek(time);
        ASSERT_TRUE(there) << there.error().text;
        EXPECT_EQ(x->scene().sequence(), y->scene().sequence()) << time;
        EXPECT_EQ(x->scene().hash(), y->scene().hash()) << time;
        ASSERT_TRUE(z->seek(time));
        EXPECT_EQ(x->scene().sequence(), z->scene().sequence()) << time;
        EXPECT_EQ(x->scene().hash(), z->scene().hash()) << time;
    }
}

TEST_P(InputLog, DamageCostsTheWayToTheNextKeyframe) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    const TemporaryFile file("damage" + std::to_string(GetParam()));
    Scene origin;
    origin.setInputRecording(true);
    {
        auto log = LogWriter::create(file.path, builtinTypes(), inMode(Mode::input));
        ASSERT_TRUE(log);
        const Attachment attachment = origin.bus().attach(**log);
        live(origin, GetParam(), 120, false, false, [](const ChangeSet&) {});
    }
    std::vector<std::uint64_t> inputs;
    {
        auto reader = LogReader::open(file.path);
        ASSERT_TRUE(reader);
        while (const auto record = reader->next())
            if (record->header.kind == RecordKind::input && record->header.from != record->header.to)
                inputs.push_back(record->offset);
    }
    ASSERT_GT(inputs.size(), 40u);
    {
        std::fstream bytes(file.path, std::ios::in | std::ios::out | std::ios::binary);
        bytes.seekp(static_cast<std::streamoff>(inputs[inputs.size() / 4] + 33));
        bytes.put('\x5A');
    }
    auto replayer = Replayer::open(file.path);
    ASSERT_TRUE(replayer);
    while (true) {
        const auto more = (*replayer)->step();
        ASSERT_TRUE(more) << more.error().text;
        if (!*more) break;
    }
    EXPECT_EQ((*replayer)->log().damage().size(), 1u);
    EXPECT_EQ((*replayer)->gaps(), 1u);
    EXPECT_EQ((*replayer)->verified(), (*replayer)->frames());
    EXPECT_FALSE((*replayer)->divergence());
}

INSTANTIATE_TEST_SUITE_P(Seeds, InputLog, testing::Range<std::uint64_t>(1, 9));

constexpr const char* kToggle = "#X3D V4.0 utf8\nDEF B BooleanToggle { }";

/// The edit of `toggle` is overwritten by the event of the same frame: only the inputs still know of it.
TEST(InputLog, ARerunNeedsTheInputsWhereTheCascadeOverwroteAnEdit) {
    for (const bool inputs : {false, true}) {
        const TemporaryFile file(inputs ? "with" : "without");
        {
            Scene scene;
            Diagnostics diagnostics;
            ASSERT_TRUE(loadText(scene, kToggle, diagnostics));
            scene.setInputRecording(inputs);
            LogOptions options;
            options.inputs = inputs;
            auto log = LogWriter::create(file.path, builtinTypes(), options);
            ASSERT_TRUE(log);
            const Attachment attachment = scene.bus().attach(**log);
            const NodeId toggle = scene.findName("B");
            scene.newFrame(0);
            ASSERT_TRUE(scene.set(toggle, x3d::BooleanToggle::toggle, true));
            ASSERT_TRUE(scene.sendEvent(toggle, x3d::BooleanToggle::set_boolean.index, Value(true)));
            scene.newFrame(1);
            EXPECT_FALSE(scene.node(toggle).get(x3d::BooleanToggle::toggle));
        }
        ReplayTest test;
        test.log = file.path;
        test.build = [](Scene& scene) -> Result<> {
            Diagnostics diagnostics;
            if (!loadText(scene, kToggle, diagnostics)) return fail("no scene");
            return {};
        };
        const auto report = runReplayTest(test);
        ASSERT_TRUE(report) << report.error().text;
        EXPECT_EQ(report->passed(), inputs) << report->format();
    }
}

/// Its frames can be told right by their hashes only, and those are not counted here.
TEST(InputLog, OneOfAnEarlierFormatIsRefusedSayingSo) {
    const TemporaryFile log("format2");
    {
        Scene origin;
        origin.setInputRecording(true);
        auto writer = LogWriter::create(log.path, builtinTypes(), inMode(Mode::input));
        ASSERT_TRUE(writer);
        const Attachment attachment = origin.bus().attach(**writer);
        for (int k = 0; k < 5; ++k) origin.newFrame(k);
    }
    EXPECT_TRUE(Replayer::open(log.path));
    std::string bytes = test::readAll(log.path);
    for (std::size_t at = 0; at < bytes.size();) {
        const RecordHeader header = *parseRecordHeader(test::asBytes(bytes).subspan(at));
        if (header.kind == RecordKind::head) {
            ByteBuffer head;
            head.append(test::asBytes(bytes).subspan(at, header.size()));
            head.data()[kRecordHeaderSize] = head.data()[kRecordHeaderSize + 2] = std::byte{2};
            sealRecord(head, header);
            std::memcpy(bytes.data() + at, head.data(), head.size());
        }
        at += header.size();
    }
    test::writeAll(log.path, bytes);
    const auto refused = Replayer::open(log.path);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().text.find("input mode of format 2"), std::string::npos) << refused.error().text;
}

TEST(InputLog, NeedsASceneThatRecordsItsInputs) {
    const TemporaryFile file("none");
    Scene scene;
    auto log = LogWriter::create(file.path, builtinTypes(), inMode(Mode::input));
    ASSERT_TRUE(log);
    const Attachment attachment = scene.bus().attach(**log);
    EXPECT_FALSE(attachment.attached());
    EXPECT_NE(attachment.failure().find("records its inputs"), std::string::npos);
}

}  // namespace
}  // namespace rtsg
