// Draws the content of GeneratedCubeMapTextures: six pictures from the middle of the first shape that has one. And that
// of RenderedTextures: one picture through the main picture's own eye.
#include <algorithm>
#include <utility>

#include "draw.h"

namespace rtsg::trace {

namespace {

/// The instances that show a GeneratedCubeMapTexture or a RenderedTexture.
struct CubeUsers {
    std::shared_ptr<const GeneratedCube> cube;
    std::vector<bool> slots;
    std::uint32_t first = 0;
};
std::vector<CubeUsers> findCubes(const TraceScene& scene, const RayView& world) {
    std::vector<CubeUsers> result;
    for (std::uint32_t slot = 0; slot < world.instances().size(); ++slot) {
        if (slot >= scene.slots.size() || !world.instance(slot).mesh) continue;
        for (const auto& cube : scene.materials[scene.slots[slot].material].generated) {
            auto found = std::ranges::find(result, cube->node, [](const CubeUsers& c) { return c.cube->node; });
            if (found == result.end()) {
                result.push_back({cube, std::vector<bool>(world.instances().size()), slot});
                found = result.end() - 1;
            }
            found->slots[slot] = true;
        }
    }
    return result;
}

/// The eye of the picture that these are drawn for, and how.
struct CubeDrawing {
    const LightState& state;
    const RayView& world;
    const Camera& camera;
    RenderSettings settings;

    /// The picture that an eye sees without these slots, as a texture; null if it has no pixels. `windows` is as in
    /// Part.
    std::shared_ptr<const Texture> draw(const Camera& eye, std::vector<bool> hidden, bool windows) const {
        const TraceScene around =
            makeTraceScene(state, world, eye, settings, Part{camera.forward, std::move(hidden), false, windows});
        const Picture picture = toLinear(drawPicture(around, eye, settings, nullptr));
        std::vector<Vec4f> pixels;
        pixels.reserve(picture.pixels.size());
        for (int y = picture.height - 1; y >= 0; --y)
            for (int x = 0; x < picture.width; ++x) pixels.emplace_back(Vec3f(picture.at(x, y)), 1);
        auto texture =
            Texture::fromFloats(std::move(pixels), picture.width, picture.height, 3, Texture::Content::color);
        return texture ? std::make_shared<const Texture>(std::move(*texture)) : nullptr;
    }

    SpaceTexture sides(const CubeUsers& users, const std::vector<bool>& hidden) const {
        std::array<std::shared_ptr<const Texture>, 6> sides;
        for (std::size_t i = 0; i < 6; ++i) {
            const auto side = static_cast<CubeSide>(i);
            Camera eye;
            eye.position = world.toWorld(world.instance(users.first).rayFromLocal[3]);
            eye.forward = Vec3d(cubeDirection(side, {.5f, .5f}));
            eye.right = glm::normalize(Vec3d(cubeDirection(side, {1, .5f}) - cubeDirection(side, {0, .5f})));
            eye.up = glm::cross(eye.right, eye.forward);
            eye.layer = camera.layer;
            sides[i] = draw(eye, hidden, false);
        }
        return SpaceTexture::cube(std::move(sides));
    }
};

}  // namespace

void drawCubes(const LightState& state, const RayView& world, const Camera& camera, const RenderSettings& settings,
               const std::vector<bool>& part, TraceScene& scene) {
    if (!scene.materials.generates()) return;
    RenderSettings own = settings;
    own.integrator = Integrator::whitted;
    if (settings.integrator == Integrator::path) own.colorSpace = ColorSpace::linear;
    own.samplesPerPixel = 1, own.error = 0, own.layers = 0;
    own.progress = {}, own.region = {};
    std::vector<std::pair<NodeId, SpaceTexture>> created;
    for (const CubeUsers& users : findCubes(scene, world)) {
        const GeneratedCube& cube = *users.cube;
        own.width = cube.size, own.height = cube.isFlat() ? cube.height : cube.size;
        std::vector<bool> hidden = users.slots;
        for (std::size_t slot = 0; !part.empty() && slot < hidden.size(); ++slot)
            hidden[slot] = hidden[slot] || part[slot];
        const CubeDrawing drawing{state, world, camera, own};
        if (!cube.isFlat()) {
            created.emplace_back(cube.node, drawing.sides(users, hidden));
        } else if (auto block = SpaceTexture::block(
                       {drawing.draw(camera.shaped(double(own.width) / own.height), hidden, true)})) {
            created.emplace_back(cube.node, std::move(*block));
        }
    }
    scene.generated = std::move(created);
}

}  // namespace rtsg::trace
