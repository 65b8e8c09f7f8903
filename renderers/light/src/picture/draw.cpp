// The loop over a picture's tiles, drawn by several threads.
#include "draw.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <numbers>

#include <rtsg/renderers/parallel_for.h>

#include "data_layers.h"
#include "lighting/environment.h"
#include "lighting/path_parts.h"
#include "lighting/sample_points.h"
#include "lighting/shutter.h"
#include "mesh/simd8.h"
#include "packet/seen_first.h"
#include "packet/tile_rays.h"
#include "path/adaptive.h"

namespace rtsg::trace {

namespace {

/// The unevenness of a sky from which on it pays to sample it directly.
constexpr float kUneven = 4;

/// A tile looks up so many samples of a pixel together, which keeps their data in the second cache.
constexpr int kFoundTogether = 64;

/// Fields may hold numbers whose products leave the range of float; a picture never does.
Vec4f finitePixel(Vec4f v) {
    for (int c = 0; c < 4; ++c) v[c] = v[c] > 0 ? std::min(v[c], std::numeric_limits<float>::max()) : 0.0f;  // NaN: 0
    return v;
}

int tilesAside(int pixels) {
    return (pixels + kTileSide - 1) / kTileSide;
}
int countTiles(const PixelRegion& drawn) {
    return tilesAside(drawn.width) * tilesAside(drawn.height);
}

/// The tiles of a picture, drawn by several threads, and the statistics over them.
class Drawing {
  public:
    Drawing(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, Picture& picture,
            const Kept* kept, const HiddenLight& hidden)
        : scene_(scene),
          camera_(camera),
          settings_(settings),
          picture_(picture),
          kept_(kept),
          drawn_(tilesAround(settings)),
          tilesX_(tilesAside(drawn_.width)),
          tiles_(countTiles(drawn_)),
          sampling_(scene, camera, settings, drawn_, hidden) {}

    void run() {
        if (settings_.error > 0 && !sampling_.run(settings_.progress)) cancelled_ = true;
        withThreads(settings_.threads, [&] {
            parallelFor(static_cast<std::size_t>(tiles_), [&](std::size_t tile) { draw(static_cast<int>(tile)); });
        });
    }

    void addTo(RenderStats& stats) const {
        const double pixels = double{1} * drawn_.width * drawn_.height;
        stats.primaryRays = sum_.primaryRays, stats.shadowRays = sum_.shadowRays;
        stats.secondaryRays = sum_.secondaryRays;
        stats.cancelled = cancelled_;
        stats.missing = sum_.missing / pixels, stats.missingMaximum = sum_.missingMaximum;
        stats.error = sampling_.error();
        stats.unreached =
            settings_.error > 0 && !sampling_.reached() && !(sum_.unreached > 0) ? 1 : sum_.unreached / pixels;
        stats.noise = std::sqrt(sum_.noise / pixels), stats.mean = sum_.mean / pixels;
        stats.samples = sum_.samples / pixels;
        stats.kept = sum_.kept / pixels;
    }

  private:
    void draw(int number) {
        if (cancelled_.load(std::memory_order_relaxed)) return;
        // Tiles lie where those of the whole picture do, whose rays depend on the place in it.
        const int x0 = drawn_.left + number % tilesX_ * kTileSide, y0 = drawn_.top + number / tilesX_ * kTileSide;
        Trail::Part* last = kept_ ? kept_->last : nullptr;
        const auto at = static_cast<std::size_t>(number);
        if (last && !kept_->tiles.empty() && kept_->tiles[at]) {
            copyTile(last->picture, picture_, x0, y0);
            add(last->tiles[at], x0, y0);
            return finish();
        }
        AdaptiveTile tile;
        TileReach reach;
        if (last) tile.result.reach = &reach;
        if (settings_.error > 0) {
            sampling_.finish(number, tile);
        } else {
            tile.result.seed = settings_.seed;
            traceRounds(scene_, camera_, settings_, x0, y0, tile.result);
            tile.samples = settings_.samplesPerPixel;
        }
        if (scene_.space == ColorSpace::automatic) addLight(tile.result);
        const TileStats own = take(tile, x0, y0);
        if (last) {
            copyTile(picture_, last->picture, x0, y0);
            last->tiles[at] = own, last->reaches[at] = reach;
        }
        finish();
    }

