// A session taken up again from its log goes on as if nothing had happened: the same states, numbers and epoch.
#include <rtsg/sync/session.h>

#include <algorithm>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/log_summary.h>

#include "support/log_support.h"
#include "test_paths.h"

namespace rtsg {
namespace {

using namespace test;

class Sessions : public LogFolder {
  protected:
    static constexpr const char* kScene = R"(#X3D V4.0 utf8
PROFILE Immersive
DEF SLIDE Transform { }
DEF DOOR Transform { }
DEF CLOCK TimeSensor { cycleInterval 2 loop TRUE }
DEF PATH PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 2 0 0 ] }
DEF PRESSED BooleanFilter { }
DEF BUTTON TimeTrigger { }
DEF OPENING TimeSensor { cycleInterval 1.5 }
DEF SWING OrientationInterpolator { key [ 0 1 ] keyValue [ 0 1 0 0, 0 1 0 1.4 ] }
PROTO Lamp [ inputOutput SFBool on FALSE ] { DEF LIGHT PointLight { on IS on } }
DEF LAMP Lamp { }
ROUTE CLOCK.fraction_changed TO PATH.set_fraction
ROUTE PATH.value_changed TO SLIDE.translation
ROUTE PRESSED.inputTrue TO BUTTON.set_boolean
ROUTE BUTTON.triggerTime TO OPENING.startTime
ROUTE OPENING.fraction_changed TO SWING.set_fraction
ROUTE SWING.value_changed TO DOOR.rotation
ROUTE OPENING.isActive TO LAMP.on
)";
    static constexpr int kFrames = 80;
    static void build(Scene& scene) {
        scene.newFrame(100);
        Diagnostics diagnostics;
        ASSERT_TRUE(loadText(scene, kScene, diagnostics));
    }
    /// Frame `k`: the button is pressed in the twentieth, so that the door is half open in the fortieth; nodes come and
    /// go.
    static void frame(Scene& scene, int k) {
        if (k == 20) {
            ASSERT_TRUE(scene.sendEvent(scene.findName("PRESSED"), x3d::BooleanFilter::set_boolean.index, true));
        }
        if (k % 3 == 0) {
            const NodeId created = scene.createNode(x3d::Transform::type);
            ASSERT_TRUE(scene.insertChild(scene.findName("SLIDE"), x3d::Transform::children, created));
        }
        if (k % 3 == 2) {
            const NodeId created = scene.node(scene.findName("SLIDE")).get(x3d::Transform::children)[0];
            ASSERT_TRUE(scene.destroyNode(created));
        }
        scene.newFrame(100 + k / 20.0);
    }
    /// The hashes of all frames of a session that nothing interrupts.
    static std::vector<Hash128> uninterrupted() {
        std::vector<Hash128> hashes;
        Scene scene;
        build(scene);
        for (int k = 0; k < kFrames; ++k) {
            frame(scene, k);
            hashes.push_back(scene.hash());
        }
        return hashes;
    }
    /// One whose process is killed after `frames` frames.
    std::uint64_t kill(int frames, LogOptions options = {}) {
        Scene scene;
        scene.setInputRecording(options.mode.mode == Mode::input);
        build(scene);
        auto log = LogWriter::create(file(), builtinTypes(), options);
        EXPECT_TRUE(log);
        Attachment attachment = scene.bus().attach(**log);
        for (int k = 0; k < frames; ++k) frame(scene, k);
        attachment.detach();
        (*log)->abandon();
        return (*log)->epoch();
    }
};

TEST_F(Sessions, GoOnAsIfNothingHadHappened) {
    const std::vector<Hash128> expected = uninterrupted();
    // Also from between the creation of a node and its end, and while the door opens.
    for (const int killed : {1, 19, 21, 31, 32, 33, 60}) {
        SCOPED_TRACE(killed);
        const std::uint64_t epoch = kill(killed);
        Scene scene;
        auto session = resumeSession(file(), scene);
        ASSERT_TRUE(session) << session.error().format();
        EXPECT_EQ(session->epoch, epoch);
        EXPECT_FALSE(session->closed);
        EXPECT_EQ(scene.hash(), expected[std::size_t(killed) - 1]);
        ASSERT_FALSE(session->before.empty());
        EXPECT_EQ(session->before.back()->to, scene.sequence());
        EXPECT_EQ(session->before.size(), std::size_t(killed));
        LogOptions options;
        options.append = true;
        options.epoch = session->epoch;
        auto log = LogWriter::create(file(), builtinTypes(), options);
        ASSERT_TRUE(log) << log.error().format();
        EXPECT_EQ((*log)->epoch(), epoch);
        Attachment attachment = scene.bus().attach(**log);
        for (int k = killed; k < kFrames; ++k) {
            frame(scene, k);
            ASSERT_EQ(scene.hash(), expected[std::size_t(k)]) << "frame " << k;
        }
        attachment.detach();
        ASSERT_TRUE((*log)->close());
        // The log is one session.
        const auto summary = summariseLog(file());
        ASSERT_TRUE(summary);
        EXPECT_EQ(summary->sessions, 1u);
        EXPECT_EQ(summary->lastState, scene.sequence());
        EXPECT_TRUE(summary->closed);
        auto replayer = Replayer::open(file());
        ASSERT_TRUE(replayer);
        Result<bool> more = true;
        while ((more = (*replayer)->step()) && *more) {
        }
        EXPECT_TRUE(more);
        EXPECT_EQ((*replayer)->gaps(), 0u);
        EXPECT_EQ((*replayer)->verified(), (*replayer)->frames());
        EXPECT_EQ((*replayer)->scene().hash(), expected.back());
    }
}

