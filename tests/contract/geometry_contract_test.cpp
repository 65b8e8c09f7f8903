// The subscriber contract for what follows the instances of a scene: flattener, ray world, light, sound.
#include <algorithm>
#include <optional>
#include <random>

#include <fmt/format.h>

#include <rtsg/audio/sound_renderer.h>
#include <rtsg/renderers/image.h>
#include <rtsg/renderers/mesh.h>

#include "geometry/world_geometry.h"
#include "support/subscriber_contract.h"
#include "test_paths.h"

namespace rtsg::test {
namespace {

/// A shared world and what is made from it. Attaches by itself; what was there is kept when it is detached.
class WorldSubject : public Subject {
  public:
    void attach(Scene& scene, Delivery delivery) override {
        const std::size_t before = scene.bus().subscribers();
        world_.emplace(scene, SharedWorld::Options{.flattening = {}, .rays = {}, .delivery = delivery});
        begin();
        EXPECT_EQ(scene.bus().subscribers(), before + 1) << "the world and nothing else is on the bus";
    }
    void poll() override { EXPECT_TRUE(world_->update()); }
    void detach() override {
        last_ = now();
        end();
        world_.reset();
    }
    SubscriberState state() override { return world_ ? now() : last_; }
    std::string failure() const override { return world_ ? world_->failure() : std::string(); }
    std::size_t snapshots() const override { return 1; }  // not to be seen from outside

  protected:
    virtual void begin() {}
    virtual void end() {}
    virtual SubscriberState now() = 0;
    SharedWorld& world() { return *world_; }

  private:
    std::optional<SharedWorld> world_;
    SubscriberState last_;
};

std::string textOf(const WorldFromLocal& m) {
    std::string text;
    for (int c = 0; c < 4; ++c) text += fmt::format(" {:.9g} {:.9g} {:.9g}", m[c].x, m[c].y, m[c].z);
    return text;
}

std::string joined(std::vector<std::string> lines) {
    std::sort(lines.begin(), lines.end());
    std::string text;
    for (const std::string& line : lines) text += line + '\n';
    return text;
}

class FlattenerSubject final : public WorldSubject {
  public:
    /// Slots and generations depend on the way, what is in them does not.
    SubscriberState now() override {
        const Flattener& flattener = world().flattener();
        std::vector<std::string> lines;
        const auto path = [](const std::vector<NodeId>& nodes) {
            std::string text;
            for (const NodeId node : nodes) text += fmt::format("/{}", node.value);
            return text;
        };
        for (const Instance& i : flattener.instances())
            if (i.id)
                lines.push_back(fmt::format("instance {} geometry {} appearance {} acoustics {} layer {} shadow {}{}",
                                            path(flattener.path(i.id)), i.geometry.value, i.appearance.value,
                                            i.acoustics.value, i.layer, i.castShadow, textOf(i.worldFromLocal)));
        for (const Placed& p : flattener.placed())
            if (p.id)
                lines.push_back(fmt::format("placed {} kind {} layer {}{}", path(flattener.placedPath(p.id)),
                                            static_cast<int>(p.kind), p.layer, textOf(p.worldFromLocal)));
        for (const InstanceDelta::Geometry& g : flattener.snapshot().geometries) {
            std::string line = fmt::format("geometry {}", g.node.value);
            for (std::uint32_t t = 0; g.mesh && t < g.mesh->triangleCount; ++t)
                for (std::uint32_t c = 0; c < 3; ++c) {
                    const Vec3f v = g.mesh->vertex(t, c);
                    line += fmt::format(" {} {} {}", v.x, v.y, v.z);
                }
            lines.push_back(line);
        }
        return {joined(std::move(lines)), {}};
    }
};

class RayWorldSubject final : public WorldSubject {
  public:
    void begin() override { (void)world().rays(); }
    /// How far rays see from within the room. Which of two coincident surfaces they meet is nobody's promise.
    SubscriberState now() override {
        const RayWorld& world = WorldSubject::world().rays();
        SubscriberState state;
        state.text = fmt::format("{} instances", world.stats().instances);
        state.outliers = 0.002;
        std::mt19937 random(7);
        std::uniform_real_distribution<float> unit(-1, 1);
        for (int i = 0; i < 1000; ++i) {
            const Vec3d from(2 * unit(random), 1.5 + unit(random), 2 * unit(random));
            const Vec3f direction(unit(random), unit(random), unit(random));
            const Ray ray{world.fromWorld(from), 0, direction, std::numeric_limits<float>::infinity()};
            state.numbers.push_back(static_cast<double>(world.intersect(ray).t));
            state.numbers.push_back(world.occluded(ray) ? 1 : 0);
        }
        return state;
    }
};

void addPixels(SubscriberState& state, const Result<Picture>& picture) {
    if (!picture) {
        state.text += picture.error().text;
        return;
    }
    for (const Vec4f& pixel : picture->pixels)
        for (int c = 0; c < 4; ++c) state.numbers.push_back(static_cast<double>(pixel[c]));
    state.tolerance = 1e-3;
    state.outliers = 0.005;
}

ImageOptions small() {
    ImageOptions options;
    options.settings.width = 48;
    options.settings.height = 27;
    return options;
}

class LightSubject final : public WorldSubject {
  public:
    ~LightSubject() override { end(); }
    void begin() override {
        light_.emplace(world(), LightRenderer::Options(std::filesystem::path(RTSG_SOURCE_DIR "/examples")));
    }
    void end() override { light_.reset(); }
    SubscriberState now() override {
        SubscriberState state;
        EXPECT_EQ(light_->failure(), "");
        // Not renderFrame(): the state is that of the last set it took.
        const auto camera = light_->tracer().camera(world().rays(), 16.0 / 9);
        addPixels(state, camera ? light_->tracer().render(world().rays(), *camera, small().settings)
                                : Result<Picture>(std::unexpected(camera.error())));
        return state;
    }

