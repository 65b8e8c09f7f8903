// Works out the figures of a trace besides RoomMetrics. Threading: pure functions.
#pragma once

#include <rtsg/audio/listen.h>

#include "response/interaural.h"

namespace rtsg {

/// Sets the figures of a source at one listener by its trace: all of RoomMetrics, and speech.
void setFigures(ListenReport::Source& source, const EarCorrelation& ears, const SpeechOptions& speech);

}  // namespace rtsg
