// Light and sound on threads of their own, on one world: each takes the newest state when it has time for it, and the
// scene waits for nobody. (08_overlap gives each a copy of the scene instead.)
//
//     11_own_threads examples/room.x3dv
#include <atomic>
#include <chrono>
#include <iostream>
#include <thread>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/light_renderer.h>

int main(int argc, char** argv) {
    rtsg::Scene scene;
    rtsg::Diagnostics diagnostics;
    if (argc != 2 || !rtsg::loadFile(scene, argv[1], diagnostics)) return std::cerr << "no scene\n", 1;

    rtsg::LightRenderer::Options picture;
    picture.image.settings.width = 320, picture.image.settings.height = 180;
    rtsg::SharedWorld world(scene);
    rtsg::LightRenderer light(world, picture);
    rtsg::SoundRenderer sound(world);
    std::atomic<bool> running = true;
    std::atomic<int> ended = 0;
    struct Count {
        int rounds = 0;
        bool ok = true;
    } pictures, blocks;
    const auto follow = [&](rtsg::WorldRenderer& renderer, Count& count) {
        for (bool last = false; count.ok && !last; ++count.rounds) {
            last = !running;
            const auto state = world.latest();  // waits for the next frame if nobody had asked before
            count.ok = state && renderer.renderFrame(**state);
        }
        ++ended;
    };
    std::jthread lightThread([&] { follow(light, pictures); }), soundThread([&] { follow(sound, blocks); });

    const auto begin = std::chrono::steady_clock::now();
    int frames = 0;
    for (; frames < 120; ++frames) {
        scene.newFrame(frames / 60.0);
        std::this_thread::sleep_until(begin + std::chrono::milliseconds(1000 * frames / 60));
    }
    running = false;
    for (; ended < 2; std::this_thread::sleep_for(std::chrono::milliseconds(1)))
        (void)world.update();  // no more frames come; whoever asks gets the last state
    lightThread.join(), soundThread.join();
    std::cout << frames << " frames, " << pictures.rounds << " pictures, " << sound.finish().sound.seconds()
              << " s of sound, " << world.counts().rayWorlds << " BVH\n";
    return pictures.ok && blocks.ok ? 0 : 1;
}