    void finish() {
        const int finished = ++done_;
        if (settings_.error == 0 && settings_.progress && progressMutex_.try_lock()) {
            const std::lock_guard lock(progressMutex_, std::adopt_lock);
            if (!settings_.progress(static_cast<double>(finished) / tiles_)) cancelled_ = true;
        }
    }
    void copyTile(const Picture& from, Picture& to, int x0, int y0) const {
        const int right = std::min(settings_.width - x0, kTileSide), below = std::min(settings_.height - y0, kTileSide);
        const int left = x0 - drawn_.left, top = y0 - drawn_.top;
        for (int y = top; y < top + below; ++y) std::copy_n(&from.at(left, y), right, &to.at(left, y));
    }
    /// Adds the statistics of a tile that is kept.
    void add(const TileStats& own, int x0, int y0) {
        const std::lock_guard lock(sumMutex_);
        addUp(own);
        sum_.kept += double{1} * std::min(settings_.width - x0, kTileSide) * std::min(settings_.height - y0, kTileSide);
    }
    void addUp(const TileStats& own) {
        sum_.samples += own.samples, sum_.unreached += own.unreached;
        sum_.noise += own.noise, sum_.mean += own.mean;
        sum_.missing += own.missing, sum_.missingMaximum = std::max(sum_.missingMaximum, own.missingMaximum);
    }

    TileStats take(const AdaptiveTile& tile, int x0, int y0) {
        TileStats own;
        const int right = std::min(settings_.width - x0, kTileSide), below = std::min(settings_.height - y0, kTileSide);
        for (int y = 0; y < below; ++y)
            for (int x = 0; x < right; x += 4) {
                const int pixel = y * kTileSide + x;
                const int count = std::min(right - x, 4);
                show(tile, pixel, &picture_.at(x0 - drawn_.left + x, y0 - drawn_.top + y), count);
                own.samples += double{1} * tile.samples * count;
            }
        own.unreached = tile.reached ? 0 : double{1} * right * below;
        if (!tile.result.missing.empty() || !picture_.interval.empty())
            for (int y = 0; y < below; ++y)
                for (int x = 0; x < right; ++x)
                    addTo(tile, y * kTileSide + x, x0 - drawn_.left + x, y0 - drawn_.top + y, own);
        const std::lock_guard lock(sumMutex_);
        addUp(own);
        sum_.primaryRays += tile.result.primaryRays, sum_.shadowRays += tile.result.shadowRays;
        sum_.secondaryRays += tile.result.secondaryRays;
        return own;
    }

    /// A few pixels of a row of a block.
    void show(const AdaptiveTile& tile, int pixel, Vec4f* to, int count) const {
        const float scale = 1.0f / static_cast<float>(tile.samples);
        const Vec4f* sum = &tile.result.sum[static_cast<std::size_t>(pixel)];
        if (count < 4) {
            for (int i = 0; i < count; ++i) to[i] = finitePixel(sum[i] * scale);
            return;
        }
        for (int i = 0; i < 4; i += 2) {
            using namespace simd;
            const F8 value = load(&sum[i].x) * scale;
            store(&to[i].x, select(value > 0.0f, min(value, all(std::numeric_limits<float>::max())), all(0)));
        }
    }
    /// Stores the data of a pixel besides its colour.
    void addTo(const AdaptiveTile& tile, int pixel, int x, int y, TileStats& own) {
        const auto at = static_cast<std::size_t>(pixel);
        if (!tile.result.missing.empty()) {
            const double missing = double{tile.result.missing[at]} * (1.0f / static_cast<float>(tile.samples));
            own.missing += missing, own.missingMaximum = std::max(own.missingMaximum, missing);
        }
        if (picture_.interval.empty()) return;
        picture_.interval[static_cast<std::size_t>(y) * static_cast<std::size_t>(picture_.width) +
                          static_cast<std::size_t>(x)] = tile.interval[at];
        const Vec4f& shown = picture_.at(x, y);
        own.noise += tile.variance[at], own.mean += (double{shown.r} + shown.g + shown.b) / 3;
    }