/// A log of what came in holds no changes: they are made again.
TEST_F(Sessions, PeersLackTheSameOfALogInInputMode) {
    std::vector<std::shared_ptr<const ChangeSet>> changes[2];
    for (const Mode mode : {Mode::state, Mode::input}) {
        LogOptions options;
        options.mode.mode = mode;
        kill(60, options);
        Scene scene;
        const auto session = resumeSession(file(), scene);
        ASSERT_TRUE(session) << session.error().format();
        changes[mode == Mode::input] = session->before;
    }
    ASSERT_EQ(changes[0].size(), 60u);
    ASSERT_EQ(changes[1].size(), 60u);
    for (std::size_t i = 0; i < 60; ++i) {
        EXPECT_EQ(changes[1][i]->from, changes[0][i]->from);
        EXPECT_EQ(changes[1][i]->to, changes[0][i]->to);
        EXPECT_EQ(changes[1][i]->hash, changes[0][i]->hash) << i;
        EXPECT_EQ(changes[1][i]->changes.size(), changes[0][i]->changes.size()) << i;
    }
}

TEST_F(Sessions, NumbersOfNodesThatAreGoneAreNotGivenAgain) {
    kill(33);  // the last node made was destroyed in the last frame
    Scene whole;
    build(whole);
    for (int k = 0; k < 33; ++k) frame(whole, k);
    Scene scene;
    ASSERT_TRUE(resumeSession(file(), scene));
    EXPECT_EQ(scene.createNode(x3d::Group::type), whole.createNode(x3d::Group::type));
}

TEST_F(Sessions, WhatPeersMayLackIsBounded) {
    kill(60);
    Scene scene;
    ResumeOptions options;
    options.maxSets = 10;
    const auto session = resumeSession(file(), scene, options);
    ASSERT_TRUE(session);
    ASSERT_EQ(session->before.size(), 10u);
    EXPECT_EQ(session->before.front()->to + 9, scene.sequence());
    Scene other;
    options.maxChanges = 0;
    EXPECT_TRUE(resumeSession(file(), other, options)->before.empty());
}

TEST_F(Sessions, ADamagedEndIsLeftOut) {
    const std::uint64_t epoch = kill(40);
    std::string bytes = readAll(file());
    const auto records = recordsOf(file());
    bytes.resize(bytes.size() - 10);
    writeAll(file(), bytes);
    Scene scene;
    const auto session = resumeSession(file(), scene);
    ASSERT_TRUE(session);
    EXPECT_EQ(session->epoch, epoch);
    EXPECT_EQ(session->damaged, 1u);
    EXPECT_EQ(scene.sequence() + 1, records.back().second.to);
}

TEST_F(Sessions, WhatCannotGoOnIsRefused) {
    Scene empty;
    EXPECT_FALSE(resumeSession(file("none.rlog"), empty));
    kill(10);
    Scene full;
    build(full);
    EXPECT_FALSE(resumeSession(file(), full));
    // A last state that is not what its origin had.
    const auto records = recordsOf(file());
    std::string bytes = readAll(file());
    const auto& [offset, header] = records.back();
    bytes[offset + 48] = static_cast<char>(bytes[offset + 48] ^ 1);
    const std::uint64_t sum = checksumOf(asBytes(std::string_view(bytes).substr(offset + 16, header.size() - 16)));
    std::memcpy(bytes.data() + offset + 8, &sum, sizeof(sum));
    writeAll(file(), bytes);
    Scene scene;
    const auto session = resumeSession(file(), scene);
    ASSERT_FALSE(session);
    EXPECT_NE(session.error().text.find("hash"), std::string::npos) << session.error().text;
}

