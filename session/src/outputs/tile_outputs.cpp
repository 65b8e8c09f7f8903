// Follows a queue of steps to the pictures that are asked for, and draws tiles of them.
#include "outputs/tile_outputs.h"

#include <poll.h>

#include <cmath>
#include <deque>
#include <span>

#include <fmt/format.h>

#include <rtsg/renderers/picture_tiles.h>
#include <rtsg/session/load_scene.h>
#include <rtsg/session/provenance.h>

namespace rtsg {

namespace {

/// States of this many pictures are kept, for tiles that others did not draw in the end.
constexpr std::size_t kKept = 3;
constexpr std::uint64_t kMaxAside = 4096;  // aside

/// What must be the same for all tiles of a picture, besides pictures a second; a word.
std::string looksOf(const OutputOptions& options) {
    std::string text = fmt::format("{},version={}",
                                   pictureSettings(options.image, options.toneMap, options.tessellation), RTSG_VERSION);
    for (char& c : text)
        if (static_cast<unsigned char>(c) <= ' ') c = '_';
    return text;
}

}  // namespace

/// The second scene, and what draws it. Belongs to the thread.
struct TileOutputs::Drawer {
    struct State {
        std::uint64_t picture = 0, sequence = 0;
        double time = 0;
        Hash128 hash;
        std::shared_ptr<const WorldState> world;
    };

    Drawer(const OutputOptions& a, const Resources& r, RecordQueue& q) : arguments(a), resources(r), queue(q) {
        scene.setBehavioursEnabled(false);
        image = arguments.image;
        image.keep = false;  // the next tile is another one
        image.settings.progress = [this](double) { return !arguments.context.interrupted(); };
    }

    double timeOf(std::uint64_t picture) const {
        return static_cast<double>(picture) / arguments.picturesPerSecond - kRounding;
    }
    /// Takes the next set, if one is there.
    Result<bool> take() {
        if (next) return true;
        auto set = std::make_shared<ChangeSet>();
        const auto taken = queue.take(*set, std::chrono::milliseconds(0));
        if (!taken) return std::unexpected(taken.error());
        if (*taken != RecordQueue::Taken::set) return false;
        next = std::move(set);
        return true;
    }
    Result<> apply() {
        const std::shared_ptr<const ChangeSet> set = std::exchange(next, nullptr);
        if (set->isSnapshot()) states.clear();
        // Of the first state that comes it is not known when it began.
        if (!light || set->isSnapshot())
            from = set->time;
        else if (set->time > scene.now())
            from = scene.now();
        if (auto ok = applyTo(scene, set); !ok) return ok;
        return light ? Result<>() : attach();
    }
    Result<> attach() {
        SharedWorld::Options options = worldOptions(resources);
        options.delivery = Delivery::polled;  // states that nobody draws come merged
        world = std::make_unique<SharedWorld>(scene, options);
        arguments.context.extensions().registerWith(*world);
        light = std::make_unique<LightRenderer>(*world, LightRenderer::Options(resources, image));
        arguments.context.extensions().registerWith(*light);
        return light->attached() ? Result<>() : fail(light->failure());
    }
    /// Null: its state has passed, or is not there yet.
    Result<const State*> find(std::uint64_t picture) {
        for (const State& state : states)
            if (state.picture == picture) return &state;
        for (;;) {
            const auto more = take();
            if (!more) return std::unexpected(more.error());
            // The present time is whole when a set of another one comes.
            const bool whole = *more && light && next->time != scene.now();
            if (whole && scene.now() >= timeOf(picture)) break;
            if (!*more) return nullptr;
            if (auto ok = apply(); !ok) return std::unexpected(ok.error());
        }
        if (from >= timeOf(picture)) return nullptr;
        auto created = light->prepare();
        if (!created) return std::unexpected(created.error());
        if (states.size() == kKept) states.pop_front();
        states.push_back({picture, scene.sequence(), scene.now(), scene.hash(), std::move(*created)});
        return &states.back();
    }
    Result<std::string> draw(const State& state, const PictureTile& tile) {
        image.settings.region = tile.in(image.settings.width, image.settings.height);
        if (image.settings.region.empty()) return fail("a tile outside the picture was requested");
        const auto picture = light->nextPicture(*state.world, image, OwnLook());
        if (!picture) return std::unexpected(picture.error());
        const std::vector<std::uint8_t> bytes = toSrgb8(*picture, arguments.toneMap);
        return std::string(bytes.begin(), bytes.end());
    }

