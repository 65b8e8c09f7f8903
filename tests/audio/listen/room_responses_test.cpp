// SOFA files of a room's responses, read back by libmysofa and set against the WAV of the same responses.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mysofa.h>

#include <rtsg/audio/sound_renderer.h>

#include "listen_scene.h"

namespace rtsg {
namespace {

using SofaOfRoom = test::Listen;

/// Reads a file by an independent reader.
class ReadSofa {
  public:
    explicit ReadSofa(const std::string& file) : hrtf_(mysofa_load(file.c_str(), &error), mysofa_free) {
        if (!hrtf_) return;
        global = noted(hrtf_->attributes);
        for (const MYSOFA_VARIABLE* v = hrtf_->variables; v; v = v->next)
            if (v->value) others[v->name] = take(*v->value);
        listenerPosition = take(hrtf_->ListenerPosition);
        listenerView = take(hrtf_->ListenerView);
        listenerUp = take(hrtf_->ListenerUp);
        sourcePosition = take(hrtf_->SourcePosition);
        receiverPosition = take(hrtf_->ReceiverPosition);
        responses = take(hrtf_->DataIR);
        rate = take(hrtf_->DataSamplingRate);
        delay = take(hrtf_->DataDelay);
    }

    struct Array {
        std::vector<float> values;
        std::map<std::string, std::string> attributes;
    };
    int error = 0;
    std::map<std::string, std::string> global;
    std::map<std::string, Array> others;
    Array listenerPosition, listenerView, listenerUp, sourcePosition, receiverPosition, responses, rate, delay;
    const MYSOFA_HRTF& raw() const { return *hrtf_; }

  private:
    static std::map<std::string, std::string> noted(const MYSOFA_ATTRIBUTE* attribute) {
        std::map<std::string, std::string> result;
        for (; attribute; attribute = attribute->next)
            result[attribute->name] = attribute->value ? attribute->value : "";
        return result;
    }
    static Array take(const MYSOFA_ARRAY& array) {
        return {{array.values, array.values + array.elements}, noted(array.attributes)};
    }