/// Two that go on with one session would both be it.
TEST_F(Sessions, WhoseWriterIsStillAtItAreRefused) {
    kill(20);
    LogOptions options;
    options.append = true;
    auto writer = LogWriter::create(file(), builtinTypes(), options);
    ASSERT_TRUE(writer);
    Scene second;
    const auto session = resumeSession(file(), second);
    ASSERT_FALSE(session);
    EXPECT_NE(session.error().text.find("another log writer"), std::string::npos) << session.error().text;
    EXPECT_EQ(second.sequence(), 0u);
    (*writer)->abandon();
    EXPECT_TRUE(resumeSession(file(), second));
}

TEST_F(Sessions, OfALossyLogAreRefused) {
    LogOptions options;
    options.mode.mode = Mode::lossy;
    options.mode.maxError = 1e-3;
    kill(10, options);
    Scene scene;
    const auto resumed = resumeSession(file(), scene);
    ASSERT_FALSE(resumed);
    EXPECT_NE(resumed.error().text.find("a lossy log holds what its readers had"), std::string::npos)
        << resumed.error().text;
}

/// One epoch, two ways of counting hashes: the head between them says where.
TEST_F(Sessions, OneOfFormat2GoesOnInThatOfToday) {
    std::filesystem::copy_file(RTSG_SOURCE_DIR "/tests/sync/conformance/format2/document.rlog", file());
    Scene scene;
    auto session = resumeSession(file(), scene);
    ASSERT_TRUE(session) << session.error().format();
    EXPECT_EQ(session->damaged, 0u);
    LogOptions options;
    options.append = true;
    options.epoch = session->epoch;
    auto log = LogWriter::create(file(), builtinTypes(), options);
    ASSERT_TRUE(log) << log.error().format();
    const Attachment attachment = scene.bus().attach(**log);
    for (int k = 0; k < 10; ++k) scene.newFrame(20 + k * .1);
    ASSERT_TRUE((*log)->close());
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer);
    EXPECT_EQ((*replayer)->head().formatVersion, 2);
    Result<bool> more = true;
    while ((more = (*replayer)->step()) && *more) {
    }
    EXPECT_TRUE(more);
    EXPECT_EQ((*replayer)->head().formatVersion, kFormatVersion);
    EXPECT_EQ((*replayer)->head().epoch, session->epoch);
    EXPECT_EQ((*replayer)->verified(), (*replayer)->frames());
    EXPECT_EQ((*replayer)->gaps(), 0u);
    EXPECT_EQ((*replayer)->scene().hash(), scene.hash());
}

/// A log in pieces: the newest one begins late, and so does the one after it is taken up again.
TEST_F(Sessions, CountFromTheirStartWhateverPieceTheyGoOnFrom) {
    LogOptions options;
    options.rotateSeconds = 1;
    kill(50, options);  // 2.45 s, three pieces
    for (const int last : {49, 79}) {
        Scene scene;
        const auto session = resumeSession(file(), scene);
        ASSERT_TRUE(session) << session.error().format();
        EXPECT_EQ(session->start, 100);
        EXPECT_EQ(session->end, 100 + last / 20.0);
        options.append = true;
        options.epoch = session->epoch;
        options.sessionStart = session->start;
        auto log = LogWriter::create(file(), builtinTypes(), options);
        ASSERT_TRUE(log) << log.error().text;
        Attachment attachment = scene.bus().attach(**log);
        for (int k = last + 1; k < kFrames; ++k) frame(scene, k);
        EXPECT_EQ(attachment.failure(), "");
        ASSERT_TRUE((*log)->close());
    }
}

/// Its newest file was cut, by a full disk say, before its first state: the piece before it has the last one.
TEST_F(Sessions, GoOnFromThePieceBeforeOneWithoutAState) {
    LogOptions options;
    options.rotateSeconds = 1;
    for (const std::uint64_t kept : {0, 5, 70, 150}) {
        std::filesystem::remove(file());
        for (const auto& piece : earlierPieces(file())) std::filesystem::remove(piece);
        const std::uint64_t epoch = kill(50, options);
        const auto pieces = earlierPieces(file());
        ASSERT_EQ(pieces.size(), 2u);
        const auto records = recordsOf(file());
        ASSERT_GT(records[1].first, 70u) << "the head is cut, too, in all but the last case";
        ASSERT_LT(records[1].first, 150u);
        std::filesystem::resize_file(file(), kept);
        Scene scene;
        const auto session = resumeSession(file(), scene);
        ASSERT_TRUE(session) << kept << session.error().format();
        EXPECT_EQ(session->epoch, epoch);
        EXPECT_EQ(session->file, pieces.back());
        EXPECT_EQ(session->start, 100);
        LogOptions more;
        more.append = true;
        more.rotateSeconds = 1;
        more.epoch = session->epoch;
        more.sessionStart = session->start;
        auto log = LogWriter::create(file(), builtinTypes(), more);
        ASSERT_TRUE(log) << log.error().text;
        Attachment attachment = scene.bus().attach(**log);
        for (int k = 50; k < kFrames; ++k) frame(scene, k);
        EXPECT_EQ(attachment.failure(), "");
        ASSERT_TRUE((*log)->close());
        std::string all;
        for (const auto& piece : earlierPieces(file())) all += readAll(piece);
        writeAll(file("all.rlog"), all + readAll(file()));
        auto replayer = Replayer::open(file("all.rlog"));
        ASSERT_TRUE(replayer);
        while (*(*replayer)->step()) continue;
        EXPECT_EQ((*replayer)->gaps(), 0u);
        EXPECT_EQ((*replayer)->scene().hash(), scene.hash());
        EXPECT_TRUE((*replayer)->log().closed());
        auto last = Replayer::open(file());
        ASSERT_TRUE(last);
        EXPECT_TRUE((*last)->laterPiece()) << "as all of its pieces but the first";
    }
}

