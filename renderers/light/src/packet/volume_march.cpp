// Marches rays through volumes: emission and absorption from sample to sample, surfaces and projections between them.
#include "volume_march.h"

#include <algorithm>
#include <cmath>

#include <rtsg/renderers/shading.h>

#include "tables/left_out.h"
#include "tables/light_tables.h"

namespace rtsg::trace {

namespace {

constexpr float kSamplesPerVoxel = 2;
constexpr float kEnough = 1 / 4096.0f;  // a march ends when less than this share of the light is left
constexpr float kOpaque = 69;           // optical depth of an opacity of 1

/// The part of a ray in one volume.
struct RaySegment {
    const TraceVolume* in = nullptr;
    Vec3f origin{0}, direction{0};  // in shares of the box
    float from = 0, to = 0;
    float voxels = 0;  // of a unit of t
    float value = 0;   // of surfaces: at the end of the last step
    bool started = false;
    Vec3f position(float t) const { return origin + t * direction; }
    const Volume& volume() const { return *in->volume; }
    bool isProjection() const {
        return !volume().isSurfaces && volume().styleOf(0).projection != VolumeStyle::Projection::none;
    }
};

class March {
  public:
    March(const TraceScene& scene, const Ray& ray, bool asLight, bool colors, float line,
          const ScopeFilter* scope = nullptr)
        : scene_(scene), ray_(ray), asLight_(asLight), colors_(colors), line_(line) {
        for (const TraceVolume& volume : scene.volumes)
            if (!scope || !scope->isOutside(volume.slot)) enter(volume);
    }

    VolumeLight run() {
        if (segments_.empty()) return {};
        speed_ = glm::length(ray_.direction);
        view_ = -ray_.direction / speed_;
        for (const RaySegment& segment : segments_) edges_.push_back(segment.from), edges_.push_back(segment.to);
        std::ranges::sort(edges_);
        for (std::size_t i = 0; i + 1 < edges_.size() && result_.left > kEnough; ++i) {
            if (edges_[i] == edges_[i + 1]) continue;
            for (const RaySegment& segment : segments_)
                if (segment.from == edges_[i] && segment.isProjection()) project(segment);
            cross(edges_[i], edges_[i + 1]);
        }
        // The little that is left is taken to look as the rest does.
        if (result_.left <= kEnough) result_.radiance /= 1 - result_.left, result_.left = 0;
        return result_;
    }

  private:
    void enter(const TraceVolume& volume) {
        RaySegment segment{.in = &volume,
                           .origin = volume.positionFromRay * Vec4f(ray_.origin, 1),
                           .direction = glm::mat3(volume.positionFromRay) * ray_.direction};
        float from = ray_.tMin, to = ray_.tMax;
        for (int k = 0; k < 3; ++k) {
            if (std::abs(segment.direction[k]) < 1e-20f) {
                if (segment.origin[k] < 0 || segment.origin[k] > 1) return;
                continue;
            }
            const float a = -segment.origin[k] / segment.direction[k],
                        b = (1 - segment.origin[k]) / segment.direction[k];
            from = std::max(from, std::min(a, b)), to = std::min(to, std::max(a, b));
        }
        if (!(from < to) || !std::isfinite(from + to)) return;
        segment.from = from, segment.to = to;
        segment.voxels = glm::length(segment.direction * Vec3f(volume.volume->voxels->size()));
        if (segment.voxels > 0 && std::isfinite(segment.voxels)) segments_.push_back(segment);
    }

    Vec3f at(float t) const { return ray_.origin + t * ray_.direction; }
    bool isCut(const RaySegment& segment, float t) const {
        return segment.in->filter && segment.in->filter->leavesOut(segment.in->slot, at(t), 0);
    }

    /// Puts a sample in front of everything beyond it.
    void add(float t, const TraceVolume& volume, const Vec3f& color, float opacity) {
        if (colors_) {
            Vec3f seen = color;
            if (scene_.fogs.any()) {
                const Fogs::Entry& entry = scene_.fogs.of(volume.lights);
                seen = glm::mix(entry.color(asLight_), seen, entry.left(at(t), line_ + t * speed_));
            }
            result_.radiance += result_.left * opacity * seen;
        }
        result_.left *= 1 - opacity;
    }

