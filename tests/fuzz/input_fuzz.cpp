// Feeds arbitrary bytes behind a valid header and checksum to the decoder of input records, and runs what it accepts in
// a scene: errors and other hashes are what may come of it.
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include <rtsg/documents/loader.h>
#include <rtsg/sync/input_codec.h>
#include <rtsg/sync/input_replica.h>

namespace {

constexpr const char* kScene = R"(#X3D V4.0 utf8
DEF T TimeSensor { loop TRUE }
DEF P PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 1 1 1 ] }
DEF M Transform { children DEF B BooleanToggle { } }
DEF L PointLight { }
ROUTE T.fraction_changed TO P.set_fraction
ROUTE P.value_changed TO M.set_translation
)";

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const std::shared_ptr<const rtsg::ChangeSet> start = [] {
        rtsg::Scene scene;
        rtsg::Diagnostics diagnostics;
        (void)rtsg::loadText(scene, kScene, diagnostics);
        scene.newFrame(0);
        scene.setInputRecording(true);
        return std::make_shared<const rtsg::ChangeSet>(scene.snapshot());
    }();
    rtsg::Scene scene;
    rtsg::InputReplica replica(scene);
    (void)replica.take(start);
    for (const bool runState : {true, false}) {
        rtsg::ByteBuffer record;
        record.room(rtsg::kRecordHeaderSize);
        record.advance(rtsg::kRecordHeaderSize);
        record.append(data, size);
        rtsg::RecordHeader header;
        header.kind = rtsg::RecordKind::input;
        header.from = start->to;
        header.to = runState ? header.from : header.from + 1;
        header.time = 1;
        header.hash = start->hash;
        rtsg::sealRecord(record, header);
        auto set = std::make_shared<rtsg::ChangeSet>();
        if (rtsg::InputDecoder().decode(record.bytes(), *set)) (void)replica.take(set);
    }
    return 0;
}