/// Bytes that nothing tells the meaning of are not written over, nor states left out that are there.
TEST_F(Sessions, GoOnFromNoPieceBehindWhichThereIsSomething) {
    LogOptions options;
    options.rotateSeconds = 1;
    kill(50, options);
    std::string bytes = readAll(file());
    for (const auto& [offset, header] : recordsOf(file()))
        if (header.kind == RecordKind::keyframe) bytes[offset + 70] = static_cast<char>(bytes[offset + 70] ^ 1);
    for (const std::string& content : {bytes, std::string("something else"), std::string(5000, 'x')}) {
        writeAll(file(), content);
        Scene scene;
        EXPECT_FALSE(resumeSession(file(), scene));
        EXPECT_EQ(readAll(file()), content);
    }
}

/// A head whose length is damaged, so that it seems to be longer than the file, is no cut one: nothing is lost by it.
TEST_F(Sessions, KeepWhatFollowsADamagedHead) {
    for (const bool pieces : {false, true}) {
        std::filesystem::remove(file());
        for (const auto& piece : earlierPieces(file())) std::filesystem::remove(piece);
        LogOptions options = denseKeyframes();
        options.rotateSeconds = pieces ? 1 : 0;
        const std::uint64_t epoch = kill(50, options);
        std::string bytes = readAll(file());
        bytes[21] = static_cast<char>(bytes[21] ^ 1);  // of its length: 16 MiB more
        writeAll(file(), bytes);
        Scene scene;
        const auto session = resumeSession(file(), scene);
        ASSERT_TRUE(session) << session.error().format();
        EXPECT_EQ(session->file, file());
        LogOptions more = options;
        more.append = true;
        more.epoch = session->epoch;
        more.sessionStart = session->start;
        EXPECT_EQ(session->epoch, epoch);
        auto log = LogWriter::create(file(), builtinTypes(), more);
        ASSERT_TRUE(log) << log.error().text;
        EXPECT_GE(readAll(file()).size(), bytes.size() - 100) << "but what was not whole at its end";
        (*log)->abandon();
    }
}

/// One flipped byte is one place, and what is missing for it is told beside it.
TEST_F(Sessions, CountWhatIsDamagedOnce) {
    kill(60, denseKeyframes());
    std::string bytes = readAll(file());
    const auto records = recordsOf(file());
    const auto frame = std::ranges::find_if(
        records, [](const auto& r) { return r.second.kind == RecordKind::frame && r.second.to == 10; });
    ASSERT_NE(frame, records.end());
    bytes[frame->first + 70] = static_cast<char>(bytes[frame->first + 70] ^ 1);
    writeAll(file(), bytes);
    Scene scene;
    const auto session = resumeSession(file(), scene);
    ASSERT_TRUE(session) << session.error().format();
    EXPECT_EQ(session->damaged, 1u);
    EXPECT_EQ(session->gaps, 1u);
}

/// A piece that others follow is none to go on from: two sessions would go by one name.
TEST_F(Sessions, DoNotGoOnFromAPieceInTheMiddle) {
    LogOptions options;
    options.rotateSeconds = 1;
    kill(50, options);
    const auto pieces = earlierPieces(file());
    ASSERT_GE(pieces.size(), 2u);
    for (const auto& piece : pieces) {
        EXPECT_EQ(laterPiece(piece), file());
        Scene scene;
        const auto session = resumeSession(piece, scene);
        ASSERT_FALSE(session);
        EXPECT_NE(session.error().text.find("its session went on in " + file().filename().string()), std::string::npos)
            << session.error().text;
    }
    EXPECT_EQ(laterPiece(file()), std::filesystem::path());
    const auto copy = file().parent_path() / "branch.rlog";
    std::filesystem::copy_file(pieces[0], copy);
    Scene branch;
    EXPECT_TRUE(resumeSession(copy, branch));
    std::filesystem::remove(file());
    Scene alone;
    EXPECT_TRUE(resumeSession(pieces[1], alone)) << "what it was a piece of is gone";
}

}  // namespace
}  // namespace rtsg
