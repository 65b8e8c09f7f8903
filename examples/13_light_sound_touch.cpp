// Light, sound and touch of one world: a picture is drawn, a room is heard, and a hand meets a ball that rolls.
//
//     13_light_sound_touch examples/room.x3dv
#include <iostream>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/documents/loader.h>
#include <rtsg/haptics/haptic_renderer.h>
#include <rtsg/renderers/light_renderer.h>

int main(int argc, char** argv) {
    rtsg::Scene scene;
    rtsg::Diagnostics diagnostics;
    if (argc != 2 || !rtsg::loadFile(scene, argv[1], diagnostics)) return std::cerr << "no scene\n", 1;

    rtsg::LightRenderer::Options picture;
    picture.image.settings.width = 160, picture.image.settings.height = 90;
    rtsg::SharedWorld world(scene);  // one flattening, one BVH
    rtsg::LightRenderer light(world, picture);
    rtsg::SoundRenderer sound(world);
    rtsg::HapticRenderer touch(world);
    if (auto ok = touch.attachToScene(scene); !ok) return std::cerr << ok.error().format() << '\n', 1;
    double largest = 0;
    for (int frame = 0; frame < 30; ++frame) {
        scene.newFrame(frame / 30.0);
        if (auto ok = light.renderFrame(); !ok) return std::cerr << ok.error().format() << '\n', 1;
        if (auto ok = sound.renderFrame(); !ok) return std::cerr << ok.error().format() << '\n', 1;
        if (auto ok = touch.renderFrame(); !ok) return std::cerr << ok.error().format() << '\n', 1;
        if (auto ok = world.present(); !ok) return std::cerr << ok.error().format() << '\n', 1;
        // A hand that stands in the ball's way. A program with a device calls touch.start(), which ticks by itself.
        for (int tick = 0; tick < 33; ++tick) {
            const rtsg::HapticTick felt = touch.touch({-.6, .3, -.9}, frame / 30.0 + tick * .001);
            largest = std::max(largest, felt.force.x);
        }
        touch.sendEvents();  // TouchSensors hear of it in the next frame
    }
    const rtsg::SharedWorld::Counts counts = world.counts();
    std::cout << counts.flatteners << " flattener, " << counts.rayWorlds << " BVH, " << sound.finish().sound.seconds()
              << " s of sound, " << touch.report().contacts << " contact, " << largest << " N at most\n";
    return 0;
}
