// Whatever numbers events put into nodes of sound: what is heard stays a sound, and what is no number is told.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>

namespace rtsg {
namespace {

using testing::HasSubstr;

/// Every node of the component that numbers have a say in.
const char* const kAllNodes = R"(#X3D V4.1 utf8
PROFILE Full
DEF L ListenerPointSource { position 0 0 2 }
DEF S Sound { source DEF B BufferAudioSource { buffer [ .5 -.5 .25 ] sampleRate 48000 loop TRUE } }
DEF P SpatialSound { coneInnerAngle 1 coneOuterAngle 2 coneOuterGain .5 location 1 0 0 children [
  DEF F BiquadFilter { children DEF D Delay { delayTime .001 children DEF C DynamicsCompressor { children
    DEF V Convolver { buffer [ .5 .25 ] normalize TRUE children DEF W WaveShaper { curve [ -1 0 1 ] oversample "2X"
      children DEF G Gain { children DEF O OscillatorSource { periodicWave DEF Q PeriodicWave { type "CUSTOM"
        optionsReal [ 0 0 ] optionsImag [ 0 1 ] } } } } } } } } ] }
DEF A AudioDestination { gain .5 children [ DEF N Analyser { children DEF I SpatialSound { children DEF E BufferAudioSource {
  buffer [ .5 -.5 ] sampleRate 48000 numberOfChannels 1 loop TRUE } } } DEF M ChannelMerger { children [ USE O DEF R ChannelSplitter { children USE B
  outputs DEF T ChannelSelector { } } ] } ] }
)";

struct NumberField {
    NodeId node;
    FieldIndex field;
    std::string name;  // DEF.field
    Value before;
};

class StrangeNumbers : public testing::Test {
  protected:
    StrangeNumbers() : world_(loaded()), sound_(world_, options()) {
        for (const char def : std::string("LSBPFDCVWGOQANIEMRT")) {
            const NodeId id = scene_.findName(std::string(1, def));
            const NodeType& type = scene_.node(id).type();
            for (FieldIndex i = 0; i < type.fields.size(); ++i) {
                const FieldDef& field = type.fields[i];
                const bool number = field.type == FieldType::SFFloat || field.type == FieldType::SFTime ||
                                    field.type == FieldType::SFVec3f || field.type == FieldType::SFRotation ||
                                    field.type == FieldType::MFFloat;
                if (!number || field.hidden || !field.writable() || !field.readable()) continue;
                fields_.push_back({id, i, def + ("." + field.name), scene_.node(id).value(i)});
            }
        }
    }
    static ListenOptions options() {
        ListenOptions options;
        options.metrics = false;
        options.render.trace.rays = 50;
        return options;
    }
    Scene& loaded() {
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene_, kAllNodes, diagnostics));
        for (const Diagnostic& d : diagnostics.all()) ADD_FAILURE() << d.format();
        return scene_;
    }
    /// Sets the field as a ROUTE would.
    void set(const NumberField& field, float number) {
        const FieldType type = scene_.node(field.node).type().fields[field.field].type;
        const Value value = type == FieldType::SFFloat      ? Value(number)
                            : type == FieldType::SFTime     ? Value(Time{static_cast<double>(number)})
                            : type == FieldType::SFVec3f    ? Value(Vec3f(0, number, 1))
                            : type == FieldType::SFRotation ? Value(Rotation{0, 1, 0, number})
                                                            : Value(Array<float>{.5f, number, -.5f});
        ASSERT_TRUE(scene_.sendEvent(field.node, field.field, value)) << field.name;
    }
    void reset(const NumberField& field) { ASSERT_TRUE(scene_.sendEvent(field.node, field.field, field.before)); }
    /// The loudest sample of some frames. Samples beyond any sound are a failure.
    double hear(const std::string& what, int frames = 2) {
        double peak = 0;
        for (int i = 0; i < frames; ++i) {
            scene_.newFrame(++frame_ / 60.0);
            EXPECT_TRUE(sound_.renderFrame());
            for (const float sample : sound_.block()) {
                if (!(std::abs(sample) < 1e10f)) {
                    ADD_FAILURE() << sample << " after " << what;
                    return peak;
                }
                peak = std::max(peak, static_cast<double>(std::abs(sample)));
            }
        }
        return peak;
    }

    Scene scene_;
    SharedWorld world_;
    SoundRenderer sound_;
    std::vector<NumberField> fields_;
    int frame_ = 0;
};

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr std::array<float, 10> kStrange = {NAN, kInfinity, -kInfinity, -1, 0, 3e38f, -3e38f, 1e-40f, 1e9f, -1e9f};

