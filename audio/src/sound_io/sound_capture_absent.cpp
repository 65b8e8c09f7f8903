// Replaces capture devices in builds without OpenAL (RTSG_SOUND_DEVICE=OFF): none can be opened.
#include <rtsg/audio/sound_input.h>

namespace rtsg {

Result<std::shared_ptr<SoundInput>> SoundInput::openDevice(const std::string&, int) {
    return fail("sound devices are left out of this build (RTSG_SOUND_DEVICE=OFF)");
}

}  // namespace rtsg
