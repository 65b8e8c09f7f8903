// Logs for tests: a folder of their own, recordings of random edits that know each state's dump, and a replay that
// expects every state it reaches to be the recorded one.
#pragma once

#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/sync/log.h>
#include <rtsg/sync/replay.h>

#include "random_edits.h"

namespace rtsg::test {

inline std::string readAll(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}
inline void writeAll(const std::filesystem::path& file, std::string_view bytes) {
    std::filesystem::remove(file);  // some file systems wait for the disk when a file is overwritten
    std::ofstream(file, std::ios::binary | std::ios::trunc).write(bytes.data(), std::streamsize(bytes.size()));
}
inline std::span<const std::byte> asBytes(std::string_view text) {
    return std::as_bytes(std::span(text.data(), text.size()));
}

class LogFolder : public testing::Test {
  protected:
    LogFolder() {
        char pattern[] = "/tmp/rtsg-log-XXXXXX";
        folder = mkdtemp(pattern);
    }
    ~LogFolder() override { std::filesystem::remove_all(folder); }
    std::filesystem::path file(std::string_view name = "a.rlog") const { return folder / name; }

    /// The state at each number.
    struct Recorded {
        std::map<std::uint64_t, std::string> dumps;
        std::map<std::uint64_t, double> times;
        std::uint64_t last = 0;
    };
    /// `frames` frames of random edits, a tenth of a second apart, each with its dump.
    static Recorded record(const std::filesystem::path& path, int frames, std::uint64_t seed, LogOptions options = {}) {
        Recorded result;
        Scene scene;
        auto log = LogWriter::create(path, builtinTypes(), options);
        EXPECT_TRUE(log) << log.error().text;
        Attachment attachment = scene.bus().attach(**log);
        test::RandomEdits edits(scene, seed);
        for (int frame = 0; frame < frames; ++frame) {
            for (int i = 0; i < 6; ++i) edits.step();
            scene.newFrame(frame * .1);
            result.dumps[scene.sequence()] = scene.dump();
            result.times[scene.sequence()] = scene.now();
        }
        EXPECT_EQ(attachment.failure(), "");
        const Result<> closed = (*log)->close();
        EXPECT_TRUE(closed) << closed.error().text;
        result.last = scene.sequence();
        return result;
    }

    struct Replayed {
        std::vector<std::uint64_t> states;
        std::size_t damage = 0;
        std::uint64_t damageAt = 0;
        bool opened = false;
    };
    /// Replays, and expects every state that is reached to be the recorded one.
    static Replayed replay(const std::filesystem::path& path, const Recorded& recorded) {
        Replayed result;
        auto replayer = Replayer::open(path);
        if (!replayer) {
            EXPECT_NE(replayer.error().text.find("at byte"), std::string::npos) << replayer.error().text;
            return result;
        }
        result.opened = true;
        while (true) {
            const Result<bool> more = (*replayer)->step();
            EXPECT_TRUE(more) << more.error().text;
            if (!more || !*more) break;
            const std::uint64_t state = (*replayer)->scene().sequence();
            if (state > 0) {
                EXPECT_EQ((*replayer)->scene().dump(), recorded.dumps.at(state)) << "state " << state;
                result.states.push_back(state);
            }
        }
        EXPECT_FALSE((*replayer)->divergence());
        result.damage = (*replayer)->log().damage().size();
        if (result.damage) result.damageAt = (*replayer)->log().damage().front().offset;
        return result;
    }
    /// Offset, header of each record of an intact file.
    static std::vector<std::pair<std::uint64_t, RecordHeader>> recordsOf(const std::filesystem::path& path) {
        std::vector<std::pair<std::uint64_t, RecordHeader>> result;
        auto log = LogReader::open(path);
        while (const auto record = log->next()) result.emplace_back(record->offset, record->header);
        EXPECT_TRUE(log->damage().empty());
        return result;
    }

    std::filesystem::path folder;
};

/// Keyframes close together, so that a short log has several.
inline LogOptions denseKeyframes() {
    LogOptions options;
    options.keyframeBytes = 200;
    options.keyframeFactor = 0;  // however long the description of types is
    return options;
}

}  // namespace rtsg::test
