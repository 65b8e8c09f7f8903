// The process with the scene: what its application does in each frame, and how it ends and begins again.
#include "origin.h"

#include <algorithm>

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/session.h>

namespace rtsg::simulation {

using namespace std::chrono_literals;

namespace {

constexpr std::uint64_t kEnded = UINT64_MAX;
constexpr double kBegin = 1000;  // seconds of scene time

std::string nameOf(std::uint32_t mover) {
    return fmt::format("MOVER{}", mover);
}

void require(const Result<>& ok) {
    if (!ok) throw std::runtime_error("the application's own edit: " + ok.error().format());
}

}  // namespace

Result<> Witness::apply(const Scene&, const ChangeSet& changes) {
    auto& known = hashes_[changes.to];
    if (std::ranges::find(known, changes.hash) == known.end()) known.push_back(changes.hash);
    return {};
}

bool Witness::saw(std::uint64_t state, const Hash128& hash) const {
    const auto found = hashes_.find(state);
    return found != hashes_.end() && std::ranges::find(found->second, hash) != found->second.end();
}

Result<> Origin::Log::apply(const Scene& scene, const ChangeSet& changes) {
    if (auto ok = writer->apply(scene, changes); !ok) {
        if (!origin.system_.isDead) origin.acknowledge_(kEnded, kEnded);
        return ok;
    }
    origin.durable_ = changes.to;
    origin.isOnLog_ = true;
    if (origin.settings_.log.sync == LogOptions::Sync::always) origin.flushedState_ = changes.to;
    origin.acknowledge_(0, changes.to);
    return {};
}

Origin::Origin(World& world, System& system, Network& network, OriginSettings settings, std::filesystem::path file)
    : Process(world, system),
      world_(world),
      system_(system),
      network_(network),
      settings_(std::move(settings)),
      file_(std::move(file)) {}

/// Movers that the application moves, and one that a clock and a route move.
void Origin::build(std::uint64_t seed) {
    Random random(seed, 3);
    Scene& scene = *scene_;
    const NodeId viewpoint = scene.createNode(x3d::Viewpoint::type);
    require(scene.setName(viewpoint, "EYE"));
    require(scene.insertChild(scene.root(), x3d::RtsgScene::children, viewpoint));
    for (std::uint32_t i = 0; i < settings_.movers; ++i) {
        const NodeId mover = scene.createNode(x3d::Transform::type), shape = scene.createNode(x3d::Shape::type);
        const NodeId box = scene.createNode(x3d::Box::type);
        require(scene.setName(mover, nameOf(i)));
        require(scene.set(mover, x3d::Transform::translation, Vec3f(float(random.below(40)), 0, float(i))));
        require(scene.setField(shape, x3d::Shape::geometry.index, box));
        require(scene.insertChild(mover, x3d::Transform::children, shape));
        require(scene.insertChild(scene.root(), x3d::RtsgScene::children, mover));
    }
    const NodeId timer = scene.createNode(x3d::TimeSensor::type);
    const NodeId path = scene.createNode(x3d::PositionInterpolator::type);
    require(scene.set(timer, x3d::TimeSensor::loop, true));
    require(scene.set(timer, x3d::TimeSensor::cycleInterval, rtsg::Time{3.0}));
    require(scene.setField(path, x3d::PositionInterpolator::key.index, Array<float>{0.f, .5f, 1.f}));
    require(scene.setField(path, x3d::PositionInterpolator::keyValue.index,
                           Array<Vec3f>{Vec3f(0, 0, 0), Vec3f(9, 1, 0), Vec3f(0, 0, 0)}));
    for (const NodeId node : {timer, path}) require(scene.insertChild(scene.root(), x3d::RtsgScene::children, node));
    require(scene.addRoute(timer, x3d::TimeSensor::fraction_changed.index, path,
                           x3d::PositionInterpolator::set_fraction.index));
    require(scene.addRoute(path, x3d::PositionInterpolator::value_changed.index, scene.findName(nameOf(0)),
                           x3d::Transform::translation.index));
    scene.newFrame(kBegin);
}

Result<> Origin::checkResumed(const Scene& scene, std::uint64_t states) const {
    if (states < durable_)
        return fail(fmt::format("the log leads to state {}, and {} was acknowledged", states, durable_));
    if (settings_.mode.mode != Mode::lossy && !witness.saw(states, scene.hash()))
        return fail(fmt::format("the log leads to state {} with a hash that the origin never had", states));
    return {};
}

Result<> Origin::checkLog() const {
    if (!settings_.logs || !isOnLog_) return {};
    // A copy, as nobody takes up a log that is being written.
    const std::filesystem::path copy = file_.parent_path() / "copy";
    std::filesystem::create_directory(copy);
    for (const auto& entry : std::filesystem::directory_iterator(file_.parent_path()))
        if (entry.is_regular_file()) std::filesystem::copy_file(entry.path(), copy / entry.path().filename());
    Scene scratch;
    const auto session = resumeSession(copy / file_.filename(), scratch);
    std::filesystem::remove_all(copy);
    if (!session) return fail("the log cannot be read: " + session.error().format());
    return checkResumed(scratch, scratch.sequence());
}

/// False if there is nothing to go on from.
Result<bool> Origin::resume(MirrorServerOptions& options, LogOptions& log) {
    if (!settings_.logs || !isOnLog_) return false;
    auto session = resumeSession(file_, *scene_);
    if (!session) return fail("the log cannot be taken up again: " + session.error().format());
    if (auto ok = checkResumed(*scene_, scene_->sequence()); !ok) return std::unexpected(ok.error());
    options.epoch = log.epoch = session->epoch;
    options.before = session->before;
    log.append = true;
    durable_ = resumedAt = scene_->sequence();
    flushedState_ = std::min(flushedState_, durable_);
    ++resumed;
    return true;
}

Result<> Origin::start(std::uint64_t seed) {
    system_.isDead = false;
    scene_ = std::make_unique<Scene>();
    MirrorServerOptions options;
    LogOptions log = settings_.log;
    options.mode = settings_.mode;
    options.upstream = settings_.upstream;
    options.history = settings_.history;
    options.maximumPeers = settings_.maximumPeers;
    options.transport = network_.transportOf(*this);
    if (settings_.mode.mode == Mode::input) scene_->setInputRecording(true);
    const Result<bool> goesOn = resume(options, log);
    if (!goesOn) return std::unexpected(goesOn.error());
    if (!*goesOn) {
        ++lineage;
        durable_ = flushedState_ = 0;
        build(seed);
    }
    if (settings_.logs) {
        log_ = std::make_unique<Log>(*this);
        auto writer = LogWriter::create(file_, builtinTypes(), log);
        if (!writer) {  // no room, say: it tries again
            problem = writer.error().format();
            system_.isDead = false;
            log_.reset();
            scene_.reset();
            startAt = clock.at() + kSecond / 2;
            if (!*goesOn) isOnLog_ = false;
            return {};
        }
        log_->writer = std::move(*writer);
    }
    if (settings_.mode.mode == Mode::lossy) lossy_ = *LossyScene::follow(*scene_, settings_.mode.maxError);
    Scene& served = lossy_ ? lossy_->scene() : *scene_;
    witnessing_ = served.bus().attach(witness);
    if (!*goesOn || lossy_) (void)witness.apply(served, served.snapshot());
    auto server = MirrorServer::start(served, kEndpoint, std::move(options));
    if (!server) return fail("the server does not start: " + server.error().format());
    server_ = std::move(*server);
    if (log_) {
        acknowledge_ = server_->sendWhatIsLogged(1h);
        logged_ = std::make_unique<Replica>(*scene_);
        logged_->poll();  // a log must not begin with the replica's empty state
        logging_ = logged_->scene().bus().attach(*log_);
        write();
    }
    due = clock.at();
    return {};
}

void Origin::frame(Random random, double time) {
    Scene& scene = *scene_;
    if (!settings_.plain) {
        const std::uint32_t edits = random.below(4);
        for (std::uint32_t i = 0; i < edits; ++i) {
            const NodeId mover = scene.findName(nameOf(random.below(settings_.movers)));
            if (mover && random.chance(900))
                (void)scene.set(mover, x3d::Transform::translation, Vec3f(float(random.below(4000)) / 64, 0, 1));
            else if (const NodeId more = scene.createNode(x3d::Group::type); mover)
                require(scene.insertChild(mover, x3d::Transform::children, more));
        }
        if (const NodeId mover = scene.findName(nameOf(1)); mover && random.chance(60)) {
            const auto& children = scene.node(mover).get(x3d::Transform::children);
            if (children.size() > 1) require(scene.destroyNode(children[1]));
        }
        // Long values, so that windows fill and keyframes come.
        if (random.chance(30))
            if (const NodeId mover = scene.findName(nameOf(2))) {
                const NodeId info = scene.createNode(x3d::WorldInfo::type);
                std::string text(200 + random.below(100) * random.below(400), ' ');
                for (char& c : text) c = static_cast<char>('a' + random.below(26));
                require(scene.setField(info, x3d::WorldInfo::title.index, String(text)));
                require(scene.insertChild(mover, x3d::Transform::children, info));
            }
    } else {
        require(scene.set(scene.findName(nameOf(1)), x3d::Transform::translation, Vec3f(float(time), 0, 0)));
    }
    scene.newFrame(std::max(scene.now(), kBegin + time));
    ++frames;
    busyUntil_ = clock.at() + 400 * kMillisecond;
}

void Origin::write() {
    writesAt_ = kNever;
    if (logged_) logged_->drain();
}

void Origin::poll() {
    if (clock.at() >= writesAt_) write();
    if (system_.isDead) return;
    server_->service();
    if (logging_.attached() && scene_->sequence() > durable_) writesAt_ = std::min(writesAt_, clock.at() + diskTakes);
    const bool busy = clock.at() < busyUntil_;
    due = clock.at() + (busy ? 20 : 200) * kMillisecond;
    if (writesAt_ < kNever) isDue(std::max(writesAt_, clock.at() + kMillisecond));
}

/// Killed: nobody says anything any more.
void Origin::die(bool isSilent) {
    if (!scene_) return;
    network_.kill(*this, isSilent);
    system_.isDead = true;
    if (log_) {
        logging_.detach();
        log_->writer->abandon();
    }
    logged_.reset();
    server_.reset();
    witnessing_.detach();
    log_.reset();
    lossy_.reset();
    scene_.reset();
    system_.isDead = false;
}

/// In order, as a program that is asked to end.
void Origin::close() {
    if (log_) {
        write();
        if (system_.isDead) return die(false);
        logging_.detach();
        (void)log_->writer->close();
        logged_.reset();
    }
    server_.reset();
    witnessing_.detach();
    log_.reset();
    lossy_.reset();
    scene_.reset();
}

/// What was not flushed may be lost, from the end of the file on.
void Origin::losePower() {
    die(true);
    durable_ = flushedState_;
    if (!settings_.logs) return;
    struct stat status{};
    if (::stat(file_.c_str(), &status) != 0) return;
    const auto flushed = system_.flushed.find(status.st_ino);
    const off_t kept = flushed == system_.flushed.end() ? 0 : std::min(flushed->second, status.st_size);
    const auto loose = static_cast<std::uint32_t>(std::min<off_t>(status.st_size - kept, 1 << 30));
    const off_t left = kept + (loose > 0 ? system_.random.below(loose + 1) : 0);
    (void)!::truncate(file_.c_str(), left);
    // Without a whole state in it there is nothing to go on from.
    if (flushedState_ == 0) {
        Scene scratch;
        if (!resumeSession(file_, scratch)) {
            isOnLog_ = false;
            std::error_code error;
            for (const auto& entry : std::filesystem::directory_iterator(file_.parent_path()))
                std::filesystem::remove_all(entry.path(), error);
        }
    }
}

}  // namespace rtsg::simulation
