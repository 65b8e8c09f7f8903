// Logs that were cut short, bent, or whose writer was killed: what was acknowledged before is there, and the damage is
// reported where it is.
#include <algorithm>
#include <csignal>

#include <sys/wait.h>
#include <unistd.h>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;

class DamagedLog : public LogFolder {
  protected:
    using Records = std::vector<std::pair<std::uint64_t, RecordHeader>>;

    /// Bytes worth trying: all but the inner ones of the long dictionaries, of which every 997th.
    static std::vector<std::size_t> offsetsToTry(const Records& records) {
        std::vector<std::size_t> result;
        for (const auto& [offset, header] : records)
            for (std::size_t at = 0; at < header.size();) {
                result.push_back(offset + at);
                const bool inside = header.size() > 20000 && at > 200 && at + 1200 < header.size();
                at += inside ? 997 : 1;
            }
        return result;
    }
    static std::vector<std::uint64_t> statesOf(const Records& records, std::uint64_t before = UINT64_MAX) {
        std::vector<std::uint64_t> states;
        for (const auto& [offset, header] : records)
            if (offset + header.size() <= before && header.to > 0 && (states.empty() || header.to > states.back()))
                states.push_back(header.to);
        return states;
    }
};

TEST_F(DamagedLog, EveryTruncationKeepsWhatCameBeforeAndIsReported) {
    const Recorded recorded = record(file(), 4, 7, denseKeyframes());
    const std::string bytes = readAll(file());
    const Records records = recordsOf(file());
    for (const std::size_t size : offsetsToTry(records)) {
        SCOPED_TRACE(testing::Message() << "cut to " << size << " bytes");
        writeAll(file("cut.rlog"), std::string_view(bytes).substr(0, size));
        const Replayed replayed = replay(file("cut.rlog"), recorded);
        const bool atBoundary =
            std::ranges::any_of(records, [size](const auto& record) { return record.first == size; });
        EXPECT_EQ(replayed.opened, size >= records[0].second.size());
        EXPECT_EQ(replayed.states, statesOf(records, size));
        if (replayed.opened) {
            EXPECT_EQ(replayed.damage, atBoundary ? 0u : 1u);
        }
        if (HasFailure()) return;
    }
}

TEST_F(DamagedLog, AFlippedByteCostsAtMostTheFramesUpToTheNextKeyframe) {
    const Recorded recorded = record(file(), 5, 8, denseKeyframes());
    const std::string bytes = readAll(file());
    const Records records = recordsOf(file());
    const std::vector<std::uint64_t> all = statesOf(records);
    ASSERT_EQ(all.size(), recorded.dumps.size());
    std::size_t hit = 0;
    for (const std::size_t at : offsetsToTry(records)) {
        SCOPED_TRACE(testing::Message() << "byte " << at << " flipped");
        while (hit + 1 < records.size() && records[hit + 1].first <= at) ++hit;
        std::string bent = bytes;
        bent[at] = static_cast<char>(bent[at] ^ (1 << (at % 8)));
        writeAll(file("bent.rlog"), bent);
        const Replayed replayed = replay(file("bent.rlog"), recorded);
        ASSERT_TRUE(replayed.opened);
        EXPECT_EQ(replayed.damage, 1u);
        EXPECT_EQ(replayed.damageAt, records[hit].first);
        // Heads, keyframes and index are there twice, or repeat what others say: only a frame can be missed.
        std::vector<std::uint64_t> expected = all;
        if (records[hit].second.kind == RecordKind::frame) {
            std::size_t next = hit;
            while (next < records.size() && records[next].second.kind != RecordKind::keyframe) ++next;
            const std::uint64_t from = records[hit].second.to,
                                until = next < records.size() ? records[next].second.to : UINT64_MAX;
            std::erase_if(expected, [&](std::uint64_t state) { return state >= from && state < until; });
        }
        EXPECT_EQ(replayed.states, expected);
        if (HasFailure()) return;
    }
}

TEST_F(DamagedLog, SeeksPastADamagedKeyframe) {
    const Recorded recorded = record(file(), 40, 9, denseKeyframes());
    const std::string bytes = readAll(file());
    const std::vector<LogKeyframe> keyframes = LogReader::open(file())->keyframes();
    ASSERT_GT(keyframes.size(), 5u);
    for (const LogKeyframe& keyframe : keyframes)
        for (const std::uint64_t at : {keyframe.head, keyframe.offset + 70}) {
            SCOPED_TRACE(testing::Message() << "byte " << at << " flipped, time " << keyframe.time);
            std::string bent = bytes;
            bent[at] = static_cast<char>(bent[at] ^ 8);
            writeAll(file("bent.rlog"), bent);
            auto replayer = Replayer::open(file("bent.rlog"));
            ASSERT_TRUE(replayer);
            ASSERT_TRUE((*replayer)->seek(keyframe.time));
            const std::uint64_t state = (*replayer)->scene().sequence();
            EXPECT_EQ((*replayer)->scene().dump(), recorded.dumps.at(state));
            EXPECT_EQ((*replayer)->scene().now(), keyframe.time);
        }
}

