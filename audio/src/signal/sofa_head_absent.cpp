// Replaces the reader of SOFA files in builds without libmysofa (RTSG_SOFA=OFF): none can be read.
#include <rtsg/audio/hrtf.h>

namespace rtsg {

Result<std::shared_ptr<const Hrtf>> Hrtf::load(const std::filesystem::path&, int) {
    return fail("SOFA files are left out of this build (RTSG_SOFA=OFF, or libmysofa was not there)");
}

}  // namespace rtsg
