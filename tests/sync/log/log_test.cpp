// Logs: replay, search, damage, index, appending, and the difference of two.
#include <rtsg/sync/log.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <algorithm>
#include <cstring>
#include <limits>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/field_comparison.h>
#include <rtsg/sync/log_check.h>
#include <rtsg/sync/log_compact.h>
#include <rtsg/sync/replay.h>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;
using Log = LogFolder;

TEST_F(Log, ReplaysEveryStateForManySeeds) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        const Recorded recorded = record(file(), 60, seed, seed % 2 ? LogOptions{} : denseKeyframes());
        const Replayed replayed = replay(file(), recorded);
        EXPECT_EQ(replayed.damage, 0u);
        ASSERT_EQ(replayed.states.size(), recorded.dumps.size());
        EXPECT_EQ(replayed.states.back(), recorded.last);
        if (seed % 2 == 0) {
            EXPECT_GT(LogReader::open(file())->keyframes().size(), 3u);
        }
    }
}

TEST_F(Log, GarbageBetweenRecordsIsSkipped) {
    const Recorded recorded = record(file(), 8, 3);
    std::string bytes = readAll(file());
    const auto records = recordsOf(file());
    bytes.insert(records[4].first, "some text that no record covers, with RTSGrec1 in it");
    writeAll(file(), bytes);
    const Replayed replayed = replay(file(), recorded);
    EXPECT_EQ(replayed.damage, 1u);
    EXPECT_EQ(replayed.damageAt, records[4].first);
    EXPECT_EQ(replayed.states.size(), recorded.dumps.size());
}

/// The search for the next record reads a MiB at a time: its magic may begin in one window and end in the next.
TEST_F(Log, AMagicAcrossTwoWindowsOfTheSearchIsFound) {
    const Recorded recorded = record(file(), 8, 3);
    const std::string bytes = readAll(file());
    const auto records = recordsOf(file());
    // A frame: heads and keyframes are there more than once, so that one that is missed would not be missed.
    const auto frame = std::ranges::find(records, RecordKind::frame, [](const auto& r) { return r.second.kind; });
    ASSERT_NE(frame, records.end());
    for (std::size_t before = 0; before <= 8; ++before) {  // bytes of the magic in the first window
        std::string damaged = bytes;
        // The search begins behind the first byte that starts no record.
        damaged.insert(frame->first, std::string((std::size_t{1} << 20) + 1 - before, 'x'));
        writeAll(file("b.rlog"), damaged);
        const Replayed replayed = replay(file("b.rlog"), recorded);
        EXPECT_EQ(replayed.states.size(), recorded.dumps.size()) << before;
        EXPECT_EQ(replayed.damage, 1u) << before;
    }
}

TEST_F(Log, OneThatWasCutAtARecordsBoundaryIsNotClosed) {
    record(file(), 8, 3);
    const std::string bytes = readAll(file());
    const auto records = recordsOf(file());
    const auto closed = [&](const std::filesystem::path& path) {
        auto log = LogReader::open(path);
        while (log->next()) continue;
        EXPECT_TRUE(log->damage().empty());
        return log->closed();
    };
    EXPECT_TRUE(closed(file()));
    for (std::size_t i = 1; i < records.size(); ++i) {
        writeAll(file("b.rlog"), std::string_view(bytes).substr(0, records[i].first));
        EXPECT_FALSE(closed(file("b.rlog"))) << "before record " << i;
    }
    // Another session behind it closes it again, and what is damaged behind the index was something.
    writeAll(file("c.rlog"), std::string_view(bytes).substr(0, records.back().first));
    LogOptions options;
    options.append = true;
    record(file("c.rlog"), 3, 4, options);
    EXPECT_TRUE(closed(file("c.rlog")));
    writeAll(file("d.rlog"), bytes + "more");
    auto log = LogReader::open(file("d.rlog"));
    while (log->next()) continue;
    EXPECT_FALSE(log->closed());
}

TEST_F(Log, RecordsBeyondTheLimitAreNotRead) {
    record(file(), 8, 3);
    const auto none = LogReader::open(file(), 10);
    ASSERT_FALSE(none);
    EXPECT_NE(none.error().text.find("exceeds the limit of 10"), std::string::npos) << none.error().text;
    EXPECT_FALSE(Replayer::open(file(), 10));
    EXPECT_TRUE(Replayer::open(file(), 1 << 20));
}

