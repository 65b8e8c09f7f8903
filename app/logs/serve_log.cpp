// Plays a log to mirrors in real time, and carries out commands.
#include "serve_log.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <iterator>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <rtsg/core/terminal.h>
#include <rtsg/sync/log_player.h>

#include "nats.h"
#include "say.h"

namespace rtsg::app {

namespace {

using Clock = std::chrono::steady_clock;

/// The shortest wait for the next state, and the longest one for that, what mirrors send and lines of standard input.
constexpr std::chrono::milliseconds kShortestRest{2}, kLongestRest{2000};

/// Reads whole lines of standard input as they come, without waiting.
class Lines {
  public:
    std::vector<std::string> take() {
        std::vector<std::string> lines;
        pollfd in{STDIN_FILENO, POLLIN, 0};
        char buffer[4096];
        while (!ended_ && ::poll(&in, 1, 0) > 0) {
            const ssize_t count = ::read(STDIN_FILENO, buffer, sizeof(buffer));
            if (count <= 0) {
                ended_ = true;
                break;
            }
            text_.append(buffer, static_cast<std::size_t>(count));
            if (text_.size() > kLongestLine) text_.clear();  // no command is that long
        }
        for (std::size_t end; (end = text_.find('\n')) != std::string::npos; text_.erase(0, end + 1))
            lines.push_back(text_.substr(0, end));
        // The last line may lack its line end.
        if (ended_ && !text_.empty()) lines.push_back(std::exchange(text_, {}));
        return lines;
    }

    /// What is readable when lines may have come; -1: none will.
    int descriptor() const { return ended_ ? -1 : STDIN_FILENO; }

  private:
    static constexpr std::size_t kLongestLine = 1 << 16;
    std::string text_;
    bool ended_ = false;
};

class Playing {
  public:
    Playing(LogPlayer& player, MirrorServer& server, bool json) : player_(player), server_(server), json_(json) {
        server.onControl([this](std::string_view text) { return obey(text); });
    }

    void run(double seconds, bool control, const std::function<void()>& service) {
        Lines lines;
        const auto start = Clock::now();
        auto last = start;
        while (!interrupted() && std::chrono::duration<double>(Clock::now() - start).count() < seconds) {
            if (control)
                for (const std::string& line : lines.take()) {
                    fmt::print("{}\n", terminalText(obey(line)));
                    std::fflush(stdout);
                }
            server_.service();
            service();
            const auto now = Clock::now();
            if (auto ok = player_.advance(std::chrono::duration<double>(now - last).count()); !ok && !lacks_)
                reportOfLack(ok.error());
            reportOfLacks();
            last = now;
            for (const Diagnostic& d : server_.takeDiagnostics()) say(d);
            const double left = seconds - std::chrono::duration<double>(now - start).count();
            wait(std::min(player_.dueIn(), left), control ? lines.descriptor() : -1);
        }
        played_ = std::chrono::duration<double>(Clock::now() - start).count();
    }
    /// Seconds of real time.
    double played() const { return played_; }
    /// True if some of the log could not be played.
    bool lacks() const { return lacks_; }
    void print() const {
        const MirrorServerStatistics statistics = server_.statistics();
        if (json_)
            fmt::print("{{\"player\":{},\"peers\":{},\"bytes\":{},\"commands\":{},\"hash\":\"{}\"}}\n",
                       player_.status(), statistics.peers, statistics.bytes, commands_, player_.scene().hash().hex());
        else
            fmt::print("at {:.3f} of {:.3f} s, state {}; {} commands, {} bytes to mirrors\n", player_.time(),
                       player_.length(), player_.scene().sequence(), commands_, statistics.bytes);
    }

  private:
    /// Until the next state, or until mirrors or lines ask for something.
    void wait(double seconds, int lines) const {
        const std::chrono::duration<double> shortest = kShortestRest, longest = kLongestRest;
        const auto maximum = std::clamp(std::chrono::duration<double>(seconds), shortest, longest);
        pollfd items[] = {{server_.callDescriptor(), POLLIN, 0}, {lines, POLLIN, 0}};
        (void)::poll(items, std::size(items),
                     static_cast<int>(std::chrono::ceil<std::chrono::milliseconds>(maximum).count()));
    }
    void reportOfLack(const Diagnostic& what) {
        say(what);
        lacks_ = true;
    }
    /// Reports each damaged place once, even if the log loops; of missing frames only the first.
    void reportOfLacks() {
        const Replayer& replayer = player_.replayer();
        const std::string file = replayer.log().file().string();
        const std::vector<LogDamage>& damage = replayer.log().damage();
        for (; damageReported_ < damage.size(); ++damageReported_) {
            const LogDamage& d = damage[damageReported_];
            reportOfLack(
                fail(fmt::format("bytes {} to {} are damaged: {}", d.offset, d.offset + d.length, d.text), {}, file)
                    .error());
        }
        if (replayer.gaps() > 0 && !std::exchange(gapsReported_, true))
            reportOfLack(fail("frames are missing: rtsg replay --verify names them", {}, file).error());
    }
    std::string obey(std::string_view text) {
        ++commands_;
        const auto status = player_.command(text);
        return status ? *status : "refused: " + status.error().text;
    }

    LogPlayer& player_;
    MirrorServer& server_;
    std::uint64_t commands_ = 0;
    std::size_t damageReported_ = 0;
    double played_ = 0;
    bool json_, gapsReported_ = false, lacks_ = false;
};

}  // namespace

void ServeLogArguments::addTo(Command& command) {
    const Command::Section section(command, "Of a log");
    command.addOption("--rate", rate, "seconds of the log a second")->preset()->range(1e-3, 1000.0);
    command.addFlag("--loop", loop, "start again at its end");
    command.addFlag("--paused", paused, "begin in the first state and wait for commands");
    command.addFlag("--control", control,
                    "commands as lines of standard input: pause, play, step [N], rate R, seek T, loop on|off, status; "
                    "mirrors that may send events can give them, too");
}

int serveLog(const ServedLog& log, const MirrorServerOptions& options) {
    auto player = LogPlayer::open(log.file);
    if (!player) return printError(player.error()), kBad;
    (*player)->setRate(log.arguments.rate);
    (*player)->setLoop(log.arguments.loop);
    (*player)->pause(log.arguments.paused);
    auto server = MirrorServer::start((*player)->scene(), log.endpoint, options);
    if (!server) return printError(namingOptions(server.error(), "--key", options.keys ? "given" : "")), kBad;
    auto web = Web::start(log.web, **server, options.keys);
    if (!web) return printError(web.error()), kBad;
    auto published = Published::start(log.nats, **server, options.keys);
    if (!published) return printError(published.error()), kBad;
    const FollowedFetches fetches((*player)->scene(), log.resources);
    (void)interrupted();  // from here on an interruption ends the program in order
    sayEndpoint(fmt::format("playing {} at", log.shown), **server, *web, log.json, published->address());
    Playing playing(**player, **server, log.json);
    playing.run(log.seconds, log.arguments.control, [&] {
        web->service((*player)->scene(), log.resources);
        published->printNews();
    });
    const auto grace = std::chrono::milliseconds(static_cast<std::int64_t>(1000 * log.linger));
    if (!interrupted() && !(*server)->drain(grace)) say("not all mirrors have caught up", Severity::warning);
    playing.print();
    server->reset();
    const bool cut = std::isfinite(log.seconds) && interrupted() && playing.played() < log.seconds;
    if (cut) printError(fmt::format("interrupted at {:.1f} of {} s", playing.played(), log.seconds));
    return playing.lacks() || cut ? kBad : kDone;
}

}  // namespace rtsg::app
