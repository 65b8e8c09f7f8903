// What was found in the sound, on its way back into the scene that it is the sound of.
//
// Threading: the scene's thread, outside frames.
#pragma once

#include <rtsg/audio/sound_scene.h>
#include <rtsg/core/scene.h>

namespace rtsg {

/// As events of the scene's next frame: see SoundRenderer::sendEvents(). A scene that is followed from elsewhere
/// refuses them, for it is sent its own.
void sendAudioEvents(Scene& scene, const AudioFindings& found);

}  // namespace rtsg