    const TraceScene& scene_;
    const Camera& camera_;
    const RenderSettings& settings_;
    Picture& picture_;
    const Kept* kept_;
    const PixelRegion drawn_;
    const int tilesX_, tiles_;
    AdaptivePicture sampling_;  // to an error
    std::atomic<int> done_ = 0;
    std::atomic<bool> cancelled_ = false;
    std::mutex progressMutex_, sumMutex_;
    RenderStats sum_;  // over pixels; of `noise` the squares
};

}  // namespace

namespace {

/// One choice of directions for all surfaces, whichever of the lights reach them: by the sum of all light from far.
void emplaceEnvironments(const TraceScene& scene, Sources& sources) {
    const std::vector<TraceEnvironment>& lights = scene.environments.lights;
    const bool all = scene.environments.groups[0].count > 0;  // are reached, and none sees the sky
    if ((all || scene.evenSky) && std::ranges::all_of(lights, [](const auto& light) { return light.from->isEven(); }))
        return;
    std::vector<FarLight> far;
    for (const TraceEnvironment& light : lights) {
        const Environment& from = *light.from;
        const bool round = from.isPanorama();
        const float sideAngle = round ? std::numbers::pi_v<float> : 2;  // at the middle of a cube's side
        far.push_back({round ? FarLight::Shape::panorama : FarLight::Shape::cube, from.detail(), light.localFromWorld,
                       [&light, sideAngle](const Vec3f& direction, float footprint) {
                           return light.color * light.from->radiance(direction, sideAngle * footprint);
                       },
                       from.source(), light.color});
        if (!from.source().specular) continue;
        far.back().inPicture = [&light, sideAngle](std::size_t side, Vec2f point, float footprint) {
            return light.color * light.from->radianceInPicture(side, point, sideAngle * footprint);
        };
    }
    sources.sky = SkyTable::of(scene.skyTable, all ? nullptr : scene.sky, std::move(far));
}

}  // namespace

void lookForLight(TraceScene& scene, Sources& sources) {
    const PlainSurfaces& plain = sources.plain.emplace(scene);
    scene.plain = &plain;
    if (pathParts().largeFirst && plain.maximum())
        if (sources.large.emplace(*scene.world, [&](std::uint32_t slot) { return plain.about(slot); }))
            scene.large = &*sources.large;
    sources.emitters = scene.emitterTable ? scene.emitterTable->of(scene) : std::make_shared<const Emitters>(scene);
    if (pathParts().emitters && !sources.emitters->empty()) scene.emitters = sources.emitters.get();
    sources.lamps = Lamps(scene.lightGroups);
    if (!sources.lamps.empty()) scene.lamps = &sources.lamps;
    if (!scene.environments.lights.empty())
        emplaceEnvironments(scene, sources);
    else if (!scene.evenSky)
        sources.sky = SkyTable::of(scene.skyTable, scene.sky, {});
    else
        return;
    if (pathParts().skyLight && sources.sky && sources.sky->unevenness() > kUneven) scene.skyLight = sources.sky.get();
}

Picture drawPicture(const TraceScene& scene, const Camera& camera, const RenderSettings& settings, RenderStats* stats,
                    const Kept* kept, const HiddenLight& hidden) {
    const PixelRegion drawn = tilesAround(settings);
    Picture picture(drawn.width, drawn.height);
    picture.space = scene.space == ColorSpace::linear ? ColorSpace::linear : ColorSpace::display;
    if (settings.error > 0) picture.interval.resize(picture.pixels.size(), Vec3f(0));
    Drawing drawing(scene, camera, settings, picture, kept, hidden);
    drawing.run();
    if (stats) drawing.addTo(*stats);
    return picture;
}

namespace {

/// Whether all that a tile's rays meet is in its TileReach.
bool leavesTrail(const TraceScene& scene, const RenderSettings& settings) {
    return settings.integrator == Integrator::whitted && settings.error == 0 && scene.volumes.empty() &&
           !scene.materials.generates() && !(scene.filter && scene.filter->makesCaps());
}

/// Which tiles of the last picture stay, and room for those that do not.
void findKept(const TraceScene& scene, const RenderSettings& settings, const Differences* differences, Kept& kept) {
    Trail::Part& last = *kept.last;
    const PixelRegion drawn = tilesAround(settings);
    const auto tiles = static_cast<std::size_t>(countTiles(drawn));
    if (differences && last.reaches.size() == tiles) {
        const Untouched untouched(*differences, scene.lightGroups.lights);
        kept.tiles.resize(tiles);
        withThreads(settings.threads, [&] {
            parallelFor(tiles, [&](std::size_t tile) { kept.tiles[tile] = untouched(last.reaches[tile]); });
        });
        return;
    }
    last.picture = Picture(drawn.width, drawn.height);
    last.reaches.assign(tiles, {}), last.tiles.assign(tiles, {});
}

}  // namespace

namespace {

/// Samples of a pixel, after which a picture of what rests is as it is.
constexpr double kMaxRefined = 16384;

Picture drawTiles(const LightState& state, const RayView& world, const Camera& camera, const RenderSettings& settings,
                  const Part& part, RenderStats& stats, Trail* trail);

/// Adds as many samples as a picture has to the last one, which shows the same.
Picture refine(const LightState& state, const RayView& world, const Camera& camera, const RenderSettings& settings,
               const Part& part, RenderStats& stats, Trail::Part& last) {
    RenderSettings own = settings;
    const double before = last.stats.samples, fraction = settings.samplesPerPixel / (before + settings.samplesPerPixel);
    own.seed = mixBits(settings.seed + static_cast<std::uint64_t>(before) * 0x9e3779b97f4a7c15ull);
    own.layers = 0;
    const Picture more = drawTiles(state, world, camera, own, part, stats, nullptr);
    stats.kept = 1;
    if (stats.cancelled) return last.picture;
    for (std::size_t i = 0; i < more.pixels.size(); ++i)
        last.picture.pixels[i] += static_cast<float>(fraction) * (more.pixels[i] - last.picture.pixels[i]);
    stats.samples += before;
    stats.missing = (1 - fraction) * last.stats.missing + fraction * stats.missing;
    stats.missingMaximum = std::max(stats.missingMaximum, last.stats.missingMaximum);
    last.stats = stats;
    return last.picture;
}

/// Does drawPart()'s work; the picture covers tilesAround() the region.
Picture drawTiles(const LightState& state, const RayView& world, const Camera& camera, const RenderSettings& settings,
                  const Part& part, RenderStats& stats, Trail* trail) {
    Kept kept;
    if (trail) kept.last = &trail->next(camera);
    if (trail && trail->isSame()) {
        if (trail->refines() && kept.last->stats.samples < kMaxRefined)
            return refine(state, world, camera, settings, part, stats, *kept.last);
        stats = kept.last->stats;
        stats.primaryRays = stats.shadowRays = stats.secondaryRays = 0, stats.kept = 1;
        stats.cancelled = settings.progress && !settings.progress(1);
        return kept.last->picture;
    }
    TraceScene scene = makeTraceScene(state, world, camera, settings, part);
    std::optional<Shutter> shutter;
    if (settings.shutter > 0 && settings.before) {
        shutter.emplace(world, camera, settings, scene);
        shutter->openFor(scene);
    }
    drawCubes(state, world, camera, settings, part.hidden, scene);
    std::optional<SeenFirst> seen;
    if (part.sight) scene.seen = &seen.emplace(scene, *part.sight);
    Sources sources;
    if (settings.integrator == Integrator::path) lookForLight(scene, sources);
    HiddenLight hidden;
    if (settings.integrator == Integrator::path && settings.error > 0) {
        hidden = findHiddenLight(scene);
        scene.countsFrom = hidden.countsFrom();
    }
    const bool tileByTile = trail && leavesTrail(scene, settings);
    if (tileByTile) findKept(scene, settings, trail->kept(), kept);
    const bool traces = std::ranges::find(kept.tiles, 0) != kept.tiles.end() || kept.tiles.empty();
    std::optional<PrimaryRays> primary;
    const int samples = settings.samplesPerPixel;
    const bool fromOnePoint = !camera.orthographic && !camera.panorama && !(camera.lensRadius > 0 && samples > 1);
    if (settings.integrator == Integrator::whitted && samples <= kFoundTogether && settings.error == 0 &&
        !scene.shutter && !scene.seen && fromOnePoint && !(camera.nearDistance > 0) && traces) {
        withThreads(settings.threads,
                    [&] { primary.emplace(*scene.world, pixelGrid(scene, camera, settings), RayKind::view, samples); });
        if (*primary) scene.primary = &*primary;
    }
    Picture picture = drawPicture(scene, camera, settings, &stats, tileByTile ? &kept : nullptr, hidden);
    stats.hiddenLight = hidden.fraction, stats.lostLight = hidden.lost;
    if (settings.layers != 0) {
        addLayers(world, settings, picture);
        if (!stats.cancelled) drawLayerData(scene, camera, settings, picture);
    }
    if (kept.last) {
        kept.last->stats = stats;
        kept.last->picture.space = picture.space;
        if (!tileByTile) kept.last->picture = picture, kept.last->reaches.clear();
    }
    return picture;
}

}  // namespace

Picture drawPart(const LightState& state, const RayView& world, const Camera& camera, const RenderSettings& settings,
                 const Part& part, RenderStats& stats, Trail* trail) {
    return cutToRegion(drawTiles(state, world, camera, settings, part, stats, trail), settings);
}

PixelRegion tilesAround(const RenderSettings& settings) {
    const PixelRegion& region = settings.region;
    if (region.empty()) return {0, 0, settings.width, settings.height};
    const auto down = [](int pixel) { return pixel / kTileSide * kTileSide; };
    const auto up = [](int pixel, int maximum) { return std::min(tilesAside(pixel) * kTileSide, maximum); };
    const int left = down(region.left), top = down(region.top);
    return {left, top, up(region.left + region.width, settings.width) - left,
            up(region.top + region.height, settings.height) - top};
}

Picture cutToRegion(Picture picture, const RenderSettings& settings) {
    const PixelRegion &region = settings.region, drawn = tilesAround(settings);
    if (region.empty() || region == drawn) return picture;
    Picture part(region.width, region.height);
    part.space = picture.space, part.notes = std::move(picture.notes);
    if (!picture.interval.empty()) part.interval.resize(part.pixels.size());
    for (const PictureLayer& layer : picture.layers)
        part.layers.push_back(
            {layer.channels, layer.integers, std::vector<float>(part.pixels.size() * layer.channels.size())});
    for (std::size_t to = 0; to < part.pixels.size(); ++to) {
        const int x = static_cast<int>(to) % region.width, y = static_cast<int>(to) / region.width;
        const std::size_t from =
            static_cast<std::size_t>(region.top - drawn.top + y) * static_cast<std::size_t>(drawn.width) +
            static_cast<std::size_t>(region.left - drawn.left + x);
        part.pixels[to] = picture.pixels[from];
        if (!part.interval.empty()) part.interval[to] = picture.interval[from];
        copyLayerData(picture, from, part, to);
    }
    return part;
}

}  // namespace rtsg::trace