    /// From one edge to the next, where the same volumes are.
    void cross(float from, float to) {
        float voxels = 0;
        for (const RaySegment& segment : segments_)
            if (isIn(segment, from, to)) voxels = std::max(voxels, segment.voxels * (to - from));
        if (!(voxels > 0)) return;
        const auto count = static_cast<int>(std::clamp(std::ceil(voxels * kSamplesPerVoxel), 1.0f, 1e6f));
        const float step = (to - from) / static_cast<float>(count);
        for (int i = 0; i < count && result_.left > kEnough; ++i) {
            const float t = from + (static_cast<float>(i) + .5f) * step;
            absorb(t, from, to, step);
            for (RaySegment& segment : segments_)
                if (segment.volume().isSurfaces && segment.from <= from && segment.to >= to)
                    meetSurfaces(segment, from + static_cast<float>(i) * step,
                                 i + 1 == count ? to : from + static_cast<float>(i + 1) * step);
        }
    }
    static bool isIn(const RaySegment& segment, float from, float to) {
        return segment.from <= from && segment.to >= to && !segment.isProjection();
    }

    /// One step of all volumes that are here, each with its share of the depth.
    void absorb(float t, float from, float to, float step) {
        float depth = 0;
        Vec3f color(0);
        const TraceVolume* densest = nullptr;
        float maximum = 0;
        for (const RaySegment& segment : segments_) {
            if (!isIn(segment, from, to) || segment.volume().isSurfaces || isCut(segment, t)) continue;
            const Vec3f position = segment.position(t);
            const VolumeStyle* style = styleAt(segment.volume(), position);
            if (!style) continue;
            const Vec4f here = StyledPoint(scene_, *segment.in, position, at(t), view_, asLight_, colors_)(*style);
            if (!(here.a > 0)) continue;
            const float own = std::min(-std::log1p(-std::min(here.a, 1.0f)), kOpaque) * segment.voxels * step;
            depth += own, color += own * Vec3f(here);
            if (own > maximum) maximum = own, densest = segment.in;
        }
        if (depth > 0) add(t, *densest, color / depth, -std::expm1(-depth));
    }
    /// Null: nothing is drawn here.
    static const VolumeStyle* styleAt(const Volume& volume, const Vec3f& position) {
        std::size_t segment = 0;
        if (volume.segments) {
            // In pictures with 8 bits a number is a byte; in finer ones it is the identifier itself.
            segment = static_cast<std::size_t>(
                std::lround(std::clamp(volume.segments->nearest(position).r, 0.0f, 1.0f) * 255));
            if (segment < volume.segmentEnabled.size() && !volume.segmentEnabled[segment]) return nullptr;
        }
        const VolumeStyle& style = volume.styleOf(segment);
        return style.drawn ? &style : nullptr;
    }

    void meetSurfaces(RaySegment& segment, float from, float to) {
        const VoxelGrid& voxels = *segment.volume().voxels;
        const float before = segment.started ? segment.value : voxels.value(segment.position(from)),
                    now = voxels.value(segment.position(to));
        segment.started = true, segment.value = now;
        if (before == now) return;
        const auto& surfaces = segment.volume().surfaces;
        const float low = std::min(before, now), high = std::max(before, now);
        // One that lies on an end belongs to the step that leaves it behind.
        const auto meets = [&](float value) {
            return value > low && value < high ? true : value == now && value != before;
        };
        const auto first = std::ranges::lower_bound(surfaces, low, {}, &std::pair<float, std::uint32_t>::first);
        const auto last = std::ranges::upper_bound(surfaces, high, {}, &std::pair<float, std::uint32_t>::first);
        const auto count = last - first;
        for (std::ptrdiff_t i = 0; i < count; ++i) {
            const auto& [value, style] = now > before ? first[i] : first[count - 1 - i];
            if (meets(value)) meetSurface(segment, value, segment.volume().styleOf(style), from, to, before, now);
        }
    }

    /// Between two places, one on either side of it.
    void meetSurface(const RaySegment& segment, float value, const VolumeStyle& style, float from, float to,
                     float before, float now) {
        constexpr int kMaxRotations = 12;
        if (!style.drawn) return;
        const VoxelGrid& voxels = *segment.volume().voxels;
        float a = from, b = to, fa = before - value, fb = now - value, t = b;
        for (int i = 0; i < kMaxRotations && fb != 0; ++i) {
            // Halves by turns, so that no end stays where it is.
            t = i % 3 == 2 ? .5f * (a + b) : a - fa * (b - a) / (fb - fa);
            if (!(t > a && t < b)) break;
            const float ft = voxels.value(segment.position(t)) - value;
            ((ft < 0) == (fa < 0) ? a : b) = t;
            ((ft < 0) == (fa < 0) ? fa : fb) = ft;
            if (ft == 0) break;
        }
        const Vec3f position = segment.position(t);
        if (isCut(segment, t)) return;
        if (segment.volume().tolerance > 0 && glm::length(voxels.gradient(position)) < segment.volume().tolerance)
            return;
        const Vec4f here =
            StyledPoint(scene_, *segment.in, position, at(t), view_, asLight_, colors_).surface(style, value);
        if (here.a > 0) add(t, *segment.in, Vec3f(here), here.a);
    }

