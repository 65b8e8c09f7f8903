// Hands out tiles of live pictures, and joins what comes back.
#include <rtsg/session/tile_assembler.h>

#include <poll.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstring>
#include <utility>

#include <fmt/format.h>

namespace rtsg {

namespace {

constexpr std::size_t kInWork = 3;           // pictures at a time
constexpr int kAsked = 2;                    // tiles that a mirror owes: one is drawn while the other is on its way
constexpr std::uint64_t kLagging = 25;       // pictures: who is farther behind is not waited for
constexpr double kLate = 10, kMinLate = .5;  // times what tiles usually take, and seconds

double passedSince(TileAssembler::Clock::time_point start) {
    return std::chrono::duration<double>(TileAssembler::Clock::now() - start).count();
}

}  // namespace

std::optional<TileAssembler::Joined> TileAssembler::poll(std::chrono::milliseconds maximum) {
    std::vector<pollfd> items{{door_.descriptor(), POLLIN, 0}};
    for (const Mirror& mirror : mirrors_)
        items.push_back(
            {mirror.link.descriptor(), static_cast<short>(POLLIN | (mirror.link.waitsToSend() ? POLLOUT : 0)), 0});
    const bool whole = !work_.empty() && work_.front().left == 0;
    const auto rest = std::chrono::ceil<std::chrono::milliseconds>(lateAt_ - Clock::now());
    const auto wait = whole ? std::chrono::milliseconds(0) : std::clamp(rest, std::chrono::milliseconds(0), maximum);
    (void)::poll(items.data(), items.size(), static_cast<int>(wait.count()));
    while (auto link = door_.accept()) mirrors_.emplace_back(std::move(*link)).order = ++came_;
    for (auto it = mirrors_.begin(); it != mirrors_.end();) {
        hear(*it);
        if (it->link.over().empty()) {
            ++it;
            continue;
        }
        forget(*it);
        it = mirrors_.erase(it);
    }
    counts_.mirrors = static_cast<std::size_t>(std::ranges::count_if(mirrors_, &Mirror::known));
    counts_.maxMirrors = std::max(counts_.maxMirrors, counts_.mirrors);
    giveUp();
    while (begin()) {
    }
    ask();
    if (work_.empty() || work_.front().left > 0) return std::nullopt;
    Joined joined = std::move(work_.front().joined);
    work_.pop_front();
    ++counts_.pictures;
    return joined;
}

void TileAssembler::hear(Mirror& mirror) {
    mirror.link.flush();
    mirror.link.read();
    while (const auto message = mirror.link.receive()) take(mirror, *message);
}

void TileAssembler::refuse(Mirror& mirror, const std::string& why) {
    problems_.push_back(why);
    mirror.link.send("refused " + why);
}

void TileAssembler::take(Mirror& mirror, const TileLink::Message& message) {
    const std::string& what = message.words[0];
    if (what == "hello") return greet(mirror, message);
    if (!mirror.known) return;
    if (what == "have") {
        const std::uint64_t have = message.number(1);
        // A scene that begins anew, as a log that is played again.
        const bool again = have < mirror.have;
        if (again) mirror.lost.clear(), states_.clear(), last_ = std::min(last_, have), anew_ = true;
        counts_.newest = again ? have : std::max(counts_.newest, have);
        mirror.have = have;
        mirror.since = message.number(2);
        compareStates(mirror, message);
    } else if (what == "gone") {
        mirror.asked = std::max(mirror.asked - 1, 0);
        mirror.lost.insert(message.number(1));
        for (Work& work : work_)
            for (Tile& tile : work.tiles)
                if (work.number == message.number(1)) std::erase(tile.of, &mirror);
    } else if (what == "tile") {
        takeTile(mirror, message);
    }
}

/// A mirror of another session draws pictures of other states: of two the one that came later is refused.
void TileAssembler::compareStates(Mirror& mirror, const TileLink::Message& have) {
    constexpr std::size_t kWords = 5, kKept = 256;
    if (have.words.size() != kWords) return;
    const std::uint64_t number = have.number(1);
    const std::string state = have.words[3] + " " + have.words[4];
    if (states_.size() == kKept) states_.erase(states_.begin());
    const auto [said, fresh] = states_.try_emplace(number, Said{state, mirror.order});
    if (fresh || said->second.state == state) return;
    const auto other = std::ranges::find(mirrors_, said->second.order, &Mirror::order);
    const bool otherGoes = other != mirrors_.end() && other->order > mirror.order;
    const std::string theirs = otherGoes ? std::exchange(said->second.state, state) : state;
    const std::string kept = said->second.state;
    if (otherGoes) said->second.order = mirror.order;
    Mirror& goes = otherGoes ? *other : mirror;
    goes.known = false;
    forget(goes);
    refuse(goes, fmt::format("a mirror of another session: picture {} shows its state {}, and state {} of the others",
                             number, theirs, kept));
}

void TileAssembler::greet(Mirror& mirror, const TileLink::Message& hello) {
    if (hello.number(1) != 1)
        return refuse(mirror, fmt::format("tiles are joined by version 1 of their protocol, and this mirror speaks {}",
                                          hello.words.size() > 1 ? hello.words[1] : "none"));
    if (hello.words.size() != 6) return refuse(mirror, "a hello that makes no sense");
    const auto side = [&](std::size_t word) {
        return static_cast<int>(std::min<std::uint64_t>(hello.number(word), 1 << 16));
    };
    double rate = 0;
    std::from_chars(hello.words[4].data(), hello.words[4].data() + hello.words[4].size(), rate);
    const std::string looks = hello.words[5];
    if (looks_.empty()) {
        if (PictureTile{0, 0, columns_, rows_}.in(side(2), side(3)).empty() || !(rate > 0))
            return refuse(mirror, fmt::format("pictures of {} x {} pixels cannot be divided into {} x {} tiles",
                                              side(2), side(3), columns_, rows_));
        width_ = side(2), height_ = side(3), picturesPerSecond_ = rate, looks_ = looks;
    }
    if (side(2) != width_ || side(3) != height_ || rate != picturesPerSecond_ || looks != looks_)
        return refuse(mirror, fmt::format("a mirror with other options for pictures: {} x {}, {} a second, {}; others "
                                          "have {} x {}, {} a second, {}",
                                          side(2), side(3), rate, looks, width_, height_, picturesPerSecond_, looks_));
    mirror.known = true;
}

void TileAssembler::takeTile(Mirror& mirror, const TileLink::Message& message) {
    mirror.asked = std::max(mirror.asked - 1, 0);
    const auto work = std::ranges::find(work_, message.number(1), &Work::number);
    if (work == work_.end() || message.words.size() != 8) return;
    const auto tile = std::ranges::find_if(work->tiles, [&](const Tile& one) {
        return message.number(2) == static_cast<std::uint64_t>(one.area.x) &&
               message.number(3) == static_cast<std::uint64_t>(one.area.y);
    });
    if (tile == work->tiles.end() || tile->done) return;  // another one was quicker
    const PixelRegion& region = tile->region;
    if (message.bytes.size() !=
        std::size_t{4} * static_cast<std::size_t>(region.width) * static_cast<std::size_t>(region.height))
        return refuse(mirror, "a tile of another size than was asked for");
    if (work->hash.empty()) {
        work->hash = message.words[5], work->joined.sequence = message.number(4);
        std::from_chars(message.words[6].data(), message.words[6].data() + message.words[6].size(), work->joined.time);
    }
    if (message.words[5] != work->hash || message.number(4) != work->joined.sequence) {
        std::erase(tile->of, &mirror);
        mirror.lost.insert(work->number);
        return refuse(mirror, fmt::format("a tile of state {} {}, and the picture's others are of state {} {}",
                                          message.words[4], message.words[5], work->joined.sequence, work->hash));
    }
    for (int y = 0; y < region.height; ++y)
        std::memcpy(work->joined.pixels.data() +
                        4 * (static_cast<std::size_t>(region.top + y) * static_cast<std::size_t>(width_) +
                             static_cast<std::size_t>(region.left)),
                    message.bytes.data() +
                        std::size_t{4} * static_cast<std::size_t>(y) * static_cast<std::size_t>(region.width),
                    std::size_t{4} * static_cast<std::size_t>(region.width));
    tile->done = true;
    const double took = passedSince(tile->since);
    usual_ = usual_ > 0 ? usual_ + .1 * (took - usual_) : took;
    ++counts_.tiles, counts_.bytes += message.bytes.size();
    if (--work->left == 0) work->joined.seconds = passedSince(work->begun);
}

/// What a mirror owes goes to others.
void TileAssembler::forget(const Mirror& mirror) {
    for (Work& work : work_)
        for (Tile& tile : work.tiles)
            if (std::erase(tile.of, &mirror) > 0 && !tile.done) ++counts_.again;
}

/// Begins the newest picture whose state all have, unless enough are in work.
bool TileAssembler::begin() {
    if (work_.size() >= kInWork) return false;
    const bool waiting = std::ranges::any_of(work_, [](const Work& work) {
        return std::ranges::any_of(work.tiles, [](const Tile& tile) { return !tile.done && tile.of.empty(); });
    });
    if (waiting) return false;
    std::uint64_t newest = 0, since = 0, all = UINT64_MAX;
    for (const Mirror& mirror : mirrors_)
        if (mirror.known) newest = std::max(newest, mirror.have), since = std::max(since, mirror.since);
    for (const Mirror& mirror : mirrors_)
        if (mirror.known && mirror.have + kLagging >= newest) all = std::min(all, mirror.have);
    if (newest == 0 || all == UINT64_MAX || all <= last_) return false;
    if (last_ >= since && !anew_) return false;
    anew_ = false;
    Work work;
    work.number = work.joined.number = last_ = all;
    work.begun = Clock::now();
    for (int y = 0; y < rows_; ++y)
        for (int x = 0; x < columns_; ++x) {
            const PictureTile area{x, y, columns_, rows_};
            work.tiles.push_back({area, area.in(width_, height_), false, {}, {}});
        }
    work.left = work.tiles.size();
    work.joined.width = width_, work.joined.height = height_;
    work.joined.pixels.resize(std::size_t{4} * static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
    work_.push_back(std::move(work));
    return true;
}

/// The tile that a mirror is to draw next: one that nobody has been asked for, or one that is late.
TileAssembler::Tile* TileAssembler::next(const Mirror& mirror, std::uint64_t& number) {
    for (const bool late : {false, true})
        for (Work& work : work_) {
            if (mirror.have < work.number || mirror.lost.contains(work.number)) continue;
            number = work.number;
            for (Tile& tile : work.tiles) {
                if (tile.done || std::ranges::find(tile.of, &mirror) != tile.of.end()) continue;
                if (!late && tile.of.empty()) return &tile;
                if (!late || tile.of.empty() || &work != &work_.front()) continue;
                if (Clock::now() >= tile.since + patience()) return &tile;
                lateAt_ = std::min(lateAt_, tile.since + patience());
            }
        }
    return nullptr;
}

TileAssembler::Clock::duration TileAssembler::patience() const {
    const std::chrono::duration<double> seconds(std::max(kMinLate, kLate * usual_));
    return std::chrono::duration_cast<Clock::duration>(seconds);
}

void TileAssembler::ask() {
    lateAt_ = Clock::time_point::max();
    for (int owed = 0; owed < kAsked; ++owed)
        for (Mirror& mirror : mirrors_) {
            if (!mirror.known || mirror.asked > owed) continue;
            std::uint64_t number = 0;
            Tile* tile = next(mirror, number);
            if (!tile) continue;
            if (!tile->of.empty()) ++counts_.again;
            tile->of.push_back(&mirror);
            tile->since = Clock::now();
            ++mirror.asked;
            mirror.link.send(fmt::format("draw {} {} {} {} {}", number, tile->area.x, tile->area.y, columns_, rows_));
        }
}

/// Drops pictures whose states all mirrors have left behind.
void TileAssembler::giveUp() {
    std::erase_if(work_, [&](const Work& work) {
        const bool possible = work.left == 0 || std::ranges::any_of(mirrors_, [&](const Mirror& mirror) {
                                  return mirror.known && !mirror.lost.contains(work.number);
                              });
        if (!possible) ++counts_.given, anew_ = true;
        return !possible;
    });
}

}  // namespace rtsg
