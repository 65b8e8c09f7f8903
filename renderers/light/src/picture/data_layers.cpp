// The rays that find the visible surface of a pixel, and the data layers made of it.
#include "data_layers.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <rtsg/renderers/parallel_for.h>

#include "draw.h"
#include "packet/tile_rays.h"
#include "surface/surface_packet.h"
#include "world/moved_view.h"

namespace rtsg::trace {

namespace {

constexpr int kMaxSamples = 64;  // for layers that hold a mean
constexpr std::size_t kRanks = 6;

struct Kind {
    DataLayer layer;
    std::vector<std::string> channels;
};
const std::vector<Kind>& kinds() {
    static const std::vector<Kind> all = [] {
        std::vector<Kind> result{{kDepth, {"Z"}},
                                 {kPosition, {"P.X", "P.Y", "P.Z"}},
                                 {kNormal, {"N.X", "N.Y", "N.Z"}},
                                 {kAlbedo, {"albedo.R", "albedo.G", "albedo.B"}},
                                 {kNode, {"node.id"}},
                                 {kObjects, {}},
                                 {kMaterials, {}},
                                 {kMotion, {"motion.X", "motion.Y"}}};
        for (Kind& kind : result)
            if (kind.layer == kObjects || kind.layer == kMaterials)
                for (std::size_t i = 0; i < 2 * kRanks; ++i)
                    kind.channels.push_back(fmt::format("{}{:02}.{}",
                                                        kind.layer == kObjects ? "CryptoObject" : "CryptoMaterial",
                                                        i / 4, "RGBA"[i % 4]));
        return result;
    }();
    return all;
}

PictureLayer* layerOf(Picture& picture, DataLayer which) {
    const auto kind = std::ranges::find(kinds(), which, &Kind::layer);
    for (PictureLayer& layer : picture.layers)
        if (layer.channels == kind->channels) return &layer;
    return nullptr;
}

std::string nameOf(const RenderSettings& settings, NodeId node) {
    std::string name = settings.nameOf ? settings.nameOf(node) : std::string();
    return name.empty() ? node ? fmt::format("#{}", node.value) : "default" : name;
}

std::string inQuotes(std::string_view text) {
    std::string result = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\') result += '\\';
        if (static_cast<unsigned char>(c) < 0x20)
            result += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
        else
            result += c;
    }
    return result + '"';
}

/// Adds the metadata that readers of Cryptomatte look for: how ids are made, and the names by id.
void addManifest(const std::string& layer, const RayView& world, const RenderSettings& settings, bool materials,
                 Picture& picture) {
    std::map<std::string, std::uint32_t> names;
    std::map<std::uint32_t, bool> asked;
    for (const RayInstance& instance : world.instances()) {
        if (!instance.info.id) continue;
        const NodeId node = materials ? instance.info.appearance : instance.info.shape;
        if (!asked.try_emplace(node.value).second) continue;
        const std::string name = nameOf(settings, node);
        names.emplace(name, murmurHash3(name));
    }
    std::string manifest = "{";
    for (const auto& [name, hash] : names)
        manifest += fmt::format("{}{}:\"{:08x}\"", manifest.size() > 1 ? "," : "", inQuotes(name),
                                std::bit_cast<std::uint32_t>(cryptomatteId(hash)));
    const std::string key = "cryptomatte/" + fmt::format("{:08x}", murmurHash3(layer)).substr(0, 7);
    picture.notes.emplace_back(key + "/name", layer);
    picture.notes.emplace_back(key + "/hash", "MurmurHash3_32");
    picture.notes.emplace_back(key + "/conversion", "uint32_to_float32");
    picture.notes.emplace_back(key + "/manifest", manifest + "}");
}

/// How often each of a few things is seen in a pixel.
struct Counts {
    std::vector<std::pair<std::uint32_t, int>> of;
    void add(std::uint32_t what) {
        for (auto& [key, count] : of)
            if (key == what) return void(++count);
        of.emplace_back(what, 1);
    }
};

/// Id and coverage by turns, the most first.
void writeRanks(Counts& counts, int samples, float* into) {
    std::ranges::sort(counts.of, [](const auto& a, const auto& b) {
        return a.second != b.second ? a.second > b.second : a.first < b.first;
    });
    for (std::size_t rank = 0; rank < std::min(kRanks, counts.of.size()); ++rank) {
        into[2 * rank] = cryptomatteId(counts.of[rank].first);
        into[2 * rank + 1] = static_cast<float>(counts.of[rank].second) / static_cast<float>(samples);
    }
}

/// The layers of one tile after the other.
class LayerTiles {
  public:
    LayerTiles(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, Picture& picture)
        : scene_(scene), camera_(camera), settings_(settings), drawn_(tilesAround(settings)) {
        for (std::size_t i = 0; i < std::size(layers_); ++i) layers_[i] = layerOf(picture, kinds()[i].layer);
        if (settings.before && layers_[7]) lookBack(*settings.before);
        for (const auto& [layer, hashes] : {std::pair(kObjects, &objects_), std::pair(kMaterials, &materials_)}) {
            if (!layerOf(picture, layer)) continue;
            std::map<std::uint32_t, std::uint32_t> known;
            hashes->resize(scene.world->instances().size());
            for (std::size_t slot = 0; slot < hashes->size(); ++slot) {
                const Instance& info = scene.world->instance(static_cast<std::uint32_t>(slot)).info;
                if (!info.id) continue;
                const NodeId node = layer == kMaterials ? info.appearance : info.shape;
                const auto [found, isNew] = known.try_emplace(node.value, 0u);
                if (isNew) found->second = murmurHash3(nameOf(settings, node));
                (*hashes)[slot] = found->second;
            }
        }
    }