    const OutputOptions& arguments;
    const Resources& resources;
    RecordQueue& queue;
    Scene scene;
    double from = -INFINITY;  // the time before the scene's present one
    ImageOptions image;
    std::unique_ptr<SharedWorld> world;
    std::unique_ptr<LightRenderer> light;
    std::shared_ptr<ChangeSet> next;
    std::deque<State> states;
};

TileOutputs::TileOutputs(const Scene& scene, const OutputOptions& arguments, const Resources& resources, TileLink link)
    : QueuedOutputs(scene, arguments, resources), link_(std::move(link)), last_(scene.now()), changed_(scene.now()) {
    start([this] { wake_.raise(); });
}

Result<std::unique_ptr<TileOutputs>> TileOutputs::attach(const Scene& scene, const OutputOptions& arguments,
                                                         const Resources& resources) {
    auto link = TileLink::connect(arguments.tiles);
    if (!link) return std::unexpected(link.error());
    return std::unique_ptr<TileOutputs>(new TileOutputs(scene, arguments, resources, std::move(*link)));
}

TileOutputs::~TileOutputs() {
    worker_.stop();
}

void TileOutputs::step(const Scene& scene, const RecordStep& step) {
    QueuedOutputs::step(scene, step);
    const auto pictureAt = [this](double time) {
        return static_cast<std::uint64_t>(std::max(0.0, std::floor((time + kRounding) * arguments_.picturesPerSecond)));
    };
    const bool passes = scene.now() != last_;
    if (passes) {
        // All sets of the time before have come.
        const std::scoped_lock lock(mutex_);
        if (std::exchange(have_.number, pictureAt(last_)) != pictureAt(last_)) have_.state = lastState_;
        have_.since = pictureAt(changed_) + 1;
        last_ = scene.now();
    }
    const bool anew = step.set && step.set->isSnapshot();
    lastState_ = anew ? std::string() : fmt::format("{} {}", scene.sequence(), scene.hash().hex());
    // A scene that rests tells its time now and then.
    if (!step.set || step.set->isSnapshot() || !step.set->changes.empty()) changed_ = last_;
    if (passes) wake_.raise();
}

/// Draws what is asked for.
Result<> TileOutputs::answer(Drawer& drawer, const TileLink::Message& message) {
    if (message.words[0] == "refused") {
        std::string why;
        for (std::size_t i = 1; i < message.words.size(); ++i) why += (i > 1 ? " " : "") + message.words[i];
        return fail("refused: " + why, {}, arguments_.tiles);
    }
    if (message.words[0] != "draw") return {};
    const std::uint64_t number = message.number(1);
    const auto word = [&](std::size_t at) {
        return static_cast<int>(std::min<std::uint64_t>(message.number(at), kMaxAside));
    };
    const PictureTile tile{word(2), word(3), std::max(word(4), 1), std::max(word(5), 1)};
    const auto state = drawer.find(number);
    if (!state) return std::unexpected(state.error());
    if (!*state) {
        link_.send(fmt::format("gone {} {} {}", number, tile.x, tile.y));
        return {};
    }
    const auto bytes = drawer.draw(**state, tile);
    if (!bytes) return std::unexpected(bytes.error());
    link_.send(fmt::format("tile {} {} {} {} {} {} {}", number, tile.x, tile.y, (*state)->sequence,
                           (*state)->hash.hex(), (*state)->time, bytes->size()),
               *bytes);
    return {};
}

Result<> TileOutputs::follow() {
    Drawer drawer(arguments_, resources_, queue_);
    reportFailuresAtTheEnd(drawer.scene);
    const RenderSettings& settings = drawer.image.settings;
    link_.send(fmt::format("hello 1 {} {} {} {}", settings.width, settings.height, arguments_.picturesPerSecond,
                           looksOf(arguments_)));
    std::uint64_t said = 0;
    while (!worker_.stops()) {
        pollfd items[] = {{link_.descriptor(), POLLIN, 0}, {wake_.get(), POLLIN, 0}};
        if (link_.waitsToSend()) items[0].events |= POLLOUT;
        (void)::poll(items, std::size(items), 1000);
        wake_.clear();
        link_.flush();
        link_.read();
        auto message = link_.receive();
        do {
            Have have;
            {
                const std::scoped_lock lock(mutex_);
                have = have_;
            }
            if (have.number != said)
                link_.send(fmt::format("have {} {} {}", said = have.number, have.since, have.state));
            if (!message) break;
            if (auto ok = answer(drawer, *message); !ok) return ok;
            message = link_.receive();
        } while (!worker_.stops());
        if (!link_.over().empty()) return {};  // whoever joins them has enough
    }
    return {};
}

Result<> TileOutputs::finish() {
    worker_.stop();
    return result("tiles ended");
}

}  // namespace rtsg
