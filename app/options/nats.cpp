// Connects verbs to NATS servers, and prints the events of these connections.
#include "nats.h"

#include <chrono>

#include <fmt/format.h>

#include "cli.h"
#include "hints.h"
#include "say.h"

namespace rtsg::app {

void checkNatsAddress(const std::string& option, const std::string& address) {
    if (const auto parsed = NatsAddress::parse(address); !parsed) throw UsageError(option, parsed.error().text);
}

Result<MirrorOrigin> openOrigin(const std::string& typed, const std::string& key, double patience) {
    if (isNatsAddress(typed)) {
        checkNatsAddress("ENDPOINT", typed);
        if (!key.empty())
            throw UsageError("--key",
                             "is for ZeroMQ: a NATS server gets user, password or token in its address, or TLS");
    } else {
        checkEndpoint("ENDPOINT", typed);
    }
    return MirrorOrigin::open(typed, std::chrono::milliseconds(static_cast<std::int64_t>(1e3 * patience)));
}

void printNews(MirrorOrigin& origin) {
    for (const Diagnostic& d : origin.takeDiagnostics()) say(d);
}

Result<Published> Published::start(const std::string& address, MirrorServer& server,
                                   const std::optional<MirrorKeys>& keys) {
    Published published;
    if (address.empty()) return published;
    NatsPublisherOptions options;
    options.address = address;
    options.keys = keys;
    auto publisher = NatsPublisher::start(server, std::move(options));
    if (!publisher) return std::unexpected(publisher.error());
    published.publisher_ = std::move(*publisher);
    return published;
}

void Published::printNews() {
    if (!publisher_) return;
    for (const Diagnostic& d : publisher_->takeDiagnostics()) {
        failed_ = failed_ || d.severity == Severity::error;
        say(d);
    }
}

}  // namespace rtsg::app