    void draw(std::size_t tile) const {
        const int tilesX = (drawn_.width + kTileSide - 1) / kTileSide;
        const int x0 = drawn_.left + static_cast<int>(tile) % tilesX * kTileSide;
        const int y0 = drawn_.top + static_cast<int>(tile) / tilesX * kTileSide;
        RenderSettings middle = settings_;
        middle.samplesPerPixel = 1;
        RenderSettings several = settings_;
        several.samplesPerPixel = std::min(settings_.samplesPerPixel, kMaxSamples);
        const bool means = layers_[kMean] || !objects_.empty() || !materials_.empty();
        for (int block = 0; block < kTilePixels / 16; ++block) {
            std::array<Seen, 16> seen;
            std::array<std::size_t, 16> positions{};
            const std::uint32_t active = look(middle, x0, y0, block, 0, seen, positions);
            for (int lane = 0; lane < 16; ++lane)
                if (active >> lane & 1u)
                    writeMiddle(seen[static_cast<std::size_t>(lane)], positions[static_cast<std::size_t>(lane)]);
            if (means && active) mean(several, x0, y0, block);
        }
    }

  private:
    static constexpr std::size_t kMean = 3;  // of kinds(): the albedo's place
    struct Seen {
        std::uint32_t slot = kNoInstance;
        Vec3f position{0}, normal{0}, albedo{0};
        Vec3f direction{0};  // of the ray that looked
        std::uint32_t triangle = 0;
        float u = 0, v = 0;
    };

