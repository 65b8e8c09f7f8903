// The subscriber contract for what follows the instances of a scene: flattener, ray world, light, sound.
#include <algorithm>
#include <optional>
#include <random>

#include <fmt/format.h>

#include <rtsg/audio/acoustic_renderer.h>
#include <rtsg/renderers/image.h>
#include <rtsg/renderers/mesh.h>

#include "support/subscriber_contract.h"
#include "test_paths.h"

namespace rtsg::test {
namespace {

/// RayWorld as one of the subscribers of a FlattenedScene.
struct WorldFollower final : InstanceSubscriber {
    RayWorld world;
    Result<> apply(const Scene&, const ChangeSet&, const InstanceDelta& delta) override {
        world.apply(delta);
        return {};
    }
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

class FlattenerSubject final : public BusSubject {
  public:
    ~FlattenerSubject() override { release(); }
    /// Slots and generations depend on the way, what is in them does not.
    SubscriberState state() override {
        const Flattener& flattener = flattened_.flattener();
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

  private:
    Subscriber& subscriber() override { return flattened_; }
    FlattenedScene flattened_;
};

class RayWorldSubject final : public BusSubject {
  public:
    RayWorldSubject() { flattened_.add(follower_); }
    ~RayWorldSubject() override { release(); }
    /// How far rays see from within the room. Which of two coincident surfaces they meet is nobody's promise.
    SubscriberState state() override {
        const RayWorld& world = follower_.world;
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

  private:
    Subscriber& subscriber() override { return flattened_; }
    FlattenedScene flattened_;
    WorldFollower follower_;
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

class LightTracerSubject final : public BusSubject {
  public:
    LightTracerSubject() {
        flattened_.add(follower_);
        flattened_.add(tracer_);
    }
    ~LightTracerSubject() override { release(); }
    SubscriberState state() override {
        SubscriberState state;
        const RenderSettings settings = small().settings;
        const auto camera = tracer_.camera(follower_.world, 16.0 / 9);
        addPixels(state, camera ? tracer_.render(follower_.world, *camera, settings)
                                : Result<Picture>(std::unexpected(camera.error())));
        return state;
    }

  private:
    Subscriber& subscriber() override { return flattened_; }
    FlattenedScene flattened_;
    WorldFollower follower_;
    LightTracer tracer_{std::filesystem::path(RTSG_SOURCE_DIR "/examples")};
};

/// Attaches by itself and follows every frame; lazy here means that pictures are asked for now and then.
class ImagerSubject final : public Subject {
  public:
    void attach(Scene& scene, Delivery delivery) override {
        const std::size_t before = scene.bus().subscribers();
        imager_.emplace(
            scene, Imager::Options{
                       .resources = std::filesystem::path(RTSG_SOURCE_DIR "/examples"), .world = {}, .meshes = {}});
        EXPECT_EQ(scene.bus().subscribers(), before + 1);
        delivery_ = delivery;
        poll();
    }
    void poll() override {
        last_ = {};
        addPixels(last_, imager_->picture(small()));
    }
    void detach() override {
        if (delivery_ == Delivery::immediate) poll();
        imager_.reset();
    }
    SubscriberState state() override {
        if (imager_ && delivery_ == Delivery::immediate) poll();
        return last_;
    }
    std::string failure() const override { return last_.text; }
    std::size_t snapshots() const override { return 1; }  // not to be seen from outside

  private:
    std::optional<Imager> imager_;
    Delivery delivery_ = Delivery::immediate;
    SubscriberState last_;
};

class AcousticSubject final : public BusSubject {
  public:
    AcousticSubject() {
        AcousticRenderer::Options options;
        options.resources = std::filesystem::path(RTSG_SOURCE_DIR "/examples");
        auto renderer = AcousticRenderer::create(follower_.world, options);
        if (!renderer) throw std::runtime_error(renderer.error().text);
        renderer_ = std::move(*renderer);
        flattened_.add(follower_);
        flattened_.add(*renderer_);
    }
    ~AcousticSubject() override { release(); }
    /// Who sounds where, who listens, and how the room answers to rays.
    SubscriberState state() override {
        SubscriberState state;
        const SoundScene& sounds = renderer_->scene();
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
        const OpenedGeometry room = renderer_->geometryFor({0, 1.5, 0});
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
        state.outliers = 0.003;
        return state;
    }

  private:
    Subscriber& subscriber() override { return flattened_; }
    FlattenedScene flattened_;
    WorldFollower follower_;
    std::unique_ptr<AcousticRenderer> renderer_;
};

INSTANTIATE_TYPED_TEST_SUITE_P(Flattener, SubscriberContract, FlattenerSubject);
INSTANTIATE_TYPED_TEST_SUITE_P(RayWorld, SubscriberContract, RayWorldSubject);
INSTANTIATE_TYPED_TEST_SUITE_P(LightTracer, SubscriberContract, LightTracerSubject);
INSTANTIATE_TYPED_TEST_SUITE_P(Imager, SubscriberContract, ImagerSubject);
INSTANTIATE_TYPED_TEST_SUITE_P(Acoustic, SubscriberContract, AcousticSubject);

}  // namespace
}  // namespace rtsg::test
