// Plays a log in time and carries out a player's commands.
#include <rtsg/sync/log_player.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace rtsg {

namespace {

constexpr double kFastest = 1000;
constexpr auto kLongestStep = std::chrono::milliseconds(250);

/// Parses a number that may end with "s" for seconds.
std::optional<double> numberIn(std::string_view text) {
    double value = 0;
    if (text.ends_with('s')) text.remove_suffix(1);
    const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (problem != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
    return value;
}

}  // namespace

Result<std::unique_ptr<LogPlayer>> LogPlayer::open(const std::filesystem::path& file) {
    auto replayer = Replayer::open(file);
    if (!replayer) return std::unexpected(replayer.error());
    std::unique_ptr<LogPlayer> player(new LogPlayer(std::move(*replayer)));
    Replayer& log = *player->replayer_;
    // The last state tells the log's length.
    if (auto ok = log.seek(std::numeric_limits<double>::infinity()); !ok) return std::unexpected(ok.error());
    player->start_ = log.keyframes().front().time;
    player->length_ = std::max(log.time() - player->start_, 0.0);
    if (auto ok = player->seek(0); !ok) return std::unexpected(ok.error());
    return player;
}

Result<bool> LogPlayer::one() {
    const Result<bool> more = replayer_->step();
    if (more) ended_ = !*more;
    return more;
}

double LogPlayer::timeOf(double next) {
    return reached() + std::max(next - scene().now(), 0.0);
}

Result<> LogPlayer::advance(double seconds) {
    if (paused_) return {};
    if (ended_ && loop_)
        if (auto ok = seek(0); !ok) return ok;
    const double until = clock_ + std::max(seconds, 0.0) * rate_;
    const auto began = std::chrono::steady_clock::now();
    while (!ended_) {
        const std::optional<double> next = replayer_->nextTime();
        if (!next) {
            ended_ = true;
            break;
        }
        if (timeOf(*next) > until) break;
        if (const Result<bool> more = one(); !more) return std::unexpected(more.error());
        if (std::chrono::steady_clock::now() - began > kLongestStep) {
            clock_ = std::max(clock_, reached());
            return {};
        }
    }
    clock_ = ended_ ? length_ : until;
    return {};
}

double LogPlayer::dueIn() {
    if (paused_ || ended()) return std::numeric_limits<double>::infinity();
    const std::optional<double> next = ended_ ? std::nullopt : replayer_->nextTime();
    return next ? std::max(0.0, (timeOf(*next) - clock_) / rate_) : 0;
}

Result<> LogPlayer::seek(double time) {
    clock_ = std::clamp(time, 0.0, length_);
    ended_ = false;
    return replayer_->seek(start_ + clock_);
}

Result<> LogPlayer::step(std::uint64_t states) {
    paused_ = true;
    for (std::uint64_t i = 0; i < states && !ended_; ++i)
        if (const Result<bool> more = one(); !more) return std::unexpected(more.error());
    clock_ = std::clamp(reached(), 0.0, length_);
    return {};
}

std::string LogPlayer::status() const {
    return fmt::format("{{\"t\":{:.6f},\"length\":{:.6f},\"state\":{},\"paused\":{},\"rate\":{},\"loop\":{}}}", clock_,
                       length_, replayer_->scene().sequence(), paused_, rate_, loop_);
}

Result<std::string> LogPlayer::command(std::string_view text) {
    const std::size_t space = text.find(' ');
    const std::string_view verb = text.substr(0, space);
    const std::string_view argument = space == std::string_view::npos ? std::string_view() : text.substr(space + 1);
    const std::optional<double> number = numberIn(argument);
    const auto understood = [&]() -> Result<bool> {
        if (argument.empty() && (verb == "pause" || verb == "play")) {
            pause(verb == "pause");
        } else if (verb == "step" && (argument.empty() || (number && *number >= 1 && *number <= 1e6))) {
            if (auto ok = step(argument.empty() ? 1 : static_cast<std::uint64_t>(*number)); !ok)
                return std::unexpected(ok.error());
        } else if (verb == "rate" && number && *number > 0 && *number <= kFastest) {
            setRate(*number);
        } else if (verb == "seek" && number && *number >= 0) {
            if (auto ok = seek(*number); !ok) return std::unexpected(ok.error());
        } else if (verb == "loop" && (argument == "on" || argument == "off")) {
            setLoop(argument == "on");
        } else {
            return verb == "status" && argument.empty();
        }
        return true;
    }();
    if (!understood) return std::unexpected(understood.error());
    if (!*understood)
        return fail(
            "not understood; there are: pause, play, step [N], rate R (up to 1000), seek T, loop on|off, status");
    return status();
}

}  // namespace rtsg