    /// Returns the lanes that are in the picture.
    std::uint32_t look(const RenderSettings& settings, int x0, int y0, int block, int sample,
                       std::array<Seen, 16>& seen, std::array<std::size_t, 16>& positions) const {
        RayPacket16 rays;
        std::uint16_t pixels[16];
        PathTask tasks[16];
        SurfacePacket s{};
        const std::uint32_t active =
            primaryRays(scene_, camera_, settings, settings.seed, x0, y0, block, sample, rays, pixels);
        for (std::size_t lane = 0; lane < 16; ++lane) {
            seen[lane] = {};
            seen[lane].direction = {rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]};
            positions[lane] = static_cast<std::size_t>(y0 - drawn_.top + pixels[lane] / kTileSide) *
                                  static_cast<std::size_t>(drawn_.width) +
                              static_cast<std::size_t>(x0 - drawn_.left + pixels[lane] % kTileSide);
        }
        std::uint32_t going = active;
        for (int pass = 0; going && pass < kMaxPassed; ++pass) {
            const std::uint32_t hits = scene_.world->intersect(rays, pass == 0) & going;
            going = 0;
            if (!hits) break;
            fetchSurfaces(scene_, rays, hits, tasks, s);
            findPoints(scene_, s);
            for (std::uint32_t rest = hits; rest; rest &= rest - 1) {
                const int lane = std::countr_zero(rest);
                if (hides(s, lane)) {
                    Seen& found = seen[static_cast<std::size_t>(lane)];
                    found.slot = s.hits.instance[lane], found.position = s.position.get(lane);
                    found.normal = s.normal.get(lane), found.albedo = albedoOf(s, lane);
                    found.triangle = s.hits.triangle[lane], found.u = s.hits.u[lane], found.v = s.hits.v[lane];
                    continue;
                }
                const Vec3f direction(rays.directionX[lane], rays.directionY[lane], rays.directionZ[lane]);
                tasks[lane].travelled += s.distance[lane];
                tasks[lane].line = tasks[lane].travelled, tasks[lane].direction = direction;
                const float left = endOfSight(camera_, tasks[lane]);
                rays.set(lane, {RayWorld::leave(pointBehind(scene_, s, lane), direction), kLeave, direction, left});
                going |= 1u << lane;
            }
            for (int lane = 0; lane < 16; ++lane)
                if (!(going >> lane & 1u)) rays.skip(lane);
        }
        return active;
    }
    static Vec3f albedoOf(const SurfacePacket& s, int lane) {
        const Material& material = *s.material[lane];
        Vec3f whole = material.reflectivity, base = s.base.get(lane);
        if (material.refractiveIndex > 0) {
            const float cosine = std::clamp(glm::dot(s.normal.get(lane), s.view.get(lane)), 0.0f, 1.0f);
            whole += (Vec3f(1) - whole) * fresnelDielectric(cosine, s.eta[lane]).mean();
            base = glm::mix(Vec3f(1), base, s.opacity[lane]);
        }
        return glm::clamp(whole + (Vec3f(1) - whole) * base, Vec3f(0), Vec3f(1));
    }
    static bool hides(const SurfacePacket& s, int lane) {
        const Material& material = *s.material[lane];
        if (material.refractiveIndex > 0) return s.coverage[lane] >= .5f;
        const float mirrored = std::max({material.reflectivity.x, material.reflectivity.y, material.reflectivity.z});
        return s.coverage[lane] * (mirrored + (1 - mirrored) * s.opacity[lane]) >= .5f;
    }

