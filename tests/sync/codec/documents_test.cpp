// Whole documents through codec, log and replay: prototypes, scripts' interfaces, whatever real files hold.
#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>
#include <unistd.h>

#include <rtsg/core/scene.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/replay.h>

#include "test_paths.h"

namespace rtsg {
namespace {

/// Follows by way of the wire alone: every set is encoded, checked and decoded.
struct WireFollower : Subscriber {
    Scene replica;
    ChangeEncoder encoder;
    ChangeDecoder decoder{builtinTypes()};
    ByteBuffer record;
    std::uint64_t bytes = 0;

    WireFollower() { replica.setBehavioursEnabled(false); }
    Result<> apply(const Scene&, const ChangeSet& changes) override {
        encoder.encode(changes, record);
        bytes += record.size();
        if (const auto header = checkRecord(record.bytes()); !header) return std::unexpected(header.error());
        const auto set = std::make_shared<ChangeSet>();
        if (auto ok = decoder.decode(record.bytes(), *set); !ok) return ok;
        if (auto ok = replica.apply(set); !ok) return ok;
        if (replica.hash() != changes.hash) return fail("other hash");
        return {};
    }
};

/// Runs `scene` for some frames with a follower, a late joiner and a log; all must end in the same state.
void followEverywhere(Scene& scene, const std::string& what) {
    SCOPED_TRACE(what);
    const std::filesystem::path file =
        std::filesystem::temp_directory_path() / ("rtsg-documents-" + std::to_string(::getpid()) + ".rlog");
    WireFollower early, late;
    Attachment followsEarly = scene.bus().attach(early), followsLate;
    {
        auto log = *LogWriter::create(file, builtinTypes());
        Attachment logged = scene.bus().attach(*log);
        for (int frame = 0; frame < 12; ++frame) {
            scene.newFrame(frame * .25);
            if (frame == 6) followsLate = scene.bus().attach(late);
        }
        EXPECT_EQ(logged.failure(), "");
    }
    EXPECT_EQ(followsEarly.failure(), "");
    EXPECT_EQ(followsLate.failure(), "");
    const std::string expected = scene.dump();
    EXPECT_EQ(early.replica.dump(), expected);
    EXPECT_EQ(late.replica.dump(), expected);
    auto replayer = Replayer::open(file);
    ASSERT_TRUE(replayer) << replayer.error().text;
    while (true) {
        const Result<bool> more = (*replayer)->step();
        ASSERT_TRUE(more) << more.error().text;
        if (!*more) break;
    }
    std::filesystem::remove(file);
    EXPECT_EQ((*replayer)->scene().dump(), expected);
    EXPECT_EQ((*replayer)->frames(), (*replayer)->verified());
}

TEST(Documents, PrototypesScriptsAndRoutesTravel) {
    constexpr const char* text = R"(#X3D V4.0 utf8
PROFILE Full
PROTO Ball [ initializeOnly SFFloat size 1  inputOutput SFColor tint 1 0 0  inputOnly SFVec3f move
             inputOutput MFNode extra [] ] {
  DEF Inner Transform {
    set_translation IS move
    children [ Shape { geometry Sphere { radius IS size }
                       appearance Appearance { material Material { diffuseColor IS tint } } } ]
  }
}
DEF Clock TimeSensor { cycleInterval 2 loop TRUE }
DEF Path PositionInterpolator { key [ 0 .5 1 ] keyValue [ 0 0 0 1 0 0 0 1 0 ] }
DEF A Ball { size 2 extra [ Group { } ] }
DEF B Ball { tint 0 1 0 }
DEF S Script { inputOnly SFFloat in  outputOnly SFBool out  inputOutput MFString words [ "a" "b" ]  url "none.js" }
Transform { children [ USE A ] }
ROUTE Clock.fraction_changed TO Path.set_fraction
ROUTE Path.value_changed TO A.move
ROUTE Path.value_changed TO B.move
ROUTE Clock.fraction_changed TO S.in
)";
    Scene scene;
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, text, diagnostics));
    EXPECT_EQ(diagnostics.errors(), 0u);
    EXPECT_GT(scene.nodeCount(), 15u);
    followEverywhere(scene, "prototypes");
}

TEST(Documents, RealFilesTravel) {
    const char* given = std::getenv("RTSG_SCENES");
    const std::filesystem::path folder =
        given ? std::filesystem::path(given) : std::filesystem::path(RTSG_SOURCE_DIR) / "../shared/scenes";
    if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << "no scenes in " << folder << " (set RTSG_SCENES)";
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
        const std::string extension = entry.path().extension();
        if ((extension == ".x3d" || extension == ".x3dv" || extension == ".wrl") && entry.is_regular_file() &&
            entry.file_size() < 300000)
            files.push_back(entry.path());
    }
    std::ranges::sort(files);
    std::size_t used = 0;
    const std::size_t step = std::max<std::size_t>(1, files.size() / 400);
    for (std::size_t i = 0; i < files.size(); i += step) {
        Scene scene;
        Diagnostics diagnostics(files[i].string());
        LoadOptions options;
        options.loadInlines = false;  // nothing from elsewhere
        if (!loadFile(scene, files[i], diagnostics, options)) continue;
        followEverywhere(scene, files[i].string());
        ++used;
        if (HasFatalFailure()) return;
    }
    EXPECT_GT(used, 0u);
}

}  // namespace
}  // namespace rtsg
