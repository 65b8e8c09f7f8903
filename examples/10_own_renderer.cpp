// A third renderer beside light and sound, on the same world: it counts the shapes that are seen from a place.
//
//     10_own_renderer examples/room.x3dv
#include <iostream>
#include <set>

#include <rtsg/documents/loader.h>
#include <rtsg/renderers/world_renderer.h>

class VisibleShapes : public rtsg::WorldRenderer {
  public:
    explicit VisibleShapes(rtsg::SharedWorld& world) : WorldRenderer(world), rays_(world.rays()) {}
    rtsg::Result<> renderFrame() override {
        if (auto ok = begin(); !ok) return ok;  // the world is in the scene's present state from here on
        look(rays_);
        return {};
    }
    rtsg::Result<> renderFrame(const rtsg::WorldState& state) override {  // the same on a thread of its own
        look(*state.rays);
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
    void look(const rtsg::RayView& rays) {
        std::set<std::uint32_t> seen;
        for (float x = -1; x <= 1; x += 1 / 32.0f)
            for (float y = -1; y <= 1; y += 1 / 32.0f)
                if (const rtsg::Hit hit = rays.intersect({rays.fromWorld(eye), 0, {x, y, -1}}))
                    seen.insert(hit.instance);
        visible = seen.size();
    }
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
    const std::size_t here = counter.visible;
    (void)world.latest({});  // asks for a state; on a thread of its own it would wait for the answer
    (void)world.update();    // answers, as the next frame would
    const auto state = world.latest();
    if (!state || !counter.renderFrame(**state) || counter.visible != here) return std::cerr << "states differ\n", 1;
    return counter.visible > 0 && counter.visible <= counter.shapes ? 0 : 1;
}
