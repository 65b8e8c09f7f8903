// Opens feeds and publishers, prints what was wrong with lines, and counts.
#include "feeds.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/terminal.h>

#include "cli.h"

namespace rtsg::app {

namespace {

bool isOfUser(const std::string& source) {
    return !source.contains("://");
}

/// "DOOR.rotation,BOX.*" as its parts.
std::vector<std::string> partsOf(const std::vector<std::string>& texts) {
    std::vector<std::string> parts;
    for (const std::string& text : texts)
        for (std::size_t from = 0; from <= text.size();) {
            const std::size_t comma = std::min(text.find(',', from), text.size());
            if (comma > from) parts.push_back(text.substr(from, comma - from));
            from = comma + 1;
        }
    return parts;
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
                   "lines of what --fields send: -, FILE, udp://HOST:PORT, tcp://HOST:PORT for who connects, "
                   "mqtt://HOST/TOPIC (repeatable)")
        ->repeatable();
    command.addOption("--fields", fields, "of --publish: DEF.field or DEF.*, by commas")->repeatable();
    command.addOption("--publish-rate", rate, "lines of each field a second at most; 0: every event")
        ->preset()
        ->range(0., 1e6);
}

void FeedArguments::check(const std::string& scene, bool timed) const {
    if (targets.empty() && !fields.empty()) throw UsageError("--fields", "only together with --publish");
    if (targets.empty() && rate > 0) throw UsageError("--publish-rate", "only together with --publish");
    if (!targets.empty() && partsOf(fields).empty())
        throw UsageError("--publish", "needs --fields, which say what: DEF.field or DEF.*, by commas");
    if (std::ranges::count(feeds, "-") + (scene == "-" ? 1 : 0) > 1)
        throw UsageError("--feed", "there is one standard input");
    for (const std::string& feed : feeds)
        if (timed && !isOfUser(feed))
            throw UsageError("--feed",
                             feed + ": simulated time waits for a pipe or a file; rtsg serve runs in real time");
}

Result<Feeds> Feeds::start(const FeedArguments& arguments, Scene& scene, const Settings& settings) {
    Feeds all;
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
        options.fields = partsOf(arguments.fields);
        options.rate = arguments.rate;
        options.start = settings.start;
        options.insecure = settings.insecure;
        auto publisher = Publisher::start(scene, std::move(options));
        if (!publisher) return fail(publisher.error().code, "--publish " + publisher.error().text);
        all.publishers_.push_back(std::move(*publisher));
    }
    return all;
}

void Feeds::before(double t) {
    for (const auto& feed : feeds_) feed->deliver(t);
}

void Feeds::after(double t) {
    for (const auto& publisher : publishers_) publisher->frame(t);
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
        for (const Diagnostic& d : news) fmt::print(stderr, "{}\n", terminalText(d.format()));
    };
    for (const auto& feed : feeds_) print(feed->takeDiagnostics());
    for (const auto& publisher : publishers_) print(publisher->takeDiagnostics());
}

std::string Feeds::sayPlaces() const {
    std::string from, to;
    for (const auto& feed : feeds_) {
        fmt::print(stderr, "events from {}\n", terminalText(feed->source()));
        from += (from.empty() ? ",\"feeds\":[" : ",") + jsonString(feed->source());
    }
    for (const auto& publisher : publishers_) {
        fmt::print(stderr, "events to {}\n", terminalText(publisher->target()));
        to += (to.empty() ? ",\"published\":[" : ",") + jsonString(publisher->target());
    }
    return from + (from.empty() ? "" : "]") + to + (to.empty() ? "" : "]");
}

void Feeds::end() {
    printNews();
    for (const auto& feed : feeds_) {
        const FeedCounts counts = feed->counts();
        if (feed->hasLeft())
            fmt::print(stderr, "{}: note: its lines go on after the end\n", terminalText(feed->source()));
        if (counts.faulty + counts.flooded == 0) continue;
        fmt::print(stderr, "{}: {} of {} lines made no sense or were refused, {} left out\n",
                   terminalText(feed->source()), counts.faulty, counts.lines, counts.flooded);
        if (isOfUser(feed->source())) noteLeftOut();
    }
    for (const auto& publisher : publishers_)
        if (const std::uint64_t missed = publisher->counts().missed)
            fmt::print(stderr, "{}: {} lines were missed\n", terminalText(publisher->target()), missed);
}

std::string Feeds::json() const {
    std::string text;
    for (const auto& feed : feeds_) {
        const FeedCounts c = feed->counts();
        text += fmt::format("{}{{\"source\":{},\"lines\":{},\"events\":{},\"merged\":{},\"faulty\":{},\"flooded\":{}}}",
                            text.empty() ? ",\"feeds\":[" : ",", jsonString(feed->source()), c.lines, c.events,
                            c.merged, c.faulty, c.flooded);
    }
    if (!text.empty()) text += ']';
    for (bool first = true; const auto& publisher : publishers_) {
        const PublishCounts c = publisher->counts();
        text += fmt::format("{}{{\"target\":{},\"events\":{},\"lines\":{},\"missed\":{}}}",
                            std::exchange(first, false) ? ",\"published\":[" : ",", jsonString(publisher->target()),
                            c.events, c.lines, c.missed);
    }
    if (!publishers_.empty()) text += ']';
    return text;
}

}  // namespace rtsg::app
