// A simulated session from its first step to the last: draws it, lets faults happen, and looks whether all holds.
#include "session.h"

#include <algorithm>
#include <system_error>

#include <fmt/format.h>

#include <rtsg/sync/record.h>

#include "columns/value_history.h"
#include "mirror.h"
#include "sockets/message.h"

namespace rtsg::simulation {

using namespace std::chrono_literals;

namespace {

constexpr std::array<const char*, kMessageTypes> kMessageNames = {
    "", "hello", "ack", "ping", "pong",    "bye",  "doubt",   "inspect", "want",   "submit",  "control", "",
    "", "",      "",    "",     "welcome", "data", "unknown", "refused", "digest", "anatomy", "verdict", "reply"};

/// Everything of one session.
class Session {
  public:
    Session(const Plan& plan, const std::filesystem::path& folder, const Shape& shape, bool trace);
    Outcome run();

  private:
    OriginSettings drawOrigin(Random& random, const std::filesystem::path& folder) const;
    MirrorSettings drawMirror(Random& random, std::uint32_t number) const;
    void begin();
    bool step();
    bool quiet();
    void happens(const Fault& fault);
    void happensToOrigin(const Fault& fault);
    void forMirror(const Fault& fault);
    bool goOn(Nanoseconds until);
    bool look(Process& process);
    bool startLate();
    bool checkAll();
    bool fail(std::string why);
    bool areAllSettled() const;
    std::string unsettled() const;
    void endIfDead();
    Phase phase() const;
    void heard(std::span<const std::byte> bytes, bool atListener);
    void say(const std::string& what) const;
    template <class F>
    bool guarded(F&& work);