TEST_F(StrangeNumbers, OneByOneLeaveASoundAndItComesBack) {
    EXPECT_GT(fields_.size(), 60u);
    const double usual = hear("nothing", 4);
    EXPECT_GT(usual, .1);
    for (const NumberField& field : fields_)
        for (const float number : kStrange) {
            const std::string what = field.name + " " + std::to_string(number);
            set(field, number);
            hear(what);
            reset(field);
            EXPECT_GT(hear(what + ", reset", 3), .01) << what;
        }
}

TEST_F(StrangeNumbers, TogetherLeaveASound) {
    for (const unsigned seed : {1u, 2u, 3u, 4u}) {
        std::mt19937 random(seed);
        for (int round = 0; round < 60; ++round) {
            std::set<std::size_t> chosen;
            while (chosen.size() < 4) chosen.insert(random() % fields_.size());
            std::string what = "seed " + std::to_string(seed) + ":";
            for (const std::size_t i : chosen) {
                const float number = kStrange[random() % kStrange.size()];
                what += " " + fields_[i].name + " " + std::to_string(number);
                set(fields_[i], number);
            }
            hear(what);
            for (const std::size_t i : chosen) reset(fields_[i]);
        }
        EXPECT_GT(hear("all is reset", 30), .01) << "seed " << seed;
    }
}

/// Once, with the node, the field and what counts instead, however long it goes on.
TEST_F(StrangeNumbers, AreTold) {
    const auto fieldOf = [&](const std::string& name) { return *std::ranges::find(fields_, name, &NumberField::name); };
    const struct {
        const char* field;
        float number;
        const char* text;
    } cases[] = {
        {"S.intensity", NAN, "S: its intensity is no finite number: 0 counts"},
        {"S.intensity", -2, "S: its intensity is too small: 0 counts"},
        {"S.intensity", 2, "S: its intensity is too large: 1 counts"},
        {"S.minFront", -1, "S: its minFront is too small: 0 counts"},
        {"S.location", NAN, "S: its location is no finite vector: it is not heard"},
        {"P.direction", kInfinity, "P: its direction is no finite vector: 0 0 1 counts"},
        {"P.gain", NAN, "P: its gain is no finite number: 0 counts"},
        {"P.rolloffFactor", -1, "P: its rolloffFactor is too small: 0 counts"},
        {"I.location", NAN, "I: its location is no finite vector: it is not heard"},
        {"B.playbackRate", NAN, "B: its playbackRate is no finite number: 1 counts"},
        {"B.buffer", NAN, "B: 1 of the 3 samples of its buffer are no finite numbers: 0 counts"},
        {"B.bufferDuration", NAN, "B: its bufferDuration is no finite number: 0 counts"},
        {"O.detune", kInfinity, "O: its detune is no finite number: 0 counts"},
        {"O.frequency", NAN, "O: its frequency is no finite number: 0 counts"},
        {"G.gain", NAN, "G: its gain is no finite number: 0 counts"},
        {"F.frequency", NAN, "F: its frequency is no finite number: 350 counts"},
        {"D.delayTime", -1, "D: its delayTime is too small: 0 counts"},
        {"D.delayTime", NAN, "D: its delayTime is no finite number: 0 counts"},
        {"C.ratio", NAN, "C: its ratio is no finite number: 12 counts"},
        {"A.gain", NAN, "A: its gain is no finite number: 0 counts"},
        {"L.gain", NAN, "L: its gain is no finite number: 0 counts"},
        {"L.position", NAN, "L: its position in the world is no place: the last that was one counts, or 0 0 10"},
        {"L.orientation", kInfinity,
         "L: its orientation in the world is no rotation: the last that was one counts, or 0 0 1 0"}};
    for (const auto& one : cases) {
        const NumberField field = fieldOf(one.field);
        for (int i = 0; i < 3; ++i) {
            set(field, one.number);
            hear(one.text);
            reset(field);
            hear(one.text);
        }
    }
    const ListenReport report = sound_.finish();
    for (const auto& one : cases) {
        const auto reported = std::ranges::count(report.diagnostics.all(), one.text, &Diagnostic::text);
        // Buffers are read when they change.
        EXPECT_TRUE(reported == 1 || (reported == 3 && std::string_view(one.field) == "B.buffer"))
            << one.text << ": " << reported;
    }
    for (const Diagnostic& d : report.diagnostics.all()) EXPECT_GT(d.where.line, 0) << d.text;
}

}  // namespace
}  // namespace rtsg