TEST_F(Log, TheIndexIsRebuiltWhenMissing) {
    record(file(), 60, 21, denseKeyframes());
    auto whole = LogReader::open(file());
    const std::vector<LogKeyframe> expected = whole->keyframes();
    EXPECT_TRUE(whole->hadIndex());
    ASSERT_GT(expected.size(), 3u);
    const std::string bytes = readAll(file());
    writeAll(file("cut.rlog"), std::string_view(bytes).substr(0, bytes.size() - 10));
    auto cut = LogReader::open(file("cut.rlog"));
    const std::vector<LogKeyframe>& found = cut->keyframes();
    EXPECT_FALSE(cut->hadIndex());
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
        EXPECT_EQ(found[i].offset, expected[i].offset);
        EXPECT_EQ(found[i].to, expected[i].to);
        EXPECT_EQ(found[i].time, expected[i].time);
        EXPECT_EQ(found[i].head, expected[i].head);
    }
}

TEST_F(Log, SeeksToAnyTime) {
    const std::uint64_t seed = 31;
    const Recorded recorded = record(file(), 60, seed, denseKeyframes());
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer);
    std::mt19937_64 random(seed);
    for (int i = 0; i < 60; ++i) {
        const double time = static_cast<double>(random() % 700) / 100. - .5;
        ASSERT_TRUE((*replayer)->seek(time));
        const Scene& scene = (*replayer)->scene();
        std::uint64_t expected = 0;
        for (const auto& [state, t] : recorded.times)
            if (t <= time) expected = state;
        ASSERT_EQ(scene.sequence(), expected) << "time " << time;
        if (expected) {
            EXPECT_EQ(scene.dump(), recorded.dumps.at(expected));
        }
    }
    EXPECT_EQ((*replayer)->frames(), (*replayer)->verified());
}

TEST_F(Log, TheTimeOfTheNextStateIsKnownBeforeIt) {
    const Recorded recorded = record(file(), 20, 33);
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer);
    std::size_t states = 0;
    while (const auto next = (*replayer)->nextTime()) {
        EXPECT_FALSE((*replayer)->atEnd());
        ASSERT_TRUE(*(*replayer)->step());
        EXPECT_EQ((*replayer)->scene().now(), *next);
        ++states;
    }
    EXPECT_TRUE((*replayer)->atEnd());
    EXPECT_EQ((*replayer)->scene().sequence(), recorded.last);
    EXPECT_FALSE(*(*replayer)->step());
    EXPECT_GE(states, recorded.dumps.size());
}

/// LogOptions::keyframeSeconds, and the MiB a second beyond which they come later.
TEST_F(Log, KeyframesComeAfterTheSecondsAskedForUnlessTheyAreLarge) {
    const auto gaps = [&](double seconds, std::size_t bytes, double duration) {
        Scene scene;
        const NodeId text = scene.createNode(x3d::MetadataString::type), box = scene.createNode(x3d::Transform::type);
        std::string letters;
        for (std::size_t i = 0; i < bytes; ++i) letters += static_cast<char>('a' + i * i % 23);
        EXPECT_TRUE(scene.set(text, x3d::MetadataString::value, Array<String>{String(letters)}));
        LogOptions options;
        options.keyframeBytes = std::uint64_t{1} << 40;  // never for that reason
        options.keyframeSeconds = seconds;
        scene.newFrame(0);
        auto log = LogWriter::create(file(), builtinTypes(), options);
        EXPECT_TRUE(log);
        const Attachment attachment = scene.bus().attach(**log);
        for (int i = 1; i * .25 <= duration; ++i) {
            EXPECT_TRUE(scene.set(box, x3d::Transform::translation, Vec3f(static_cast<float>(i))));
            scene.newFrame(i * .25);
        }
        EXPECT_TRUE((*log)->close());
        std::vector<double> result;
        double last = 0;
        auto reader = LogReader::open(file());
        for (const LogKeyframe& keyframe : reader->keyframes()) {
            if (keyframe.time > last) result.push_back(keyframe.time - last);
            last = keyframe.time;
        }
        return result;
    };
    EXPECT_EQ(gaps(2, 100, 9), (std::vector<double>{2, 2, 2, 2}));
    EXPECT_EQ(gaps(0, 100, 9), std::vector<double>{});
    EXPECT_EQ(gaps(2, 5 << 20, 21), (std::vector<double>{5.25, 5.25, 5.25, 5.25}))
        << "5 MiB take five seconds and more";
}