/// Any damage at all: what is reached is right, and so is all before the first bent byte.
TEST_F(DamagedLog, RandomDamageNeverYieldsAWrongState) {
    const std::uint64_t seed = 4711;
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 random(seed);
    const Recorded recorded = record(file(), 40, seed, denseKeyframes());
    const std::string bytes = readAll(file());
    const Records records = recordsOf(file());
    for (int round = 0; round < 100; ++round) {
        std::string bent = bytes;
        // Half of the damage where the frames are: the dictionary is most of so short a log.
        const std::size_t begin = round % 2 ? records[1].first : 0;
        const std::size_t end = round % 2 ? records[records.size() - 2].first : bytes.size();
        const std::size_t at = begin + random() % (end - begin);
        const std::size_t length = std::min<std::size_t>(1 + random() % 5000, bent.size() - at);
        switch (round % 5) {
            case 0:  // a lost block
                std::fill_n(bent.begin() + std::ptrdiff_t(at), length, '\0');
                break;
            case 1:
                bent.erase(at, length);
                break;
            case 2:  // the same part twice
                bent.insert(at, bent.substr(at / 2, length));
                break;
            case 3:
                for (int i = 0; i < 20; ++i) {
                    char& byte = bent[at + random() % (bent.size() - at)];
                    byte = static_cast<char>(random());
                }
                break;
            default:
                for (std::size_t i = at; i < at + length; ++i) bent[i] = static_cast<char>(random());
                break;
        }
        SCOPED_TRACE(testing::Message() << "round " << round << ", " << length << " bytes from " << at);
        writeAll(file("bent.rlog"), bent);
        const Replayed replayed = replay(file("bent.rlog"), recorded);
        const std::vector<std::uint64_t> before = statesOf(records, at);
        if (!before.empty()) {
            EXPECT_TRUE(replayed.opened);
            ASSERT_GE(replayed.states.size(), before.size());
            EXPECT_TRUE(std::ranges::equal(before, std::span(replayed.states).first(before.size())));
        }
        if (bent != bytes && round % 5 != 2 && round % 5 != 1) {
            EXPECT_GE(replayed.damage, replayed.opened ? 1u : 0u);
        }
        if (HasFailure()) return;
    }
}

/// A writer that acknowledges each state on a pipe once apply() has returned, killed at a random moment.
TEST_F(DamagedLog, KilledAtAnyMomentKeepsEveryAcknowledgedState) {
    const std::uint64_t seed = 90;
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 random(seed);
    std::size_t acknowledgedInAll = 0;
    for (int round = 0; round < 50; ++round) {
        int pipes[2];
        ASSERT_EQ(pipe(pipes), 0);
        const pid_t child = fork();
        ASSERT_GE(child, 0);
        if (child == 0) {
            LogOptions options = denseKeyframes();
            options.keyframeBytes = 2000;
            auto log = LogWriter::create(file(), builtinTypes(), options);
            if (!log) _exit(1);
            Scene scene;
            Attachment attachment = scene.bus().attach(**log);
            RandomEdits edits(scene, seed + static_cast<std::uint64_t>(round));
            for (int frame = 0;; ++frame) {
                for (int i = 0; i < 6; ++i) edits.step();
                scene.newFrame(frame * .1);
                const std::uint64_t acknowledged[3] = {scene.sequence(), scene.hash().low, scene.hash().high};
                if (::write(pipes[1], acknowledged, sizeof(acknowledged)) < 0) _exit(1);
            }
        }
        ::close(pipes[1]);
        std::map<std::uint64_t, Hash128> acknowledged;
        std::uint64_t next[3];
        const std::size_t wanted = random() % 60;
        const auto readOne = [&] {
            if (::read(pipes[0], next, sizeof(next)) != ssize_t(sizeof(next))) return false;
            acknowledged[next[0]] = {next[1], next[2]};
            return true;
        };
        while (acknowledged.size() < wanted && readOne()) {
        }
        ::usleep(static_cast<useconds_t>(random() % 2000));
        ::kill(child, SIGKILL);
        ::waitpid(child, nullptr, 0);
        while (readOne()) {
        }
        ::close(pipes[0]);
        acknowledgedInAll += acknowledged.size();
        auto replayer = Replayer::open(file());
        if (acknowledged.empty()) continue;  // killed before the first: there may not even be a head
        ASSERT_TRUE(replayer) << replayer.error().text;
        std::map<std::uint64_t, Hash128> found;
        while (true) {
            const Result<bool> more = (*replayer)->step();
            ASSERT_TRUE(more) << more.error().text;
            if (!*more) break;
            found[(*replayer)->scene().sequence()] = (*replayer)->scene().hash();
        }
        for (const auto& [state, hash] : acknowledged) {
            ASSERT_TRUE(found.contains(state)) << "round " << round << ", state " << state;
            EXPECT_EQ(found[state], hash);
        }
        EXPECT_EQ((*replayer)->frames(), (*replayer)->verified());
        EXPECT_LE((*replayer)->log().damage().size(), 1u);
        // The next session goes on behind what is whole.
        LogOptions again;
        again.append = true;
        EXPECT_TRUE(LogWriter::create(file(), builtinTypes(), again));
        EXPECT_TRUE(LogReader::open(file())->damage().empty());
    }
    EXPECT_GT(acknowledgedInAll, 1000u);
}

}  // namespace
}  // namespace rtsg