    /// Calls `see(t, weight)` where the ray passes from one cell between voxels' middles to the next, and half way
    /// between; the weights are those of Simpson's rule, which is exact here: within a cell values are cubic in t.
    template <class See>
    static void visitCells(const RaySegment& segment, const See& see) {
        const Vec3f n(segment.volume().voxels->size()), speed = segment.direction * n, start = segment.origin * n - .5f;
        float t = segment.from;
        while (t < segment.to) {
            float next = segment.to;
            for (int k = 0; k < 3; ++k) {
                if (speed[k] == 0) continue;
                const float u = start[k] + t * speed[k];
                const float plane = speed[k] > 0 ? std::floor(u + 1e-4f) + 1 : std::ceil(u - 1e-4f) - 1;
                const float at = (plane - start[k]) / speed[k];
                if (at > t) next = std::min(next, at);
            }
            const float length = next - t;
            see(t, length / 6), see(t + .5f * length, length * 4 / 6), see(next, length / 6);
            t = next;
        }
    }

    /// 41.4.8: one value for the whole way, put where the way begins.
    void project(const RaySegment& segment) {
        using Projection = VolumeStyle::Projection;
        const VolumeStyle& style = segment.volume().styleOf(0);
        if (!style.drawn) return;
        const VoxelGrid& voxels = *segment.volume().voxels;
        const float sign = style.projection == Projection::smallest ? -1.0f : 1.0f;
        float best = 0, alpha = 0, sum = 0, alphas = 0, whole = 0;
        bool any = false, found = false;
        visitCells(segment, [&](float t, float weight) {
            if (isCut(segment, t)) return;
            const Vec3f position = segment.position(t);
            const float value = voxels.value(position), own = voxels.at(position).a;
            sum += weight * value, alphas += weight * own, whole += weight;
            if (!any || (!found && sign * value > sign * best))
                best = value, alpha = own;
            else if (style.threshold > 0 && sign * best > sign * style.threshold && value != best)
                found = true;  // the first that is beyond the threshold, at its highest
            any = true;
        });
        if (!(whole > 0)) return;
        if (style.projection == Projection::mean) best = sum / whole, alpha = alphas / whole;
        add(segment.from, *segment.in, asLight_ ? Vec3f(linearFromSrgb(best)) : Vec3f(best),
            std::clamp(alpha, 0.0f, 1.0f));
    }

    const TraceScene& scene_;
    const Ray& ray_;
    bool asLight_, colors_;
    float line_, speed_ = 1;
    Vec3f view_{0};
    std::vector<RaySegment> segments_;
    std::vector<float> edges_;
    VolumeLight result_;
};

}  // namespace

VolumeLight marchVolumes(const TraceScene& scene, const Ray& ray, bool asLight, float line) {
    return March(scene, ray, asLight, true, line).run();
}

float volumesLeft(const TraceScene& scene, const Ray& ray, const ScopeFilter* scope) {
    return scene.volumes.empty() ? 1 : March(scene, ray, true, false, 0, scope).run().left;
}

void findVolumes(const LightState& state, const RayView& world, const std::vector<bool>& hidden,
                 std::shared_ptr<const RayFilter> filter, TraceScene& scene) {
    for (const std::uint32_t slot : *state.volumeSlots) {
        if (slot >= world.instances().size() || !world.instance(slot).mesh || !world.instance(slot).mesh->triangleCount)
            continue;
        if (slot < hidden.size() && hidden[slot]) continue;
        const RayInstance& instance = world.instance(slot);
        const Volume* volume = state.materials[state.slots[slot].material]->volume.get();
        WorldFromLocal m = instance.info.worldFromLocal;
        if (!volume || !volume->voxels || !instance.info.seen || determinantSign(m) == 0 || !isFinite(m)) continue;
        m[3] -= world.origin();
        const Vec3d size(volume->dimensions);
        const glm::dmat3 back = glm::inverse(glm::dmat3(m[0], m[1], m[2]));
        TraceVolume found;
        found.volume = volume;
        for (int k = 0; k < 3; ++k) found.positionFromRay[k] = Vec3f(back[k] / size);
        found.positionFromRay[3] = Vec3f(-(back * m[3]) / size + .5);
        found.normalFromLocal = instance.normalFromLocal;
        found.lights = state.slots[slot].lights, found.slot = slot;
        if (filter && filter->concerns(slot)) found.filter = filter.get();
        scene.volumes.push_back(found);
    }
    if (!scene.volumes.empty()) scene.volumeFilter = std::move(filter);
}

}  // namespace rtsg::trace