/// LogOptions::repeatFirstUpTo: nothing before it could stand in for the first keyframe.
TEST_F(Log, TheFirstKeyframeIsThereTwiceUnlessItIsLong) {
    for (const std::uint64_t upTo : {std::uint64_t{1} << 20, std::uint64_t{0}}) {
        Scene scene;
        ASSERT_TRUE(scene.setName(scene.createNode(x3d::Group::type), "G"));
        scene.newFrame(0);
        LogOptions options;
        options.repeatFirstUpTo = upTo;
        auto log = LogWriter::create(file(), builtinTypes(), options);
        ASSERT_TRUE(log);
        {
            const Attachment attachment = scene.bus().attach(**log);
            scene.newFrame(1);
        }
        ASSERT_TRUE((*log)->close());
        std::size_t first = 0;
        for (const auto& [offset, header] : recordsOf(file()))
            first += header.kind == RecordKind::keyframe && header.to == 1;
        EXPECT_EQ(first, upTo > 0 ? 2U : 1U);
    }
}

TEST_F(Log, AnAppendedLogReplaysBothSessions) {
    const Recorded first = record(file(), 10, 1);
    const std::string bytes = readAll(file());
    writeAll(file(), std::string_view(bytes).substr(0, bytes.size() - 200));  // cut inside index and last frame
    LogOptions options;
    options.append = true;
    const Recorded second = record(file(), 10, 2, options);
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer);
    const std::uint64_t epoch = (*replayer)->head().epoch;
    bool inSecond = false;
    std::size_t states = 0;
    while (*(*replayer)->step()) {
        const Scene& scene = (*replayer)->scene();
        inSecond |= (*replayer)->head().epoch != epoch;
        if (scene.sequence() > 0) {
            EXPECT_EQ(scene.dump(), (inSecond ? second : first).dumps.at(scene.sequence()));
        }
        ++states;
    }
    EXPECT_TRUE(inSecond);
    EXPECT_GE(states, 18u);
    EXPECT_TRUE((*replayer)->log().damage().empty());
    // Wherever one jumps to, types and epoch are those of the session that is there.
    for (const auto& [time, session] : {std::pair{.5, &first}, {1.4, &second}, {.3, &first}}) {
        ASSERT_TRUE((*replayer)->seek(time));
        EXPECT_EQ((*replayer)->head().epoch != epoch, session == &second) << time;
        const Scene& scene = (*replayer)->scene();
        EXPECT_EQ(scene.dump(), session->dumps.at(scene.sequence())) << time;
    }
}

TEST_F(Log, RefusesWhatIsNoLog) {
    EXPECT_FALSE(LogReader::open(file("absent.rlog")));
    EXPECT_FALSE(LogReader::open(folder));
    writeAll(file("text.rlog"), std::string(5000, 'x'));
    const auto text = Replayer::open(file("text.rlog"));
    ASSERT_FALSE(text);
    EXPECT_NE(text.error().text.find("not a log"), std::string::npos);
    EXPECT_FALSE(LogWriter::create("/nonexistent/folder/a.rlog", builtinTypes()));
}

/// A file full of forged headers, each claiming all that follows: work must stay bounded.
TEST_F(Log, ForgedHeadersDoNotMakeReadingQuadratic) {
    record(file(), 3, 1);
    std::string bytes = readAll(file());
    const std::size_t start = bytes.size();
    for (int i = 0; i < 60000; ++i) {
        ByteBuffer header;
        header.room(kRecordHeaderSize);
        header.advance(kRecordHeaderSize);
        RecordHeader h;
        sealRecord(header, h);
        std::string text(reinterpret_cast<const char*>(header.data()), header.size());
        const std::uint64_t length = (std::uint64_t(60000 - i - 1) * 64) << 16 | 2;
        std::memcpy(text.data() + 16, &length, 8);
        bytes += text;
    }
    writeAll(file(), bytes);
    auto log = LogReader::open(file());
    ASSERT_TRUE(log);
    while (log->next()) {
    }
    ASSERT_EQ(log->damage().size(), 1u);
    EXPECT_EQ(log->damage()[0].offset, start);
    EXPECT_NE(log->damage()[0].text.find("gave up"), std::string::npos);
}

