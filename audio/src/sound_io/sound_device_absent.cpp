// Replaces the output device in builds without one (RTSG_SOUND_DEVICE=OFF): it cannot be opened.
#include "sound_device.h"

namespace rtsg {

struct SoundDevice::Impl {
    std::string name;
};

SoundDevice::SoundDevice(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SoundDevice::~SoundDevice() = default;
SoundDevice::SoundDevice(SoundDevice&&) noexcept = default;
SoundDevice& SoundDevice::operator=(SoundDevice&&) noexcept = default;

namespace {

constexpr const char* kAbsent = "sound devices are left out of this build (RTSG_SOUND_DEVICE=OFF)";

}  // namespace

Result<SoundDevice> SoundDevice::open(const Options&) {
    return fail(kAbsent);
}
std::size_t SoundDevice::free() {
    return 0;
}
Result<> SoundDevice::write(std::span<const float>) {
    return fail(kAbsent);
}
std::uint64_t SoundDevice::underruns() const {
    return 0;
}
double SoundDevice::latencySeconds() const {
    return 0;
}
const std::string& SoundDevice::name() const {
    return impl_->name;
}

}  // namespace rtsg
