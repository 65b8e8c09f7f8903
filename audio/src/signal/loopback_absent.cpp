// In place of the OpenAL mixer in builds without a sound device (RTSG_SOUND_DEVICE=OFF): it cannot be opened.
#include <rtsg/audio/loopback.h>

namespace rtsg {

struct LoopbackMixer::Impl {};

LoopbackMixer::LoopbackMixer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LoopbackMixer::~LoopbackMixer() = default;
LoopbackMixer::LoopbackMixer(LoopbackMixer&&) noexcept = default;
LoopbackMixer& LoopbackMixer::operator=(LoopbackMixer&&) noexcept = default;

namespace {

constexpr const char* kAbsent =
    "stereo and binaural sound are left out of this build (RTSG_SOUND_DEVICE=OFF); ambisonics and metrics are not";

}  // namespace

Result<LoopbackMixer> LoopbackMixer::open(const Options&) {
    return fail(kAbsent);
}
Result<std::size_t> LoopbackMixer::addSource() {
    return fail(kAbsent);
}
void LoopbackMixer::setDirection(std::size_t, const glm::vec3&) {}
Result<> LoopbackMixer::render(std::span<const std::span<const float>>, std::span<float>) {
    return fail(kAbsent);
}
std::size_t LoopbackMixer::latency() const {
    return 0;
}
float LoopbackMixer::frontGain() const {
    return 0;
}
bool LoopbackMixer::binaural() const {
    return false;
}
std::size_t LoopbackMixer::blockSize() const {
    return 0;
}

}  // namespace rtsg
