// Sends findings in the sound back into its scene.
//
// Threading: the scene's thread, outside frames.
#pragma once

#include <rtsg/audio/sound_scene.h>
#include <rtsg/core/scene.h>

namespace rtsg {

/// Sends them as events of the scene's next frame: see SoundRenderer::sendEvents(). A scene that is followed from
/// elsewhere refuses them, since it is sent its own.
void sendAudioEvents(Scene& scene, const AudioFindings& found);

}  // namespace rtsg
