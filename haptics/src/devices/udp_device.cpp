// A device at the other end of a datagram socket: receives positions, and sends forces.
#include <rtsg/haptics/haptic_device.h>

#include <bit>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <optional>
#include <utility>

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <fmt/format.h>

#include <rtsg/core/descriptor.h>

namespace rtsg {

namespace {

static_assert(std::endian::native == std::endian::little, "numbers go as they lie in memory");

double monotonicSeconds() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

class UdpDevice final : public HapticDevice {
  public:
    UdpDevice(Descriptor socket, double patience) : socket_(std::move(socket)), patience_(patience) {}

    /// The last of those that have come; a thousand at most, so that a flood does not hold the tick.
    Result<Vec3d> position(double) override {
        for (int i = 0; i < 1000; ++i) {
            double numbers[3];
            char packet[sizeof(numbers) + 1];
            sockaddr_in from{};
            socklen_t size = sizeof(from);
            const ssize_t got =
                ::recvfrom(socket_.get(), packet, sizeof(packet), 0, reinterpret_cast<sockaddr*>(&from), &size);
            if (got < 0) break;
            if (got != sizeof(numbers)) {
                ++odd_;
                continue;
            }
            const bool isOther =
                peer_ && (from.sin_port != peer_->sin_port || from.sin_addr.s_addr != peer_->sin_addr.s_addr);
            if (isOther && monotonicSeconds() - heard_ <= patience_) {
                if (others_++ == 0) other_ = from;
                continue;
            }
            std::memcpy(numbers, packet, sizeof(numbers));
            at_ = Vec3d(numbers[0], numbers[1], numbers[2]);
            peer_ = from;
            heard_ = monotonicSeconds();
        }
        if (!peer_) return fail(odd_ ? "datagrams came that are not three doubles" : "no datagram has come yet");
        if (monotonicSeconds() - heard_ > patience_) return fail("no datagram has come lately");
        return at_;
    }
    std::string warning() const override {
        if (others_ == 0) return {};
        return fmt::format(
            "{} datagrams were ignored, the first from port {}: another device is at the hand, at port {}", others_,
            ntohs(other_.sin_port), ntohs(peer_->sin_port));
    }
    void push(const Vec3d& force) override {
        if (!peer_) return;
        const double numbers[3] = {force.x, force.y, force.z};
        // A device that has gone hears nothing; it is missed by its datagrams.
        (void)::sendto(socket_.get(), numbers, sizeof(numbers), MSG_DONTWAIT,
                       reinterpret_cast<const sockaddr*>(&*peer_), sizeof(*peer_));
    }

  private:
    const Descriptor socket_;
    const double patience_;
    Vec3d at_{0};
    double heard_ = 0;
    std::uint64_t odd_ = 0, others_ = 0;
    std::optional<sockaddr_in> peer_;
    sockaddr_in other_{};
};

}  // namespace

Result<std::unique_ptr<HapticDevice>> udpDevice(std::uint16_t port, double patience, std::uint16_t* bound) {
    Descriptor created(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (!created) return fail(fmt::format("no socket can be had: {}", std::strerror(errno)));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    if (::bind(created.get(), reinterpret_cast<const sockaddr*>(&address), size) != 0 ||
        ::getsockname(created.get(), reinterpret_cast<sockaddr*>(&address), &size) != 0) {
        const std::string why = std::strerror(errno);
        return fail(fmt::format("port {} of this machine cannot be had: {}", port, why));
    }
    if (bound) *bound = ntohs(address.sin_port);
    return std::unique_ptr<HapticDevice>(std::make_unique<UdpDevice>(std::move(created), patience));
}

}  // namespace rtsg
