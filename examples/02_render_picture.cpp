// Loads a scene, runs it for two seconds and writes a ray-traced picture of it. The world follows the scene
// frame by frame, and a picture costs no rebuilding of anything.
//
//     02_render_picture examples/room.x3dv room.png
#include <iostream>

#include <rtsg/documents/loader.h>
#include <rtsg/renderers/light_renderer.h>

int main(int argc, char** argv) {
    if (argc != 3) return std::cerr << "usage: 02_render_picture SCENE PICTURE\n", 2;
    rtsg::Scene scene;
    rtsg::Diagnostics diagnostics;
    const bool loaded = rtsg::loadFile(scene, argv[1], diagnostics);  // true as well if only a part is usable
    for (const rtsg::Diagnostic& d : diagnostics.all()) std::cerr << d.format() << '\n';
    if (!loaded) return 1;

    rtsg::SharedWorld world(scene);
    rtsg::LightRenderer light(world, rtsg::LightRenderer::Options(rtsg::Resources::ofFile(argv[1])));
    rtsg::ImageOptions options;
    options.settings.width = 320;
    options.settings.height = 180;
    options.settings.samplesPerPixel = 4;

    scene.newFrame(0);  // the clocks start
    const rtsg::Result<rtsg::Picture> before = light.picture(options);
    for (int frame = 1; frame <= 50; ++frame) scene.newFrame(frame / 25.0);
    const rtsg::Result<rtsg::Picture> after = light.picture(options);
    if (!before || !after) return std::cerr << (before ? after : before).error().format() << '\n', 1;

    if (const auto written = rtsg::writePicture(*after, argv[2]); !written)
        return std::cerr << written.error().format() << '\n', 1;
    const auto difference = rtsg::compare(*before, *after);
    std::cout << argv[2] << ": " << after->width << " x " << after->height << ", differs by "
              << (difference ? difference->rmse : 0) << " (root mean square) from the picture at t = 0\n";
    return difference && difference->rmse > 0 ? 0 : 1;  // a scene that moves must not look the same
}
