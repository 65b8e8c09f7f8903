// One world on stage: light, sound, a mirror and a log follow one scene; the first two share one flattening and one
// BVH.
//
//     09_one_world examples/room.x3dv session.rlog
#include <iostream>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/light_renderer.h>
#include <rtsg/sync/log_recorder.h>
#include <rtsg/sync/mirror_server.h>

int main(int argc, char** argv) {
    rtsg::Scene scene;
    rtsg::Diagnostics diagnostics;
    if (argc != 3 || !rtsg::loadFile(scene, argv[1], diagnostics)) return std::cerr << "no scene\n", 1;

    rtsg::LightRenderer::Options picture;
    picture.image.settings.width = 160, picture.image.settings.height = 90;
    rtsg::SharedWorld world(scene);             // one flattening, one BVH
    rtsg::LightRenderer light(world, picture);  // renderers of it
    rtsg::SoundRenderer sound(world);
    auto mirror = rtsg::MirrorServer::start(scene, "tcp://127.0.0.1:*");  // plain subscribers
    auto log = rtsg::LogRecorder::start(scene, argv[2]);
    if (!mirror || !log) return std::cerr << "no mirror or no log\n", 1;
    for (int frame = 0; frame < 30; ++frame) {
        scene.newFrame(frame / 30.0);  // one cascade, one ChangeSet, everybody has it
        if (auto ok = sound.renderFrame(); !ok) return std::cerr << ok.error().format() << '\n', 1;
        if (auto ok = light.renderFrame(); !ok) return std::cerr << ok.error().format() << '\n', 1;
    }
    const rtsg::SharedWorld::Counts counts = world.counts();
    std::cout << counts.flatteners << " flattener, " << counts.rayWorlds << " BVH, " << sound.finish().sound.seconds()
              << " s of sound, all in state " << world.sequence() << " of " << scene.sequence() << '\n';
    return (*log)->stop() ? 0 : 1;
}