/// Two scenes that differ in one edit; named nodes, one changed field.
void recordSteps(const std::filesystem::path& path, int oddFrame, LogOptions options = {}) {
    Scene scene;
    auto log = LogWriter::create(path, builtinTypes(), options);
    ASSERT_TRUE(log);
    Attachment attachment = scene.bus().attach(**log);
    const NodeId ball = scene.createNode(x3d::Transform::type), hall = scene.createNode(x3d::Transform::type);
    for (const NodeId node : {ball, hall})
        ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children.index, node));
    ASSERT_TRUE(scene.setName(ball, "BALL"));
    ASSERT_TRUE(scene.setName(hall, "HALL"));
    for (int frame = 1; frame <= 10; ++frame) {
        ASSERT_TRUE(scene.set(ball, x3d::Transform::translation, Vec3f(float(frame), 0, 0)));
        if (frame == oddFrame) {
            ASSERT_TRUE(scene.set(hall, x3d::Transform::scale, Vec3f(2)));
        }
        scene.newFrame(frame);
    }
}

TEST_F(Log, DiffNamesFrameNodeAndField) {
    recordSteps(file("a.rlog"), 0);
    recordSteps(file("b.rlog"), 0);
    recordSteps(file("c.rlog"), 6, denseKeyframes());
    const auto same = diffLogs(file("a.rlog"), file("b.rlog"));
    ASSERT_TRUE(same) << same.error().text;
    EXPECT_FALSE(*same);
    const auto other = diffLogs(file("a.rlog"), file("c.rlog"));
    ASSERT_TRUE(other);
    ASSERT_TRUE(*other);
    EXPECT_EQ((*other)->frame, 6u);
    EXPECT_EQ((*other)->time, 6.);
    EXPECT_EQ((*other)->node, "HALL");
    EXPECT_EQ((*other)->field, "scale");
}

TEST_F(Log, DiffTellsHowManyStatesItCouldCompare) {
    recordSteps(file("a.rlog"), 0);
    CompactOptions later;
    later.from = 4;
    ASSERT_TRUE(compactLog(file("a.rlog"), file("b.rlog"), later));
    ComparedStates all, some;
    ASSERT_TRUE(diffLogs(file("a.rlog"), file("a.rlog"), {}, &all));
    EXPECT_EQ(all.one, 0u);
    EXPECT_EQ(all.format(), "in every state");
    const auto found = diffLogs(file("a.rlog"), file("b.rlog"), {}, &some);
    ASSERT_TRUE(found);
    EXPECT_FALSE(*found);
    EXPECT_GT(some.one, 0u);
    EXPECT_EQ(some.both + some.one, all.both);
    EXPECT_EQ(some.format(),
              fmt::format("in all states that both hold ({}); {} more are in one of them", some.both, some.one));
    // One that begins where the other ends has nothing to compare.
    CompactOptions first;
    first.to = 3;
    ASSERT_TRUE(compactLog(file("a.rlog"), file("c.rlog"), first));
    const auto none = diffLogs(file("c.rlog"), file("b.rlog"));
    ASSERT_TRUE(none && *none);
    EXPECT_EQ((*none)->text, "no state is in both logs");
}

TEST_F(Log, DiffNoticesThatOneEndsEarlier) {
    recordSteps(file("a.rlog"), 0);
    const auto records = recordsOf(file("a.rlog"));
    const std::string bytes = readAll(file("a.rlog"));
    writeAll(file("b.rlog"), std::string_view(bytes).substr(0, records[records.size() - 3].first));
    const auto found = diffLogs(file("a.rlog"), file("b.rlog"));
    ASSERT_TRUE(found && *found);
    EXPECT_NE((*found)->text.find("b.rlog ends before"), std::string::npos) << (*found)->text;
}