    std::unique_ptr<MYSOFA_HRTF, decltype(&mysofa_free)> hrtf_;
};

void expectPositions(const std::vector<float>& got, const std::vector<glm::dvec3>& expected) {
    ASSERT_EQ(got.size(), 3 * expected.size());
    for (std::size_t i = 0; i < got.size(); ++i)
        EXPECT_NEAR(static_cast<double>(got[i]), expected[i / 3][static_cast<int>(i % 3)], 1e-6) << i;
}

const std::string kTwoEach =
    "DEF Voice Sound { location 1 1 1.5 maxBack 60 maxFront 60 source AudioClip { url \"impulse.wav\" } }\n"
    "DEF Horn SpatialSound { location 5 4 2 direction 0 0 -1 coneInnerAngle 1 coneOuterAngle 2 coneOuterGain .2 "
    "children AudioClip { url \"impulse.wav\" } }\n"
    "DEF Seat Viewpoint { position 4 3 1.5 }\nDEF Aisle Viewpoint { position 2 3 1.2 orientation 0 1 0 1.5707963268 "
    "}\n";

TEST_F(SofaOfRoom, HoldsEveryPairWhereItIsAndAsItSounds) {
    Scene scene;
    load(scene, test::room("absorption .3 diffuse .35 specular .35", kTwoEach));
    SharedWorld world(scene);
    ListenOptions asked = options();
    asked.trace.rays = 500;
    asked.render.document = "hall.x3dv";
    SoundRenderer sound(world, asked);
    auto report = sound.survey();
    ASSERT_TRUE(report) << report.error().text;
    const RoomResponses room = sound.responses(*report);
    const std::string file = (folder_ / "room.sofa").string();
    ASSERT_EQ(::setenv("SOURCE_DATE_EPOCH", "86400", 1), 0);
    const auto written = writeSofa(file, room);
    ASSERT_EQ(::unsetenv("SOURCE_DATE_EPOCH"), 0);
    ASSERT_TRUE(written) << written.error().text;

    const ReadSofa sofa(file);
    ASSERT_EQ(sofa.error, MYSOFA_OK);
    EXPECT_EQ(sofa.raw().M, 4u);
    EXPECT_EQ(sofa.raw().R, 1u);
    EXPECT_EQ(sofa.raw().E, 1u);
    EXPECT_EQ(sofa.raw().C, 3u);
    EXPECT_EQ(sofa.raw().I, 1u);
    for (const auto& [name, value] : std::map<std::string, std::string>{{"Conventions", "SOFA"},
                                                                        {"Version", "2.1"},
                                                                        {"SOFAConventions", "SingleRoomSRIR"},
                                                                        {"SOFAConventionsVersion", "1.0"},
                                                                        {"DataType", "FIR"},
                                                                        {"RoomType", "shoebox"},
                                                                        {"RoomGeometry", "hall.x3dv"},
                                                                        {"DateCreated", "1970-01-02 00:00:00"}})
        EXPECT_EQ(sofa.global.at(name), value);
    for (const char* name : {"Title", "DateModified", "APIName", "APIVersion", "AuthorContact", "Organization",
                             "License", "DatabaseName", "RoomDescription", "ReceiverDescription"})
        EXPECT_FALSE(sofa.global.at(name).empty()) << name;
    // z is up: (x, -z, y). The listener at each place looks in the direction of the Viewpoint: along -z, and along -x.
    const glm::dvec3 voice(1, -1.5, 1), horn(5, -2, 4), seat(4, -1.5, 3), aisle(2, -1.2, 3);
    expectPositions(sofa.sourcePosition.values, {voice, voice, horn, horn});
    expectPositions(sofa.others.at("SourceView").values, {{1, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 1, 0}});
    expectPositions(sofa.listenerPosition.values, {seat, aisle, seat, aisle});
    expectPositions(sofa.listenerView.values, {{0, 1, 0}, {-1, 0, 0}, {0, 1, 0}, {-1, 0, 0}});
    expectPositions(sofa.listenerUp.values, std::vector<glm::dvec3>(4, {0, 0, 1}));
    expectPositions(sofa.receiverPosition.values, {{0, 0, 0}});
    expectPositions(sofa.others.at("RoomCornerA").values, {{0, -3, 0}});
    expectPositions(sofa.others.at("RoomCornerB").values, {{6, 0, 5}});
    EXPECT_NEAR(sofa.others.at("RoomVolume").values.at(0), 90, 1e-4);
    EXPECT_NEAR(sofa.others.at("RoomTemperature").values.at(0), 293.15, 1e-3);
    EXPECT_EQ(sofa.others.at("SourceNumber").values, (std::vector<float>{0, 0, 1, 1}));
    EXPECT_EQ(sofa.others.at("SourceNumber").attributes.at("Names"), "Voice\nHorn");
    EXPECT_EQ(sofa.others.at("ListenerNumber").values, (std::vector<float>{0, 1, 0, 1}));
    EXPECT_EQ(sofa.others.at("ListenerNumber").attributes.at("Names"), "Seat\nAisle");
    for (const auto* position : {&sofa.sourcePosition, &sofa.listenerPosition, &sofa.receiverPosition}) {
        EXPECT_EQ(position->attributes.at("Type"), "cartesian");
        EXPECT_EQ(position->attributes.at("Units"), "metre");
    }
    EXPECT_EQ(sofa.rate.values, std::vector<float>{48000});
    EXPECT_EQ(sofa.rate.attributes.at("Units"), "hertz");
    EXPECT_EQ(sofa.delay.values, std::vector<float>{0});
    // Sample for sample; where a response ends before the longest there is silence.
    const std::size_t frames = sofa.raw().N;
    ASSERT_EQ(sofa.responses.values.size(), 4 * frames);
    for (std::size_t m = 0; m < 4; ++m) {
        const std::vector<float>& expected = room.pairs[m].response.channels[0];
        ASSERT_LE(expected.size(), frames);
        EXPECT_GT(expected.size(), 1000u);
        for (std::size_t i = 0; i < frames; ++i)
            ASSERT_EQ(sofa.responses.values[m * frames + i], i < expected.size() ? expected[i] : 0) << m << ' ' << i;
    }
}

/// The WAV that `--ir` writes for the scene's listener holds the same as the file of all pairs, channel by channel.
TEST_F(SofaOfRoom, IsTheWavOfTheSameResponsesInEachKindOfChannels) {
    using Channels = ImpulseResponseOptions::Channels;
    for (const auto& [channels, order, receivers, convention] :
         {std::tuple{Channels::mono, 0, 1u, "SingleRoomSRIR"}, std::tuple{Channels::binaural, 0, 2u, "SingleRoomSRIR"},
          std::tuple{Channels::ambisonic, 2, 9u, "SingleRoomSRIR"},
          std::tuple{Channels::stereo, 0, 2u, "GeneralFIR"}}) {
        Scene scene;
        load(scene, test::room("absorption .3 diffuse .35 specular .35", test::kPair));
        SharedWorld world(scene);
        ListenOptions asked = options();
        asked.trace.rays = 400;
        asked.responses = channels;
        asked.render.ambisonicOrder = order;
        SoundRenderer sound(world, asked);
        auto report = sound.survey();
        ASSERT_TRUE(report) << report.error().text;
        const std::string file = (folder_ / "channels.sofa").string();
        ASSERT_TRUE(writeSofa(file, sound.responses(*report)));
        ASSERT_TRUE(sound.measure());
        const std::string wav = (folder_ / "channels.wav").string();
        ASSERT_TRUE(writeWav(wav, sound.finish().impulseResponses(), WavFormat::float32));

        const ReadSofa sofa(file);
        ASSERT_EQ(sofa.error, MYSOFA_OK);
        const auto heard = readSound(wav);
        ASSERT_TRUE(heard);
        EXPECT_EQ(sofa.global.at("SOFAConventions"), convention);
        ASSERT_EQ(sofa.raw().R, receivers);
        ASSERT_EQ(heard->channels, static_cast<int>(receivers));
        ASSERT_EQ(sofa.raw().N, heard->frames());
        for (std::size_t r = 0; r < receivers; ++r)
            for (std::size_t i = 0; i < heard->frames(); ++i)
                ASSERT_EQ(sofa.responses.values[r * heard->frames() + i], heard->samples[i * receivers + r]) << r;
        if (channels == Channels::ambisonic) {
            EXPECT_EQ(sofa.receiverPosition.attributes.at("Type"), "spherical harmonics");
            EXPECT_NE(sofa.global.at("ReceiverDescription").find("SN3D"), std::string::npos);
        }
        if (channels == Channels::binaural)
            expectPositions(sofa.receiverPosition.values, {{0, .0875, 0}, {0, -.0875, 0}});
    }
}

/// Where ears are is told as they were heard with: once of heads alike, else measurement by measurement.
TEST_F(SofaOfRoom, SaysHowFarEarsAreApart) {
    for (const bool alike : {false, true}) {
        Scene scene;
        load(scene, test::room("absorption .3 specular .7", test::kPair) +
                        "DEF Wide ListenerPointSource { position 4 3 1.5 interauralDistance .5 }\n" +
                        "DEF Usual ListenerPointSource { position 4 3 1.5 " + (alike ? "interauralDistance .5" : "") +
                        " }\n");
        SharedWorld world(scene);
        ListenOptions asked = options();
        asked.responses = ImpulseResponseOptions::Channels::binaural;
        SoundRenderer sound(world, asked);
        auto report = sound.survey();
        ASSERT_TRUE(report) << report.error().text;
        const RoomResponses room = sound.responses(*report);
        ASSERT_EQ(room.pairs.size(), 2u);
        const std::string file = (folder_ / "ears.sofa").string();
        ASSERT_TRUE(writeSofa(file, room));
        const ReadSofa sofa(file);
        if (alike)
            expectPositions(sofa.receiverPosition.values, {{0, .25, 0}, {0, -.25, 0}});
        else  // x, y and z of the left ear, then of the right, each of both measurements
            EXPECT_THAT(sofa.receiverPosition.values,
                        testing::ElementsAre(0, 0, .25f, .0875f, 0, 0, 0, 0, -.25f, -.0875f, 0, 0));
        // The voice is behind to the left: the ears hear it as far apart as they are.
        const auto first = [&](std::size_t pair, std::size_t ear) {
            const std::vector<float>& heard = room.pairs[pair].response.channels[ear];
            return std::ranges::find_if(heard, [](float x) { return std::abs(x) > .02f; }) - heard.begin();
        };
        const double side = 3 / std::hypot(3, 2);
        for (std::size_t pair = 0; pair < 2; ++pair)
            EXPECT_NEAR(static_cast<double>(first(pair, 1) - first(pair, 0)),
                        (alike || pair == 0 ? .25 : .0875) / 343 * (side + std::asin(side)) * 48000, 4);
    }
}

TEST_F(SofaOfRoom, SaysWhatIsNoBoxAndKeepsWhatWasThereAfterAnError) {
    Scene scene;
    load(scene, test::room("absorption .3", test::kPair) +
                    "Transform { translation 3.1 .55 1.07 children Shape { geometry Box { size 1 1 1 } } }\n");
    SharedWorld world(scene);
    SoundRenderer sound(world, options());
    auto report = sound.survey({{"here", {4, 3, 1.5}}});
    ASSERT_TRUE(report) << report.error().text;
    RoomResponses room = sound.responses(*report);
    const std::string file = (folder_ / "furnished.sofa").string();
    ASSERT_TRUE(writeSofa(file, room));
    {
        const ReadSofa sofa(file);
        ASSERT_EQ(sofa.error, MYSOFA_OK);
        EXPECT_EQ(sofa.global.at("RoomType"), "reverberant");
        EXPECT_FALSE(sofa.others.contains("RoomCornerA"));
        EXPECT_EQ(sofa.others.at("ListenerNumber").attributes.at("Names"), "here");
    }
    room.pairs.push_back(room.pairs.front());
    room.pairs.back().response.channels.push_back(room.pairs.back().response.channels.front());
    const auto uneven = writeSofa(file, room);
    ASSERT_FALSE(uneven);
    EXPECT_NE(uneven.error().text.find("same channels"), std::string::npos);
    room.pairs.clear();
    EXPECT_FALSE(writeSofa(file, room));
    EXPECT_EQ(ReadSofa(file).error, MYSOFA_OK);
    const RoomResponses again = sound.responses(*report);
    const auto nowhere = writeSofa((folder_ / "none" / "a.sofa").string(), again);
    ASSERT_FALSE(nowhere);
    EXPECT_NE(nowhere.error().format().find("cannot write SOFA"), std::string::npos) << nowhere.error().format();
}

}  // namespace
}  // namespace rtsg
