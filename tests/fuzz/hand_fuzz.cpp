// Datagrams of any kind to a hand: its position is that of the last one of three numbers, bit for bit.
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <optional>

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <rtsg/haptics/haptic_device.h>

namespace {

using namespace rtsg;

struct Hand {
    std::uint16_t port = 0;
    std::unique_ptr<HapticDevice> device;
    int sender = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    Hand() {
        auto created = udpDevice(0, 1e9, &port);
        if (!created) std::abort();
        device = std::move(*created);
        sockaddr_in to{};
        to.sin_family = AF_INET, to.sin_port = htons(port), to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        if (::connect(sender, reinterpret_cast<const sockaddr*>(&to), sizeof(to)) != 0) std::abort();
    }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static Hand hand;
    static std::optional<Vec3d> last;
    // A byte of length, then as many.
    for (std::size_t at = 0, count = 0; at < size && count < 64; ++count) {
        const std::size_t length = std::min<std::size_t>(data[at], size - at - 1);
        if (::send(hand.sender, data + at + 1, length, 0) != static_cast<ssize_t>(length)) std::abort();
        if (length == sizeof(double) * 3) {
            double numbers[3];
            std::memcpy(numbers, data + at + 1, sizeof(numbers));
            last = Vec3d(numbers[0], numbers[1], numbers[2]);
        }
        at += 1 + length;
    }
    const auto position = hand.device->position(0);
    if (position.has_value() != last.has_value()) std::abort();
    if (last && std::memcmp(&*position, &*last, sizeof(Vec3d)) != 0) std::abort();
    hand.device->push(Vec3d(1, 0, 0));
    return 0;
}