/// Changes one value inside an intact log and makes the checksum right again.
void tamper(const std::filesystem::path& path, std::uint64_t state, float before, float after) {
    std::string bytes = readAll(path);
    std::string result;
    for (std::size_t at = 0; at < bytes.size();) {
        const RecordHeader header = *parseRecordHeader(asBytes(bytes).subspan(at));
        ByteBuffer record;
        record.append(asBytes(bytes).subspan(at, header.size()));
        if (header.kind == RecordKind::frame && header.to == state)
            for (std::size_t i = kRecordHeaderSize; i + 4 <= record.size(); ++i)
                if (std::memcmp(record.data() + i, &before, 4) == 0) {
                    std::memcpy(record.data() + i, &after, 4);
                    break;
                }
        sealRecord(record, header);
        result.append(reinterpret_cast<const char*>(record.data()), record.size());
        at += header.size();
    }
    writeAll(path, result);
}

TEST_F(Log, VerificationNamesTheFirstDivergence) {
    for (const bool keyframes : {false, true}) {
        recordSteps(file(), 6, keyframes ? denseKeyframes() : LogOptions{});
        tamper(file(), 6, 2.f, 2.5f);  // HALL's scale
        auto replayer = Replayer::open(file());
        ASSERT_TRUE(replayer);
        while (*(*replayer)->step()) {
        }
        const auto& found = (*replayer)->divergence();
        ASSERT_TRUE(found);
        EXPECT_EQ(found->frame, 6u);
        EXPECT_EQ(found->time, 6.);
        if (keyframes) {
            EXPECT_EQ(found->node, "HALL") << found->text;
            EXPECT_EQ(found->field, "scale");
        } else {
            EXPECT_TRUE(found->node == "HALL" || found->node == "BALL");
        }
        EXPECT_LT((*replayer)->verified(), (*replayer)->frames());
    }
}

TEST_F(Log, AnExistingLogIsReplacedOrKeptButNeverCut) {
    const auto write = [&](Existing existing) {
        LogOptions options;
        options.existing = existing;
        return LogWriter::create(file(), builtinTypes(), options);
    };
    ASSERT_TRUE(write(Existing::keep));
    const auto size = std::filesystem::file_size(file());
    auto reading = LogReader::open(file());
    ASSERT_TRUE(reading);
    const auto refused = write(Existing::keep);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().format().find("there is a file already"), std::string::npos);
    EXPECT_EQ(std::filesystem::file_size(file()), size);
    // Replaced: the name leads to the new one with its first state, whoever has the old one open keeps it.
    auto replaced = write(Existing::replace);
    ASSERT_TRUE(replaced) << replaced.error().format();
    EXPECT_TRUE(reading->next());
    EXPECT_TRUE(LogReader::open(file()));
    EXPECT_FALSE(write(Existing::replace)) << "two would write";
    EXPECT_TRUE((*replaced)->close());
    EXPECT_EQ(std::filesystem::file_size(file()), size) << "a log without a state takes no other's place";
    record(file("other.rlog"), 3, 1);
    const std::string before = readAll(file("other.rlog"));
    Scene scene;
    LogOptions options;
    options.existing = Existing::replace;
    auto other = LogWriter::create(file("other.rlog"), builtinTypes(), options);
    ASSERT_TRUE(other);
    EXPECT_EQ(readAll(file("other.rlog")), before);
    const Attachment attachment = scene.bus().attach(**other);
    scene.newFrame(1);
    EXPECT_NE(readAll(file("other.rlog")), before);
    EXPECT_TRUE((*other)->close()) << "it is where its name says";
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 2) << "and nowhere else";
}

/// Without one frame in its middle; the next keyframe goes on.
TEST_F(Log, DiffFindsAHoleInTheMiddle) {
    record(file("a.rlog"), 60, 5, denseKeyframes());
    const auto records = recordsOf(file("a.rlog"));
    const std::string bytes = readAll(file("a.rlog"));
    const auto frame = std::ranges::find_if(records.begin() + 20, records.end(),
                                            [](const auto& r) { return r.second.kind == RecordKind::frame; });
    writeAll(file("b.rlog"), bytes.substr(0, frame->first) + bytes.substr(frame->first + frame->second.size()));
    for (const auto& [one, other] : {std::pair("a.rlog", "b.rlog"), std::pair("b.rlog", "a.rlog")}) {
        ComparedStates states;
        const auto found = diffLogs(file(one), file(other), {}, &states);
        ASSERT_TRUE(found) << found.error().text;
        ASSERT_TRUE(*found);
        EXPECT_EQ((*found)->frame, frame->second.to);
        EXPECT_TRUE((*found)->text.contains("b.rlog lacks this state")) << (*found)->text;
        EXPECT_GT(states.one, 0u);
        EXPECT_GT(states.both, 40u);
    }
    // The same hole in both is none between them.
    const auto same = diffLogs(file("b.rlog"), file("b.rlog"));
    ASSERT_TRUE(same);
    EXPECT_FALSE(*same) << (*same)->format();
}

