#include <rtsg/renderers/image.h>

#include <algorithm>
#include <cctype>

#include <fmt/format.h>

#include <rtsg/renderers/tessellate.h>

namespace rtsg {

namespace {

/// RayWorld as one of the subscribers of a FlattenedScene.
struct WorldFollower final : InstanceSubscriber {
    RayWorld world;
    explicit WorldFollower(const RayWorld::Options& options) : world(options) {}
    Result<> apply(const Scene&, const ChangeSet&, const InstanceDelta& delta) override {
        world.apply(delta);
        return {};
    }
};

}  // namespace

struct Imager::Impl {
    Scene& scene;
    Diagnostics meshDiagnostics;
    FlattenedScene flattened;
    WorldFollower world;
    LightTracer tracer;
    Attachment attachment;

    Impl(Scene& s, Options options)
        : scene(s),
          flattened(flattenerOptions(std::move(options.meshes))),
          world(options.world),
          tracer(std::move(options.resources)) {
        flattened.add(world);
        flattened.add(tracer);
        attachment = scene.bus().attach(flattened);
    }

    Flattener::Options flattenerOptions(MeshSource meshes) {
        Flattener::Options options;
        options.meshes = meshes ? std::move(meshes) : meshSource();
        return options;
    }
    MeshSource meshSource() {
        return [this](const Scene& from, NodeId geometry) -> std::shared_ptr<const Mesh> {
            auto mesh = tessellate(from, geometry);
            if (!mesh) {
                meshDiagnostics.add(mesh.error().severity, mesh.error().where, mesh.error().text);
                return nullptr;
            }
            meshDiagnostics.append((*mesh)->diagnostics);
            return *mesh;
        };
    }
};

Imager::Imager(Scene& scene) : Imager(scene, Options()) {}
Imager::Imager(Scene& scene, Options options) : impl_(std::make_unique<Impl>(scene, std::move(options))) {}
Imager::~Imager() = default;

Result<Picture> Imager::picture(const ImageOptions& options, RenderStats* stats) {
    Impl& s = *impl_;
    if (!s.attachment.attached()) return fail("the scene could not be followed: " + s.attachment.failure());
    if (options.settings.width < 1 || options.settings.height < 1)
        return fail("a picture's width and height must be positive");
    s.scene.seal();  // edits not yet published belong to the picture
    const double aspect = static_cast<double>(options.settings.width) / options.settings.height;
    auto camera = s.tracer.camera(s.world.world, aspect, options.viewpoint);
    if (!camera) return std::unexpected(camera.error());
    // Levels of detail are chosen for this eye.
    s.flattened.flattener().setViewer(camera->position);
    if (auto ok = s.flattened.catchUp(s.scene); !ok) return std::unexpected(ok.error());
    return s.tracer.render(s.world.world, *camera, options.settings, stats);
}

FlattenedScene& Imager::flattened() {
    return impl_->flattened;
}
const RayWorld& Imager::world() const {
    return impl_->world.world;
}
const LightTracer& Imager::tracer() const {
    return impl_->tracer;
}

Diagnostics Imager::diagnostics() const {
    Diagnostics all;
    all.append(impl_->meshDiagnostics);
    all.append(impl_->flattened.flattener().diagnostics());
    all.append(impl_->world.world.diagnostics());
    all.append(impl_->tracer.diagnostics());
    return all;
}

Result<Picture> render(Scene& scene, const ImageOptions& options, double time, Imager::Options imagerOptions,
                       Diagnostics* diagnostics) {
    Imager imager(scene, std::move(imagerOptions));
    scene.newFrame(time);
    auto result = imager.picture(options);
    if (diagnostics) diagnostics->append(imager.diagnostics());
    return result;
}

std::optional<std::string> numberedName(const std::string& pattern, int number) {
    std::string result;
    bool placed = false;
    for (std::size_t i = 0; i < pattern.size(); ++i) {
        if (pattern[i] != '%') {
            result.push_back(pattern[i]);
            continue;
        }
        if (i + 1 < pattern.size() && pattern[i + 1] == '%') {
            result.push_back(pattern[i++]);
            continue;
        }
        std::size_t end = i + 1;
        const bool zeros = end < pattern.size() && pattern[end] == '0';
        std::size_t width = 0;
        for (; end < pattern.size() && std::isdigit(static_cast<unsigned char>(pattern[end])); ++end)
            width = std::min<std::size_t>(width * 10 + static_cast<std::size_t>(pattern[end] - '0'), 64);
        if (placed || end >= pattern.size() || pattern[end] != 'd') return std::nullopt;
        const std::string digits = std::to_string(number);
        if (digits.size() < width) result.append(width - digits.size(), zeros ? '0' : ' ');
        result += digits;
        placed = true;
        i = end;
    }
    if (!placed) return std::nullopt;
    return result;
}

Result<> renderToFile(Scene& scene, Imager& imager, const std::filesystem::path& file, const ImageOptions& options,
                      const AnimationOptions& animation, const ToneMap& toneMap) {
    if (animation.frames < 1) return fail("an animation needs at least one frame");
    if (!(animation.framesPerSecond > 0)) return fail("frames per second must be positive");
    const bool gif = file.extension() == ".gif" || file.extension() == ".GIF";
    const bool numbered = numberedName(file.filename().string(), 0).has_value();
    if (animation.frames > 1 && !gif && !numbered)
        return fail("several frames need a .gif, or a name with a place for their number such as %04d", {},
                    file.string());
    std::vector<Picture> frames;
    for (int i = 0; i < animation.frames; ++i) {
        scene.newFrame(animation.start + i / animation.framesPerSecond);
        RenderStats stats;
        auto picture = imager.picture(options, &stats);
        if (!picture) return std::unexpected(picture.error());
        if (animation.stats) animation.stats(stats);
        if (gif && !numbered) {
            frames.push_back(std::move(*picture));
        } else {
            const auto name = numbered ? file.parent_path() / *numberedName(file.filename().string(), i) : file;
            if (auto ok = writePicture(*picture, name, toneMap); !ok) return ok;
        }
        if (animation.progress && !animation.progress(i + 1)) break;
    }
    if (!frames.empty()) return writeAnimation(frames, file, animation.framesPerSecond, toneMap);
    return {};
}

}  // namespace rtsg
