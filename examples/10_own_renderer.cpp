// A third renderer beside light and sound, on the same world: it counts the shapes that are seen from a place.
//
//     10_own_renderer examples/room.x3dv
#include <iostream>
#include <set>

#include <rtsg/core/loader.h>
#include <rtsg/renderers/world_renderer.h>

class VisibleShapes : public rtsg::WorldRenderer {
  public:
    explicit VisibleShapes(rtsg::SharedWorld& world) : WorldRenderer(world), rays_(world.rays()) {}
    rtsg::Result<> renderFrame() override {
        if (auto ok = begin(); !ok) return ok;  // the world is in the scene's present state from here on
        std::set<std::uint32_t> seen;
        for (float x = -1; x <= 1; x += 1 / 32.0f)
            for (float y = -1; y <= 1; y += 1 / 32.0f)
                if (const rtsg::Hit hit = rays_.intersect({rays_.fromWorld(eye), 0, {x, y, -1}}))
                    seen.insert(hit.instance);
        visible = seen.size();
        return {};
    }
    rtsg::Vec3d eye{0, 1.6, 3};
    std::size_t shapes = 0, visible = 0;

  protected:
    rtsg::Result<> follow(const rtsg::Scene&, const rtsg::ChangeSet&, const rtsg::InstanceDelta& delta) override {
        shapes += delta.added.size() - delta.removed.size();  // a slot is dense: index arrays with instance.id.slot
        return {};
    }

  private:
    const rtsg::RayWorld& rays_;
};

int main(int argc, char** argv) {
    rtsg::Scene scene;
    rtsg::Diagnostics diagnostics;
    if (argc != 2 || !rtsg::loadFile(scene, argv[1], diagnostics)) return std::cerr << "no scene\n", 1;
    rtsg::SharedWorld world(scene);
    VisibleShapes counter(world);
    if (auto ok = counter.attachToScene(scene); !ok) return std::cerr << ok.error().format() << '\n', 1;
    scene.newFrame(0);
    if (auto ok = counter.renderFrame(); !ok) return std::cerr << ok.error().format() << '\n', 1;
    std::cout << counter.visible << " of " << counter.shapes << " shapes are seen\n";
    return counter.visible > 0 && counter.visible <= counter.shapes ? 0 : 1;
}