  private:
    std::optional<LightRenderer> light_;
};

/// Through the whole renderer, levels of detail and all; lazy here means that pictures are asked for now and then.
class PictureSubject final : public WorldSubject {
  public:
    ~PictureSubject() override { end(); }
    void begin() override {
        light_.emplace(world(), LightRenderer::Options(std::filesystem::path(RTSG_SOURCE_DIR "/examples"), small()));
    }
    void end() override { light_.reset(); }
    SubscriberState now() override {
        SubscriberState state;
        const auto created = light_->renderFrame();
        addPixels(state,
                  created ? Result<Picture>(light_->frame()) : Result<Picture>(std::unexpected(created.error())));
        return state;
    }

  private:
    std::optional<LightRenderer> light_;
};

class SoundSubject final : public WorldSubject {
  public:
    ~SoundSubject() override { end(); }
    void begin() override {
        ListenOptions options;
        options.render.resources = std::filesystem::path(RTSG_SOURCE_DIR "/examples");
        sound_.emplace(world(), options);
        if (!sound_->attached()) throw std::runtime_error(sound_->failure());
    }
    void end() override { sound_.reset(); }
    /// The sources, the listener, and the answers of the room to rays.
    SubscriberState now() override {
        SubscriberState state;
        EXPECT_EQ(sound_->failure(), "");
        const SoundScene& sounds = sound_->renderer().scene();
        std::vector<std::string> lines;
        for (const SoundEmitter& emitter : sounds.emitters()) {
            const SoundNode& sound = sounds.sound(emitter);
            const glm::dvec3 at = sounds.position(emitter);
            lines.push_back(fmt::format("{} {} at {:.9g} {:.9g} {:.9g} intensity {} reach {} {} {} {} voices {}",
                                        sound.node.value, sound.enabled, at.x, at.y, at.z, sound.intensity,
                                        sound.minFront, sound.minBack, sound.maxFront, sound.maxBack,
                                        sound.voices.size()));
        }
        state.text = joined(std::move(lines));
        const ListenerPose& ear = sounds.listener();
        for (const glm::dvec3& v : {ear.position, ear.right, ear.up, ear.back})
            for (int i = 0; i < 3; ++i) state.numbers.push_back(v[i]);
        const OpenedGeometry room = sound_->room({0, 1.5, 0});
        std::mt19937 random(11);
        std::uniform_real_distribution<double> unit(-1, 1);
        for (int i = 0; i < 500; ++i) {
            const glm::dvec3 from(2 * unit(random), 1.5 + unit(random), 2 * unit(random));
            const glm::dvec3 direction(unit(random), unit(random), unit(random));
            AcousticHit hit;
            const bool found = room.closest(from, glm::normalize(direction), 1e6, kNoPlane, hit) && hit.distance < 1e6;
            state.numbers.push_back(found ? hit.distance : -1);
            state.numbers.push_back(found ? room.materials()[hit.material].absorption[4] : -1);
        }
        state.outliers = 0.01;  // of two walls in one plane either answers
        return state;
    }

  private:
    std::optional<SoundRenderer> sound_;
};

INSTANTIATE_TYPED_TEST_SUITE_P(Flattener, SubscriberContract, FlattenerSubject);
INSTANTIATE_TYPED_TEST_SUITE_P(RayWorld, SubscriberContract, RayWorldSubject);
INSTANTIATE_TYPED_TEST_SUITE_P(Light, SubscriberContract, LightSubject);
INSTANTIATE_TYPED_TEST_SUITE_P(Picture, SubscriberContract, PictureSubject);
INSTANTIATE_TYPED_TEST_SUITE_P(Sound, SubscriberContract, SoundSubject);

}  // namespace
}  // namespace rtsg::test
