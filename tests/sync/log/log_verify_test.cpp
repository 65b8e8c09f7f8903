// A forged value, checksum and all, in a frame of many changes and with no later keyframe: running the frame again from
// its input tells which one it is.
#include <cstring>

#include <rtsg/documents/loader.h>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;
using Verification = LogFolder;

/// Ten frames, a quarter of a second apart: at t = 1 s the clock is at 0.25, GAUGE at 1.75, BALL at (0.5, 0, 0).
void recordClock(const std::filesystem::path& file) {
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, R"(#X3D V4.0 utf8
PROFILE Immersive
DEF CLOCK TimeSensor { cycleInterval 4 loop TRUE }
DEF GAUGE ScalarInterpolator { key [ 0 1 ] keyValue [ 0 7 ] }
DEF PATH PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 2 0 0 ] }
DEF BALL Transform { }
ROUTE CLOCK.fraction_changed TO GAUGE.set_fraction
ROUTE CLOCK.fraction_changed TO PATH.set_fraction
ROUTE PATH.value_changed TO BALL.translation
)",
                         diagnostics));
    auto log = LogWriter::create(file, builtinTypes());
    ASSERT_TRUE(log);
    Attachment attachment = scene.bus().attach(**log);
    for (int frame = 0; frame < 10; ++frame) scene.newFrame(frame * .25);
}

/// In the frame of `time`, the first value of these bits becomes another, and the checksum is made right again.
void forge(const std::filesystem::path& file, double time, float before, float after) {
    std::string bytes = readAll(file);
    bool found = false;
    for (std::size_t at = 0; at < bytes.size();) {
        const RecordHeader header = *parseRecordHeader(asBytes(bytes).subspan(at));
        if (header.kind == RecordKind::frame && header.time == time && !found) {
            ByteBuffer record;
            record.append(asBytes(bytes).subspan(at, header.size()));
            for (std::size_t i = kRecordHeaderSize; i + 4 <= record.size() && !found; ++i)
                if (std::memcmp(record.data() + i, &before, 4) == 0) {
                    std::memcpy(record.data() + i, &after, 4);
                    found = true;
                }
            sealRecord(record, header);
            std::memcpy(bytes.data() + at, record.data(), record.size());
        }
        at += header.size();
    }
    ASSERT_TRUE(found);
    writeAll(file, bytes);
}

TEST_F(Verification, AForgedDerivedValueIsNamedAtOnce) {
    recordClock(file());
    forge(file(), 1, 1.75f, 1.5f);
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer);
    while (*(*replayer)->step()) {
    }
    const auto& found = (*replayer)->divergence();
    ASSERT_TRUE(found);
    EXPECT_EQ(found->time, 1.);
    EXPECT_EQ(found->node, "GAUGE");
    EXPECT_EQ(found->field, "value_changed");
    EXPECT_NE(found->text.find("the origin had 1.75, the log has 1.5"), std::string::npos) << found->text;
    EXPECT_NE(found->text.find("by running the frame again"), std::string::npos) << found->text;
    EXPECT_LT((*replayer)->verified(), (*replayer)->frames());
}

TEST_F(Verification, AnIntactLogHasNoDivergence) {
    recordClock(file());
    auto replayer = Replayer::open(file());
    ASSERT_TRUE(replayer);
    while (*(*replayer)->step()) {
    }
    EXPECT_FALSE((*replayer)->divergence());
    EXPECT_EQ((*replayer)->verified(), (*replayer)->frames());
}

}  // namespace
}  // namespace rtsg