    const Plan& plan_;
    const Shape& shape_;
    const bool trace_;
    World world_;
    System system_;
    System::Installed installed_{system_};
    Network network_{world_, system_};
    EditLedger ledger_;
    std::unique_ptr<Origin> origin_;
    std::vector<std::unique_ptr<Relay>> relays_;
    std::vector<std::unique_ptr<Mirror>> mirrors_;
    std::unique_ptr<Stranger> stranger_;
    std::vector<Process*> processes_;
    std::size_t nextFault_ = 0;
    std::uint32_t step_ = 0;
    Phase phase_ = Phase::originDown;
    Nanoseconds diskFullUntil_ = 0, noFlushUntil_ = 0;
    Process* noMemory_ = nullptr;
    std::uint64_t noMemoryAfter_ = 0;
    Outcome outcome_;
};

/// The encoder's tables are salted once a thread, so the first session must not draw it.
void saltTables() {
    wire::Table table;
    (void)table.findOrAdd(1);
}

Session::Session(const Plan& plan, const std::filesystem::path& folder, const Shape& shape, bool trace)
    : plan_(plan), shape_(shape), trace_(trace), system_(plan.seed) {
    std::error_code error;
    std::filesystem::remove_all(folder, error);
    std::filesystem::create_directories(folder);
    Random random(plan.seed, 4);
    origin_ = std::make_unique<Origin>(world_, system_, network_, drawOrigin(random, folder), folder / "session.rlog");
    const std::uint32_t relays = shape.plain || random.chance(600) ? 0 : 1 + random.below(3);
    for (std::uint32_t i = 0; i < relays; ++i) {
        const std::uint32_t above = random.below(i + 1);
        relays_.push_back(std::make_unique<Relay>(world_, system_, network_,
                                                  above == 0 ? Origin::kEndpoint : fmt::format("relay{}", above),
                                                  fmt::format("relay{}", i + 1), origin_->settings().upstream));
    }
    const std::uint32_t mirrors = shape.mirrors ? shape.mirrors : 1 + random.below(random.chance(50) ? 60 : 9);
    for (std::uint32_t i = 0; i < mirrors; ++i)
        mirrors_.push_back(std::make_unique<Mirror>(world_, system_, network_, drawMirror(random, i), ledger_));
    stranger_ = std::make_unique<Stranger>(world_, system_, network_);
    stranger_->due = kNever;
    processes_.push_back(origin_.get());
    for (const auto& relay : relays_) processes_.push_back(relay.get());
    for (const auto& mirror : mirrors_) processes_.push_back(mirror.get());
    processes_.push_back(stranger_.get());
    network_.heard = [this](std::span<const std::byte> bytes, bool atListener) { heard(bytes, atListener); };
}

OriginSettings Session::drawOrigin(Random& random, const std::filesystem::path&) const {
    OriginSettings s;
    s.plain = shape_.plain;
    const Nanoseconds intervals[] = {10 * kMillisecond, 33 * kMillisecond, 100 * kMillisecond, kSecond};
    s.interval = intervals[random.below(4)];
    if (shape_.interval > 0) s.interval = shape_.interval;
    const std::uint32_t mode = random.below(10);
    if (mode < 2) s.mode.mode = Mode::input;
    if (mode == 2) s.mode = {Mode::lossy, Coding::raw, .01};
    s.mode.coding = static_cast<Coding>(random.below(3));
    if (s.plain) s.mode = {};
    if (s.mode.mode == Mode::lossy) s.upstream = MirrorUpstream::none;
    s.history = std::uint64_t{1} << (12 + random.below(14));
    s.movers = 4 + random.below(12);
    s.logs = !s.plain && s.mode.mode != Mode::lossy && random.chance(600);
    if (random.chance(300)) s.log.rotateBytes = 2000 + random.below(60000);
    if (random.chance(200)) s.log.rotateSeconds = 1 + random.below(20);
    if (random.chance(200)) s.log.keepBytes = 100000;
    s.log.keyframeBytes = 1000 + random.below(100000);
    s.log.keyframeSeconds = random.chance(500) ? .5 : 10;
    s.log.sync = static_cast<LogOptions::Sync>(random.below(3));
    s.log.mode.coding = static_cast<Coding>(random.below(3));
    return s;
}

MirrorSettings Session::drawMirror(Random& random, std::uint32_t number) const {
    using Kind = MirrorSettings::Kind;
    MirrorSettings m;
    m.number = number;
    const auto relay = random.below(static_cast<std::uint32_t>(relays_.size()) + 1);
    m.endpoint = relay == 0 ? Origin::kEndpoint : fmt::format("relay{}", relay);
    m.options.name = fmt::format("M{}", number);
    const std::uint32_t drawn = random.below(14);
    if (shape_.plain) return m;
    m.kind = drawn < 7 ? static_cast<Kind>(drawn) : Kind::whole;
    switch (m.kind) {
        case Kind::part:
            m.options.parts = {fmt::format("MOVER{}", random.below(4))};
            break;
        case Kind::region:
            m.options.parts = {fmt::format("region:MOVER{},{}", random.below(4), 5 + random.below(30))};
            break;
        case Kind::aspects:
            m.options.aspects = {static_cast<Aspect>(random.below(3))};
            break;
        case Kind::inputs:
            m.options.inputs = true;
            break;
        case Kind::latency:
            m.options.latency = std::chrono::milliseconds(50 + random.below(400));
            break;
        default:
            break;
    }
    m.options.whenSlow = static_cast<MirrorWhenSlow>(random.below(4));
    m.options.window = random.chance(500) ? 64 << 10 : 8 << 20;
    if (random.chance(200)) m.options.maxBytesPerSecond = 2000 + random.below(60000);
    if (random.chance(200) && m.kind != Kind::latency) m.options.framesPerSecond = 1 + random.below(20);
    if (random.chance(200)) m.options.maxLag = 0ms;
    m.edits = origin_->settings().upstream != MirrorUpstream::none && random.chance(500);
    m.locks = m.edits && random.chance(300);
    m.undoes = m.edits && random.chance(300);  // it creates nothing, as that would be undone, too
    return m;
}

void Session::say(const std::string& what) const {
    if (trace_) fmt::print("{:9.3f} {:4} {}\n", double(world_.now) / kSecond, step_, what);
}

bool Session::fail(std::string why) {
    if (outcome_.failure.empty()) {
        outcome_.failure = std::move(why);
        outcome_.step = step_;
    }
    return false;
}

void Session::heard(std::span<const std::byte> bytes, bool atListener) {
    if (bytes.size() <= 5) return;
    const auto type = std::to_integer<std::size_t>(bytes[5]);
    world_.note(static_cast<std::uint64_t>(world_.now) ^ type << 56 ^ bytes.size() << 40 ^
                std::uint64_t{atListener} << 63);
    for (std::size_t i = 8; i + 8 <= bytes.size(); i += 8) {
        std::uint64_t word = 0;
        std::memcpy(&word, bytes.data() + i, 8);
        world_.digest = (world_.digest ^ word) * 0x9E3779B97F4A7C15;
    }
    if (type < kMessageTypes) ++outcome_.coverage.messages[type][static_cast<std::size_t>(phase_)];
}

/// Runs what a process does. An allocation that fails ends that process, as an exception that nobody catches would.
template <class F>
bool Session::guarded(F&& work) {
    try {
        return work();
    } catch (const std::bad_alloc&) {
        system_.untilNoMemory = 0;
        return true;
    }
}

bool Session::look(Process& process) {
    if (&process == noMemory_) system_.untilNoMemory = noMemoryAfter_;
    std::string problem;
    (void)guarded([&] {
        if (&process == origin_.get() && origin_->isRunning()) origin_->poll();
        for (const auto& relay : relays_)
            if (relay.get() == &process && relay->isRunning()) problem = relay->poll(*origin_);
        if (auto* mirror = dynamic_cast<Mirror*>(&process); mirror && mirror->isRunning())
            problem = mirror->poll(*origin_);
        if (&process == stranger_.get()) stranger_->poll();
        return true;
    });
    endIfDead();
    if (&process == noMemory_) {
        const bool happened = system_.untilNoMemory == 0;
        system_.untilNoMemory = 0;
        noMemory_ = nullptr;
        if (happened)
            happens({step_, &process == origin_.get() ? FaultKind::killOrigin : FaultKind::killMirror,
                     static_cast<std::uint32_t>(std::ranges::find(processes_, &process) - processes_.begin()), 100});
        if (happened) return true;
    }
    return problem.empty() || fail(problem);
}

/// Lets all that is due until then happen, in the order of its time.
bool Session::goOn(Nanoseconds until) {
    for (;;) {
        Process* next = nullptr;
        for (Process* process : processes_)
            if (process->next() < (next ? next->next() : until)) next = process;
        const Nanoseconds before = world_.now;
        world_.now = std::max(world_.now, next ? next->next() : until);
        for (Process* process : processes_) process->clock.catchUp(before);
        if (!next) return true;
        next->due = kNever;
        if (!look(*next)) return false;
        if (!startLate()) return false;
    }
}

bool Session::startLate() {
    const Nanoseconds now = world_.now;
    if (diskFullUntil_ > 0 && now >= diskFullUntil_) system_.isFull = false, diskFullUntil_ = 0;
    if (noFlushUntil_ > 0 && now >= noFlushUntil_) system_.failsToFlush = false, noFlushUntil_ = 0;
    if (!origin_->isRunning() && now >= origin_->startAt) {
        const std::uint32_t lineage = origin_->lineage;
        if (auto ok = origin_->start(plan_.seed); !ok) return fail(ok.error().text);
        if (origin_->isRunning()) {
            say(fmt::format("the origin runs, in state {}", origin_->scene().sequence()));
            const bool goesOn = lineage == origin_->lineage;
            ledger_.forgetAfter(goesOn ? origin_->resumedAt : 0, goesOn ? lineage : origin_->lineage);
        }
    }
    for (const auto& relay : relays_)
        if (!relay->isRunning() && now >= relay->startAt) relay->start();
    for (const auto& mirror : mirrors_)
        if (!mirror->isRunning() && now >= mirror->startAt) mirror->start();
    return true;
}

void Session::happensToOrigin(const Fault& fault) {
    const Nanoseconds time = fault.amount * kMillisecond;
    origin_->startAt = world_.now + time;
    if (!origin_->isRunning()) return;
    switch (fault.kind) {
        case FaultKind::closeOrigin:
            return origin_->close();
        case FaultKind::losePower:
            return origin_->losePower();
        default:
            return origin_->die(fault.target % 2 != 0);
    }
}

void Session::forMirror(const Fault& fault) {
    Mirror& mirror = *mirrors_[fault.target % mirrors_.size()];
    mirror.startAt = world_.now + fault.amount * kMillisecond;
    if (fault.kind == FaultKind::killMirror)
        mirror.die();
    else
        mirror.leave();
}

void Session::happens(const Fault& fault) {
    const Nanoseconds time = fault.amount * kMillisecond;
    const std::uint32_t target = fault.target;
    Process& process = *processes_[target % processes_.size()];
    const auto kind = static_cast<std::size_t>(fault.kind);
    phase_ = phase();
    ++outcome_.coverage.faults[kind][static_cast<std::size_t>(phase_)];
    ++outcome_.faults;
    say(fmt::format("fault {} {} {}", kFaultNames[kind], target, fault.amount));
    switch (fault.kind) {
        case FaultKind::cut:
            return (void)network_.cut(target);
        case FaultKind::halfOpen:
            return (void)network_.halfOpen(target, time);
        case FaultKind::stall:
            return (void)network_.stall(target, time);
        case FaultKind::throttle:
            return (void)network_.throttle(target, 500 + fault.amount * 20, 2 * kSecond);
        case FaultKind::slow:
            return (void)network_.slow(target, time);
        case FaultKind::refuse:
            return (void)network_.refuse(target, time);
        case FaultKind::killMirror:
        case FaultKind::leaveMirror:
            return forMirror(fault);
        case FaultKind::killRelay:
            if (relays_.empty()) return;
            relays_[target % relays_.size()]->die();
            relays_[target % relays_.size()]->startAt = world_.now + time;
            return;
        case FaultKind::stop:
            process.stoppedUntil = std::max(process.stoppedUntil, world_.now + time);
            return;
        case FaultKind::jump:
            return process.clock.jump(time);
        case FaultKind::drift:
            return process.clock.setDrift(std::int64_t{fault.amount} * (target % 2 ? 100 : -100));
        case FaultKind::killOrigin:
        case FaultKind::closeOrigin:
        case FaultKind::losePower:
            return happensToOrigin(fault);
        case FaultKind::diskFull:
            system_.isFull = true;
            diskFullUntil_ = world_.now + time;
            return;
        case FaultKind::tornWrite:
            system_.tearsNextWrite = origin_->settings().logs;
            return;
        case FaultKind::noFlush:
            system_.failsToFlush = true;
            noFlushUntil_ = world_.now + time;
            return;
        case FaultKind::slowDisk:
            origin_->diskTakes = time % (2 * kSecond);
            return;
        case FaultKind::noMemory:
            noMemory_ = &process;
            noMemoryAfter_ = fault.amount;
            return;
        case FaultKind::meddle:
            return mirrors_[target % mirrors_.size()]->meddle(Random(plan_.seed, 9, step_), origin_->settings().movers);
        case FaultKind::forge:
            return stranger_->send(Random(plan_.seed, 6, step_), fault.amount,
                                   target % 3 == 0 && !relays_.empty() ? "relay1" : Origin::kEndpoint);
    }
}

/// A write that was cut short is the last that its process did.
void Session::endIfDead() {
    if (!system_.isDead) return;
    say("killed in a write");
    origin_->startAt = world_.now + kSecond;
    origin_->die(false);
}

Phase Session::phase() const {
    if (!origin_->isRunning()) return Phase::originDown;
    Phase result = Phase::inStep;
    for (const auto& mirror : mirrors_) {
        if (!mirror->isRunning() || mirror->client().statistics().frames == 0) return Phase::joining;
        if (mirror->client().originLost())
            result = Phase::lost;
        else if (!mirror->client().inStep() && result != Phase::lost)
            result = Phase::behind;
    }
    return result;
}

bool Session::checkAll() {
    if (origin_->isRunning()) {
        if (std::string lost = ledger_.check(origin_->scene(), origin_->lineage); !lost.empty()) return fail(lost);
        if (auto ok = origin_->checkLog(); !ok) return fail(ok.error().text);
    }
    // A window, what is sent at once beyond it, and what a hello costs.
    if (network_.maximumUnread > (std::uint64_t{8} << 20) + (1 << 20))
        return fail(fmt::format("{} bytes of records were on their way by one connection", network_.maximumUnread));
    return true;
}

bool Session::step() {
    ++step_;
    phase_ = phase();
    for (; nextFault_ < plan_.faults.size() && plan_.faults[nextFault_].step <= step_; ++nextFault_)
        happens(plan_.faults[nextFault_]);
    if (!startLate()) return false;
    if (origin_->isRunning() && origin_->stoppedUntil <= world_.now && origin_->clock.ahead() == 0) {
        origin_->frame(Random(plan_.seed, 5, step_), double(world_.now) / kSecond);
        origin_->poll();
        endIfDead();
    }
    for (const auto& mirror : mirrors_)
        if (mirror->settings().edits && mirror->isRunning() && mirror->stoppedUntil <= world_.now)
            if (Random random(plan_.seed, 100 + mirror->settings().number, step_); random.chance(300)) {
                mirror->edit(random, origin_->settings().movers);
                mirror->isDue(mirror->clock.at());
            }
    if (!goOn(world_.now + origin_->settings().interval)) return false;
    return !Random(plan_.seed, 7, step_).chance(30) || checkAll();
}

bool Session::areAllSettled() const {
    return origin_->isRunning() && !origin_->scene().hasUnsealedEdits() &&
           std::ranges::all_of(relays_, [&](const auto& r) { return r->isSettled(*origin_); }) &&
           std::ranges::all_of(mirrors_, [&](const auto& m) { return m->isSettled(*origin_); });
}

std::string Session::unsettled() const {
    if (!origin_->isRunning()) return "the origin does not run: " + origin_->problem;
    std::string text = fmt::format("the origin is in state {}", origin_->served().sequence());
    for (const auto& relay : relays_)
        if (!relay->isSettled(*origin_)) text += "\n  a relay is not in step";
    for (const auto& mirror : mirrors_)
        if (!mirror->isSettled(*origin_)) text += "\n  " + mirror->status();
    for (const Diagnostic& d : origin_->server().takeDiagnostics()) text += "\n    " + d.format();
    return text;
}

/// No more faults: all have to become equal, and each editor's last edit answered.
bool Session::quiet() {
    network_.heal();
    system_.isFull = system_.failsToFlush = system_.tearsNextWrite = false;
    noMemory_ = nullptr;
    for (Process* process : processes_) {
        process->stoppedUntil = 0;
        process->clock.setDrift(0);
    }
    const Nanoseconds end = world_.now + kQuiet;
    std::uint32_t frames = 20;  // in the end the scene rests
    bool isLast = false;
    while (world_.now < end) {
        if (!startLate() || !goOn(world_.now + 500 * kMillisecond)) return false;
        if (origin_->isRunning() && frames > 0) {
            origin_->frame(Random(plan_.seed, 8, frames--), double(world_.now) / kSecond);
            origin_->poll();
        } else if (areAllSettled()) {
            if (std::exchange(isLast, true)) return checkAll();
            // All leases are over, so that everybody may edit every node again.
            for (const auto& mirror : mirrors_)
                if (mirror->settings().edits) mirror->editAll(origin_->settings().movers);
            frames = 4;
        }
    }
    return fail(fmt::format("not all are equal {} s after the last fault: {}", kQuiet / kSecond, unsettled()));
}

Outcome Session::run() {
    try {
        bool good = startLate();
        while (good && step_ < plan_.steps) good = step();
        if (good) good = quiet();
        if (good)
            for (const auto& mirror : mirrors_) world_.note(mirror->scene().hash().low);
    } catch (const std::exception& e) {
        fail(std::string("an exception: ") + e.what());
    }
    outcome_.digest = world_.digest;
    outcome_.events = world_.events;
    outcome_.messages = network_.messages;
    outcome_.frames = origin_->frames;
    outcome_.resumed = origin_->resumed;
    outcome_.seconds = double(world_.now) / kSecond;
    for (const auto& mirror : mirrors_) outcome_.edits += mirror->edits;
    return outcome_;
}

}  // namespace

void Coverage::add(const Coverage& other) {
    for (std::size_t m = 0; m < messages.size(); ++m)
        for (std::size_t p = 0; p < messages[m].size(); ++p) messages[m][p] += other.messages[m][p];
    for (std::size_t f = 0; f < faults.size(); ++f)
        for (std::size_t p = 0; p < faults[f].size(); ++p) faults[f][p] += other.faults[f][p];
}

std::string Coverage::text() const {
    std::size_t seen = 0, all = 0;
    std::string missing;
    const auto count = [&](std::string_view name, const auto& row) {
        if (name.empty()) return;
        for (std::size_t p = 0; p < row.size(); ++p, ++all) {
            seen += row[p] > 0;
            if (row[p] == 0) missing += fmt::format(" {}/{}", name, kPhaseNames[p]);
        }
    };
    for (std::size_t m = 0; m < messages.size(); ++m) count(kMessageNames[m], messages[m]);
    for (std::size_t f = 0; f < faults.size(); ++f) count(kFaultNames[f], faults[f]);
    return fmt::format("{} of {} pairs of a message or a fault and a phase of the session came{}{}", seen, all,
                       missing.empty() ? "" : "; not:", missing);
}

Outcome runSession(const Plan& plan, const std::filesystem::path& folder, const Shape& shape, bool trace) {
    saltTables();
    Session session(plan, folder, shape, trace);
    return session.run();
}

Plan shrink(const Plan& plan, const std::function<bool(const Plan&)>& fails, int runs) {
    Plan best = plan;
    // Leaves out ever smaller runs of faults (delta debugging, Zeller and Hildebrandt 2002).
    for (std::size_t size = std::max<std::size_t>(1, (best.faults.size() + 1) / 2); runs > 0;) {
        bool any = false;
        for (std::size_t at = 0; at < best.faults.size() && runs > 0;) {
            Plan candidate = best;
            const auto from = candidate.faults.begin() + static_cast<std::ptrdiff_t>(at);
            const std::size_t count = std::min(size, candidate.faults.size() - at);
            candidate.faults.erase(from, from + static_cast<std::ptrdiff_t>(count));
            --runs;
            if (fails(candidate)) {
                best = std::move(candidate);
                any = true;
            } else {
                at += size;
            }
        }
        if (size == 1 && !any) break;
        size = std::max<std::size_t>(1, size / 2);
    }
    // The steps behind the last fault may not be needed, nor half of all.
    for (std::uint32_t cut = best.steps / 2; cut > 0 && runs > 0;) {
        Plan candidate = best;
        candidate.steps -= cut;
        --runs;
        const bool isShorter = candidate.steps > 0 &&
                               (best.faults.empty() || best.faults.back().step < candidate.steps) && fails(candidate);
        if (isShorter)
            best = std::move(candidate);
        else
            cut /= 2;
        cut = std::min(cut, best.steps / 2);
    }
    return best;
}

}  // namespace rtsg::simulation
