// Opens feeds, publishers and servers for viewers, prints faults of lines, and counts.
#include "feeds.h"

#include <algorithm>
#include <filesystem>
#include <limits>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>

#include "cli.h"
#include "say.h"

namespace rtsg::app {

namespace {

bool isOfUser(const std::string& source) {
    return !source.contains("://");
}

/// Both names lead to one file that is no pipe or device.
bool isSameFile(const std::string& one, const std::string& other) {
    std::error_code ignored;
    return std::filesystem::is_regular_file(one, ignored) && std::filesystem::equivalent(one, other, ignored);
}

}  // namespace

void FeedArguments::addTo(Command& command) {
    const Command::Section section(command, "Feeds");
    command
        .addOption("--feed", feeds,
                   "events from outside, lines of JSON or CSV: -, FILE, udp://HOST:PORT, tcp://HOST:PORT, "
                   "mqtt://HOST/TOPIC (repeatable)")
        ->repeatable();
    command
        .addOption("--publish", targets,
                   "events of --fields as lines: -, FILE, udp://HOST:PORT, tcp://HOST:PORT (it listens there), "
                   "mqtt://HOST/TOPIC (repeatable)")
        ->repeatable();
    command.addOption("--fields", fields, "for --publish and --foxglove: DEF.field or DEF.*, separated by commas")
        ->repeatable();
    command.addOption("--publish-rate", rate, "lines of each field a second at most; 0: every event")
        ->preset()
        ->range(0., 1e6);
    foxglove.addTo(command);
}

void FeedArguments::check(const std::string& scene, bool timed) const {
    if (targets.empty() && !foxglove.wanted() && !fields.empty())
        throw UsageError("--fields", "only together with --publish or --foxglove");
    if (targets.empty() && rate > 0) throw UsageError("--publish-rate", "only together with --publish");
    if (!targets.empty() && fieldsIn(fields).empty())
        throw UsageError("--publish", "needs --fields: DEF.field or DEF.*, separated by commas");
    if (std::ranges::count(feeds, "-") + (scene == "-" ? 1 : 0) > 1)
        throw UsageError("--feed", "standard input can be used only once");
    for (const std::string& target : targets)
        for (const std::string& feed : feeds)
            if (isSameFile(target, feed)) throw UsageError("--publish", target + " is what --feed reads");
    for (const std::string& feed : feeds)
        if (timed && !isOfUser(feed))
            throw UsageError("--feed",
                             feed + ": simulated time waits for a pipe or a file; rtsg serve runs in real time");
}

Result<Feeds> Feeds::start(const FeedArguments& arguments, WorldOnDemand& world, const Settings& settings) {
    Feeds all;
    Scene& scene = world.scene();
    for (const std::string& source : arguments.feeds) {
        FeedOptions options;
        options.source = source;
        options.insecure = settings.insecure;
        options.timed = settings.timed;
        options.call = settings.call;
        options.cancelled = interrupted;
        auto feed = Feed::start(scene, std::move(options));
        if (!feed) return fail(feed.error().code, "--feed " + feed.error().text);
        all.feeds_.push_back(std::move(*feed));
    }
    for (const std::string& target : arguments.targets) {
        PublishOptions options;
        options.target = target;
        options.fields = fieldsIn(arguments.fields);
        options.rate = arguments.rate;
        options.start = settings.start;
        options.insecure = settings.insecure;
        options.waits = settings.timed;
        auto publisher = Publisher::start(scene, std::move(options));
        if (!publisher) return fail(publisher.error().code, "--publish " + publisher.error().text);
        all.publishers_.push_back(std::move(*publisher));
    }
    auto foxglove = Foxglove::start(arguments.foxglove.listen, arguments.fields, world,
                                    {settings.insecure, settings.call}, programContext());
    if (!foxglove) return std::unexpected(foxglove.error());
    all.foxglove_ = std::move(*foxglove);
    return all;
}

void Feeds::before(double t) {
    for (const auto& feed : feeds_) feed->deliver(t);
    for (const auto& publisher : publishers_) publisher->expect(t);
    foxglove_.before();
}

void Feeds::after(double t) {
    for (const auto& publisher : publishers_) publisher->frame(t);
    foxglove_.after();
    printNews();
}

double Feeds::nextAt() const {
    double next = std::numeric_limits<double>::infinity();
    for (const auto& feed : feeds_) next = std::min(next, feed->nextAt());
    for (const auto& publisher : publishers_) next = std::min(next, publisher->nextAt());
    return next;
}

void Feeds::printNews() {
    const auto print = [](const std::vector<Diagnostic>& news) {
        for (const Diagnostic& d : news) say(d);
    };
    for (const auto& feed : feeds_) print(feed->takeDiagnostics());
    for (const auto& publisher : publishers_) print(publisher->takeDiagnostics());
}

std::string Feeds::sayEndpoints() const {
    std::string from, to;
    for (const auto& feed : feeds_) {
        say("events from " + feed->source());
        from += (from.empty() ? ",\"feeds\":[" : ",") + jsonString(feed->source());
    }
    for (const auto& publisher : publishers_) {
        say("events to " + publisher->target());
        to += (to.empty() ? ",\"published\":[" : ",") + jsonString(publisher->target());
    }
    const std::string viewers = foxglove_.address();
    return from + (from.empty() ? "" : "]") + to + (to.empty() ? "" : "]") +
           (viewers.empty() ? "" : ",\"foxglove\":" + jsonString(viewers));
}

void Feeds::end() {
    for (const auto& publisher : publishers_) publisher->close();
    printNews();
    for (const auto& feed : feeds_) {
        const FeedCounts counts = feed->counts();
        if (feed->hasLeft()) say(feed->source() + ": note: it has more lines after the end");
        if (counts.broken && isOfUser(feed->source())) noteLeftOut();
        if (counts.faulty + counts.flooded == 0) continue;
        say(fmt::format("{}: {} of {} lines were invalid or refused, {} left out", feed->source(), counts.faulty,
                        counts.lines, counts.flooded),
            Severity::warning);
        if (isOfUser(feed->source())) noteLeftOut();
    }
    for (const auto& publisher : publishers_) {
        const std::uint64_t missed = publisher->counts().missed;
        if (missed == 0) continue;
        say(fmt::format("{}: {} lines were missed", publisher->target(), missed), Severity::warning);
        if (isOfUser(publisher->target())) noteLeftOut();
    }
    if (foxglove_.address().empty()) return;
    const FoxgloveCounts counts = foxglove_.counts();
    viewers_ = fmt::format(",\"foxglove\":{{\"messages\":{},\"missed\":{},\"garbage\":{},\"refused\":{}}}",
                           counts.messages, counts.missed, counts.garbage, counts.refused);
    if (auto ok = foxglove_.end(); !ok) {
        say(ok.error());
        noteLeftOut();
    }
}

std::vector<EndpointCounts> Feeds::counts() const {
    std::vector<EndpointCounts> all;
    for (const auto& feed : feeds_) {
        const FeedCounts c = feed->counts();
        all.push_back({feed->source(),
                       {{"lines", c.lines},
                        {"events", c.events},
                        {"merged", c.merged},
                        {"faulty", c.faulty},
                        {"flooded", c.flooded}}});
    }
    for (const auto& publisher : publishers_) {
        const PublishCounts c = publisher->counts();
        all.push_back({publisher->target(), {{"events", c.events}, {"lines", c.lines}, {"missed", c.missed}}});
    }
    if (const std::string at = foxglove_.address(); !at.empty()) {
        const FoxgloveCounts c = foxglove_.counts();
        all.push_back({at, {{"lines", c.messages}, {"missed", c.missed}}});
    }
    return all;
}

std::string Feeds::json() const {
    std::string text;
    std::size_t index = 0;
    for (const EndpointCounts& one : counts()) {
        const bool isFeed = index < feeds_.size();
        const bool isFirst = index == 0 || index == feeds_.size();
        if (isFirst) text += isFeed ? ",\"feeds\":[" : ",\"published\":[";
        text +=
            fmt::format("{}{{\"{}\":{}", isFirst ? "" : ",", isFeed ? "source" : "target", jsonString(one.endpoint));
        for (const auto& [name, value] : one.counts) text += fmt::format(",\"{}\":{}", name, value);
        text += '}';
        ++index;
        if (index == feeds_.size() || index == feeds_.size() + publishers_.size()) text += ']';
    }
    return text + viewers_;
}

}  // namespace rtsg::app
