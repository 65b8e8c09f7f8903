// Messages that own or borrow their bytes, and ZeroMQ's errors as diagnostics.
#include "zmq_socket.h"

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>

#include <fmt/format.h>
#include <netdb.h>
#include <pthread.h>
#include <sched.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

namespace rtsg {

namespace {

/// True if ZeroMQ may be asked to change its threads' scheduling policy. It stops the process if the system refuses, as
/// a container's filter may. The system allows it if this thread may be given the policy that it has.
bool mayChangeKind() {
    int kind = 0;
    sched_param parameters{};
    return pthread_getschedparam(pthread_self(), &kind, &parameters) == 0 && kind == SCHED_OTHER &&
           pthread_setschedparam(pthread_self(), kind, &parameters) == 0;
}

}  // namespace

ZmqContext::ZmqContext() : context_(zmq_ctx_new()) {
    if (mayChangeKind()) zmq_ctx_set(context_, ZMQ_THREAD_SCHED_POLICY, SCHED_BATCH);
}

ZmqMessage::ZmqMessage(std::span<const std::byte> bytes) {
    if (zmq_msg_init_size(&message_, bytes.size()) != 0) {
        zmq_msg_init(&message_);  // no memory: the receiver refuses an empty message
        return;
    }
    if (!bytes.empty()) std::memcpy(zmq_msg_data(&message_), bytes.data(), bytes.size());
}

ZmqMessage::ZmqMessage(std::span<const std::byte> bytes, std::shared_ptr<const void> owner) {
    auto* hint = new std::shared_ptr<const void>(std::move(owner));
    const auto drop = [](void*, void* h) { delete static_cast<std::shared_ptr<const void>*>(h); };
    if (zmq_msg_init_data(&message_, const_cast<std::byte*>(bytes.data()), bytes.size(), drop, hint) != 0) {
        delete hint;
        zmq_msg_init(&message_);
    }
}

int ZmqSocket::descriptor() const {
    int result = -1;
    std::size_t size = sizeof(result);
    zmq_getsockopt(socket_, ZMQ_FD, &result, &size);
    return result;
}

void ZmqSocket::skipRest(const ZmqMessage& last) {
    bool more = last.more();
    while (more) {
        ZmqMessage next;
        if (!receive(next)) return;
        more = next.more();
    }
}

Result<> checkRoomForSocket() {
    constexpr std::size_t kNeeded = 16;
    std::array<int, kNeeded> opened{};
    std::size_t count = 0;
    while (count < kNeeded && (opened[count] = ::eventfd(0, EFD_CLOEXEC)) >= 0) ++count;
    const int error = errno;
    for (std::size_t i = 0; i < count; ++i) ::close(opened[i]);
    if (count == kNeeded) return {};
    return fail(fmt::format("cannot open the files of a connection: {} (ulimit -n)", std::strerror(error)));
}

void allowIpv6(ZmqSocket& socket, std::string_view endpoint) {
    constexpr std::string_view kTcp = "tcp://";
    if (!endpoint.starts_with(kTcp)) return;
    endpoint.remove_prefix(kTcp.size());
    const std::string host(endpoint.substr(0, endpoint.rfind(':')));
    bool needed = host.starts_with('[');
    if (!needed && host != "*") {
        addrinfo hints{}, *found = nullptr;
        hints.ai_family = AF_INET, hints.ai_socktype = SOCK_STREAM;
        const int problem = ::getaddrinfo(host.c_str(), nullptr, &hints, &found);
        if (problem == 0) ::freeaddrinfo(found);
        needed = problem == EAI_NONAME || problem == EAI_NODATA || problem == EAI_ADDRFAMILY;
    }
    socket.set(ZMQ_IPV6, needed ? 1 : 0);
}

Result<> checkPort(std::string_view endpoint) {
    if (!endpoint.starts_with("tcp://")) return {};
    const std::string_view port = endpoint.substr(endpoint.rfind(':') + 1);
    std::uint32_t number = 0;
    const auto [end, problem] = std::from_chars(port.data(), port.data() + port.size(), number);
    if (problem == std::errc::invalid_argument) return {};  // `*`, or something that ZeroMQ refuses itself
    // ZeroMQ would use the digits at the beginning.
    if (problem == std::errc() && end != port.data() + port.size())
        return fail(fmt::format("{}: '{}' is no port", endpoint, port));
    if (problem == std::errc() && number <= 65535) return {};
    return fail(fmt::format("{}: ports are at most 65535", endpoint));
}

Diagnostic zmqFailure(std::string_view what) {
    return {Severity::error, {}, {}, fmt::format("{}: {}", what, zmq_strerror(zmq_errno()))};
}

}  // namespace rtsg