    float* valueOf(std::size_t kind, std::size_t pixel) const {
        PictureLayer* layer = layers_[kind];
        return layer ? &layer->values[pixel * layer->channels.size()] : nullptr;
    }
    void writeMiddle(const Seen& seen, std::size_t pixel) const {
        if (float* motion = valueOf(7, pixel); motion && settings_.before) writeMotion(seen, motion);
        if (seen.slot == kNoInstance) return;
        if (float* z = valueOf(0, pixel))
            *z = camera_.panorama ? glm::length(seen.position - scene_.eye)
                                  : glm::dot(seen.position - scene_.eye, scene_.forward);
        const auto three = [&](std::size_t kind, const Vec3f& value) {
            if (float* at = valueOf(kind, pixel))
                for (int c = 0; c < 3; ++c) at[c] = value[c];
        };
        three(1, Vec3f(scene_.world->toWorld(seen.position)));
        three(2, seen.normal);
        if (float* node = valueOf(4, pixel))
            *node = std::bit_cast<float>(scene_.world->instance(seen.slot).info.shape.value);
    }
    void lookBack(const PictureBefore& before) {
        eyeBefore_ = camera_.since(before.camera, 0);
        const RayInstances& all = scene_.world->instances();
        meshBefore_.resize(all.size());
        for (std::size_t slot = 0; slot < all.size(); ++slot) {
            const Mesh* now = all[slot].mesh.get();
            if (!now || !wasThere(*before.world, all[slot])) continue;
            // A mesh that deforms keeps its triangles; of another one in its place nothing was anywhere.
            const Mesh* then = before.world->instance(static_cast<std::uint32_t>(slot)).mesh.get();
            if (then && then != now && then->positions.size() == now->positions.size() &&
                then->triangleStride == now->triangleStride && then->triangles == now->triangles)
                meshBefore_[slot] = then;
        }
    }
    /// From where it is now to where it was.
    void writeMotion(const Seen& seen, float* motion) const {
        if (seen.slot == kNoInstance && camera_.orthographic) return;
        Vec3d now(seen.direction), then = now;
        if (seen.slot == kNoInstance)
            now += camera_.position, then += eyeBefore_.position;
        else
            std::tie(now, then) = motionOf(seen);
        Vec2d displacement = eyeBefore_.project(then) - camera_.project(now);
        if (camera_.panorama) displacement.x -= std::round(displacement.x);
        if (!std::isfinite(displacement.x) || !std::isfinite(displacement.y)) return;
        motion[0] = static_cast<float>(displacement.x * settings_.width);
        motion[1] = static_cast<float>(-displacement.y * settings_.height);
    }
    /// The present and the previous position of a surface's place, in world space.
    std::pair<Vec3d, Vec3d> motionOf(const Seen& seen) const {
        const RayInstance& now = scene_.world->instance(seen.slot);
        const Vec3d position = scene_.world->toWorld(seen.position);
        const RayView& before = *settings_.before->world;
        if (!wasThere(before, now)) return {position, position};
        const RayInstance& then = before.instance(seen.slot);
        const WorldFromLocal &m = now.info.worldFromLocal, &was = then.info.worldFromLocal;
        const auto applied = [](const WorldFromLocal& t, const Vec3d& p) {
            return t[0] * p.x + t[1] * p.y + t[2] * p.z + t[3];
        };
        if (now.mesh->strokeCount > 0 || seen.triangle == kCap) {
            if (m == was || now.sign == 0) return {position, position};
            return {position, applied(was, glm::inverse(glm::dmat3(m[0], m[1], m[2])) * (position - m[3]))};
        }
        const auto local = [&](const Mesh& mesh) {
            return double{1 - seen.u - seen.v} * Vec3d(mesh.vertex(seen.triangle, 0)) +
                   double{seen.u} * Vec3d(mesh.vertex(seen.triangle, 1)) +
                   double{seen.v} * Vec3d(mesh.vertex(seen.triangle, 2));
        };
        const Mesh* other = meshBefore_[seen.slot];
        return {applied(m, local(*now.mesh)), applied(was, local(other ? *other : *now.mesh))};
    }
    void mean(const RenderSettings& settings, int x0, int y0, int block) const {
        std::array<Vec3f, 16> albedo{};
        std::array<Counts, 16> objects, materials;
        std::array<Seen, 16> seen;
        std::array<std::size_t, 16> positions{};
        std::uint32_t active = 0;
        for (int sample = 0; sample < settings.samplesPerPixel; ++sample) {
            active = look(settings, x0, y0, block, sample, seen, positions);
            for (std::size_t lane = 0; lane < 16; ++lane) {
                if (!(active >> lane & 1u) || seen[lane].slot == kNoInstance) continue;
                albedo[lane] += seen[lane].albedo;
                if (!objects_.empty()) objects[lane].add(objects_[seen[lane].slot]);
                if (!materials_.empty()) materials[lane].add(materials_[seen[lane].slot]);
            }
        }
        for (std::size_t lane = 0; lane < 16; ++lane) {
            if (!(active >> lane & 1u)) continue;
            if (float* at = valueOf(kMean, positions[lane]))
                for (int c = 0; c < 3; ++c) at[c] = albedo[lane][c] / static_cast<float>(settings.samplesPerPixel);
            if (!objects_.empty()) writeRanks(objects[lane], settings.samplesPerPixel, valueOf(5, positions[lane]));
            if (!materials_.empty()) writeRanks(materials[lane], settings.samplesPerPixel, valueOf(6, positions[lane]));
        }
    }

