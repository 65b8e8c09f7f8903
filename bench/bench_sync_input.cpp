// Input mode: what a frame costs when only what came into it travels, beside the changes themselves.
#include <algorithm>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/frame_input.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/input_codec.h>
#include <rtsg/sync/input_replica.h>

#include "bench_sync.h"

namespace rtsg::bench {

namespace {

constexpr int kFigures = 48, kJoints = 16;

/// Figures whose joints all follow interpolators: everything derives from the clock.
std::string troopers() {
    std::string text = "#X3D V4.0 utf8\n";
    for (int f = 0; f < kFigures; ++f) {
        text += fmt::format("DEF T{} TimeSensor {{ loop TRUE cycleInterval {} }}\n", f, 1 + f * .01);
        for (int j = 0; j < kJoints; ++j)
            text += fmt::format(
                "DEF I{0}_{1} OrientationInterpolator {{ key [ 0 .5 1 ] keyValue [ 1 0 0 0, 1 0 0 1, 1 0 0 0 ] }}\n"
                "DEF J{0}_{1} Transform {{ }}\nROUTE T{0}.fraction_changed TO I{0}_{1}.set_fraction\n"
                "ROUTE I{0}_{1}.value_changed TO J{0}_{1}.rotation\n",
                f, j);
    }
    return text;
}

struct Costs {
    double frame = 0, encode = 0, follow = 0;  // CPU seconds
    double bytes = 0;
    bool equal = true;
};

Costs runInput(const std::string& document, int frames, bool byInput) {
    Scene origin, copy;
    Diagnostics diagnostics;
    (void)loadText(origin, document, diagnostics);
    origin.setInputRecording(byInput);
    copy.setBehavioursEnabled(false);
    InputReplica* replica = nullptr;
    std::unique_ptr<InputReplica> own;
    if (byInput) {
        own = std::make_unique<InputReplica>(copy);
        replica = own.get();
    }
    ChangeEncoder encoder;
    ChangeDecoder decoder(builtinTypes());
    InputEncoder inputs;
    InputDecoder inputDecoder;
    ByteBuffer record;
    Costs costs;
    auto received = std::make_shared<ChangeSet>();
    for (int frame = 0; frame <= frames; ++frame) {
        double before = cpuSeconds();
        const auto set = origin.newFrame(frame * .016);
        if (frame == 0) {
            auto first = std::make_shared<const ChangeSet>(origin.snapshot());
            costs.equal &= replica ? replica->take(first).value_or(false) : copy.apply(first).has_value();
            continue;
        }
        costs.frame += cpuSeconds() - before;
        before = cpuSeconds();
        byInput ? inputs.encode(*set, record) : encoder.encode(*set, record);
        costs.encode += cpuSeconds() - before;
        costs.bytes += static_cast<double>(record.size());
        before = cpuSeconds();
        if (received.use_count() > 1) received = std::make_shared<ChangeSet>();
        if (replica) {
            (void)inputDecoder.decode(record.bytes(), *received);
            costs.equal &= replica->take(received).value_or(false);
        } else {
            (void)decoder.decode(record.bytes(), *received);
            (void)copy.apply(received);
        }
        costs.equal &= copy.hash() == set->hash;
        costs.follow += cpuSeconds() - before;
    }
    return costs;
}

}  // namespace

bool input(const SyncSizes& sizes, const Report& report) {
    const std::string document = troopers();
    const int frames = std::max(20, sizes.frames / 2);
    Costs state, byInput;
    for (int i = 0; i < 3; ++i) {
        const Costs a = runInput(document, frames, false), b = runInput(document, frames, true);
        if (!a.equal || !b.equal) return false;
        const auto best = [i](Costs& kept, const Costs& one) {
            if (i == 0) kept = one;
            kept.frame = std::min(kept.frame, one.frame);
            kept.encode = std::min(kept.encode, one.encode);
            kept.follow = std::min(kept.follow, one.follow);
        };
        best(state, a);
        best(byInput, b);
    }
    const double transforms = double(frames) * kFigures * kJoints;
    const std::string name = fmt::format("{} figures, {} joints", kFigures, kJoints);
    report({"input", name, "bytes of a changed transform, input mode", "B", byInput.bytes / transforms,
            "state mode, raw", state.bytes / transforms, "a record's header alone",
            double(kRecordHeaderSize) / (kFigures * kJoints)});
    report({"input", name, "frame with its input recorded", "us", byInput.frame / frames * 1e6, "not recorded",
            state.frame / frames * 1e6, "", 0});
    report({"input", name, "follow a frame, input mode", "us", byInput.follow / frames * 1e6,
            "state mode: decode, apply", state.follow / frames * 1e6, "the origin's own frame",
            state.frame / frames * 1e6});
    return true;
}

}  // namespace rtsg::bench
