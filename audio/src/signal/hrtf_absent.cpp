// In place of the reader of SOFA files in builds without libmysofa (RTSG_SOFA=OFF): none can be read.
#include <rtsg/audio/hrtf.h>

namespace rtsg {

struct Hrtf::Impl {};

Hrtf::Hrtf(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Hrtf::~Hrtf() = default;
int Hrtf::sampleRate() const {
    return 48000;
}
std::size_t Hrtf::early() const {
    return 0;
}
Result<std::shared_ptr<const Hrtf>> Hrtf::load(const std::filesystem::path&, int) {
    return fail("SOFA files are left out of this build (RTSG_SOFA=OFF, or libmysofa was not there)");
}
Hrtf::Ears Hrtf::at(const glm::dvec3&) const {
    return {std::vector<float>{1}, std::vector<float>{1}};
}
void Hrtf::at(const glm::dvec3& direction, Ears& ears, const std::array<double, 2>&) const {
    ears = at(direction);
}

}  // namespace rtsg