    const TraceScene& scene_;
    const Camera& camera_;
    const RenderSettings& settings_;
    const PixelRegion drawn_;  // by the picture
    PictureLayer* layers_[8];  // as kinds(); null: not asked for
    Camera eyeBefore_;
    std::vector<const Mesh*> meshBefore_;             // by slot, of the motion's layer; null: the one that it is now
    std::vector<std::uint32_t> objects_, materials_;  // hashes of names, by slot
};

}  // namespace

void addLayers(const RayView& world, const RenderSettings& settings, Picture& picture) {
    for (const Kind& kind : kinds()) {
        if (!(settings.layers & kind.layer)) continue;
        const float nothing = kind.layer == kDepth ? std::numeric_limits<float>::infinity() : 0.0f;
        picture.layers.push_back({kind.channels, kind.layer == kNode,
                                  std::vector<float>(picture.pixels.size() * kind.channels.size(), nothing)});
    }
    if (settings.layers & kObjects) addManifest("CryptoObject", world, settings, false, picture);
    if (settings.layers & kMaterials) addManifest("CryptoMaterial", world, settings, true, picture);
}

void drawLayerData(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, Picture& picture) {
    TraceScene asLight = scene;
    asLight.space = ColorSpace::linear;
    asLight.energyLimited = false;
    const LayerTiles tiles(asLight, camera, settings, picture);
    const int across = (picture.width + kTileSide - 1) / kTileSide, down = (picture.height + kTileSide - 1) / kTileSide;
    withThreads(settings.threads, [&] {
        parallelFor(static_cast<std::size_t>(across) * static_cast<std::size_t>(down),
                    [&](std::size_t tile) { tiles.draw(tile); });
    });
}

void copyLayerData(const Picture& from, std::size_t pixel, Picture& to, std::size_t index) {
    for (std::size_t i = 0; i < std::min(from.layers.size(), to.layers.size()); ++i) {
        const std::size_t n = from.layers[i].channels.size();
        std::memcpy(&to.layers[i].values[index * n], &from.layers[i].values[pixel * n], n * sizeof(float));
    }
}

std::uint32_t murmurHash3(std::string_view text) {
    const auto mixed = [](std::uint32_t k) { return std::rotl(k * 0xcc9e2d51u, 15) * 0x1b873593u; };
    const auto byte = [&](std::size_t i) { return std::uint32_t{static_cast<unsigned char>(text[i])}; };
    std::uint32_t hash = 0;
    std::size_t at = 0;
    for (; at + 4 <= text.size(); at += 4) {
        hash ^= mixed(byte(at) | byte(at + 1) << 8 | byte(at + 2) << 16 | byte(at + 3) << 24);
        hash = std::rotl(hash, 13) * 5 + 0xe6546b64u;
    }
    std::uint32_t tail = 0;
    for (std::size_t i = text.size(); i > at; --i) tail = tail << 8 | byte(i - 1);
    if (at < text.size()) hash ^= mixed(tail);
    hash ^= static_cast<std::uint32_t>(text.size());
    hash = (hash ^ hash >> 16) * 0x85ebca6bu;
    hash = (hash ^ hash >> 13) * 0xc2b2ae35u;
    return hash ^ hash >> 16;
}

float cryptomatteId(std::uint32_t hash) {
    const std::uint32_t exponent = std::clamp(hash >> 23 & 255u, 1u, 254u);
    return std::bit_cast<float>((hash & 0x807fffffu) | exponent << 23);
}

}  // namespace rtsg::trace
