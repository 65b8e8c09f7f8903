// The sound that an engine plays of a scene that changes from frame to frame.
#pragma once

#include <cmath>
#include <functional>
#include <string>

#include <gtest/gtest.h>

#include <rtsg/documents/loader.h>
#include <rtsg/renderers/shared_world.h>

#include "engine/acoustic_engine.h"

namespace rtsg::test {

/// From 0 to `seconds`; `frame` changes the node called `name` to what it is at a time.
inline SoundBuffer playedFrames(const std::string& text, const std::string& name, const AcousticOptions& options,
                                double fps, double seconds, const std::function<void(Scene&, NodeId, double)>& frame) {
    Scene scene;
    Diagnostics diagnostics;
    EXPECT_TRUE(loadText(scene, "#X3D V4.0 utf8\nPROFILE Full\n" + text, diagnostics));
    SharedWorld world(scene);
    AcousticTables tables(world.rays());
    world.add(tables);
    const NodeId node = scene.findName(name);
    auto engine = *AcousticEngine::create(options);
    SoundBuffer sound;
    for (int i = 0; i <= std::lround(seconds * fps); ++i) {
        const double t = i / fps;
        frame(scene, node, t);
        scene.newFrame(t);
        EXPECT_TRUE(engine->render(*tables.latest(), world.rays(), t, sound));
    }
    world.remove(tables);
    return sound;
}

}  // namespace rtsg::test
