// The output of a graph of audio nodes, heard through an AudioDestination.
#pragma once

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/documents/loader.h>

namespace rtsg::test {

/// Left and right of `seconds` of a graph. `told`: takes what is said of it, which is nothing otherwise. `fields`: of
/// the destination. `listener`: of the scene.
inline std::array<std::vector<double>, 2> hear(const std::string& graph, double seconds = .5,
                                               std::string* reported = nullptr, const std::string& fields = "",
                                               const std::string& listener = "Viewpoint { position 0 0 0 }") {
    Scene scene;
    Diagnostics diagnostics;
    EXPECT_TRUE(loadText(scene,
                         "#X3D V4.0 utf8\nPROFILE Full\nAudioDestination { " + fields + " children [ " + graph +
                             " ] }\n" + listener + "\n",
                         diagnostics));
    for (const Diagnostic& d : diagnostics.all())
        if (!reported) ADD_FAILURE() << d.format();
    ListenOptions options;
    options.metrics = false;
    SharedWorld world(scene);
    SoundRenderer sound(world, options);
    std::array<std::vector<double>, 2> out;
    for (int frame = 1; frame <= std::lround(seconds * 60); ++frame) {
        scene.newFrame(frame / 60.0);
        EXPECT_TRUE(sound.renderFrame());
        for (std::size_t i = 0; i < sound.block().size(); ++i)
            out[i % 2].push_back(static_cast<double>(sound.block()[i]));
    }
    const ListenReport report = sound.finish();
    for (const Diagnostic& d : report.diagnostics.all())
        if (reported)
            *reported += d.text + '\n';
        else if (d.text.find("made no sound in that time") == std::string::npos)  // some tests expect silence
            ADD_FAILURE() << d.format();
    return out;
}

inline const std::string kSteady = "BufferAudioSource { sampleRate 48000 loop TRUE buffer [ .25 ] }",
                         kSteadyPair =
                             "BufferAudioSource { numberOfChannels 2 sampleRate 48000 loop TRUE buffer [ .5 -.25 ] }";

}  // namespace rtsg::test
