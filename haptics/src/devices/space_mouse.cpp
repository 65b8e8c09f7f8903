// A 3D mouse by the socket of its daemon (spacenavd): it moves the hand as long as its cap is pushed.
#include <rtsg/haptics/haptic_device.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <optional>
#include <utility>

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <fmt/format.h>

#include <rtsg/core/descriptor.h>

namespace rtsg {

namespace {

constexpr double kFull = 350;         // of an axis, when the cap is pushed as far as it goes
constexpr double kLongestTick = 0.1;  // seconds that a hand goes on at a speed

class SpaceMouse final : public HapticDevice {
  public:
    SpaceMouse(Descriptor socket, double speed) : socket_(std::move(socket)), speed_(speed) {}

    Result<Vec3d> position(double seconds) override {
        if (auto ok = take(); !ok) return std::unexpected(ok.error());
        if (time_) at_ += std::clamp(seconds - *time_, 0.0, kLongestTick) * speed_ / kFull * axes_;
        time_ = seconds;
        return at_;
    }
    void push(const Vec3d&) override {}  // it has no motor

  private:
    /// Reads the packets that have arrived: eight numbers each, a kind and then the axes.
    Result<> take() {
        for (int i = 0; i < 1000; ++i) {
            const ssize_t got =
                ::recv(socket_.get(), reinterpret_cast<char*>(packet_) + held_, sizeof(packet_) - held_, MSG_DONTWAIT);
            if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) return {};
            if (got <= 0) return fail("the 3D mouse's daemon has gone");
            held_ += static_cast<std::size_t>(got);
            if (held_ < sizeof(packet_)) continue;
            held_ = 0;
            // The device's z axis points away from the user, the world's towards the user.
            if (packet_[0] == 0) axes_ = Vec3d(packet_[1], packet_[2], -packet_[3]);
        }
        return {};
    }

    const Descriptor socket_;
    const double speed_;
    std::int32_t packet_[8] = {};
    std::size_t held_ = 0;  // bytes of a packet
    Vec3d axes_{0}, at_{0};
    std::optional<double> time_;
};

}  // namespace

Result<std::unique_ptr<HapticDevice>> spaceMouse(const std::string& socket, double speed) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (socket.size() >= sizeof(address.sun_path)) return fail(fmt::format("{}: too long for a socket's name", socket));
    std::copy(socket.begin(), socket.end(), address.sun_path);
    Descriptor created(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    if (!created) return fail(fmt::format("no socket can be had: {}", std::strerror(errno)));
    if (::connect(created.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
        const std::string why = std::strerror(errno);
        return fail(fmt::format("{}: no 3D mouse: {} (is spacenavd running?)", socket, why));
    }
    return std::unique_ptr<HapticDevice>(std::make_unique<SpaceMouse>(std::move(created), speed));
}

}  // namespace rtsg