/// Record `index` with another time, its checksum made right again.
std::string withTime(std::string bytes, const std::pair<std::uint64_t, RecordHeader>& record, double time) {
    RecordHeader header = record.second;
    header.time = time;
    ByteBuffer forged;
    forged.append(asBytes(bytes).subspan(record.first, header.size()));
    sealRecord(forged, header);
    std::memcpy(bytes.data() + record.first, forged.data(), forged.size());
    return bytes;
}

TEST_F(Log, TimesThatAreNoneOrGoBackAreRefused) {
    record(file(), 30, 5);
    const std::string bytes = readAll(file());
    const auto records = recordsOf(file());
    const auto frame = std::ranges::find_if(records.begin() + 15, records.end(),
                                            [](const auto& r) { return r.second.kind == RecordKind::frame; });
    for (const double time : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), .05}) {
        writeAll(file("b.rlog"), withTime(bytes, *frame, time));
        auto replayer = Replayer::open(file("b.rlog"));
        ASSERT_TRUE(replayer);
        LogCheck check(**replayer);
        while (check.step().value_or(true)) continue;
        ASSERT_TRUE(check.first()) << time;
        EXPECT_EQ(check.first()->frame, frame->second.to);
        EXPECT_TRUE(check.first()->text.contains(fmt::format("at byte {}", frame->first + (time == .05 ? 0 : 40))))
            << check.first()->text;
        FieldSelection all;
        all.tolerance = 1;
        EXPECT_FALSE(diffLogFields(file(), file("b.rlog"), all));  // and comes to an end
    }
}

/// The head of another session, and frames, but no keyframe that these start from.
TEST_F(Log, FramesWithoutTheirKeyframeAreAGap) {
    record(file(), 30, 5);
    record(file("other.rlog"), 1, 5);
    const auto records = recordsOf(file());
    const std::string bytes = readAll(file()), other = readAll(file("other.rlog"));
    const auto frame = std::ranges::find_if(records.begin() + 15, records.end(),
                                            [](const auto& r) { return r.second.kind == RecordKind::frame; });
    const std::string head = other.substr(0, recordsOf(file("other.rlog")).front().second.size());
    writeAll(file("b.rlog"), bytes.substr(0, frame->first) + head + bytes.substr(frame->first));
    auto replayer = Replayer::open(file("b.rlog"));
    ASSERT_TRUE(replayer);
    LogCheck check(**replayer);
    while (check.step().value_or(true)) continue;
    EXPECT_EQ((*replayer)->gaps(), 1u);
    ASSERT_TRUE(check.first());
    EXPECT_EQ(check.first()->frame, frame->second.to);
    EXPECT_TRUE(check.first()->text.contains("no keyframe")) << check.first()->text;
}

/// Without an index all damage is found at the start; it is named where it lies.
TEST_F(Log, DamageIsNamedBehindTheStateBeforeIt) {
    const Recorded recorded = record(file(), 30, 5);
    const std::string bytes = readAll(file());
    writeAll(file("b.rlog"), bytes.substr(0, recordsOf(file()).back().first) + "a torn record");
    auto replayer = Replayer::open(file("b.rlog"));
    ASSERT_TRUE(replayer);
    (void)(*replayer)->keyframes();
    LogCheck check(**replayer);
    while (check.step().value_or(true)) continue;
    ASSERT_TRUE(check.first());
    EXPECT_EQ(check.first()->frame, recorded.last + 1);
    EXPECT_DOUBLE_EQ(check.first()->time, recorded.times.at(recorded.last));
}

}  // namespace
}  // namespace rtsg
