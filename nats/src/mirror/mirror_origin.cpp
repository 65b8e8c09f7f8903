// Opens the origin of a mirror.
#include <rtsg/nats/mirror_origin.h>

#include <rtsg/nats/nats_address.h>

namespace rtsg {

Result<MirrorOrigin> MirrorOrigin::open(const std::string& address, std::chrono::milliseconds patience) {
    MirrorOrigin origin;
    origin.shown_ = address;
    if (!isNatsAddress(address)) return origin;
    auto nats = NatsSubscriber::start(address, patience);
    if (!nats) return std::unexpected(nats.error());
    origin.nats_ = std::move(*nats);
    origin.shown_ = origin.nats_->address();
    return origin;
}

/// All mirrors behind a NATS server share the questions that their server answers to one peer. Those that only look
/// for faults of memory would leave none for repairs.
Result<> MirrorOrigin::prepare(MirrorClientOptions& options) const {
    if (!nats_) return {};
    if (options.keys)
        return fail("keys are for ZeroMQ: a NATS server gets user, password or token in its address, or TLS", {},
                    shown_);
    options.scrub = std::chrono::milliseconds(0);
    options.transport = nats_->transport();
    return {};
}

std::vector<Diagnostic> MirrorOrigin::takeDiagnostics() {
    return nats_ ? nats_->takeDiagnostics() : std::vector<Diagnostic>();
}

}  // namespace rtsg
